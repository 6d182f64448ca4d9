"""Bearing tower of the belt layout: holds the shaft's two bearings, the capsule below them, and the servo beside them.

Frame: rotation frame at gamma = 0 (`cad/layout/belt_stack.py`), mm; the servo's side is that of `BeltStack.quarter`.
A tube with a seat at either end of a lip, wider around the capsule, on a square foot with the threads of the mount's
screws; at its top a shelf of two arms, between which the servo hangs from its plate: the plate's screws end in the
arms. Nuts, where the printer's profile asks for them, go into the arms from below and into the foot from its corners.
A round window on the far side leads a driver to the grub screws of `shaft_ring`. Its top is flat: it prints upside
down. An index groove in the edge of its top at +y meets the groove of the linkage's hub.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cadquery as cq
import numpy as np

from cad import solids
from cad.layout.belt_stack import (
    BOSS,
    CASE_ROOM,
    DISC,
    FOOT,
    FOOT_HALF,
    FOOT_HOLE,
    FOOT_SCREW,
    LIP,
    PLATE_GRIP,
    PLATE_SCREW,
    SHELF,
    TRAVEL,
    BeltStack,
)
from cad.screws import SCREWS, Trap, thread_hole, trap_of
from cad.solids import building, checked
from design.scanner import Scanner

PART = "bearing_tower"
DISC_SCREW = SCREWS["M3"]
DISC_SCREWS = 3
SCREW_DEPTH = 10.0  # of a radial screw in the disc
UNDER_HEAD = 3.5  # of the wall
UNDER_FOOT_NUT = 4.0  # of the foot
BEYOND_NUT = 6.0  # of the hole in the foot: screws come in steps of 5 mm at most
WINDOW = 10.0  # diameter
FOOT_CHAMFER = 8.0
GROOVE = 1.0  # half width of the index groove
MARKED = 6.0  # half of the edge that it is in


@dataclass(frozen=True, slots=True, kw_only=True)
class BearingTower:
    """Lengths in mm."""

    stack: BeltStack
    fit: float  # diametral clearance of a sliding fit
    plate_thread: float  # diameter
    plate_trap: Trap | None  # below the arms, if these screws hold in nuts
    foot_thread: float  # diameter
    foot_trap: Trap | None  # open to the corners of the foot, if these screws do
    disc_hole: float  # diameter


def tower_of(scanner: Scanner, stack: BeltStack) -> BearingTower:
    """Parameters of the tower of one scanner."""
    printer = scanner.printer
    plate, foot = trap_of(PLATE_SCREW, printer), trap_of(FOOT_SCREW, printer)
    if foot is not None and math.sqrt(2) * FOOT_HOLE - foot.corner - printer.min_wall_mm < stack.chamber_radius:
        foot = None
    return BearingTower(
        stack=stack,
        fit=printer.fit_clearance_mm,
        plate_thread=thread_hole(PLATE_SCREW, printer) if plate is None else plate.hole,
        plate_trap=plate,
        foot_thread=thread_hole(FOOT_SCREW, printer) if foot is None else foot.hole,
        foot_trap=foot,
        disc_hole=DISC_SCREW.nominal + printer.screw_clearance_mm,
    )


def nuts_words(p: BearingTower) -> tuple[str, ...]:
    """What the drawing says of the room for nuts."""
    words = []
    if p.plate_trap is not None:
        words.append(f"Hexagons under the arms for nuts {PLATE_SCREW.name}: {p.plate_trap.across:g} across flats.")
    if p.foot_trap is not None:
        words.append(f"Slots in the foot for nuts {FOOT_SCREW.name}: {p.foot_trap.across:g} wide, from its corners.")
    return tuple(words)


def disc_azimuths(stack: BeltStack) -> list[float]:
    """Of the radial screws that hold the capsule's disc [rad], servo's frame: between the screws of its flange."""
    return [math.pi / stack.flange.holes + 2 * math.pi * k / DISC_SCREWS + math.pi / 2 for k in range(DISC_SCREWS)]


def bearing_tower(p: BearingTower) -> cq.Solid:
    """Make the tower.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    stack = p.stack
    size = f"{stack.carrier.outer_mm:g}"
    with building(PART, "tube, shelf and foot", "outer_mm", size):
        body = checked(
            _tube(p).fuse(_foot(p), *_shelf(p)).cut(_inside(p)), PART, "tube, shelf and foot", "outer_mm", size
        )
    with building(PART, "holes and mark", "outer_mm", size):
        made = checked(body.cut(*_holes(p)).clean(), PART, "holes", "outer_mm", size).moved(
            solids.location(stack.turn())
        )
        edge = (stack.plate_y[1], stack.tower_radius, -stack.plate_y[0], stack.tower_radius)[stack.quarter]
        groove = solids.prism(solids.diamond(GROOVE, edge), stack.tower_top - SHELF - 1.0, stack.tower_top + 1.0)
        return checked(made.cut(groove).clean(), PART, "mark", "outer_mm", size)


def _tube(p: BearingTower) -> cq.Solid:
    """Round outside: around the bearings, then at 45 deg wider around the capsule."""
    stack = p.stack
    narrow, wide, wall = stack.tower_radius, stack.wide_radius, 1.0
    inner = stack.carrier.outer_mm / 2 - LIP
    turn = stack.lower_bottom
    return solids.lathe(
        [
            (inner, stack.tower_top),
            (narrow, stack.tower_top),
            (narrow, turn + max(0.0, wide - narrow)),
            (wide, turn),
            (wide, stack.tower_bottom),
            (inner, stack.tower_bottom),
            (inner, stack.tower_bottom + wall),
        ]
    )


def _inside(p: BearingTower) -> cq.Shape:
    """Seats, the way between them, and the chamber."""
    stack = p.stack
    seat, width = stack.carrier.outer_mm / 2 + p.fit / 4, stack.carrier.width_mm
    way = stack.carrier.outer_mm / 2 - LIP
    upper = solids.upright(seat, stack.tower_top - width, stack.tower_top + 1.0)
    middle = solids.upright(way, stack.lower_bottom, stack.tower_top)
    lower = solids.upright(seat, stack.lower_bottom - 0.5, stack.lower_bottom + width)
    chamber = solids.upright(stack.chamber_radius, stack.tower_bottom - 1.0, stack.lower_bottom)
    return upper.fuse(middle, lower, chamber)


def _foot(p: BearingTower) -> cq.Shape:
    """The square of the mount's screws, on a cone that needs no support upside down."""
    stack = p.stack
    low, high = stack.tower_bottom, stack.tower_bottom + FOOT
    plate = solids.prism(solids.octagon(FOOT_HALF, FOOT_HALF, FOOT_CHAMFER), low, high)
    reach = math.sqrt(2) * FOOT_HALF
    rise = reach - stack.wide_radius
    inner = stack.chamber_radius - 0.5
    cone = solids.lathe(
        [
            (inner, high - 0.5),
            (reach, high - 0.5),
            (reach, high),
            (stack.wide_radius, high + rise),
            (inner, high + rise),
        ]
    )
    around = solids.prism(solids.octagon(FOOT_HALF, FOOT_HALF, FOOT_CHAMFER), high - 1.0, high + rise + 1.0)
    return plate.fuse(cone.intersect(around))


def _shelf(p: BearingTower) -> list[cq.Shape]:
    """A plate around the tube's top, forked around the servo's case; servo's frame."""
    stack = p.stack
    low, high = stack.plate_y
    (inner_low, _), (inner_high, _) = stack.arms_y
    bottom, top = stack.tower_top - SHELF, stack.tower_top
    root = stack.centre + stack.servo.case_min_mm[0] - TRAVEL - CASE_ROOM
    end = stack.centre + stack.slot_x + TRAVEL + PLATE_SCREW.head_room + 1.0
    back = -stack.tower_radius
    outline = [[-MARKED, low], [end, low], [end, high], [-MARKED, high], [back, 12.0], [back, -12.0]]
    whole = solids.prism(outline, bottom, top)
    return [whole.cut(solids.box((root, inner_low, bottom - 1.0), (end + 1.0, inner_high, top + 1.0)))]


def _corner_slot(trap: Trap, floor: float, azimuth: float) -> cq.Solid:
    """Slot in a corner of the foot that a nut is pushed into from outside, before the mount comes."""
    start, half = math.sqrt(2) * FOOT_HOLE - trap.corner, trap.across / 2
    slot = solids.box((start, -half, floor), (math.sqrt(2) * FOOT_HALF, half, floor + trap.depth))
    return slot.rotate(cq.Vector(0, 0, 0), cq.Vector(0, 0, 1), math.degrees(azimuth))


def _holes(p: BearingTower) -> list[cq.Solid]:
    stack = p.stack
    cuts = []
    for x in (stack.centre - stack.slot_x, stack.centre + stack.slot_x):
        for _, y in stack.arms_y:
            cuts.append(solids.upright(p.plate_thread / 2, stack.tower_top - SHELF - 1.0, stack.tower_top + 1.0, x, y))
            if p.plate_trap is not None:
                nut = np.array([x, y]) + solids.polygon(p.plate_trap.corner, 6, 0.0)
                cuts.append(solids.prism(nut, stack.tower_top - SHELF - 1.0, stack.tower_top - PLATE_GRIP))
    low = stack.tower_bottom
    deep = FOOT - 1.0 if p.foot_trap is None else UNDER_FOOT_NUT + p.foot_trap.depth + BEYOND_NUT
    for x in (FOOT_HOLE, -FOOT_HOLE):
        for y in (FOOT_HOLE, -FOOT_HOLE):
            cuts.append(solids.upright(p.foot_thread / 2, low - 1.0, low + deep, x, y))
            if p.foot_trap is not None:
                cuts.append(_corner_slot(p.foot_trap, low + UNDER_FOOT_NUT, math.atan2(y, x)))
    for azimuth in disc_azimuths(stack):
        out = (math.cos(azimuth), math.sin(azimuth), 0.0)
        height = stack.disc_top - DISC / 2
        cuts.append(solids.cylinder(p.disc_hole / 2, (0.0, 0.0, height), out, 80.0))
        start = tuple((stack.chamber_radius + UNDER_HEAD) * c for c in out[:2])
        cuts.append(solids.cylinder(DISC_SCREW.head_room, (*start, height), out, 80.0))
    ring = stack.collar_low + BOSS / 2
    cuts.append(solids.cylinder(WINDOW / 2, (0.0, 0.0, ring), (-1.0, 0.0, 0.0), 80.0))
    return cuts
