"""Bearing tower of the belt layout: holds the shaft's two bearings, the capsule below them, and the servo next to them.

Frame: rotation frame at gamma = 0 (`cad/layout/belt/stack.py`), mm; the servo's side is that of `BeltStack.quarter`. A
tube with a seat at either end of a lip, wider around the capsule, on a square foot with the threads of the mount's
screws; at its top a shelf of two arms, between which the servo hangs from its plate. Nuts are inserted into the arms
from below and into the foot from its corners. Through a round window on the far side a driver reaches the grub screws
of `shaft_ring`. It prints upside down on its flat top. An index groove in the edge of its top at +y meets the groove of
the linkage's hub.
"""

import math
from functools import partial

import cadquery as cq
import numpy as np

from scanwright.cad import outlines, solids
from scanwright.cad.layout.belt.stack import (
    BOSS,
    CASE_GAP,
    DISC,
    DISC_SCREW,
    FOOT,
    FOOT_HALF,
    FOOT_HOLE,
    FOOT_SCREW,
    PLATE_GRIP,
    PLATE_SCREW,
    SCREW_DEPTH,
    SHELF,
    TRAVEL,
    UNDER_FOOT_NUT,
    BeltStack,
    disc_azimuths,
    tower_corners,
)
from scanwright.cad.layout.cables.obstacles import shape_of
from scanwright.cad.layout.joints import Joint, inward_axes, placed_axes, round_wall_mm
from scanwright.cad.layout.names import BEARING, BEARING_TOWER, SLIP_RING_ADAPTER
from scanwright.cad.layout.placement import Placement
from scanwright.cad.parts.part_spec import PartSpec, Step, printed_seat
from scanwright.cad.screws import Thread, Trap, passing_hole, thread_in_part, trap_of
from scanwright.cad.solids import building
from scanwright.design.catalogue.products import Printer

BEYOND_NUT = 6.0  # of the hole in the foot: screws come in steps of 5 mm at most
WINDOW = 10.0  # diameter
FOOT_CHAMFER = 8.0
GROOVE = 1.0  # half width of the index groove
MARKED = 6.0  # half of the edge that it is in
LIP = 1.5  # of the tower inside the bearings' outer rings
UNDER_HEAD = 3.5  # of the wall


def tower_spec(place: Placement) -> PartSpec | None:
    """Return the tower of one scanner; None without a belt."""
    stack, printer, foot = place.drive.of(BeltStack), place.scanner.printer, place.drive.mounted.thread
    if stack is None or foot is None:
        return None
    heads, fit = stack.chamber_radius + UNDER_HEAD, printer.fit_clearance_mm
    joint = Joint(
        BEARING_TOWER,
        SLIP_RING_ADAPTER,
        "thread",
        DISC_SCREW,
        placed_axes(inward_axes(disc_azimuths(stack), heads, stack.disc_top - DISC / 2), stack.turn()),
        grip_mm=round_wall_mm(stack.chamber_radius, heads, passing_hole(DISC_SCREW, printer)),
        thread_mm=SCREW_DEPTH - fit / 2,
        thread=thread_in_part(DISC_SCREW, printer, nut_fits=False),
    )
    words = (
        "Press one bearing into the tower from above and one from below, each by its outer ring, until it is seated."
    )
    return PartSpec(
        name=BEARING_TOWER,
        turns=False,
        make=partial(bearing_tower, stack, printer, foot),
        step=Step(
            "Bearings into the tower", words, "both inner rings turn freely, neither bearing protrudes", (BEARING,)
        ),
        fits=(printed_seat(stack.carrier, fit),),
        notes=_nuts_words(foot, printer),
        shaped_by=("servo.case_min_mm", "servo.case_max_mm", "slip_ring.length_mm", "slip_ring.flange"),
        shapes={"printer.fit_clearance_mm": "every bore and seat"},
        joints=(joint,),
        avoid=tuple(map(shape_of, tower_corners(stack))),
    )


def _nuts_words(foot: Thread, printer: Printer) -> tuple[str, ...]:
    """Return the notes of the drawing on spaces for nuts."""
    plate, words = trap_of(PLATE_SCREW, printer), []
    if plate is not None:
        words.append(f"Hexagons under the arms for nuts {PLATE_SCREW.name}: {plate.across:g} across flats.")
    if foot.trap is not None:
        words.append(f"Slots in the foot for nuts {FOOT_SCREW.name}: {foot.trap.across:g} wide, from its corners.")
    return tuple(words)


def bearing_tower(stack: BeltStack, printer: Printer, foot: Thread) -> cq.Solid:
    """Make the tower; `foot` is the thread of the mount's screws."""
    size = f"{stack.carrier.outer_mm:g}"
    with building(BEARING_TOWER, "tube, shelf and foot", "outer_mm", size) as checked:
        body = checked(_tube(stack).fuse(_foot(stack), _shelf(stack)).cut(_inside(stack, printer.fit_clearance_mm)))
    with building(BEARING_TOWER, "holes and mark", "outer_mm", size) as checked:
        made = checked(body.cut(*_holes(stack, printer, foot)).clean()).moved(solids.location(stack.turn()))
        edge = (stack.plate_y[1], stack.tower_radius, -stack.plate_y[0], stack.tower_radius)[stack.quarter]
        groove = solids.prism(outlines.diamond(GROOVE, edge), stack.tower_top - SHELF - 1.0, stack.tower_top + 1.0)
        return checked(made.cut(groove).clean())


def _tube(stack: BeltStack) -> cq.Solid:
    """Round outer shape: around the bearings, then at 45 deg wider around the capsule."""
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


def _inside(stack: BeltStack, fit: float) -> cq.Shape:
    """Return the seats, the passage between them, and the chamber."""
    seat, width = stack.carrier.outer_mm / 2 + fit / 4, stack.carrier.width_mm
    passage = stack.carrier.outer_mm / 2 - LIP
    upper = solids.upright(seat, stack.tower_top - width, stack.tower_top + 1.0)
    middle = solids.upright(passage, stack.lower_bottom, stack.tower_top)
    lower = solids.upright(seat, stack.lower_bottom - 0.5, stack.lower_bottom + width)
    chamber = solids.upright(stack.chamber_radius, stack.tower_bottom - 1.0, stack.lower_bottom)
    return upper.fuse(middle, lower, chamber)


def _foot(stack: BeltStack) -> cq.Shape:
    """Return the square of the mount's screws, on a cone that needs no support upside down."""
    low, high = stack.tower_bottom, stack.tower_bottom + FOOT
    plate = solids.plate(FOOT_HALF, FOOT_HALF, FOOT_CHAMFER, low, high, FOOT_CHAMFER)
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
    around = solids.plate(FOOT_HALF, FOOT_HALF, FOOT_CHAMFER, high - 1.0, high + rise + 1.0, FOOT_CHAMFER)
    return plate.fuse(cone.intersect(around))


def _shelf(stack: BeltStack) -> cq.Shape:
    """Return a plate around the tube's top, forked around the servo's case; servo's frame."""
    low, high = stack.plate_y
    (inner_low, _), (inner_high, _) = stack.arms_y
    bottom, top = stack.tower_top - SHELF, stack.tower_top
    root = stack.centre + stack.servo.case_min_mm[0] - TRAVEL - CASE_GAP
    end = stack.centre + stack.slot_x + TRAVEL + PLATE_SCREW.driver_radius + 1.0
    back = -stack.tower_radius
    outline = [[-MARKED, low], [end, low], [end, high], [-MARKED, high], [back, 12.0], [back, -12.0]]
    shelf = solids.prism(outline, bottom, top, outlines.HAND)
    low_edge, high_edge = (root, inner_low, bottom - 1.0), (end + 1.0, inner_high, top + 1.0)
    return shelf.cut(solids.slab(low_edge, high_edge, (outlines.NOTCH, 0.0, 0.0, outlines.NOTCH)))


def _corner_slot(trap: Trap, floor: float, azimuth: float) -> cq.Solid:
    """Return the slot in a corner of the foot for a nut, inserted from outside before the mount."""
    start, half = math.sqrt(2) * FOOT_HOLE - trap.corner, trap.across / 2
    slot = solids.box((start, -half, floor), (math.sqrt(2) * FOOT_HALF, half, floor + trap.depth))
    return slot.rotate(cq.Vector(0, 0, 0), cq.Vector(0, 0, 1), math.degrees(azimuth))


def _holes(stack: BeltStack, printer: Printer, foot: Thread) -> list[cq.Solid]:
    plate, cuts = thread_in_part(PLATE_SCREW, printer), []
    for x in (stack.centre - stack.slot_x, stack.centre + stack.slot_x):
        for _, y in stack.arms_y:
            cuts.append(solids.upright(plate.hole / 2, stack.tower_top - SHELF - 1.0, stack.tower_top + 1.0, x, y))
            if plate.trap is not None:
                nut = np.array([x, y]) + outlines.polygon(plate.trap.corner, 6, 0.0)
                cuts.append(solids.prism(nut, stack.tower_top - SHELF - 1.0, stack.tower_top - PLATE_GRIP))
    low = stack.tower_bottom
    deep = FOOT - 1.0 if foot.trap is None else UNDER_FOOT_NUT + foot.trap.depth + BEYOND_NUT
    for x in (FOOT_HOLE, -FOOT_HOLE):
        for y in (FOOT_HOLE, -FOOT_HOLE):
            cuts.append(solids.upright(foot.hole / 2, low - 1.0, low + deep, x, y))
            if foot.trap is not None:
                cuts.append(_corner_slot(foot.trap, low + UNDER_FOOT_NUT, math.atan2(y, x)))
    for azimuth in disc_azimuths(stack):
        height, heads = stack.disc_top - DISC / 2, stack.chamber_radius + UNDER_HEAD
        cuts.append(solids.radial(passing_hole(DISC_SCREW, printer) / 2, azimuth, height))
        cuts.append(solids.radial(DISC_SCREW.driver_radius, azimuth, height, heads))
    ring = stack.collar_low + BOSS / 2
    cuts.append(solids.cylinder(WINDOW / 2, (0.0, 0.0, ring), (-1.0, 0.0, 0.0), 80.0))
    return cuts
