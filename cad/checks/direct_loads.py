"""Horn and bearing of a servo on the axis against what they are rated for, and how far the shaft bends. SI units.

The bend of the shaft is that of a beam, the cage a spring known within a factor of two (`stiffness_n_per_m`). How far
the linkage bends is `deflection.py`.
"""

from __future__ import annotations

import math

from cad.checks.check import Check, at_most, horn_check, rated
from cad.layout.direct.cage import share_weight
from cad.layout.direct.loads import Supported
from cad.layout.direct.stack import DirectStack
from cad.layout.loads import FAR_MM, Weight, noise_deg
from cad.layout.names import BEARING, SERVO, SERVO_SHAFT
from design.scanner import Scanner


def direct_loads(scanner: Scanner, stack: DirectStack, weight: Weight) -> list[Check]:
    """What horn and bearing carry of the weight of all that turns."""
    shared = share_weight(scanner, stack, weight)
    return [*_forces(scanner, stack, weight, shared), _slope(scanner, shared)]


def _forces(scanner: Scanner, stack: DirectStack, weight: Weight, shared: Supported) -> list[Check]:
    servo, axial = scanner.servo, f"load along the axis of {scanner.servo.name}"
    checks = [
        horn_check(scanner, shared.horn_moment_nm, f"tilt moment on the horn of {servo.name}"),
        rated("axial_load", weight.along_n, servo.axial_load_n, "N", SERVO, axial),
    ]
    if stack.bearing is not None:
        what = f"load across {stack.bearing.name}"
        limit = stack.bearing.static_load_n
        checks.append(at_most("bearing_load", shared.bearing_force_n, limit, "N", BEARING, what))
    return checks


def _slope(scanner: Scanner, shared: Supported) -> Check:
    """Gravity tilts the turning axis by this much, the same way in every position: a constant error of the mount."""
    at_10_m = math.tan(shared.slope_rad) * FAR_MM
    what = f"bend of the shaft at the hub ({at_10_m:.1f} mm at 10 m)"
    return at_most("shaft_slope", math.degrees(shared.slope_rad), noise_deg(scanner), "deg", SERVO_SHAFT, what)
