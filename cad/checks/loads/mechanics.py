"""Torques that the rotor's weight requires of the servo, and the backlash of its gears. SI units."""

import math
from collections.abc import Mapping

from scanwright.cad.assembly.masses import LIDAR_CENTRE_ERROR_MM, off_axis_error_m, rotor_of, rotor_weight
from scanwright.cad.checks.limits import at_most, note, tidy, with_error
from scanwright.cad.checks.loads.belt import belt_loads
from scanwright.cad.checks.loads.direct import direct_loads
from scanwright.cad.geometry.inertia import Inertial
from scanwright.cad.layout.loads import FAR_MM, Weight, friction_nm
from scanwright.cad.layout.names import SERVO
from scanwright.cad.layout.placement import Placement
from scanwright.cad.layout.rotor.imbalance import backlash_matters, keeps_flank
from scanwright.design.findings import Finding, Severity
from scanwright.design.scanner import Scanner

SPIN_UP_S = 0.2  # to full speed: chosen, a small part of the fastest turn
DEFAULT_PERIOD_S = 1.0  # if the angle set names no motion: the fastest turn of the shipped tasks
BALANCE_AT_MM = 50.0  # from the axis, for which the message states a counterweight


def mechanics_checks(layout: Placement, bodies: Mapping[str, Inertial]) -> list[Finding]:
    """Check torques, backlash and loads; bodies of `masses.link_bodies`."""
    scanner, stack = layout.scanner, layout.stack
    rotor, weight = rotor_of(scanner, bodies), rotor_weight(scanner, stack, bodies)
    error_m = off_axis_error_m(bodies)
    off = "centre of mass off the axis"
    return [
        note("centre_of_mass", 1000 * weight.off_axis_m, "mm", "rotor", off, 1000 * error_m),
        *_torques(scanner, rotor, weight, weight.across_n * error_m),
        _flanks(scanner, rotor, weight, error_m),
        *belt_loads(layout, rotor, weight, spin_up_nm(scanner, rotor, weight)),
        *direct_loads(layout, weight),
    ]


def _torques(scanner: Scanner, rotor: Inertial, weight: Weight, error_nm: float) -> list[Finding]:
    servo = scanner.servo
    limit = servo.continuous_torque_nm
    rubs = friction_nm(scanner)[1]
    static = weight.across_n * weight.off_axis_m + rubs
    spin_up = spin_up_nm(scanner, rotor, weight)
    what = f"with {rubs:g} N m of friction, against a fifth of the stall torque of {servo.name}"
    holds, spins = f"torque of the imbalance, {what}", f"torque to full speed in {SPIN_UP_S:g} s, {what}"
    return [
        at_most("static_torque", static, limit, "N m", SERVO, holds, error_nm),
        at_most("spin_up_torque", spin_up, limit, "N m", SERVO, spins, error_nm),
    ]


def spin_up_nm(scanner: Scanner, rotor: Inertial, weight: Weight) -> float:
    """Return the torque that brings the rotor to full speed in SPIN_UP_S against imbalance and friction."""
    motion = scanner.angles.motion
    period = DEFAULT_PERIOD_S if motion is None else getattr(motion, "period_s", DEFAULT_PERIOD_S)
    x, y = rotor.centre_m[:2]
    about_axis = float(rotor.inertia_kg_m2[2, 2] + rotor.mass_kg * (x**2 + y**2))
    still = weight.across_n * weight.off_axis_m + friction_nm(scanner)[1]
    return still + about_axis * 2 * math.pi / period / SPIN_UP_S


def _flanks(scanner: Scanner, rotor: Inertial, weight: Weight, error_m: float) -> Finding:
    """Check whether gravity moves the load from one flank of the gears to the other.

    The least friction of ring and bearing that the catalogue states keeps the flank.
    """
    rubs = friction_nm(scanner)[0]
    servo, torque, error = scanner.servo, weight.across_n * weight.off_axis_m, weight.across_n * error_m
    moment = f"{SERVO}: gravity turns {servo.name} with {with_error(torque, error)} N m"
    severity: Severity = "warning" if backlash_matters(scanner) else "note"
    limit: float | None = rubs
    hint = ""
    if torque + error <= rubs:
        severity, what = "ok", f"at most the friction of ring and bearing ({rubs:g})"
    elif keeps_flank(scanner, rotor.centre_m[:2], error_m):
        severity, what, limit = "ok", "in one direction in every position of the sweep", None
    elif torque <= rubs:
        what = (
            f"less than the friction of ring and bearing ({rubs:g}), but the centre of mass of "
            f"{scanner.lidar.name} is undocumented: within {LIDAR_CENTRE_ERROR_MM:g} mm of the middle of its body "
            "(assumed)"
        )
        hint = "compare the ripple that `scanwright scan` prints, and move the balancing weight, if any, to reduce it"
    else:
        x, y = rotor.centre_m[:2]
        azimuth = round(math.degrees(math.atan2(-y, -x))) % 360
        backlash = "a backlash that its maker does not state"
        if servo.backlash_deg is not None:
            off = math.radians(servo.backlash_deg) * FAR_MM
            backlash = f"a backlash of {servo.backlash_deg:g} deg ({off:.0f} mm at 10 m)"
        what = f"back and forth through {backlash}: only an encoder on the output shaft measures that"
        grams = 1000 * rotor.mass_kg * weight.off_axis_m / (BALANCE_AT_MM / 1000)
        hint = f"balance it with {grams:.0f} g at {BALANCE_AT_MM:g} mm from the axis, {azimuth} deg from +x"
    return Finding("flanks", severity, SERVO, f"{moment}, {what}", tidy(torque), limit, "N m", hint)
