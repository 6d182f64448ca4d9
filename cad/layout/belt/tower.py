"""Numbers of the bearing tower: screws of plate, foot and disc. No kernel."""

import math

from scanwright.cad import outlines
from scanwright.cad.layout.belt.stack import FOOT_HOLE, FOOT_SCREW, BeltStack
from scanwright.cad.screws import SCREWS, Thread, thread_in_part
from scanwright.design.catalogue.products import Printer
from scanwright.design.catalogue.slip_ring import Flange

DISC_SCREW = SCREWS["M3"]
DISC_SCREWS = 3
SCREW_DEPTH = 10.0  # of a radial screw in the disc
UNDER_HEAD = 3.5  # of the wall
UNDER_FOOT_NUT = 4.0  # of the foot


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
