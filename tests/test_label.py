"""The engraved label: what it says, where it is, that it leaves a wall; and a part without room goes without."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from cad.build import config_hash
from cad.glyphs import letters, text_width
from cad.label import DEPTH, DIGITS, _engraved, label_texts, labelled_parts
from cad.mesh import checked_mesh
from cad.solids import box, upright


def test_the_parts_that_hold_the_angles_say_them(made):
    digest = config_hash(made.scanner)
    assert label_texts(made.scanner, "alignment_linkage", digest) == ["tilted", "L -20 -70", digest[:DIGITS]]
    assert label_texts(made.scanner, "base_mount", digest) == ["tilted", "R 0 35", digest[:DIGITS]]
    assert label_texts(made.scanner, "bearing_cage", digest) == ["tilted", digest[:DIGITS]]
    labels = labelled_parts(made.scanner, made.result.assembly, digest)
    assert set(labels.parts) >= {"alignment_linkage", "base_mount"}
    missing = {out.what for out in made.result.left_out if out.unit == "labels"}
    assert missing == {f"label of {name}" for name in labels.without}
    assert set(labels.without) | set(labels.parts) == set(made.result.assembly.made) - {"servo_shaft"}
    named = made.scanner.angles.model_copy(update={"task": "another"})
    assert config_hash(replace(made.scanner, angles=named)) != digest


def test_engraving_takes_off_the_area_of_its_letters_and_nothing_else(made):
    for name in ("alignment_linkage", "base_mount"):
        plain = made.result.assembly.made[name]
        mesh = made.result.meshes[name]
        read = trimesh.load(made.folder / "parts" / f"{name}.stl")
        assert read.is_watertight and read.body_count == 1
        lost = checked_mesh(plain, name).volume() - mesh.volume()
        lines = [*label_texts(made.scanner, name, config_hash(made.scanner))]
        if name == "alignment_linkage":
            lines.append("FRONT")
        areas = [sum(part.area for line in lines for part in letters(line, height)) for height in (3.6, 4.5)]
        assert DEPTH * areas[0] * 0.98 < lost < DEPTH * areas[1] * 1.02
        solid = checked_mesh(plain, name).vertices
        np.testing.assert_allclose(read.bounds, [solid.min(axis=0), solid.max(axis=0)], atol=1e-3)


def test_front_stands_on_the_seat_towards_the_front(made):
    R = np.array(made.result.assembly.stack.R_rot_laser)
    mesh = made.result.meshes["alignment_linkage"]
    local = mesh.vertices @ R
    floor = local[np.abs(local[:, 2] - (made.result.assembly.linkage.seat - DEPTH)) < 1e-3]
    front = floor[(np.abs(floor[:, 0] - 20.0) < 2.7) & (np.abs(floor[:, 1]) < 11.5)]
    assert len(front) > 50
    assert np.ptp(front[:, 1]) == pytest.approx(text_width("FRONT", 4.5) + 0.8, abs=0.05)


def test_a_label_leaves_a_wall_and_goes_round_holes():
    thin = box((0, 0, 0), (60, 60, 1.5))
    assert _engraved(thin, ["LABEL"], None, 1.2) is None
    assert _engraved(box((0, 0, 0), (34, 20, 20)), ["A LONG LABEL"], None, 1.2) is not None  # in two lines
    assert _engraved(box((0, 0, 0), (8, 8, 8)), ["LABEL"], None, 1.2) is None
    plate = box((0, 0, 0), (60, 30, 6)).cut(upright(5.0, -1, 7, 30, 15)).Solids()[0]
    engraved, mesh = _engraved(plate, ["LABEL"], None, 1.2)
    assert mesh.is_closed()
    lost = plate.Volume() - engraved.Volume()
    assert lost == pytest.approx(DEPTH * sum(part.area for part in letters("LABEL", 4.5)), rel=1e-6)


def test_letters_join_where_strokes_meet():
    assert len(letters("HELLO", 4.5)) == 5
    assert len(letters("0", 4.5)[0].interiors) == 1 and len(letters("8", 4.5)[0].interiors) == 2
    assert letters(" ", 4.5) == []
