"""Ring under the lower bearing of the belt layout: with the collar above it keeps the shaft where it is.

Frame: rotation frame at gamma = 0 (`cad/layout/belt_stack.py`), mm. A step that only the inner ring touches, and two
grub screws 90 deg apart; a driver reaches them through the window of the tower.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cadquery as cq

from cad import solids
from cad.layout.belt_stack import BOSS, GRUB, BeltStack
from cad.layout.head import BEARING_STEP
from cad.screws import thread_hole
from cad.solids import building, checked
from design.scanner import Scanner

PART = "shaft_ring"
GRUBS_DEG = (45.0, 135.0)  # azimuths from +x


@dataclass(frozen=True, slots=True, kw_only=True)
class ShaftRing:
    """Lengths in mm."""

    stack: BeltStack
    fit: float  # diametral clearance of a sliding fit
    thread: float  # diameter


def shaft_ring_of(scanner: Scanner, stack: BeltStack) -> ShaftRing:
    """Parameters of the ring of one scanner."""
    printer = scanner.printer
    return ShaftRing(stack=stack, fit=printer.fit_clearance_mm, thread=thread_hole(GRUB, printer))


def shaft_ring(p: ShaftRing) -> cq.Solid:
    """Make the ring.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    stack = p.stack
    size = f"{stack.tube_diameter:g} mm"
    with building(PART, "ring", "shaft diameter", size):
        low, high = stack.collar_low, stack.collar_low + BOSS
        body = solids.upright(stack.boss_radius, low, high).fuse(
            solids.upright(stack.collar_radius, low, high + BEARING_STEP)
        )
        bore = solids.upright((stack.tube_diameter + p.fit) / 2, low - 1.0, high + 2.0)
        grubs = [_radial(p, math.radians(azimuth)) for azimuth in GRUBS_DEG]
        return checked(body.cut(bore, *grubs).clean(), PART, "ring", "shaft diameter", size)


def _radial(p: ShaftRing, azimuth: float) -> cq.Solid:
    start = (0.0, 0.0, p.stack.collar_low + BOSS / 2)
    return solids.cylinder(p.thread / 2, start, (math.cos(azimuth), math.sin(azimuth), 0.0), 80.0)
