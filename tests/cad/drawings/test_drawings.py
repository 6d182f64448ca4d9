"""Drawings: what they say against the exported meshes, in three formats, read back by other programs' readers."""

import io
import itertools
import re
import xml.etree.ElementTree as ET
from collections import Counter
from types import SimpleNamespace

import ezdxf
import numpy as np
import pytest
import trimesh
from ezdxf.disassemble import recursive_decompose
from hypothesis import given
from hypothesis import strategies as st
from reportlab.pdfbase.pdfmetrics import stringWidth
from shapely import LineString, Polygon
from shapely import box as shapely_box
from shapely.affinity import rotate, translate
from svglib.svglib import svg2rlg

from scanwright.cad.drawings import project as projection
from scanwright.cad.drawings.dimensions import angle_between, spread
from scanwright.cad.drawings.patterns import number, part_of, patterns_of
from scanwright.cad.drawings.pen import CAPITAL, DIAMETER, TURN_RAD, Pen, document_at
from scanwright.cad.drawings.project import Arc, project
from scanwright.cad.drawings.sheet import A2, A3, Sheet, Title, sheet_of
from scanwright.cad.drawings.views import HATCH_MM, cut_along_axis, hatching
from scanwright.cad.drawings.write import Outline, Words, drawn_on, dxf_bytes, pdf_bytes, svg_bytes
from scanwright.cad.geometry.holes import rounds_of
from scanwright.cad.parts.part_spec import PartSpec, ToleratedDiameter
from scanwright.cad.solids import box, cylinder, upright
from scanwright.design.errors import BuildError

X, Y, Z = np.eye(3)
SVG = "{http://www.w3.org/2000/svg}"


def said_in(entities):
    """Texts, those in the pictures of dimensions too."""
    return [entity.plain_text() for entity in recursive_decompose(entities) if entity.dxftype() == "TEXT"]


@pytest.fixture(scope="module")
def sheets(made):
    """Per part: texts of the DXF, of the SVG, and the exported mesh."""
    out = {}
    for part in made.result.parts:
        document = ezdxf.readfile(made.folder / "drawings" / f"{part.name}.dxf")
        assert not document.audit().errors
        svg = ET.parse(made.folder / "drawings" / f"{part.name}.svg")
        out[part.name] = SimpleNamespace(
            dxf=document,
            said=said_in(document.modelspace()),
            svg=[element.text for element in svg.iter(f"{SVG}text")],
            mesh=trimesh.load(made.folder / "parts" / f"{part.name}.stl"),
        )
    return out


def ordinates(sheet):
    return {float(text) for text in sheet.said if re.fullmatch(r"-?\d+(\.\d+)?", text)}


def circles_in(mesh, origin, normal):
    """Diameters and centres of the round loops of a section."""
    section, to_3d = mesh.section(plane_origin=origin, plane_normal=normal).to_2D()
    found = []
    for loop in section.discrete:
        centre = (loop.max(axis=0) + loop.min(axis=0)) / 2
        radii = np.linalg.norm(loop - centre, axis=1)
        if len(loop) > 20 and np.ptp(radii) < 0.02:
            found.append((2 * radii.max(), (to_3d @ [*centre, 0, 1])[:3]))
    return found


def test_all_three_formats_say_the_same(sheets):
    for sheet in sheets.values():
        assert sheet.said == sheet.svg
        assert len(sheet.said) > 20


def test_every_sheet_has_its_views_lines_and_title(sheets, made):
    task = made.scanner.angles.task
    for name, sheet in sheets.items():
        assert {name, task} <= set(sheet.said)
        assert sum(text.startswith(("FRONT", "TOP", "FROM THE LEFT")) for text in sheet.said) == 3
        assert any(re.fullmatch(r"\d+(:\d+)   A[23]", text) for text in sheet.said)
        assert sum(re.fullmatch(r"[0-9a-f]{12}(-\d)?", text) is not None for text in sheet.said) == 2
        layers = {entity.dxf.layer for entity in sheet.dxf.modelspace()}
        assert layers == {"VISIBLE", "HIDDEN", "CENTRE", "DIMENSION", "FRAME"}
        assert sheet.dxf.layers.get("HIDDEN").dxf.linetype == "HIDDEN"


def test_the_envelope_is_that_of_the_mesh(sheets):
    for sheet in sheets.values():
        line = next(text for text in sheet.said if text.startswith("Envelope"))
        said = [float(v) for v in re.findall(r"[\d.]+(?= x| along)", line)]
        np.testing.assert_allclose(said, sheet.mesh.extents, atol=0.02)


def test_shaft_circle_of_holes_and_diameters(sheets):
    sheet = sheets["servo_shaft"]
    count, hole, circle = re.search(
        r"(\d)x Ø([\d.]+) THRU ON Ø([\d.]+)", next(text for text in sheet.said if "THRU ON" in text)
    ).groups()
    low = sheet.mesh.bounds[0, 2]
    found = circles_in(sheet.mesh, [0, 0, low + 2.0], Z)
    holes = [centre for diameter, centre in found if abs(diameter - float(hole)) < 0.02]
    assert len(holes) == int(count)
    np.testing.assert_allclose(2 * np.linalg.norm(np.array(holes)[:, :2], axis=1), float(circle), atol=0.01)
    top = sheet.mesh.bounds[1, 2]
    outer = max(diameter for diameter, _ in circles_in(sheet.mesh, [0, 0, top - 25.0], Z))
    assert f"Ø{number(round(outer, 2))}  0/-0.011" in sheet.said  # h6 below the bearing's sleeve
    assert any(abs(value - (top - low)) < 0.01 for value in ordinates(sheet))


def test_every_hole_that_holds_a_screw_says_by_what(sheets, made):
    for name, sheet in sheets.items():
        held = [joint for joint in made.result.assembly.layout.joints if joint.holder == name]
        told = Counter()
        for text in sheet.said:
            if found := re.match(r"(?:(\d+)x )?Ø.*(?:TAPPED|THREAD|INSERT|FOR NUT) ([\w./-]+(?: UNC)?)", text):
                told[found[2].rstrip(",")] += int(found[1] or 1)
        assert told == sum((Counter({joint.screw.name: joint.count}) for joint in held), Counter()), name
    assert any("TAPPED M3" in text for text in sheets["servo_shaft"].said)


def test_the_thickness_of_an_inclined_plate_is_told(sheets):
    """Measured through the mesh, beside each hole."""
    for name in ("base_mount", "alignment_linkage"):
        mesh = sheets[name].mesh
        normals, areas = mesh.facets_normal, mesh.facets_area
        largest = np.argmax(np.where(np.abs(normals @ Z) < 0.999, areas, 0))
        normal, face = normals[largest], mesh.facets_origin[largest]
        (hole,) = [re.search(r"Middle of (\d)x Ø([\d.]+)", text) for text in sheets[name].said if "Middle of" in text]
        count, radius = int(hole[1]), float(hole[2]) / 2
        circles = circles_in(mesh, face - normal, normal)
        middles = [centre for diameter, centre in circles if abs(diameter / 2 - radius) < 0.02]
        assert len(middles) == count
        aside = np.cross(normal, Z) / np.linalg.norm(np.cross(normal, Z)) * (radius + 0.4)
        (said,) = [text for text in sheets[name].said if "thick" in text]
        for middle in middles:
            places, *_ = mesh.ray.intersects_location([middle + aside + 2 * normal], [-normal])
            near, far = np.sort((places - face) @ -normal)[:2]
            assert float(re.search(r"is ([\d.]+) thick", said)[1]) == pytest.approx(far - near, abs=0.02), name


def test_linkage_angle_seat_and_holes(sheets, made):
    sheet = sheets["alignment_linkage"]
    # the seat: the plane 55 mm behind the optical centre, found in the mesh by its area
    mesh = sheet.mesh
    keys = np.round(np.column_stack([mesh.face_normals, (mesh.face_normals * mesh.triangles_center).sum(axis=1)]), 2)
    _, index = np.unique(keys, axis=0, return_inverse=True)
    largest = index == np.bincount(index, weights=mesh.area_faces).argmax()
    normal = (mesh.face_normals * mesh.area_faces[:, None])[largest].sum(axis=0)
    normal /= np.linalg.norm(normal)
    tilt = np.degrees(np.arccos(abs(normal[2])))
    (said,) = [float(text[:-1]) for text in sheet.said if re.fullmatch(r"[\d.]+°", text)]
    assert said == pytest.approx(tilt, abs=0.006)
    a, b = np.radians([made.scanner.angles.angles_deg.alpha_laser, made.scanner.angles.angles_deg.beta_laser])
    assert said == pytest.approx(np.degrees(np.arccos(np.cos(a) * np.cos(b))), abs=0.005)
    note = next(text for text in sheet.said if text.startswith("The largest face across"))
    assert float(re.search(r"lies ([\d.]+)", note)[1]) == pytest.approx(
        abs((mesh.triangles_center[largest] @ normal).mean()), abs=1e-3
    )
    R = made.scanner.angles.R_rot_laser()
    found = circles_in(sheet.mesh, R @ [0, 0, -57.0], R[:, 2])
    holes = np.array([R.T @ centre for diameter, centre in found if abs(diameter - 3.4) < 0.02])
    assert len(holes) == 4 and any(text.startswith("4x Ø3.4 THRU") for text in sheet.said)
    for value in np.unique(np.round(holes[:, :2], 1)):
        assert any(abs(value - other) < 0.01 for other in ordinates(sheet))


def test_mount_angle_and_deck_holes(sheets, made):
    sheet = sheets["base_mount"]
    (said,) = [float(text[:-1]) for text in sheet.said if re.fullmatch(r"[\d.]+°", text)]
    axis = made.scanner.angles.axis_world()
    assert said == pytest.approx(np.degrees(np.arccos(axis[2])), abs=0.005)
    T = made.scanner.angles.T_world_rot(0.0)
    T[:3, 3] *= 1000
    deck = sheet.mesh.copy().apply_transform(T)
    found = [centre for diameter, centre in circles_in(deck, [0, 0, 3.0], Z) if abs(diameter - 4.4) < 0.02]
    np.testing.assert_allclose(np.abs(np.array(found)[:, :2]), 40.0, atol=0.01)
    assert {40.0, -40.0} <= ordinates(sheet) and "4x Ø4.4 THRU" in sheet.said


def test_every_screw_hole_of_the_adapter_has_its_place(sheets):
    sheet = sheets["slip_ring_adapter"]
    low = sheet.mesh.bounds[0, 2]
    holes = [centre for diameter, centre in circles_in(sheet.mesh, [0, 0, low + 1.0], Z) if abs(diameter - 2.9) < 0.02]
    assert any(text.startswith(f"{len(holes)}x Ø2.9 THRU") for text in sheet.said)
    for value in np.unique(np.round(np.array(holes)[:, :2], 1)):
        assert any(abs(value - other) < 0.01 for other in ordinates(sheet))


def test_the_bearing_has_a_fit_on_both_of_its_sheets(sheets):
    # 61806 is 30 x 42: the print is drawn half of the sliding fit of 0.2 away from it, the turned sleeve is g6
    assert "Ø42.1  ±0.1" in sheets["bearing_cage"].said
    assert "Ø29.98  +0.013/0" in sheets["journal_sleeve"].said


def test_every_dimension_measures_what_it_says(sheets):
    for sheet in sheets.values():
        dimensions = list(sheet.dxf.query("DIMENSION"))
        assert len(dimensions) > 5
        for dimension in dimensions:
            kind, measured = dimension.dimtype, dimension.get_measurement()
            if kind == 6:
                measured = measured.x if dimension.dxf.dimtype & 64 else measured.y
                assert measured > -1e-6 or "<>" not in dimension.dxf.text  # some readers tell its sign, some do not
            value = {3: "Ø", 5: "", 6: ""}[kind] + number(measured) + {3: "", 5: "°", 6: ""}[kind]
            words = dimension.dxf.text.replace("<>", value).replace("%%c", "Ø")
            assert said_in([dimension]) == [words]
        measured = {text for dimension in dimensions for text in said_in([dimension])}
        loose = set(sheet.said) - measured  # diameters on the axis and ordinates are all measured
        assert not [text for text in loose if re.fullmatch(r"-?[\d.]+°?|Ø[\d.]+(  [+±].*)?", text)]


def test_a_diameter_spans_the_circle_that_it_names(sheets):
    holes = [d for d in sheets["servo_shaft"].dxf.query("DIMENSION") if d.dxf.text == "8x <> THRU ON %%c22"]
    circles = {
        tuple(np.round(c.dxf.center.xyz[:2], 6)): c.dxf.radius for c in sheets["servo_shaft"].dxf.query("CIRCLE")
    }
    (hole,) = holes
    centre = tuple(np.round(((hole.dxf.defpoint + hole.dxf.defpoint4) / 2).xyz[:2], 6))
    near = min(circles, key=lambda at: np.hypot(at[0] - centre[0], at[1] - centre[1]))
    np.testing.assert_allclose(near, centre, atol=0.01)
    assert circles[near] == pytest.approx(hole.get_measurement() / 2, abs=2e-3)


def test_geometry_in_the_dxf_is_true_to_size(sheets):
    sheet = sheets["servo_shaft"]
    circles = [entity for entity in sheet.dxf.query("CIRCLE") if entity.dxf.layer == "VISIBLE"]
    holes = [circle for circle in circles if abs(2 * circle.dxf.radius - 2.9) < 0.01]
    assert len(holes) == 8
    centres = np.array([(circle.dxf.center.x, circle.dxf.center.y) for circle in holes])
    np.testing.assert_allclose(np.linalg.norm(centres - centres.mean(axis=0), axis=1), 11.0, atol=0.01)


def test_svg_is_read_and_the_pdf_is_one_page(made, sheets):
    for name in sheets:
        drawing = svg2rlg(str(made.folder / "drawings" / f"{name}.svg"))
        assert min(abs(drawing.width / drawing.height - w / h) for w, h in (A3, A2)) < 1e-3
        pdf = (made.folder / "drawings" / f"{name}.pdf").read_bytes()
        assert pdf.startswith(b"%PDF-") and pdf.count(b"/Type /Page\n") == 1
        assert b"2000" in re.search(rb"/CreationDate \((.*?)\)", pdf)[1]


def straight(curve):
    return not isinstance(curve, Arc) and len(curve.points) == 2


def drawn(solid, right, up):
    curves = project(solid, right, up, np.zeros(3))
    return [c for c in curves if not c.hidden], [c for c in curves if c.hidden]


def test_a_block_with_a_blind_hole_seen_from_three_sides():
    solid = box((0, 0, 0), (40, 20, 10)).cut(upright(3, 4, 11, 10, 10)).Solids()[0]
    seen, hidden = drawn(solid, X, Y)
    assert len(seen) == 5 and not hidden
    (circle,) = [curve for curve in seen if isinstance(curve, Arc)]
    assert circle.radius == pytest.approx(3, abs=2e-3) and circle.end - circle.start == pytest.approx(2 * np.pi)
    np.testing.assert_allclose(circle.centre, (10, 10), atol=0.01)
    seen, hidden = drawn(solid, X, Z)
    assert len(seen) == 4 and all(straight(curve) for curve in seen)
    ends = sorted(sorted(z for _, z in line.points) for line in hidden)
    np.testing.assert_allclose(ends, [(4, 4), (4, 10), (4, 10)], atol=0.01)
    seen, hidden = drawn(solid, X, -Y)  # from below
    assert len(seen) == 4 and len([curve for curve in hidden if isinstance(curve, Arc)]) == 1


def test_a_section_is_hatched_where_material_is_cut_and_nowhere_else():
    tube = upright(20.0, 0, 60).cut(upright(8.0, 10, 70)).Solids()[0]
    cut = cut_along_axis(tube, X, Z)
    assert cut.Volume() == pytest.approx(tube.Volume() / 2)
    assert cut.Center().y > 0  # one looks along +Y: what is before the axis is gone
    lines = np.array(hatching(cut, X, Z, np.zeros(3)))
    lengths = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)
    area = 40 * 60 - 16 * 50
    assert (lengths * HATCH_MM).sum() == pytest.approx(area, rel=0.02)
    across, high = np.abs(lines[..., 0]), lines[..., 1]
    assert (across <= 20.001).all() and (high >= -0.001).all() and (high <= 60.001).all()
    middles = lines.mean(axis=1)
    assert not ((np.abs(middles[:, 0]) < 8) & (middles[:, 1] > 10)).any()  # the bore is empty
    assert lines.tolist() == np.array(hatching(cut_along_axis(tube, X, Z), X, Z, np.zeros(3))).tolist()


def test_what_has_a_fit_has_a_section_its_finish_and_one_material(sheets):
    for name in ("servo_shaft", "journal_sleeve"):
        said = sheets[name].said
        assert any(text.startswith("S-S") for text in said) and said.count("S") == 2
        assert "ISO 2768-mK" in said and any(text.startswith("Ra 3.2, faces with a fit Ra 0.8") for text in said)
        assert not any(" or " in text for text in said if text.startswith("aluminium"))
    assert any("as printed, sanded or reamed" in text for text in sheets["bearing_cage"].said)
    assert not any(text.startswith("S-S") for text in sheets["base_mount"].said)


def test_what_lies_exactly_behind_is_drawn_once():
    solid = box((0, 0, 0), (10, 10, 10))
    for right, up in ((X, Y), (Y, Z), (X, Z)):
        seen, hidden = drawn(solid, right, up)
        assert len(seen) == 4 and not hidden


@pytest.mark.parametrize("seed", range(3))
def test_a_view_that_the_kernel_returns_incomplete_is_drawn_at_another_angle(seed, monkeypatch):
    rng = np.random.default_rng(seed)
    size = rng.uniform(5, 40, 3)
    solid = box(-size, size).cut(upright(rng.uniform(1, 3), -50, 50))
    right, up = (np.roll(X, k) for k in rng.choice(3, 2, replace=False))
    whole, fails = projection._pieces, int(rng.integers(1, len(projection.SKEWS_RAD)))
    seen = []

    def incomplete(solid, right, up, zero, skew, *, hidden):
        seen.append(skew)
        lines = whole(solid, right, up, zero, skew, hidden=hidden)
        if len(seen) > fails:
            return lines
        edge = max(points[:, 0].max() for points, _ in lines)
        return [piece for piece in lines if piece[0][:, 0].max() < edge - 0.5] if rng.random() < 0.5 else []

    expected = project(solid, right, up, np.zeros(3))
    monkeypatch.setattr(projection, "_pieces", incomplete)
    assert len(project(solid, right, up, np.zeros(3))) == len(expected)
    assert seen == list(projection.SKEWS_RAD[: fails + 1])
    fails = len(projection.SKEWS_RAD)
    seen.clear()
    with pytest.raises(BuildError, match="no lines of a part"):
        project(solid, right, up, np.zeros(3))


def test_an_inclined_cylinder_ends_in_curves():
    tilted = cylinder(5, (0, 0, 0), (0.6, 0, 0.8), 30)
    seen, _ = drawn(tilted, X, Y)
    assert {straight(curve) for curve in seen} == {True, False}
    assert not any(isinstance(curve, Arc) for curve in seen)


def test_holes_are_told_from_bosses_and_blind_ones_from_through_ones():
    solid = box((-20, -20, 0), (20, 20, 10)).cut(upright(2, -1, 11, 8, 0), upright(2, 5, 11, -8, 0))
    solid = solid.fuse(upright(6, 9, 15, 0, 12)).Solids()[0]
    found = {(item.hole, item.through, round(item.length, 3)) for item in rounds_of(solid)}
    assert found == {(True, True, 10.0), (True, False, 5.0), (False, False, 5.0)}


def test_screw_holes_take_their_recesses_along():
    cuts = [upright(1.7, -1, 11, x, y) for x in (-10, 10) for y in (-10, 10)]
    cuts += [upright(3.2, 6, 11, x, y) for x in (-10, 10) for y in (-10, 10)]
    solid = box((-20, -20, 0), (20, 20, 10)).cut(*cuts).Solids()[0]
    (pattern,) = patterns_of(rounds_of(solid))
    assert pattern.words() == "4x Ø3.4 THRU, Ø6.4 FOR HEADS"


def test_holes_on_both_sides_of_a_bore_are_one_and_not_heads():
    tube = upright(10, 0, 30).cut(upright(7, -1, 31))
    (pattern,) = patterns_of(rounds_of(tube.cut(cylinder(4, (-12, 0, 20), X, 24)).Solids()[0]))
    assert pattern.words() == "Ø8 THRU"


@given(st.lists(st.floats(-100, 100), min_size=1, max_size=12).map(sorted), st.floats(0.5, 10))
def test_spread_keeps_order_distance_and_mean(wanted, step):
    places = spread(wanted, step)
    assert all(b - a >= step - 1e-6 for a, b in itertools.pairwise(places))
    assert np.mean(places) == pytest.approx(np.mean(wanted), abs=1e-6)
    if all(b - a >= step for a, b in itertools.pairwise(wanted)):
        np.testing.assert_allclose(places, wanted, atol=1e-9)


def test_everything_that_a_pen_draws_is_in_every_format():
    def sheet():
        document = document_at(0.5)
        pen = Pen(document.modelspace(), 0.5, (10.0, 10.0))
        pen.stroke("HIDDEN", ((0, 0), (10, 0), (10, 20)))
        pen.arc("VISIBLE", (40, 40), 10)
        pen.arc("CENTRE", (40, 40), 20, 0.5, 4.0)
        own = pen.dimension(DIAMETER, "2x <> <90°>", (20, 20), defpoint=(30, 40), defpoint4=(50, 40))
        own.text((20, 20), "2x Ø40 <90°>", anchor="middle", angle=90.0)
        own.head((0, 0), 0.0)
        return pen, Sheet(document, 0.5, A3, "a & b")

    (pen, first), (_, second) = sheet(), sheet()
    assert dxf_bytes(first) == dxf_bytes(second)
    for write in (svg_bytes, lambda sheet, shown: pdf_bytes([(sheet, shown)])):
        assert write(first, list(drawn_on(first))) == write(second, list(drawn_on(second)))
    document = ezdxf.read(io.StringIO(dxf_bytes(first).decode("utf-8")))
    kinds = sorted(entity.dxftype() for entity in document.modelspace())
    assert kinds == ["ARC", "CIRCLE", "DIMENSION", "LWPOLYLINE"]
    assert document.query("CIRCLE")[0].dxf.radius == 20  # views are 1:1, the sheet grows
    assert document.query("DIMENSION")[0].get_measurement() == pytest.approx(40)
    page = ET.fromstring(svg_bytes(first, list(drawn_on(first))))
    text = page.find(f".//{SVG}text")
    assert text.text == "2x Ø40 <90°>" and (text.get("x"), text.get("y")) == ("30", "267")
    circle = next(path for path in page.iter(f"{SVG}path") if path.get("d").count("C") > 3)
    assert circle.get("d").startswith("M60 247 C")  # the right end of the circle, on paper, y down
    left, low, right, top = pen.box()
    assert (left, right, top) == (pytest.approx(-2.2), pytest.approx(40 + 20 * np.cos(0.5)), pytest.approx(60, abs=0.2))
    assert low == pytest.approx(-0.35)
    assert pen.box() == measured_box()


def measured_box():
    """Of the same, drawn on nothing."""
    pen = Pen(None, 0.5)
    pen.stroke("HIDDEN", ((0, 0), (10, 0), (10, 20)))
    pen.arc("VISIBLE", (40, 40), 10, 0.0, TURN_RAD)
    pen.arc("CENTRE", (40, 40), 20, 0.5, 4.0)
    own = pen.dimension(DIAMETER, "<>", (20, 20))
    own.text((20, 20), "2x Ø40 <90°>", anchor="middle", angle=90.0)
    own.head((0, 0), 0.0)
    return pen.box()


def struck(sheet):
    """Words that a line of the sheet goes through, by the widths of the PDF's own font."""
    shown = list(drawn_on(sheet))
    lines = [LineString([(p.x, p.y) for p in o.path.flattening(0.1)]) for o in shown if isinstance(o, Outline)]
    found = []
    for words in (item for item in shown if isinstance(item, Words)):
        width = stringWidth(words.text, "Helvetica", words.height / CAPITAL)
        left = -{"left": 0.0, "middle": 0.5, "right": 1.0}[words.anchor] * width
        room = rotate(shapely_box(left, 0.0, left + width, words.height), words.angle, origin=(0, 0))
        if any(line.intersects(translate(room, *words.at)) for line in lines):
            found.append(words.text)
    return found


def sheet_with(solid, *, lidar_axis=None, fits=()):
    part = part_of(PartSpec(name="part", turns=False, make=solid.copy, fits=fits), solid.Solids()[0], lidar_axis, [])
    return sheet_of(part, Title((("part", "part"),), ("A note.",)), "part")


def test_what_is_told_of_a_bar_stands_beyond_the_axis():
    bar = box((-52, -10, 0), (-12, 10, 20)).cut(upright(1.65, -1, 21, -42, 0), upright(1.65, -1, 21, -26, 0))
    sheet = sheet_with(bar)
    assert "2x Ø3.3 THRU" in [words.text for words in drawn_on(sheet) if isinstance(words, Words)]
    assert struck(sheet) == []


def test_the_letters_of_a_section_stand_beside_the_leaders():
    shaft = upright(14, 0, 4).fuse(upright(6, 0, 112))
    crossed = shaft.cut(*(cylinder(1.25, (9 * x, -9, 106), (-x, 1, 0), 26) for x in (-1, 1)))
    sheet = sheet_with(crossed, fits=(ToleratedDiameter(12.0, False, "0/-0.011", "h6"),))
    assert [words.text for words in drawn_on(sheet) if isinstance(words, Words)].count("S") == 2
    assert struck(sheet) == []


@pytest.mark.parametrize("angle_deg", [2.0, 6.0, 20.0, 55.0, 88.0])
def test_an_angle_is_told_beside_its_arms(angle_deg):
    document = document_at(1.0)
    pen = Pen(document.modelspace(), 1.0, (100, 100))
    turned = np.pi / 2 + np.radians(angle_deg)
    angle_between(pen, (0, 0), np.pi / 2, turned, 12.0, f"{angle_deg:g}°")
    sheet = Sheet(document, 1.0, A3, "angle")
    assert struck(sheet) == []
    heads = [item.path for item in drawn_on(sheet) if isinstance(item, Outline) and item.filled]
    first, second = (Polygon([(p.x, p.y) for p in path.flattening(0.1)]) for path in heads)
    assert not first.intersects(second)


def test_the_optical_centre_is_named_where_nothing_is_drawn():
    plate = box((-20, -20, -60), (-12, 20, 30)).cut(
        cylinder(1.5, (-30, 10, 10), X, 30), cylinder(1.5, (-30, -10, 10), X, 30)
    )
    sheet = sheet_with(plate.fuse(upright(15, -70, -50)), lidar_axis=X)
    assert "OPTICAL CENTRE" in [words.text for words in drawn_on(sheet) if isinstance(words, Words)]
    assert struck(sheet) == []
