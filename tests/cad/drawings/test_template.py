"""Template and test plate: hole patterns at 1:1, read again from the PDF and from the mesh."""

import re

import numpy as np
import pytest
from scanners import CAPSULE, GROUND_AHEAD, ROLLING, UPRIGHT, scanner_at

from scanwright.cad.drawings.files import template_pdf
from scanwright.cad.drawings.write import POINTS_PER_MM
from scanwright.cad.geometry.mesh import mesh_of
from scanwright.cad.labels.fit_coupon import EDGE_MM, make_test_plate
from scanwright.cad.layout.joints import screw_patterns
from scanwright.cad.layout.names import LIDAR_BODY, SERVO_CASE, SERVO_HORN, SERVO_OUTPUT
from scanwright.cad.measure.bores import bores_of, walls_of
from scanwright.cad.parts.all_parts import laid_out
from scanwright.cad.screws import passing_hole

pytestmark = pytest.mark.quick
SCANNERS = {
    "ring": (GROUND_AHEAD, {}),
    "capsule": (ROLLING, {"slip_ring": CAPSULE}),
    "ears": (UPRIGHT, {"sensor": "STL27L", "servo": "XL430-W250", "slip_ring": None}),
}


@pytest.fixture(scope="module", params=SCANNERS)
def tried(request):
    """A scanner and its patterns."""
    setting, products = SCANNERS[request.param]
    scanner = scanner_at(setting, **products)
    layout = laid_out(scanner)
    return scanner, screw_patterns(layout.joints, layout.stack.R())


def pages_of(pdf):
    """Pages of an uncompressed PDF: size in mm, and its circles and straight lines in mm."""
    text = pdf.decode("latin-1")
    sizes = [
        (float(w) / POINTS_PER_MM, float(h) / POINTS_PER_MM)
        for w, h in re.findall(r"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", text)
    ]
    pages = []
    for stream in re.findall(r"stream\r?\n(.*?)endstream", text, re.DOTALL):
        scale = float(re.findall(r"([\d.]+) 0 0 [\d.]+ 0 0 cm", stream)[1]) / POINTS_PER_MM
        circles, lines = [], []
        for path in re.findall(r"n\s((?:-?[\d.]+\s)+m\s+(?:(?:-?[\d.]+\s)+[lc]\s+)*)S", stream):
            numbers = scale * np.array(re.findall(r"(-?[\d.]+) (-?[\d.]+) [mlc]\b", path), dtype=float)
            if " c" in path:
                circles.append(((numbers.min(axis=0) + numbers.max(axis=0)) / 2, np.ptp(numbers, axis=0)))
            elif len(numbers) == 2:
                lines.append(numbers)
        pages.append((circles, lines))
    return sizes, pages


def test_the_template_has_each_pattern_at_full_size(tried):
    scanner, patterns = tried
    sizes, pages = pages_of(template_pdf(scanner, patterns))
    assert len(sizes) == len(pages) == len(patterns)
    for size, (circles, lines), pattern in zip(sizes, pages, patterns, strict=True):
        assert any(np.allclose(size, paper, atol=0.01) for paper in ((210, 297), (297, 420)))
        middles = np.array([middle for middle, _ in circles])
        assert len(middles) == len(pattern.places)
        np.testing.assert_allclose(
            middles - middles[0], np.array(pattern.places) - pattern.places[0], atol=2e-3, err_msg=pattern.device
        )
        np.testing.assert_allclose([across for _, across in circles], pattern.screw.nominal, atol=1e-2)
        assert (middles > 10).all() and (middles < np.array(size) - 10).all()
        assert max(np.ptp(line[:, 0]) for line in lines if np.ptp(line[:, 1]) == 0) == pytest.approx(100)


def test_a_pattern_is_that_of_the_record_seen_from_outside(tried):
    scanner, patterns = tried
    (lidar,) = (pattern for pattern in patterns if pattern.device == LIDAR_BODY)
    below = {(round(x, 3), round(-y, 3)) for x, y in scanner.lidar.base.places}  # seen from below y points down
    assert set(lidar.places) == below
    assert lidar.screw.name == scanner.lidar.base.screw
    horn = next(pattern for pattern in patterns if pattern.device in (SERVO_HORN, SERVO_OUTPUT))
    assert len(horn.places) == scanner.servo.horn_holes
    np.testing.assert_allclose(np.linalg.norm(horn.places, axis=1), scanner.servo.horn_circle_mm / 2, atol=1e-3)


def test_the_test_plate_has_the_same_holes(tried):
    scanner, patterns = tried
    mesh = mesh_of(make_test_plate(scanner, patterns))
    assert mesh.is_closed()
    assert mesh.volume() < 12e3  # mm3, about half an hour of print
    triangles = mesh.vertices[mesh.faces]
    bores = [bore for bore in bores_of(triangles, walls_of(triangles)) if not bore.slot]
    start = 0.0
    for pattern in patterns:
        if pattern.device not in (LIDAR_BODY, SERVO_HORN, SERVO_OUTPUT, SERVO_CASE):
            continue
        places = np.array(pattern.places)
        diameter = passing_hole(pattern.screw, scanner.printer)
        for place in places - places.min(axis=0) + EDGE_MM + [start, 0.0]:
            nearest = min(bores, key=lambda bore: np.hypot(*(np.array(bore.mouth)[:2] - place)))
            np.testing.assert_allclose(nearest.mouth[:2], place, atol=2e-3)
            assert nearest.diameter == pytest.approx(diameter, abs=2e-3)
            assert np.isinf(nearest.free)
        start += np.ptp(places[:, 0]) + 2 * EDGE_MM - 1.0
