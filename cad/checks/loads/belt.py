"""Loads on bearings, belt and servo horn of the belt drive against their ratings, and the angle error of the belt."""

import math

from scanwright.cad.checks.limits import at_most, horn_check, note, tidy
from scanwright.cad.geometry.inertia import Inertial
from scanwright.cad.layout.belt.loads import belt_nm_per_rad, belt_pull, carrier_forces, run_out_rad
from scanwright.cad.layout.belt.stack import BeltStack
from scanwright.cad.layout.loads import FAR_MM, SHOCK_G, Weight, noise_deg
from scanwright.cad.layout.names import BEARING, BELT
from scanwright.cad.layout.placement import Placement
from scanwright.design.findings import Finding, Severity
from scanwright.design.scanner import Scanner


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
        horn_check(scanner, pull.horn_nm, on_horn, "choose a servo with a higher radial load"),
        _angle(scanner, stack, torque),
    ]


def _angle(scanner: Scanner, stack: BeltStack, torque_nm: float) -> Finding:
    """Check the angle between axis and servo encoder: pulleys off their axes, and the belt's stretch."""
    run_out = run_out_rad(stack, scanner.printer.fit_clearance_mm)
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
