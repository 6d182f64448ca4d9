"""A driver's straight line to a screw: what lies over the head blocks it, what is aside, far or turns away does not."""

import numpy as np
import pytest

from scanwright.cad import solids
from scanwright.cad.checks import access
from scanwright.cad.checks.access import Body, access_checks, blocked_screws
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
