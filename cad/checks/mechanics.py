"""What the weight of all that turns asks of the servo: torques, and the flanks of its gears. SI units."""

from __future__ import annotations

import math
from collections.abc import Mapping

from scanwright.cad.assembly.masses import LIDAR_DOUBT_MM, off_axis_doubt_m, rotor_of, rotor_weight
from scanwright.cad.checks.check import Check, Severity, at_most, doubted, note, tidy
from scanwright.cad.checks.loads.belt import belt_loads
from scanwright.cad.checks.loads.direct import direct_loads
from scanwright.cad.geometry.inertia import Inertial
from scanwright.cad.layout.balance.imbalance import keeps_flank, play_matters
from scanwright.cad.layout.belt.stack import BeltStack
from scanwright.cad.layout.drive import Stack
from scanwright.cad.layout.loads import FAR_MM, Weight, friction_nm
from scanwright.cad.layout.names import SERVO
from scanwright.design.scanner import Scanner

SPIN_UP_S = 0.2
SLOWEST_PERIOD_S = 1.0  # where the angle set names no motion
BALANCE_AT_MM = 50.0  # from the axis, where a counterweight is worked out


def mechanics_checks(scanner: Scanner, stack: Stack, bodies: Mapping[str, Inertial]) -> list[Check]:
    """Everything that has to do with weight.

    Args:
        scanner: angles and products.
        stack: its layout.
        bodies: of `masses.link_bodies`.
    """
    rotor, weight = rotor_of(scanner, bodies), rotor_weight(scanner, stack, bodies)
    doubt_m = off_axis_doubt_m(bodies)
    off = "centre of mass off the axis"
    return [
        note("centre_of_mass", 1000 * weight.off_axis_m, "mm", "rotor", off, 1000 * doubt_m),
        *_torques(scanner, rotor, weight, weight.across_n * doubt_m),
        _flanks(scanner, rotor, weight, doubt_m),
        *load_checks(scanner, stack, bodies),
    ]


def load_checks(scanner: Scanner, stack: Stack, bodies: Mapping[str, Inertial]) -> list[Check]:
    """Forces on servo and bearings against their ratings; arguments as for `mechanics_checks`."""
    rotor, weight = rotor_of(scanner, bodies), rotor_weight(scanner, stack, bodies)
    if isinstance(stack, BeltStack):
        return belt_loads(scanner, stack, rotor, weight, spin_up_nm(scanner, rotor, weight))
    return direct_loads(scanner, stack, weight)


def _torques(scanner: Scanner, rotor: Inertial, weight: Weight, doubt_nm: float) -> list[Check]:
    servo = scanner.servo
    limit = servo.continuous_torque_nm
    rubs = friction_nm(scanner)[1]
    static = weight.across_n * weight.off_axis_m + rubs
    spin_up = spin_up_nm(scanner, rotor, weight)
    what = f"of {servo.name}, a fifth of its stall torque"
    with_friction = f"with {rubs:g} N m of friction, {what}"
    holds = f"torque that turns the imbalance, {with_friction}"
    spins = f"torque to full speed in {SPIN_UP_S:g} s, {with_friction}"
    return [
        at_most("static_torque", static, limit, "N m", SERVO, holds, doubt_nm),
        at_most("spin_up_torque", spin_up, limit, "N m", SERVO, spins, doubt_nm),
    ]


def spin_up_nm(scanner: Scanner, rotor: Inertial, weight: Weight) -> float:
    """Torque that brings the rotor to full speed in SPIN_UP_S against imbalance and friction."""
    motion = scanner.angles.motion
    period = SLOWEST_PERIOD_S if motion is None else getattr(motion, "period_s", SLOWEST_PERIOD_S)
    x, y = rotor.centre_m[:2]
    about_axis = float(rotor.inertia_kg_m2[2, 2] + rotor.mass_kg * (x**2 + y**2))
    still = weight.across_n * weight.off_axis_m + friction_nm(scanner)[1]
    return still + about_axis * 2 * math.pi / period / SPIN_UP_S


def _flanks(scanner: Scanner, rotor: Inertial, weight: Weight, doubt_m: float) -> Check:
    """Where gravity swings the load from one flank of the gears to the other by the play between them.

    The friction of ring and bearing holds one flank: the least that the catalogue states.
    """
    rubs = friction_nm(scanner)[0]
    servo, torque, doubt = scanner.servo, weight.across_n * weight.off_axis_m, weight.across_n * doubt_m
    turns = f"with {doubted(torque, doubt)} N m"
    severity: Severity = "warning" if play_matters(scanner) else "note"
    if torque + doubt <= rubs:
        message = f"{SERVO}: gravity turns it {turns}, no more than the friction of ring and bearing"
        return Check("flanks", "pass", tidy(torque), rubs, "N m", SERVO, message)
    if keeps_flank(scanner, rotor.centre_m[:2], doubt_m):
        message = f"{SERVO}: gravity turns it {turns}, one way all over the sweep"
        return Check("flanks", "pass", tidy(torque), None, "N m", SERVO, message)
    if torque <= rubs:
        message = (
            f"{SERVO}: gravity turns {servo.name} {turns}, of {rubs:g} N m of friction of ring and bearing; the "
            f"centre of mass of {scanner.lidar.name} is unverified, within {LIDAR_DOUBT_MM:g} mm of the middle of "
            "its body; look at the ripple that `scanwright scan` prints, and move the balancing weight, where there "
            "is one, until it is least"
        )
        return Check("flanks", severity, tidy(torque), rubs, "N m", SERVO, message)
    grams = 1000 * rotor.mass_kg * weight.off_axis_m / (BALANCE_AT_MM / 1000)
    x, y = rotor.centre_m[:2]
    azimuth = round(math.degrees(math.atan2(-y, -x))) % 360
    play = "by a play that its maker does not tell"
    if servo.backlash_deg is not None:
        off = math.radians(servo.backlash_deg) * FAR_MM
        play = f"by {servo.backlash_deg:g} deg of play ({off:.0f} mm at 10 m)"
    message = (
        f"{SERVO}: gravity turns {servo.name} {turns} to and fro and changes the flank of its gears, "
        f"{play}: an encoder on the output shaft sees that, one on the motor does not; {grams:.0f} g at "
        f"{BALANCE_AT_MM:g} mm from the axis, {azimuth} deg from +x, would balance it"
    )
    return Check("flanks", severity, tidy(torque), rubs, "N m", SERVO, message)
