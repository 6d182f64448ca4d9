"""Numbers of the plate that holds the servo next to the axis. No kernel."""

import math
from dataclasses import replace

from scanwright.cad.layout.drive import Ears, ears_on
from scanwright.cad.layout.names import DRIVE_PLATE
from scanwright.cad.screws import SCREWS, passing_hole
from scanwright.design.catalogue.servo import Servo
from scanwright.design.errors import BuildError
from scanwright.design.scanner import Scanner

UNDER_HEAD = 2.5  # of the plate
HORN_GAP = 1.5  # around the foot of the pulley
THIN_GAP = 0.5  # the same if the servo's screws are close to it


def plate_of(scanner: Scanner) -> Ears:
    """Return the holes for the plate of one scanner: two pairs outside the pulley, or all close to a thinner foot.

    Raises:
        BuildError: the case has no two front holes next to the horn.
    """
    servo, printer = scanner.servo, scanner.printer
    opening = max(pulley_foot_radius(servo), servo.horn_diameter_mm / 2) + HORN_GAP
    least = opening + passing_hole(SCREWS[servo.front.screw], printer) / 2 + printer.min_wall_mm
    free = [(x, y) for x, y in servo.front.places if math.hypot(x, y) >= least]
    widest = max((x for x, _ in free), default=0.0)
    ys = sorted(y for x, y in free if x == widest and (-x, y) in free)
    if len(ys) >= 2:
        return ears_on(scanner, opening, tuple((side * widest, y) for y in (ys[0], ys[-1]) for side in (1.0, -1.0)))
    places = servo.front.places
    thin = (servo.horn_circle_mm + passing_hole(SCREWS[servo.horn_screw], printer)) / 2 + printer.min_wall_mm
    opening = max(thin, servo.horn_diameter_mm / 2) + THIN_GAP
    least = opening + passing_hole(SCREWS[servo.front.screw], printer) / 2 + printer.min_wall_mm
    if len(places) < 2 or min(math.hypot(x, y) for x, y in places) < least:
        caution = servo.caution("holes")
        raise BuildError(
            f"{DRIVE_PLATE}: ears: holes = {list(places)} in front{caution}: {servo.name} needs two or more front "
            f"holes, all at least {least:.2f} mm from its axis, outside of the pulley"
        )
    ears = ears_on(scanner, opening, places)
    middle = sum(y for _, y in places) / len(places)
    heel = min(middle - servo.case_min_mm[1], servo.case_max_mm[1] - middle)
    return replace(ears, heel_mm=heel if len(places) == 2 else None)


def pulley_foot_radius(servo: Servo, opening: float = math.inf) -> float:
    """Return the radius of the drive pulley's foot on the horn, in the opening of a plate."""
    return min(servo.horn_circle_mm / 2 + SCREWS[servo.horn_screw].nominal / 2 + 2.0, opening - THIN_GAP)
