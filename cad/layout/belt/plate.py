"""Numbers of the plate that holds the servo next to the axis. No kernel."""

import math

from scanwright.cad.layout.drive import Ears, ears_on
from scanwright.cad.layout.names import DRIVE_PLATE
from scanwright.cad.screws import SCREWS, passing_hole
from scanwright.design.catalogue.servo import Servo
from scanwright.design.errors import BuildError
from scanwright.design.scanner import Scanner

UNDER_HEAD = 2.5  # of the plate
HORN_GAP = 1.5  # around the foot of the pulley


def plate_of(scanner: Scanner) -> Ears:
    """Return the holes for the plate of one scanner.

    Raises:
        BuildError: the case has no four front holes next to the horn.
    """
    servo, printer = scanner.servo, scanner.printer
    opening = max(pulley_foot_radius(servo), servo.horn_diameter_mm / 2) + HORN_GAP
    least = opening + passing_hole(SCREWS[servo.front.screw], printer) / 2 + printer.min_wall_mm
    free = [(x, y) for x, y in servo.front.places if math.hypot(x, y) >= least]
    widest = max((x for x, _ in free), default=0.0)
    ys = sorted(y for x, y in free if x == widest and (-x, y) in free)
    if len(ys) < 2:
        caution = servo.caution("holes")
        raise BuildError(
            f"{DRIVE_PLATE}: ears: holes = {list(servo.front.places)} in front{caution}: {servo.name} needs two "
            f"pairs of front holes at least {least:.2f} mm from its axis, outside of the pulley"
        )
    return ears_on(scanner, opening, tuple((side * widest, y) for y in (ys[0], ys[-1]) for side in (1.0, -1.0)))


def pulley_foot_radius(servo: Servo) -> float:
    """Return the radius of the drive pulley's foot on the horn."""
    return servo.horn_circle_mm / 2 + SCREWS[servo.horn_screw].nominal / 2 + 2.0
