"""The friction that holds the mount's angle, against statics worked out in another way."""

import math
from dataclasses import replace

import pytest

from scanwright.cad.checks.loads.angle import angle_checks, slip_deg
from scanwright.cad.layout.joints import Joint
from scanwright.cad.layout.tightening import ALUMINIUM, PRINTED, hold_of


def clamp_of(assembly) -> Joint:
    return next(joint for joint in assembly.layout.joints if joint.onto == assembly.layout.drive.shaft)


def test_pressure_under_the_washers_and_friction_carry_the_torque(made):
    assembly = made.result.assembly
    (check,) = angle_checks(assembly)
    preload = 20.0 * math.pi / 4 * (9.0**2 - 3.4**2)  # of one M3 on a washer of 9 mm
    assert hold_of(clamp_of(assembly), PRINTED, ALUMINIUM).preload_n == pytest.approx(preload)
    holds = 0.15 * math.sqrt(2) * preload * assembly.layout.stack.shaft_diameter / 2000  # two screws, square
    assert f"{holds:.3g} N m of friction" in check.message
    assert check.severity == "ok" and check.value >= 2.0


def test_a_load_that_friction_does_not_carry_is_an_error(made):
    ring = made.scanner.slip_ring
    rubs = replace(made.scanner, slip_ring=ring.model_copy(update={"friction_nm": (0.1, 2.0)}))
    heavy = replace(made.scanner, lidar=made.scanner.lidar.model_copy(update={"mass_g": 20_000.0}))
    assembly = made.result.assembly
    for scanner in (rubs, heavy):
        (check,) = angle_checks(replace(assembly, layout=replace(assembly.layout, scanner=scanner)))
        assert check.severity == "error" and check.value < 2.0


def test_a_slip_ends_at_the_flat_or_at_a_screw(made):
    linkage, joint = made.result.assembly.layout.linkage, clamp_of(made.result.assembly)
    stack = linkage.stack
    corner = math.acos(stack.flat / (stack.shaft_diameter / 2))  # azimuth of the flat's edge, from the flat's middle
    tight = replace(linkage, cross_hole=100.0)
    turn = math.radians(slip_deg(tight, joint)) / 2
    high = stack.shaft_diameter / 2 * math.cos(corner - turn)
    assert high == pytest.approx(stack.flat + linkage.fit / 2)  # there it meets the flat of the bore
    assert 0.1 < slip_deg(linkage, joint) <= slip_deg(tight, joint) < 5.0
