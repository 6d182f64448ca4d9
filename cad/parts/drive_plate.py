"""Drive plate of the belt layout: holds the servo by its front ears and slides on the tower's arms to tighten the belt.

Frame: rotation frame at gamma = 0 (`cad/layout/belt_stack.py`), mm; the servo's place and turn are those of the
stack. A flat plate with an opening for horn and pulley, feet down to the ears, and four slots along the line of
centres.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cadquery as cq

from cad import solids
from cad.layout.belt_stack import PLATE, PLATE_SCREW, TRAVEL, BeltStack
from cad.screws import SCREWS, Screw
from cad.solids import building, checked
from design.errors import BuildError
from design.scanner import Scanner

PART = "drive_plate"
FOOT_RADIUS = 3.0
UNDER_HEAD = 2.5  # of the plate
HORN_ROOM = 1.5  # around the foot of the pulley


@dataclass(frozen=True, slots=True, kw_only=True)
class DrivePlate:
    """Lengths in mm, servo's frame."""

    stack: BeltStack
    opening: float  # radius
    ears: float  # z of the planes around the front holes
    screw: Screw
    hole: float  # diameter
    holes: tuple[tuple[float, float], ...]
    slot: float  # width


def plate_of(scanner: Scanner, stack: BeltStack, pulley_foot: float) -> DrivePlate:
    """Parameters of the plate of one scanner.

    Args:
        scanner: its servo and printer.
        stack: its layout.
        pulley_foot: radius of what lies on the horn.

    Raises:
        BuildError: the case has no four front holes beside the horn.
    """
    servo, printer = scanner.servo, scanner.printer
    screw = SCREWS[servo.case_screw]
    hole = screw.nominal + printer.screw_clearance_mm
    opening = max(pulley_foot, servo.horn_diameter_mm / 2) + HORN_ROOM
    least = opening + hole / 2 + printer.min_wall_mm
    free = [(x, y) for x, y in servo.case_holes_mm if math.hypot(x, y) >= least]
    widest = max((x for x, _ in free), default=0.0)
    ys = sorted(y for x, y in free if x == widest and (-x, y) in free)
    if len(ys) < 2:
        raise BuildError(
            f"{PART}: ears: case_holes_mm = {list(servo.case_holes_mm)}: {servo.name} needs two pairs of front holes "
            f"at least {least:.2f} mm from its axis, beside the pulley"
        )
    return DrivePlate(
        stack=stack,
        opening=opening,
        ears=stack.horn + servo.case_holes_z_mm,
        screw=screw,
        hole=hole,
        holes=tuple((side * widest, y) for y in (ys[0], ys[-1]) for side in (1.0, -1.0)),
        slot=PLATE_SCREW.nominal + printer.screw_clearance_mm,
    )


def drive_plate(p: DrivePlate) -> cq.Solid:
    """Make the plate.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    stack = p.stack
    low, high = stack.tower_top, stack.tower_top + PLATE
    y0, y1 = stack.plate_y
    with building(PART, "plate and feet", "case_holes_mm", p.holes):
        plate = solids.prism(solids.octagon(stack.plate_x, (y1 - y0) / 2, 3.0, (y0 + y1) / 2), low, high)
        feet = [solids.upright(FOOT_RADIUS, p.ears, low + 1.0, x, y) for x, y in p.holes]
        body = checked(plate.fuse(*feet), PART, "plate and feet", "case_holes_mm", p.holes)
    with building(PART, "opening, holes and slots", "case_holes_mm", p.holes):
        cuts: list[cq.Shape] = [solids.upright(p.opening, p.ears - 1.0, high + 1.0)]
        for x, y in p.holes:
            cuts.append(solids.upright(p.hole / 2, p.ears - 1.0, high + 1.0, x, y))
            cuts.append(solids.upright(p.screw.head_room, low + UNDER_HEAD, high + 1.0, x, y))
        for x in (-stack.slot_x, stack.slot_x):
            cuts += [_slot(p, x, y, low, high) for _, y in stack.arms_y]
        plate = checked(body.cut(*cuts).clean(), PART, "opening, holes and slots", "case_holes_mm", p.holes)
    return plate.moved(solids.location(stack.turn(), stack.beside() * [1.0, 1.0, 0.0]))


def _slot(p: DrivePlate, x: float, y: float, low: float, high: float) -> cq.Shape:
    half = p.slot / 2
    ends = [solids.upright(half, low - 1.0, high + 1.0, x + side * TRAVEL, y) for side in (1.0, -1.0)]
    middle = solids.box((x - TRAVEL, y - half, low - 1.0), (x + TRAVEL, y + half, high + 1.0))
    return middle.fuse(*ends)
