"""Numbers of the bearing tower: screws of plate, foot and disc. No kernel."""

import math

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
from scanwright.cad.layout.envelope import around_axis, box_corners
from scanwright.cad.screws import SCREWS, Thread, thread_in_part
from scanwright.design.arrays import Array
from scanwright.design.catalogue.products import Printer
from scanwright.design.catalogue.slip_ring import Flange

DISC_SCREW = SCREWS["M3"]
DISC_SCREWS = 3
SCREW_DEPTH = 10.0  # of a radial screw in the disc
UNDER_HEAD = 3.5  # of the wall
UNDER_FOOT_NUT = 4.0  # of the foot


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
