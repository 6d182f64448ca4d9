"""A driver's straight line to a screw: what lies over the head blocks it, what is aside, far or turns away does not.

The length of its blade: by hand, and by points in random boxes.
"""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scanwright.cad import solids
from scanwright.cad.checks import access
from scanwright.cad.checks.access import (
    HANDLE_MM,
    LONGEST_MM,
    Body,
    access_checks,
    blade_mm,
    blocked_screws,
    driver_rays,
)
from scanwright.cad.geometry.mesh import mesh_of
from scanwright.cad.layout.joints import Joint, ScrewAxis
from scanwright.cad.screws import SCREWS

AT = (20.0, 0.0, 0.0)
DOWN = Joint("plate", "block", "thread", SCREWS["M3"], (ScrewAxis(AT, (0.0, 0.0, -1.0)),), 4.0, 8.0)


def body(low, high):
    return Body(mesh_of(solids.box(low, high)))


@pytest.mark.parametrize(
    ("low", "high", "blocked"),
    [
        ((10, -5, 30), (30, 5, 40), True),  # over it
        ((21.5, -5, 30), (30, 5, 40), True),  # the shaft of the key has a radius
        ((21.7, -5, 30), (30, 5, 40), False),
        ((10, -5, 70), (30, 5, 80), False),  # beyond the key
        ((10, -5, -20), (30, 5, -1), False),  # what it holds
    ],
)
def test_what_lies_over_a_head_blocks_its_driver(low, high, blocked):
    found = blocked_screws(DOWN, {"cover": body(low, high)}, frozenset())
    assert [each.body for each in found] == ["cover"] * blocked
    if blocked:
        assert found[0].after_mm == pytest.approx(30.0 - 3.0 - 0.2, abs=1e-3)


def test_what_turns_is_turned_out_of_the_way_and_what_turns_with_the_screw_is_not():
    present = {"arm": body((10, -5, 30), (30, 5, 40))}
    assert blocked_screws(DOWN, present, frozenset({"arm"})) == []
    assert blocked_screws(DOWN, present, frozenset({"arm", "plate"}))
    around = {"disc": body((-40, -40, 30), (40, 40, 40))}
    assert blocked_screws(DOWN, around, frozenset({"disc"}))


def test_each_screw_of_a_joint_is_looked_at_from_its_own_head():
    axes = (*DOWN.axes, ScrewAxis((0.0, 0.0, 10.0), (0.0, 1.0, 0.0)))
    both = Joint("plate", "block", "thread", SCREWS["M3"], axes, 4.0, 8.0)
    (found,) = blocked_screws(both, {"wall": body((-9, -30, -9), (9, -25, 30))}, frozenset())
    assert found.screw == 2


def test_every_screw_of_a_scanner_is_reached_and_a_roof_over_it_is_an_error_with_its_step(made, monkeypatch):
    assembly = made.result.assembly
    (check,) = access_checks(assembly)
    assert (check.severity, check.value) == ("ok", 0.0)
    stiff = access._bodies(assembly) | {"servo_case": body((-300, -300, 120), (300, 300, 130))}
    monkeypatch.setattr(access, "_bodies", lambda _: stiff)
    monkeypatch.setattr(access, "KEYS_MM", {name: (radius, 2000.0) for name, (radius, _) in access.KEYS_MM.items()})
    failed = access_checks(assembly)
    assert failed and {check.severity for check in failed} == {"error"}
    assert all("step " in check.message and "blocks it" in check.message for check in failed)
    assert sum(check.value for check in failed) <= sum(joint.count for joint in assembly.layout.joints)
    assert np.isfinite([check.value for check in failed]).all()


NONE = frozenset[str]()
WALL = ((29, -9, -9), (33, 9, 60))  # 9 mm from the axis of the screw, less than the radius of the handle


@pytest.mark.parametrize(
    ("boxes", "turning", "length"),
    [
        ({}, NONE, 5),  # the head
        ({"wall": WALL}, NONE, 60),
        ({"wall": ((36, -9, -9), (40, 9, 60))}, NONE, 5),
        ({"wall": WALL, "roof": ((-99, -99, 79), (99, 99, 85))}, NONE, LONGEST_MM + 1),
        ({"wall": WALL, "roof": ((-99, -99, 82), (99, 99, 85))}, NONE, 60),
        ({"wall": WALL}, frozenset({"wall"}), 5),
        ({"wall": WALL}, frozenset({"wall", "plate"}), 60),
        ({"wall": ((29, -9, -9), (33, 9, 160))}, NONE, LONGEST_MM + 1),
    ],
)
def test_a_blade_reaches_so_far_that_its_handle_is_free(boxes, turning, length):
    assert blade_mm(DOWN, {name: body(*corners) for name, corners in boxes.items()}, turning) == length


STARTS = DOWN.screw.head_height + access.OVER_HEAD_MM
HALVES = st.integers(-60, 60).map(lambda n: n / 2 + 0.13)
HEIGHTS = st.integers(-80, 1400).map(lambda n: STARTS + (n + 0.5) / 8)


@given(
    st.lists(
        st.tuples(HALVES, HALVES, HEIGHTS, st.integers(4, 60), st.integers(4, 60), st.integers(8, 400)), max_size=3
    )
)
def test_the_blade_by_points_in_boxes(drawn):
    boxes = [((20 + x, y, z), (20 + x + dx / 2, y + dy / 2, z + dz / 8)) for x, y, z, dx, dy, dz in drawn]
    bodies = {str(n): body(*box) for n, box in enumerate(boxes)}
    starts, back = driver_rays(DOWN, (access.KEYS_MM["M3"][0], HANDLE_MM[0] / 2, HANDLE_MM[0]))
    heights = np.arange(1 / 32, LONGEST_MM + HANDLE_MM[1], 1 / 16)
    points = starts[0][:, None] + heights[:, None] * np.array([0.0, 0.0, 1.0])
    inside = np.array([((points > low) & (points < high)).all(axis=-1) for low, high in boxes])
    filled = inside.reshape(len(boxes), len(points), LONGEST_MM + HANDLE_MM[1], 16).any(axis=-1)  # cells of 1 mm
    cells = filled.any(axis=0)
    assert [each.filled(starts, back)[0].tolist() for each in bodies.values()] == filled.tolist()
    lengths = (
        5 * math.ceil((first + DOWN.screw.head_height) / 5)
        for first in range(LONGEST_MM + 1)
        if not cells[:, first : first + HANDLE_MM[1]].any() and not cells[: 1 + access.RAYS, : first + 1].any()
    )
    least = next(lengths, LONGEST_MM + 1)
    found = blade_mm(DOWN, bodies, NONE)
    assert found == (least if least <= LONGEST_MM else LONGEST_MM + 1)
