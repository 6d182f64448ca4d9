"""Forces and torques against what servo and bearings are rated for, and how far the shaft bends. SI units.

The bend of the shaft is that of a beam, the cage a spring known within a factor of two (`stiffness_n_per_m`). How far
the linkage bends is `deflection.py`.
"""

from __future__ import annotations

import math

import numpy as np

from cad.checks.check import Check, Severity, at_most, note, tidy
from cad.checks.remarks import rotor_weight
from cad.drives.drive import Drive
from cad.geometry.inertia import Inertial, together
from cad.layout.balance import RUBS_NM
from cad.layout.direct_stack import Stack
from cad.layout.imbalance import FAR_MM, keeps_flank, play_matters
from cad.layout.loads import RATED_AT_MM, Supported, Weight, hanging, rated_moment_nm, supported
from cad.parts.bearing_cage import cage_of, stiffness_n_per_m
from design.scanner import Scanner

TORQUE_SHARE = 0.2  # of the stall torque that a servo gives all day
SPIN_UP_S = 0.2
SLOWEST_PERIOD_S = 1.0  # where the angle set names no motion
BALANCE_AT_MM = 50.0  # from the axis, where a counterweight is worked out


def mechanics_checks(scanner: Scanner, drive: Drive, bodies: dict[str, Inertial]) -> list[Check]:
    """Everything that has to do with weight.

    Args:
        scanner: angles and products.
        drive: its layout.
        bodies: of `weights.link_bodies`.
    """
    rotor = together([bodies["rot"], bodies["laser"].moved(scanner.angles.T_rot_laser())])
    weight = rotor_weight(scanner, drive.stack, bodies)
    return [
        note("centre_of_mass", 1000 * weight.off_axis_m, "mm", "rotor", "centre of mass off the axis"),
        *_torques(scanner, rotor, weight),
        _flanks(scanner, rotor, weight),
        *drive.load_checks(bodies),
    ]


def direct_loads(scanner: Scanner, stack: Stack, bodies: dict[str, Inertial]) -> list[Check]:
    """What horn and bearing carry where the servo is on the axis; arguments as for `mechanics_checks`."""
    weight = rotor_weight(scanner, stack, bodies)
    shared = _shared(scanner, stack, weight)
    return [*_forces(scanner, stack, weight, shared), _slope(scanner, shared)]


def _shared(scanner: Scanner, stack: Stack, weight: Weight) -> Supported:
    cage = cage_of(scanner, stack)
    return hanging(weight, stack) if cage is None else supported(weight, stack, stiffness_n_per_m(cage))


def _torques(scanner: Scanner, rotor: Inertial, weight: Weight) -> list[Check]:
    servo = scanner.servo
    limit = TORQUE_SHARE * servo.stall_torque_nm
    static = weight.across_n * weight.off_axis_m
    spin_up = spin_up_nm(scanner, rotor, weight)
    what = f"of {servo.name}, a fifth of its stall torque"
    return [
        at_most("static_torque", static, limit, "N m", "servo", f"torque that holds the imbalance, {what}"),
        at_most("spin_up_torque", spin_up, limit, "N m", "servo", f"torque to full speed in {SPIN_UP_S:g} s, {what}"),
    ]


def spin_up_nm(scanner: Scanner, rotor: Inertial, weight: Weight) -> float:
    """Torque that brings the rotor to full speed in SPIN_UP_S against its imbalance."""
    motion = scanner.angles.motion
    period = SLOWEST_PERIOD_S if motion is None else getattr(motion, "period_s", SLOWEST_PERIOD_S)
    x, y = rotor.centre_m[:2]
    about_axis = float(rotor.inertia_kg_m2[2, 2] + rotor.mass_kg * (x**2 + y**2))
    return weight.across_n * weight.off_axis_m + about_axis * 2 * math.pi / period / SPIN_UP_S


def _flanks(scanner: Scanner, rotor: Inertial, weight: Weight) -> Check:
    """Where gravity swings the load from one flank of the gears to the other by the play between them.

    The friction of ring and bearing, which would hold one flank, is in no data sheet: taken for none.
    """
    servo, torque = scanner.servo, weight.across_n * weight.off_axis_m
    if torque <= RUBS_NM:
        message = f"servo: gravity turns it with {torque:.1g} N m, no more than ring and bearing rub with"
        return Check("flanks", "pass", tidy(torque), RUBS_NM, "N m", "servo", message)
    if keeps_flank(scanner, rotor.centre_m[:2]):
        message = f"servo: gravity turns it with {torque:.2g} N m, one way all over the sweep"
        return Check("flanks", "pass", tidy(torque), None, "N m", "servo", message)
    grams = 1000 * rotor.mass_kg * weight.off_axis_m / (BALANCE_AT_MM / 1000)
    x, y = rotor.centre_m[:2]
    azimuth = round(math.degrees(math.atan2(-y, -x))) % 360
    play = "by a play that its maker does not tell"
    if servo.backlash_deg is not None:
        off = math.radians(servo.backlash_deg) * FAR_MM
        play = f"by {servo.backlash_deg:g} deg of play ({off:.0f} mm at 10 m)"
    message = (
        f"servo: gravity turns {servo.name} with {torque:.2g} N m to and fro and changes the flank of its gears, "
        f"{play}: an encoder on the output shaft sees that, one on the motor does not; {grams:.0f} g at "
        f"{BALANCE_AT_MM:g} mm from the axis, {azimuth} deg from +x, would balance it"
    )
    severity: Severity = "warning" if play_matters(scanner) else "note"
    return Check("flanks", severity, tidy(torque), RUBS_NM, "N m", "servo", message)


def _forces(scanner: Scanner, stack: Stack, weight: Weight, shared: Supported) -> list[Check]:
    servo, rated = scanner.servo, rated_moment_nm(scanner)
    checks = []
    what = f"tilt moment on the horn of {servo.name}"
    if rated is None:
        what = f"{what}, for which its maker gives no rating"
        checks.append(note("tilt_moment", shared.horn_moment_nm, "N m", "servo", what))
    else:
        what = f"{what}, rated {servo.radial_load_n:g} N at {RATED_AT_MM:g} mm"
        checks.append(at_most("tilt_moment", shared.horn_moment_nm, rated, "N m", "servo", what))
    what = f"load along the axis of {servo.name}"
    if servo.axial_load_n is None:
        checks.append(note("axial_load", weight.along_n, "N", "servo", f"{what}, for which its maker gives no rating"))
    else:
        checks.append(at_most("axial_load", weight.along_n, servo.axial_load_n, "N", "servo", what))
    if stack.bearing is not None:
        what = f"load across {stack.bearing.name}"
        limit = stack.bearing.static_load_n
        checks.append(at_most("bearing_load", shared.bearing_force_n, limit, "N", "bearing", what))
    return checks


def _slope(scanner: Scanner, shared: Supported) -> Check:
    """Gravity tilts the turning axis by this much, the same way in every position: a constant error of the mount."""
    at_10_m = math.tan(shared.slope_rad) * 10_000
    what = f"bend of the shaft at the hub ({at_10_m:.1f} mm at 10 m)"
    limit = float(np.degrees(math.atan(scanner.lidar.range_sigma_mm / 10_000)))
    return at_most("shaft_slope", math.degrees(shared.slope_rad), limit, "deg", "servo_shaft", what)
