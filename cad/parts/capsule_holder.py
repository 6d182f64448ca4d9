"""Slip-ring adapter of the belt layout: a disc in the tower that the capsule's flange is screwed to.

Frame: rotation frame at gamma = 0 (`cad/layout/belt_stack.py`), mm; turned with the servo's side. The capsule hangs
through its middle, its flange on top, screws from below with nuts on the flange; then the disc slides into the tower
from below, and three radial screws hold it. The flange's own wide holes and the soft tube on the rotor take what is
not in line.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cadquery as cq

from cad import solids
from cad.layout.belt_stack import DISC, BeltStack
from cad.parts.bearing_tower import DISC_SCREW, SCREW_DEPTH, disc_azimuths
from cad.screws import SCREWS, Screw, thread_hole
from cad.solids import building, checked
from design.scanner import Scanner

PART = "slip_ring_adapter"
BODY_ROOM = 0.5  # around the capsule's body


@dataclass(frozen=True, slots=True, kw_only=True)
class CapsuleHolder:
    """Lengths in mm."""

    stack: BeltStack
    fit: float  # diametral clearance of a sliding fit
    screw: Screw  # of the flange
    hole: float  # diameter
    thread: float  # diameter, of the radial screws


def holder_of(scanner: Scanner, stack: BeltStack) -> CapsuleHolder:
    """Parameters of the disc of one scanner."""
    printer = scanner.printer
    screw = SCREWS[stack.flange.screw]
    return CapsuleHolder(
        stack=stack,
        fit=printer.fit_clearance_mm,
        screw=screw,
        hole=screw.nominal + printer.screw_clearance_mm,
        thread=thread_hole(DISC_SCREW, printer),
    )


def capsule_holder(p: CapsuleHolder) -> cq.Solid:
    """Make the disc.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    stack = p.stack
    low, high = stack.disc_top - DISC, stack.disc_top
    size = f"{stack.flange.diameter_mm:g}"
    with building(PART, "disc", "flange.diameter_mm", size):
        radius = stack.chamber_radius - p.fit / 2
        cuts = [solids.upright(stack.ring_radius + BODY_ROOM, low - 1.0, high + 1.0)]
        for x, y in flange_centres(stack):
            cuts.append(solids.upright(p.hole / 2, low - 1.0, high + 1.0, x, y))
        for azimuth in disc_azimuths(stack):
            out = (math.cos(azimuth), math.sin(azimuth), 0.0)
            start = tuple((radius - SCREW_DEPTH) * c for c in out[:2])
            cuts.append(solids.cylinder(p.thread / 2, (*start, (low + high) / 2), out, SCREW_DEPTH + 1.0))
        disc = checked(solids.upright(radius, low, high).cut(*cuts).clean(), PART, "disc", "flange.diameter_mm", size)
    return disc.moved(solids.location(stack.turn()))


def flange_centres(stack: BeltStack) -> list[tuple[float, float]]:
    """Of the flange's holes, servo's frame; one at its +y."""
    centres = solids.polygon(stack.flange.circle_mm / 2, stack.flange.holes, math.pi / 2)
    return [(float(x), float(y)) for x, y in centres]
