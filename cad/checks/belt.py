"""Bearings, belt and horn of the belt layout against what they are rated for, and what the belt does to the angle."""

from __future__ import annotations

import math

from cad.checks.check import Check, at_most, note, tidy
from cad.checks.mechanics import spin_up_nm
from cad.checks.remarks import rotor_weight
from cad.drives.belt_loads import belt_nm_per_rad, belt_pull, carrier_forces, run_out_rad
from cad.geometry.inertia import Inertial, together
from cad.layout.belt_stack import BeltStack
from cad.layout.loads import RATED_AT_MM, rated_moment_nm
from design.scanner import Scanner

FAR_MM = 10_000.0


def belt_checks(scanner: Scanner, stack: BeltStack, bodies: dict[str, Inertial]) -> list[Check]:
    """All of them; arguments as for `mechanics_checks`."""
    rotor = together([bodies["rot"], bodies["laser"].moved(scanner.angles.T_rot_laser())])
    weight = rotor_weight(scanner, stack, bodies)
    torque = spin_up_nm(scanner, rotor, weight)
    pull = belt_pull(stack, torque)
    upper, lower = carrier_forces(stack, weight, 1000 * float(rotor.centre_m[2]), pull.shaft_n)
    name, limit = stack.carrier.name, stack.carrier.static_load_n
    strand = pull.strand_n + pull.working_n / 2
    what = f"pull of the tighter strand of {stack.belt.name}, pre-load {pull.strand_n:.1f} N"
    tension = at_most("belt_tension", strand, stack.belt.working_tension_n, "N", "belt", what)
    return [
        at_most("bearing_load", max(upper, lower), limit, "N", "bearing", f"load across {name}, weight and belt"),
        note("bearing_axial", weight.along_n, "N", "bearing", f"load along {name}, which one of the two carries"),
        tension,
        *_horn(scanner, pull.horn_nm, pull.shaft_n),
        _angle(scanner, stack, torque),
    ]


def _horn(scanner: Scanner, moment_nm: float, pull_n: float) -> list[Check]:
    servo, rated = scanner.servo, rated_moment_nm(scanner)
    what = f"tilt moment on the horn of {servo.name} by the belt's pull of {pull_n:.1f} N"
    if rated is None:
        return [note("tilt_moment", moment_nm, "N m", "servo", f"{what}, for which its maker gives no rating")]
    what = f"{what}, rated {servo.radial_load_n:g} N at {RATED_AT_MM:g} mm"
    return [at_most("tilt_moment", moment_nm, rated, "N m", "servo", what)]


def _angle(scanner: Scanner, stack: BeltStack, torque_nm: float) -> Check:
    """How far the axis is from where the servo's encoder says: pulleys off their axes, and the belt's stretch."""
    run_out = run_out_rad(stack, scanner.printer.fit_clearance_mm)
    stretch = torque_nm / belt_nm_per_rad(stack)
    error = math.degrees(run_out + stretch)
    limit = math.degrees(math.atan(scanner.lidar.range_sigma_mm / FAR_MM))
    off = math.radians(error) * FAR_MM
    message = (
        f"belt: the axis is off the servo's angle by up to {error:.2g} deg, once per turn ({off:.0f} mm at 10 m): "
        f"{math.degrees(run_out):.2g} if both printed pulleys stand off their axes by half of their play, and "
        f"{math.degrees(stretch):.2g} of stretch: calibrate reports it with the encoder's harmonics"
    )
    return Check(
        "belt_angle", "pass" if error <= limit else "warning", tidy(error), tidy(limit), "deg", "belt", message
    )
