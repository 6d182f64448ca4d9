"""Numbers of the bearing tower and of the plate that holds the servo next to the axis. No kernel."""

import math
from dataclasses import replace

from scanwright.cad import outlines
from scanwright.cad.layout.belt.stack import (
    FOOT,
    FOOT_HALF,
    FOOT_HOLE,
    FOOT_SCREW,
    PLATE,
    SHELF,
    BeltStack,
    drive_corners,
)
from scanwright.cad.layout.drive import Ears, ears_on
from scanwright.cad.layout.envelope import around_axis, box_corners
from scanwright.cad.layout.names import DRIVE_PLATE
from scanwright.cad.screws import SCREWS, Thread, passing_hole, thread_in_part
from scanwright.design.arrays import Array
from scanwright.design.catalogue.products import Printer
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import Flange
from scanwright.design.errors import BuildError
from scanwright.design.scanner import Scanner

DISC_SCREW = SCREWS["M3"]
DISC_SCREWS = 3
SCREW_DEPTH = 10.0  # of a radial screw in the disc
UNDER_FOOT_NUT = 4.0  # of the foot
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


def tower_corners(stack: BeltStack) -> tuple[Array, Array]:
    """Return the corners of a cylinder around the tower, shape (n, 3), and of a box around its foot, shape (8, 3)."""
    flares = max(0.0, math.sqrt(2) * FOOT_HALF - stack.wide_radius)  # the cone on the foot, at 45 deg
    low, high = stack.tower_bottom, stack.tower_bottom + FOOT + flares
    foot = box_corners(((-FOOT_HALF, -FOOT_HALF, low), (FOOT_HALF, FOOT_HALF, high)))
    return around_axis(stack.wide_radius, low, stack.tower_top), foot


def shelf_corners(stack: BeltStack) -> Array:
    """Return the corners of a box around plate and arms, shape (8, 3)."""
    corners = drive_corners(stack)[:, :2]
    (x0, y0), (x1, y1) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    return box_corners(((x0, y0, stack.tower_top - SHELF), (x1, y1, stack.tower_top + PLATE)))


def tower_foot_of(printer: Printer, stack: BeltStack) -> Thread:
    """Return the thread of the mount's screws in the foot; nuts are inserted from its corners."""
    foot = thread_in_part(FOOT_SCREW, printer, carries=True)
    free = math.sqrt(2) * FOOT_HOLE - printer.min_wall_mm - stack.chamber_radius
    fits = foot.trap is None or foot.trap.corner <= free
    return foot if fits else thread_in_part(FOOT_SCREW, printer, nut_fits=False, carries=True)


def disc_azimuths(stack: BeltStack) -> list[float]:
    """Return azimuths [rad] of the radial screws of the capsule's disc, servo's frame, between those of its flange."""
    return [math.pi / stack.flange.holes + 2 * math.pi * k / DISC_SCREWS + math.pi / 2 for k in range(DISC_SCREWS)]


def flange_centres(flange: Flange) -> list[tuple[float, float]]:
    """Return centres of the flange's holes, servo's frame; one at its +y."""
    centres = outlines.polygon(flange.circle_mm / 2, flange.holes, math.pi / 2)
    return [(float(x), float(y)) for x, y in centres]
