"""Loads on horn and bearing of a direct drive against their ratings, and the bend of the shaft. SI units.

The shaft bends as a beam; the cage is a spring whose stiffness is known within a factor of two (`stiffness_n_per_m`).
The bend of the linkage is in `deflection.py`.
"""

import math
from dataclasses import replace

from scanwright.cad.checks.limits import at_most, figures, horn_check, rated
from scanwright.cad.layout.direct.cage import BearingCage, share_weight
from scanwright.cad.layout.direct.loads import ALUMINIUM, STEEL, Supported
from scanwright.cad.layout.direct.misalignment import SHARE, contributions, worst_moment_nm
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.loads import FAR_MM, SHOCK_G, Weight, noise_deg, rated_moment_nm
from scanwright.cad.layout.names import BEARING, SERVO, SERVO_SHAFT
from scanwright.cad.layout.placement import Placement
from scanwright.design.findings import Finding
from scanwright.design.scanner import Scanner


def direct_loads(layout: Placement, weight: Weight) -> list[Finding]:
    """Check horn, bearing and shaft under the weight of all that turns; no finding with a belt between."""
    scanner, stack, cage = layout.scanner, layout.drive.of(DirectStack), layout.drive.of(BearingCage)
    if stack is None:
        return []
    shared = share_weight(scanner, stack, cage, weight)
    return [*_forces(scanner, stack, cage, weight, shared), *_yields(scanner, stack), _slope(scanner, stack, shared)]


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
        return horn_check(scanner, shared.horn_moment_nm, f"tilt moment on the horn of {servo.name}", hint)
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
    stall, what = (
        scanner.servo.stall_torque_nm,
        f"stall torque of {scanner.servo.name} against the yield of the waist in",
    )
    limits = {metal.name: metal.twisted_off_nm(stack.waist_diameter) for metal in (ALUMINIUM, STEEL) if stack.bearing}
    return [
        at_most("waist_torque", stall, limit, "N m", SERVO_SHAFT, f"{what} {name}") for name, limit in limits.items()
    ]


def _slope(scanner: Scanner, stack: DirectStack, shared: Supported) -> Finding:
    """Check the tilt of the axis by gravity: a constant error of the mount, the same in every position."""
    at_10_m = math.tan(shared.slope_rad) * FAR_MM
    what = f"bend of the shaft at the hub ({at_10_m:.1f} mm at 10 m)"
    return at_most("shaft_slope", math.degrees(shared.slope_rad), noise_deg(scanner), "deg", stack.shaft, what)
