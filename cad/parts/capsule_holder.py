"""Slip-ring adapter of the belt layout: a disc in the tower that the capsule's flange is screwed to.

Frame: rotation frame at gamma = 0 (`cad/layout/belt/stack.py`), mm; turned with the servo's side. The capsule hangs
through its middle, its flange on top, screws from below with nuts on the flange; then the disc slides into the tower
from below, and three radial screws hold it. The flange's own wide holes and the soft tube on the rotor take what is
not in line.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import cadquery as cq

from cad import solids
from cad.layout.belt.stack import DISC, BeltStack
from cad.layout.belt.tower import DISC_SCREW, SCREW_DEPTH, disc_azimuths, flange_centres
from cad.layout.joints import screws
from cad.layout.names import RING_STATOR, SLIP_RING_ADAPTER
from cad.parts.part_spec import PartSpec, Step
from cad.screws import SCREWS, Screw, Thread, passing_hole, thread_in_part
from cad.solids import building, checked
from design.scanner import Scanner

BODY_ROOM = 0.5  # around the capsule's body


@dataclass(frozen=True, slots=True, kw_only=True)
class CapsuleHolder:
    """Lengths in mm."""

    stack: BeltStack
    fit: float  # diametral clearance of a sliding fit
    screw: Screw  # of the flange
    hole: float  # diameter
    thread: Thread  # of the radial screws


def holder_spec(scanner: Scanner, stack: BeltStack) -> PartSpec:
    """The disc of one scanner."""
    words = (
        "On the bench: put the capsule through the disc from above, its flange on the disc, its rotor upwards. "
        f"{screws(RING_STATOR)} Leave them so loose that the flange still gives. Push 10 mm of soft tube, "
        f"{stack.shaft_bore:g} x {stack.rotor.diameter_mm:g} mm, over the stub of the rotor."
    )
    return PartSpec(
        name=SLIP_RING_ADAPTER,
        turns=False,
        make=partial(capsule_holder, holder_of(scanner, stack)),
        step=Step("Capsule on its disc", words),
        shaped_by=("slip_ring.outer_diameter_mm", "slip_ring.flange"),
    )


def holder_of(scanner: Scanner, stack: BeltStack) -> CapsuleHolder:
    """Parameters of the disc of one scanner."""
    printer = scanner.printer
    screw = SCREWS[stack.flange.screw]
    return CapsuleHolder(
        stack=stack,
        fit=printer.fit_clearance_mm,
        screw=screw,
        hole=passing_hole(screw, printer),
        thread=thread_in_part(DISC_SCREW, printer, room_for_nut=False),
    )


def capsule_holder(p: CapsuleHolder) -> cq.Solid:
    """Make the disc.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    stack = p.stack
    low, high = stack.disc_top - DISC, stack.disc_top
    size = f"{stack.flange.diameter_mm:g}"
    with building(SLIP_RING_ADAPTER, "disc", "flange.diameter_mm", size):
        radius = stack.chamber_radius - p.fit / 2
        cuts = [solids.upright(stack.ring_radius + BODY_ROOM, low - 1.0, high + 1.0)]
        for x, y in flange_centres(stack):
            cuts.append(solids.upright(p.hole / 2, low - 1.0, high + 1.0, x, y))
        for azimuth in disc_azimuths(stack):
            out = (math.cos(azimuth), math.sin(azimuth), 0.0)
            start = tuple((radius - SCREW_DEPTH) * c for c in out[:2])
            cuts.append(solids.cylinder(p.thread.hole / 2, (*start, (low + high) / 2), out, SCREW_DEPTH + 1.0))
        disc = checked(
            solids.upright(radius, low, high).cut(*cuts).clean(), SLIP_RING_ADAPTER, "disc", "flange.diameter_mm", size
        )
    return disc.moved(solids.location(stack.turn()))
