"""A part without a screw's hole, with an opening there, or elsewhere, is an error, on both sides of a joint."""

from dataclasses import replace

import numpy as np
import pytest

from scanwright.cad import solids
from scanwright.cad.checks.access import Body
from scanwright.cad.checks.seats import face_shares, seat_checks
from scanwright.cad.geometry.mesh import mesh_of
from scanwright.cad.layout.joints import Joint, ScrewAxis
from scanwright.cad.screws import SCREWS

HOLE_MM = 3.4


def plate(*cuts):
    return solids.box((-20, -20, 0), (20, 20, 5)).cut(*cuts).Solids()[0]


def hole(x, y):
    return solids.upright(HOLE_MM / 2, -1.0, 6.0, x, y)


CASES = {
    "as it should be": (plate(hole(0, 0)), 1.0),
    "in a recess": (plate(hole(0, 0), solids.upright(3.5, 4.2, 6.0)), 1.0),
    "in a recess that is open to a side": (plate(hole(0, 0), solids.box((-3.2, -3.2, 4.5), (30, 3.2, 6.0))), 1.0),
    "a slot": (plate(solids.box((-1.7, -6, -1), (1.7, 6, 6))), 0.5),
    "at an edge": (plate(hole(0, 0), solids.box((0, -30, -1), (30, 30, 6))), 0.5),
    "no hole": (plate(hole(9, 0)), 0.0),
    "an opening": (plate(solids.upright(8.0, -1.0, 6.0)), 0.0),
    "beside the part": (plate(hole(0, 0)).moved(solids.location(np.eye(3), np.array([30.0, 0, 0]))), 0.0),
    "far below": (plate(hole(0, 0)).moved(solids.location(np.eye(3), np.array([0, 0, -4.0]))), 0.0),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("turn_deg", [0.0, 75.0])
def test_the_share_of_a_seat_is_that_of_the_material_under_the_head(name, turn_deg):
    solid, expected = CASES[name]
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    R = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    z = 4.5 if "recess" in name else 5.0
    joint = Joint("plate", "block", "thread", SCREWS["M3"], (ScrewAxis(tuple(R @ (0, 0, z)), tuple(-R[:, 2])),), z, 8.0)
    body = Body(mesh_of(solid.moved(solids.location(R, np.zeros(3)))))
    middle_mm = (HOLE_MM + SCREWS["M3"].head_diameter) / 2
    assert face_shares(joint, body, middle_mm, 0.0, 1.0, z) == pytest.approx(expected, abs=0.09)


def test_a_screw_of_a_build_without_seat_is_an_error_that_counts_it(made):
    assembly = made.result.assembly
    (check,) = seat_checks(assembly)
    assert (check.severity, check.value) == ("ok", 0.0)
    cage = next(joint for joint in assembly.layout.joints if joint.part == "bearing_cage")
    aside = replace(cage.axes[1], start=tuple(np.add(cage.axes[1].start, (0, 0, 9.0))))
    moved = replace(cage, axes=(cage.axes[0], aside, *cage.axes[2:]))
    found = seat_checks(replace(assembly, layout=replace(assembly.layout, joints=(moved,))))
    assert [(check.severity, check.subject, check.value) for check in found] == [
        ("error", part, 1.0) for part in ("bearing_cage", "slip_ring_adapter")
    ]
    assert all("bearing_cage on slip_ring_adapter: 1 of 4 M3: " in check.message for check in found)
