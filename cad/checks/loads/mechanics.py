"""Torques that the rotor's weight requires of the servo, the backlash of its gears, and loads on each drive. SI units.

The shaft of a direct drive bends as a beam; the cage of its bearing is a spring whose stiffness is known within a
factor of two (`stiffness_n_per_m`). The bend of the linkage is in `deflection.py`.
"""

import math
from collections.abc import Mapping
from dataclasses import replace

from scanwright.cad.assembly.assembly import Assembly, link_bodies, rotor_of, rotor_weight
from scanwright.cad.checks.table import at_most, figures, note, rated, tidy, with_error
from scanwright.cad.geometry.inertia import Inertial
from scanwright.cad.layout.belt.loads import belt_nm_per_rad, belt_pull, carrier_forces
from scanwright.cad.layout.belt.stack import BeltStack
from scanwright.cad.layout.direct.cage import BearingCage, share_weight
from scanwright.cad.layout.direct.loads import ALUMINIUM, STEEL, Supported
from scanwright.cad.layout.direct.misalignment import SHARE, contributions, worst_moment_nm
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.loads import FAR_MM, RATED_AT_MM, Weight, friction_nm, noise_deg, rated_moment_nm
from scanwright.cad.layout.names import BEARING, BELT, SERVO, SERVO_SHAFT
from scanwright.cad.layout.placement import Placement
from scanwright.cad.layout.rotor.cross_screws import LIDAR_CENTRE_ERROR_MM
from scanwright.cad.layout.rotor.imbalance import backlash_matters, keeps_flank
from scanwright.cad.layout.tightening import SHOCK_G
from scanwright.design.findings import Finding, Severity
from scanwright.design.scanner import Scanner

SPIN_UP_S = 0.2  # to full speed: chosen, a small part of the fastest turn
DEFAULT_PERIOD_S = 1.0  # if the angle set names no motion: the fastest turn of the shipped tasks
BALANCE_AT_MM = 50.0  # from the axis, for which the message states a counterweight


def direct_loads(layout: Placement, weight: Weight) -> list[Finding]:
    """Check horn, bearing and shaft under the weight of all that turns; no finding with a belt between."""
    scanner, stack, cage = layout.scanner, layout.drive.of(DirectStack), layout.drive.of(BearingCage)
    if stack is None:
        return []
    shared = share_weight(scanner, stack, cage, weight)
    return [*_forces(scanner, stack, cage, weight, shared), *_yields(scanner, stack), _slope(stack, shared)]


def _forces(
    scanner: Scanner, stack: DirectStack, cage: BearingCage | None, weight: Weight, shared: Supported
) -> list[Finding]:
    checks = [_horn(scanner, cage, weight, shared), _axial(scanner, weight)]
    if stack.bearing is not None:
        what = f"load across {stack.bearing.name} at {SHOCK_G:g} g"
        shock_n = share_weight(scanner, stack, cage, weight.at_g(SHOCK_G)).bearing_force_n
        checks.append(at_most("bearing_load", shock_n, stack.bearing.static_load_n, "N", BEARING, what))
    return checks


def _axial(scanner: Scanner, weight: Weight) -> Finding:
    """Check the load along the servo's axis: the weight in operation, SHOCK_G times it in a shock."""
    servo, shock_n = scanner.servo, SHOCK_G * math.hypot(weight.across_n, weight.along_n)
    what = f"load along the axis of {servo.name}, {figures(shock_n)} N in a shock of {SHOCK_G:g} g along it"
    check = rated("axial_load", weight.along_n, servo.axial_load_n, "N", SERVO, what)
    if check.severity != "ok" or servo.axial_load_n is None or shock_n <= servo.axial_load_n:
        return check
    hint = "its rating is for work: hold the rotor in transport, and do not lift the scanner by it"
    return replace(check, severity="warning", hint=hint)


def _horn(scanner: Scanner, cage: BearingCage | None, weight: Weight, shared: Supported) -> Finding:
    """Check the horn under the weight, and with a bearing also under every misalignment."""
    servo, rating = scanner.servo, rated_moment_nm(scanner)
    if cage is None:
        hint = "support the shaft with a bearing near the hub; none of the catalogue fits it"
        return _horn_moment(scanner, shared.horn_moment_nm, f"tilt moment on the horn of {servo.name}", hint)
    sums = worst_moment_nm(cage, weight)
    parts = ", ".join(
        f"{each.what} {'' if each.off_mm is None else f'({each.off_mm:.3f} mm) '}{each.moment_nm:.3f}"
        for each in contributions(cage, weight)
    )
    both = ", ".join(f"{total:.3g} in {name}" for name, total in sums.items())
    what = f"worst tilt moment on the horn of {servo.name}, {both}; in aluminium {parts}"
    by, limit = ("", None) if rating is None else (f"; half of its rating of {rating:g} N m allowed", SHARE * rating)
    hint = "use a lighter lidar or linkage, or raise the axis"
    return rated("tilt_moment", max(sums.values()), limit, "N m", SERVO, what, by, hint)


def _yields(scanner: Scanner, stack: DirectStack) -> list[Finding]:
    """Check that the waist does not yield if the rotor is blocked."""
    stall = scanner.servo.stall_torque_nm
    what = f"stall torque of {scanner.servo.name} against the yield of the waist in"
    limits = {metal.name: metal.twisted_off_nm(stack.waist_diameter) for metal in (ALUMINIUM, STEEL) if stack.bearing}
    return [
        at_most("waist_torque", stall, limit, "N m", SERVO_SHAFT, f"{what} {name}") for name, limit in limits.items()
    ]


def _slope(stack: DirectStack, shared: Supported) -> Finding:
    """Return the tilt of the axis by gravity: the part of `deflection` that the shaft has in it."""
    at_10_m = math.tan(shared.slope_rad) * FAR_MM
    what = f"bend of the shaft at the hub ({at_10_m:.1f} mm at 10 m), which `deflection` includes"
    return note("shaft_slope", math.degrees(shared.slope_rad), "deg", stack.shaft, what)


def belt_loads(layout: Placement, rotor: Inertial, weight: Weight, torque: float) -> list[Finding]:
    """Check bearings, belt, horn and angle at the largest torque of the servo [N m]; no finding without a belt."""
    scanner, stack = layout.scanner, layout.drive.of(BeltStack)
    if stack is None:
        return []
    pull = belt_pull(stack, torque)
    upper, lower = carrier_forces(stack, weight.at_g(SHOCK_G), 1000 * float(rotor.centre_m[2]), pull.shaft_n)
    name, limit = stack.carrier.name, stack.carrier.static_load_n
    strand = pull.strand_n + pull.working_n / 2
    what = f"pull of the tighter strand of {stack.belt.name}, pre-load {pull.strand_n:.1f} N"
    on_horn = f"tilt moment on the horn of {scanner.servo.name} by the belt's pull of {pull.shaft_n:.1f} N"
    tension = at_most("belt_tension", strand, stack.belt.working_tension_n, "N", BELT, what)
    return [
        at_most("bearing_load", max(upper, lower), limit, "N", BEARING, f"load across {name}, {SHOCK_G:g} g and belt"),
        note("bearing_axial", weight.along_n, "N", BEARING, f"load along {name}, carried by one of the two"),
        tension,
        _horn_moment(scanner, pull.horn_nm, on_horn, "choose a servo with a higher radial load"),
        _belt_angle(scanner, stack, torque),
    ]


def _belt_angle(scanner: Scanner, stack: BeltStack, torque_nm: float) -> Finding:
    """Check the angle between axis and servo encoder: pulleys off their axes, and the belt's stretch."""
    run_out = scanner.printer.fit_clearance_mm / 2 / stack.pitch_radius  # each pulley is off by half of its fit
    stretch = torque_nm / belt_nm_per_rad(stack)
    error = math.degrees(run_out + stretch)
    limit = noise_deg(scanner)
    off = math.radians(error) * FAR_MM
    message = (
        f"{BELT}: the axis is off the servo's angle by up to {error:.2g} deg, once per turn ({off:.0f} mm at 10 m): "
        f"{math.degrees(run_out):.2g} if both printed pulleys are off their axes by half of their clearance, and "
        f"{math.degrees(stretch):.2g} of stretch"
    )
    severity: Severity = "ok" if error <= limit else "warning"
    hint = "calibrate reports it with the encoder's harmonics"
    return Finding("belt_angle", severity, BELT, message, tidy(error), tidy(limit), "deg", hint)


def mechanics_checks(assembly: Assembly) -> list[Finding]:
    """Check torques, backlash and loads."""
    return load_checks(assembly.layout, link_bodies(assembly))


def load_checks(layout: Placement, bodies: Mapping[str, Inertial]) -> list[Finding]:
    """Check torques, backlash and loads; bodies of `link_bodies`."""
    scanner, stack = layout.scanner, layout.stack
    rotor, weight = rotor_of(scanner, bodies), rotor_weight(scanner, stack, bodies)
    # across the axis: the centre of mass of the lidar is undocumented
    error_m = LIDAR_CENTRE_ERROR_MM / 1000 * bodies["laser"].mass_kg / rotor.mass_kg
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


def _horn_moment(scanner: Scanner, moment_nm: float, what: str, hint: str) -> Finding:
    """Return the tilt moment on the servo's horn against its rating; `what` and `hint` as for `at_most`."""
    by = f", rated {scanner.servo.radial_load_n:g} N at {RATED_AT_MM:g} mm" if scanner.servo.radial_load_n else ""
    return rated("tilt_moment", moment_nm, rated_moment_nm(scanner), "N m", SERVO, what, by, hint)
