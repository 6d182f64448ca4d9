"""The friction that holds the mount's angle, against statics worked out in another way."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scanners import CAPSULE, RING, scanner_at

from scanwright.cad.checks.loads.angle import angle_checks
from scanwright.cad.layout.joints import Joint
from scanwright.cad.layout.loads import friction_nm
from scanwright.cad.layout.placement import placement_of
from scanwright.cad.layout.rotor.counterweight import Counterweight
from scanwright.cad.layout.rotor.cross_screws import slip_deg
from scanwright.cad.layout.rotor.imbalance import estimated_moment
from scanwright.cad.layout.tightening import ALUMINIUM, PRINTED, hold_of
from scanwright.design.errors import BuildError


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


@given(mass_g=st.floats(50, 6000), beta_laser=st.floats(-80, 80), ring=st.sampled_from([None, RING, CAPSULE]))
@settings(max_examples=10, deadline=None)
def test_heavier_lidars_get_larger_screws_or_are_refused(mass_g, beta_laser, ring):
    """Against the imbalance of the estimate alone, with the formula of the test above."""
    scanner = scanner_at((0, 0, 0, beta_laser), sensor="LMS111", servo="XM540-W270", slip_ring=ring)
    scanner = replace(scanner, lidar=scanner.lidar.model_copy(update={"mass_g": mass_g}))
    try:
        place = placement_of(scanner)
    except BuildError as error:
        assert "hold its angle" not in str(error) or "2 x M4" in str(error)
        return
    moment = estimated_moment(scanner, place.linkage, place.neck)
    imbalance = 0.0 if isinstance(place.counterweight, Counterweight) else float(np.hypot(*moment)) * 1e-6
    turns = 2 * 9.80665 * (imbalance + mass_g * 2e-6) + friction_nm(scanner)[1]
    washer, hole = place.stack.cross_screw.washer, place.stack.cross_screw.screw.nominal + 0.4
    preload = 20.0 * math.pi / 4 * (washer**2 - hole**2)
    proof = 0.5 * 450.0 * math.pi / 4 * (place.stack.cross_screw.screw.nominal * 0.86) ** 2  # about
    if place.stack.cup_bore == 0 and preload < proof:
        assert 0.15 * math.sqrt(2) * preload * place.stack.shaft_diameter / 2000 >= 0.9 * 2 * turns
