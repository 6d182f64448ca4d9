"""Servo shaft: from the servo's horn through the slip ring to the linkage's hub. One turned part.

Frame: rotation frame at gamma = 0 (`cad/layout/direct_stack.py`), mm. Horn flange with the horn's holes and a pocket
for its boss, a collar around the pocket, the shaft; the upper end is a spigot with a flat at +y. A flange at both ends
could not pass the ring. Where a bearing holds the hub, the shaft is longer and has a waist above the collar: horn and
bearing are never quite in line, and a stiff shaft would turn the error into a moment on the horn. Length and shape do
not depend on the scan plane: one shaft serves every linkage.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cadquery as cq

from cad import solids
from cad.layout.direct_stack import Stack, horn_screw
from cad.layout.loads import WAIST, waist_radius_mm
from cad.solids import building, checked
from design.scanner import Scanner

PART = "servo_shaft"


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoShaft:
    """Lengths in mm."""

    stack: Stack
    boss_radius: float  # of the pocket
    boss_depth: float
    hole: float  # diameter
    circle: float  # diameter
    holes: int
    first_hole_deg: float  # from +y


def shaft_of(scanner: Scanner, stack: Stack) -> ServoShaft:
    """Parameters of the shaft of one scanner."""
    servo = scanner.servo
    return ServoShaft(
        stack=stack,
        boss_radius=servo.horn_boss_diameter_mm / 2 + 0.2,
        boss_depth=servo.horn_boss_height_mm + 0.5,
        hole=horn_screw(servo).nominal + scanner.printer.screw_clearance_mm,
        circle=servo.horn_circle_mm,
        holes=servo.horn_holes,
        first_hole_deg=servo.horn_first_hole_deg,
    )


def servo_shaft(p: ServoShaft) -> cq.Solid:
    """Make the shaft.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    stack = p.stack
    horn, radius = stack.horn, stack.shaft_diameter / 2
    with building(PART, "body", "shaft diameter", f"{stack.shaft_diameter:g} mm"):
        body: cq.Shape = solids.upright(stack.flange_radius, horn, horn + stack.flange_thickness)
        if stack.collar_radius > radius:
            body = body.fuse(solids.upright(stack.collar_radius, horn, horn + stack.collar_height))
        body = body.fuse(solids.upright(radius, horn, stack.spigot_top))
        body = checked(body, PART, "body", "shaft diameter", f"{stack.shaft_diameter:g} mm")
    with building(PART, "holes, flat and marks", "horn_circle_mm", p.circle):
        low = (-2 * radius, stack.flat, stack.hub_bottom)
        cuts = [solids.box(low, (2 * radius, 2 * radius, stack.spigot_top + 1.0)), *_holes(p), _index_groove(p)]
        if p.boss_radius > 0.2:
            cuts.append(solids.upright(p.boss_radius, horn - 1.0, horn + p.boss_depth))
        if stack.bearing is not None:
            cuts.append(_waist(stack))
        return checked(body.cut(*cuts).clean(), PART, "holes, flat and marks", "horn_circle_mm", p.circle)


def _holes(p: ServoShaft) -> list[cq.Solid]:
    low, high = p.stack.horn - 1.0, p.stack.horn + p.stack.flange_thickness + 1.0
    first = math.radians(90.0 + p.first_hole_deg)
    centres = solids.polygon(p.circle / 2, p.holes, first)
    return [solids.upright(p.hole / 2, low, high, float(x), float(y)) for x, y in centres]


def _waist(stack: Stack) -> cq.Solid:
    """What is turned off: its ends slope at 45 deg, an edge would crack."""
    radius, waist = stack.shaft_diameter / 2, waist_radius_mm(stack)
    slope = radius - waist
    low = stack.horn + stack.collar_height
    high = low + WAIST + slope
    outer = radius + 1.0
    return solids.lathe([[outer, low], [waist, low], [waist, low + WAIST], [outer, high + 1.0]])


def _index_groove(p: ServoShaft) -> cq.Solid:
    low, high = p.stack.horn - 1.0, p.stack.horn + p.stack.flange_thickness + 1.0
    return solids.prism(solids.diamond(0.6, p.stack.flange_radius), low, high)
