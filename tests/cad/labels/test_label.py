"""The engraved label: its text and place, that it can be read and leaves a wall; engraving against booleans."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
import trimesh
from scanners import digest_of

from scanwright.cad import solids
from scanwright.cad.geometry.holes import Piercing
from scanwright.cad.geometry.mesh import checked_mesh
from scanwright.cad.labels.engrave import engrave, flat_at, flats_of, groove_of
from scanwright.cad.labels.label import DIGITS, Ground, engraved, free_distance, label_on, label_texts
from scanwright.cad.labels.lettering import letters, text_width
from scanwright.cad.layout.placement import placement_of
from scanwright.cad.solids import box, upright
from scanwright.design.errors import BuildError
from scanwright.design.left_out import LeftOut
from scanwright.design.motion import Sweep

STROKE = 0.8


@pytest.fixture(scope="module")
def groove(made):
    return groove_of(made.scanner.printer)


def test_the_parts_that_hold_the_angles_are_labelled_with_them(made):
    digest, parts = digest_of(made.scanner), made.result.assembly.parts
    assert label_texts(made.scanner, parts["alignment_linkage"], digest) == [
        "tilted",
        "L -20 -70",
        digest[:DIGITS],
    ]
    assert label_texts(made.scanner, parts["base_mount"], digest) == [
        "tilted",
        "R 0 35",
        digest[:DIGITS],
    ]
    assert label_texts(made.scanner, parts["bearing_cage"], digest) == ["tilted", digest[:DIGITS]]
    assert set(made.result.meshes) >= {"alignment_linkage", "base_mount"}
    named = made.scanner.angles.model_copy(update={"task": "another"})
    assert digest_of(replace(made.scanner, angles=named)) != digest


def test_scanners_whose_parts_may_differ_have_labels_that_do(made):
    ring = made.scanner.slip_ring.model_copy(update={"friction_nm": None})  # whose friction would hold the imbalance
    free = replace(made.scanner, slip_ring=ring)

    def swept(*limits_deg, period_s=18.0):
        motion = Sweep(limits_deg=limits_deg, period_s=period_s)
        return replace(free, angles=free.angles.model_copy(update={"motion": motion}))

    scanners = [made.scanner, swept(-10.0, 10.0), swept(-90.0, 90.0)]
    assert len({digest_of(scanner) for scanner in scanners}) == 3
    assert digest_of(swept(-10.0, 10.0, period_s=9.0)) == digest_of(scanners[1])
    bars = [placement_of(scanner).counterweight for scanner in scanners[1:]]
    assert [isinstance(bar, LeftOut) for bar in bars] == [True, False]  # the narrow one keeps the gears on a flank


def test_a_printed_part_has_a_label_or_is_listed_without(made):
    result, missing = made.result, {out.what for out in made.result.left_out if out.unit == "labels"}
    for name in set(result.assembly.made) - result.assembly.metal():
        plain = result.assembly.mesh(name).volume() - result.meshes[name].volume() < 1.0
        assert plain == (f"label of {name}" in missing)


def test_engraving_takes_off_the_area_of_its_letters_and_nothing_else(made, groove):
    assert (groove.width, groove.depth) == (pytest.approx(STROKE), pytest.approx(0.6))
    for name in ("alignment_linkage", "base_mount"):
        plain = made.result.assembly.made[name]
        mesh = made.result.meshes[name]
        read = trimesh.load(made.folder / "parts" / f"{name}.stl")
        assert read.is_watertight and read.body_count == 1
        lost = checked_mesh(plain, name).volume() - mesh.volume()
        lines = [*label_texts(made.scanner, made.result.assembly.parts[name], digest_of(made.scanner))]
        if name == "alignment_linkage":
            lines.append("FRONT")
        areas = [sum(part.area for line in lines for part in letters(line, height, STROKE)) for height in (3.6, 4.5)]
        assert groove.depth * areas[0] * 0.98 < lost < groove.depth * areas[1] * 1.02
        solid = checked_mesh(plain, name).vertices
        np.testing.assert_allclose(read.bounds, [solid.min(axis=0), solid.max(axis=0)], atol=1e-3)


def test_front_stands_on_the_seat_towards_the_front(made, groove):
    R = np.array(made.result.assembly.layout.stack.R_rot_laser)
    mesh = made.result.meshes["alignment_linkage"]
    local = mesh.vertices @ R
    floor = local[np.abs(local[:, 2] - (made.result.assembly.layout.linkage.seat - groove.depth)) < 1e-3]
    front = floor[(np.abs(floor[:, 0] - 20.0) < 2.7) & (np.abs(floor[:, 1]) < 11.5)]
    assert len(front) > 50
    assert np.ptp(front[:, 1]) == pytest.approx(text_width("FRONT", 4.5) + STROKE, abs=0.05)


def test_labels_can_be_read_on_the_assembled_scanner(made):
    """By rays of another library: outwards from the letters of each label is no body, not even the deck."""
    assembly = made.result.assembly
    bodies = [trimesh.Trimesh(mesh.vertices, mesh.faces, process=False) for mesh in assembly.meshes().values()]
    scanner = trimesh.util.concatenate(bodies)
    normal, on_deck = np.array(assembly.layout.deck.normal), np.array(assembly.layout.deck.centre)
    for name in ("alignment_linkage", "base_mount"):
        mesh, plain = made.result.meshes[name], checked_mesh(assembly.made[name], name)
        known = {tuple(vertex) for vertex in np.round(plain.vertices, 4)}
        new = np.array([vertex for vertex in mesh.vertices if tuple(np.round(vertex, 4)) not in known])
        R = np.array(assembly.layout.stack.R_rot_laser)
        seat = assembly.layout.linkage.seat
        label = new[np.abs(new @ R[:, 2] - seat) > 1.0] if name == "alignment_linkage" else new
        # the letters lie in one plane, and their floors in another
        level = label
        for _ in range(2):
            out = np.linalg.svd(level - level.mean(axis=0), full_matrices=False)[2][2]
            height = label @ out
            level = label[height < height.mean()]
        assert np.ptp(height) == pytest.approx(0.6, abs=1e-3)
        top = label[height > height.max() - 1e-3]
        if trimesh.Trimesh(plain.vertices, plain.faces).contains(top[:20] + 0.05 * out).all():  # inwards: the other way
            out, top = -out, label[height < height.min() + 1e-3]
        starts = top + 0.05 * out
        assert not scanner.ray.intersects_any(starts, np.tile(out, (len(starts), 1))).any()
        towards_deck = (starts - on_deck) @ normal / max(1e-9, -float(out @ normal))
        assert towards_deck.min() > 200.0


def test_no_room_is_measured_before_faces_that_mate(made):
    assembly = made.result.assembly
    before, R, seat = free_distance(assembly), assembly.layout.stack.R(), assembly.layout.linkage.seat
    on_seat = flat_at(assembly.made["alignment_linkage"], R @ [0.0, 0.0, seat], R[:, 2])
    deck = -np.array(assembly.layout.deck.normal)
    foot = flat_at(assembly.made["base_mount"], np.array(assembly.layout.deck.centre) + 1e-9 * deck, deck)
    points = np.stack(np.meshgrid(*2 * [np.arange(-20.0, 21.0, 5.0)]), axis=2).reshape(-1, 2)
    assert [before(flat, points).min() for flat in (on_seat, foot)] == pytest.approx([0.0, 0.0], abs=0.3)


def _found(solid, texts, groove, before=lambda _, points: np.full(len(points), np.inf)):
    return label_on(Ground(flats_of(solid, 12), Piercing(solid), groove, 1.2, None), texts, before)


def test_a_label_leaves_a_wall_and_goes_round_holes(groove):
    assert _found(box((0, 0, 0), (60, 60, 1.5)), ["LABEL"], groove) is None
    assert len(_found(box((0, 0, 0), (34, 20, 20)), ["A LONG LABEL"], groove)[1].lines) == 2
    assert _found(box((0, 0, 0), (8, 8, 8)), ["LABEL"], groove) is None
    assert _found(box((0, 0, 0), (30, 12, 4)), ["MANY", "LINES", "ABCD"], groove)[1].lines == ("ABCD",)
    block = box((0, 0, 0), (60, 30, 6))
    plate = block.cut(upright(5.0, -1, 7, 30, 15)).Solids()[0]
    label = _found(plate, ["LABEL"], groove)
    mesh = checked_mesh(plate, "plate")
    lost = mesh.volume() - engraved(mesh, [label], groove, "plate").volume()
    area = sum(part.area for part in letters("LABEL", label[1].height, STROKE))
    assert lost == pytest.approx(groove.depth * area, rel=1e-5)


def test_a_label_goes_to_the_free_part_of_a_face(groove):
    block = box((0, 0, 0), (100, 100, 6))

    def corner_at(depth_mm):
        def before(flat, points):
            x, y, z = flat.at(points).T
            return np.where((z > 5.9) & (x > 60) & (y > 55), depth_mm, 0.0)

        place, lines = _found(block, ["LABEL"], groove, before)
        return place.flat.at(place.put(np.array([[0.0, 0.0], lines.size])))

    for depth_mm in (300.0, 50.0):  # readable on the scanner; in the hand only
        assert (corner_at(depth_mm)[:, 0] > 60).all() and (corner_at(depth_mm)[:, 1] > 55).all()
    assert _found(block, ["LABEL"], groove, lambda _, points: np.zeros(len(points))) is None


def test_engraving_is_what_a_boolean_would_cut():
    rng = np.random.default_rng(4)
    R, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    R *= np.sign(np.linalg.det(R))
    block = box((0, 0, 0), (40, 30, 8)).cut(upright(3.0, -1, 9, 33, 22)).Solids()[0]
    for solid in (block, block.moved(solids.location(R, (3.0, 4.0, 5.0)))):
        for flat in flats_of(solid, 2):  # of both orientations
            outlines = [
                shapely.transform(part, lambda points: points * 0.8 - [8, 2]) for part in letters("08A", 4.5, 0.8)
            ]
            assert all(flat.outline.contains(part) for part in outlines)
            cut = engrave(checked_mesh(solid, "block"), [(flat, outlines)], 0.6, "block")
            frame = solids.location(flat.frame, flat.origin)
            tools = [
                solids.prism(np.asarray(part.exterior.coords)[:-1], -0.6, 1.0).cut(
                    *(solids.prism(np.asarray(ring.coords)[:-1], -0.7, 1.1) for ring in part.interiors)
                )
                for part in outlines
            ]
            wanted = checked_mesh(solid.cut(*(tool.moved(frame) for tool in tools)), "block").manifold()
            assert (cut.manifold() - wanted).volume() + (wanted - cut.manifold()).volume() == pytest.approx(0, abs=1e-3)


def test_grooves_that_cut_a_part_in_two_are_refused():
    plate = box((0, 0, 0), (20, 10, 2))
    flat = flat_at(plate, np.array([10.0, 5.0, 2.0]), np.array([0.0, 0.0, 1.0]))
    across = shapely.transform(shapely.box(9, -1, 11, 11), lambda p: flat.along(np.column_stack([p, 0 * p[:, 0] + 2])))
    with pytest.raises(BuildError, match="do not leave one closed body"):
        engrave(checked_mesh(plate, "plate"), [(flat, [across])], 3.0, "plate")


def test_letters_join_where_strokes_meet():
    assert len(letters("HELLO", 4.5, STROKE)) == 5
    assert len(letters("0", 4.5, STROKE)[0].interiors) == 1 and len(letters("8", 4.5, STROKE)[0].interiors) == 2
    assert letters(" ", 4.5, STROKE) == []
