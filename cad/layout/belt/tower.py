"""Numbers of the bearing tower: screws of plate, foot and disc. No kernel."""

from __future__ import annotations

import math
from dataclasses import dataclass

from scanwright.cad import outlines
from scanwright.cad.layout.belt.stack import FOOT_HOLE, FOOT_SCREW, PLATE_SCREW, BeltStack
from scanwright.cad.screws import SCREWS, Thread, passing_hole, thread_in_part
from scanwright.design.catalogue.slip_ring import Flange
from scanwright.design.scanner import Scanner

DISC_SCREW = SCREWS["M3"]
DISC_SCREWS = 3
SCREW_DEPTH = 10.0  # of a radial screw in the disc
UNDER_HEAD = 3.5  # of the wall
UNDER_FOOT_NUT = 4.0  # of the foot


@dataclass(frozen=True, slots=True, kw_only=True)
class BearingTower:
    """Lengths in mm."""

    stack: BeltStack
    fit: float  # diametral clearance of a sliding fit
    plate: Thread  # of the plate's screws; nuts below the arms
    foot: Thread  # of the mount's screws; nuts from the corners of the foot
    disc_hole: float  # diameter


def tower_of(scanner: Scanner, stack: BeltStack) -> BearingTower:
    """Return the tower of one scanner."""
    printer = scanner.printer
    foot = thread_in_part(FOOT_SCREW, printer, carries=True)
    free = math.sqrt(2) * FOOT_HOLE - printer.min_wall_mm - stack.chamber_radius
    if foot.trap is not None and foot.trap.corner > free:
        foot = thread_in_part(FOOT_SCREW, printer, room_for_nut=False, carries=True)
    return BearingTower(
        stack=stack,
        fit=printer.fit_clearance_mm,
        plate=thread_in_part(PLATE_SCREW, printer),
        foot=foot,
        disc_hole=passing_hole(DISC_SCREW, printer),
    )


def disc_azimuths(stack: BeltStack) -> list[float]:
    """Return azimuths [rad] of the radial screws of the capsule's disc, servo's frame, between those of its flange."""
    return [math.pi / stack.flange.holes + 2 * math.pi * k / DISC_SCREWS + math.pi / 2 for k in range(DISC_SCREWS)]


def flange_centres(flange: Flange) -> list[tuple[float, float]]:
    """Return centres of the flange's holes, servo's frame; one at its +y."""
    centres = outlines.polygon(flange.circle_mm / 2, flange.holes, math.pi / 2)
    return [(float(x), float(y)) for x, y in centres]
