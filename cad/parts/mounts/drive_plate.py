"""Drive plate of the belt layout: holds the servo by its front ears and slides on the tower's arms to tighten the belt.

Frame: rotation frame at gamma = 0 (`cad/layout/belt/stack.py`), mm. A flat plate with an opening for horn and pulley,
feet down to the ears, and four slots along the line of centres.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import cadquery as cq
import numpy as np

from scanwright.cad import outlines, solids
from scanwright.cad.layout.belt.plate import UNDER_HEAD, DrivePlate
from scanwright.cad.layout.belt.stack import PLATE, PLATE_GRIP, PLATE_SCREW, SHELF, TRAVEL, BeltStack, drive_corners
from scanwright.cad.layout.belt.tower import BearingTower
from scanwright.cad.layout.cables.obstacles import Shape, shape_of
from scanwright.cad.layout.envelope import box_corners
from scanwright.cad.layout.joints import Joint, fixing_in, fixing_of, placed_axes, screws, triple, upright_axes
from scanwright.cad.layout.names import BEARING_TOWER, DRIVE_PLATE, SERVO, SERVO_CASE
from scanwright.cad.layout.placement import Placement
from scanwright.cad.parts.part_spec import PartSpec, Step, to_centre
from scanwright.cad.parts.tolerances import OnSheet
from scanwright.cad.screws import Thread
from scanwright.cad.solids import building
from scanwright.design.catalogue.servo import Servo

OF_SERVO = (
    "servo.case_max_mm",
    "servo.holes",
    "servo.horn_diameter_mm",
)
FOOT_RADIUS = 3.0


def plate_spec(place: Placement) -> PartSpec | None:
    """Return the plate of one scanner; None without a belt."""
    p, tower = place.drive.of(DrivePlate), place.drive.of(BearingTower)
    if p is None or tower is None:
        return None
    stack = p.stack
    words = f"{to_centre(place.scanner.servo)} Put the plate on its front. {screws(SERVO_CASE)}"
    return PartSpec(
        name=DRIVE_PLATE,
        turns=False,
        make=partial(drive_plate, p),
        step=Step("Servo on its plate", words, "the horn still turns freely in the hole of the plate", (SERVO,)),
        sheet=OnSheet(axis=stack.horn_axis),
        shaped_by=OF_SERVO,
        shapes={"belt.teeth": "where the servo stands"},
        joints=tuple(_joints(place.scanner.servo, p, tower.plate)),
        avoid=(_around(stack),),
    )


def _joints(servo: Servo, p: DrivePlate, thread: Thread) -> Iterator[Joint]:
    """Yield the joints of the plate with servo and tower."""
    stack = p.stack
    R, t, heads = stack.turn(), stack.servo_origin() * [1.0, 1.0, 0.0], stack.tower_top + UNDER_HEAD
    axes, grip = placed_axes(upright_axes(p.holes, heads, -1.0), R, t), heads - p.ears
    yield Joint(
        DRIVE_PLATE,
        SERVO_CASE,
        fixing_of(servo.front),
        p.screw,
        axes,
        grip_mm=grip,
        thread_mm=servo.front.depth_mm,
    )
    slots = [(x, y) for x in (-stack.slot_x, stack.slot_x) for _, y in stack.arms_y]
    yield Joint(
        DRIVE_PLATE,
        BEARING_TOWER,
        fixing_in(thread),
        PLATE_SCREW,
        placed_axes(upright_axes(slots, stack.tower_top + PLATE, -1.0), R, t),
        grip_mm=PLATE,
        thread_mm=SHELF if thread.trap is None else PLATE_GRIP,
        thread=thread,
        slot_mm=(p.slot, p.slot + 2 * TRAVEL),
    )


def _around(stack: BeltStack) -> Shape:
    """Return the plate and arms of the tower, with the pulley on the horn."""
    corners = drive_corners(stack)
    low = np.where(np.arange(3) == 2, stack.tower_top - SHELF, corners.min(axis=0))
    high = np.where(np.arange(3) == 2, stack.tower_top + PLATE, corners.max(axis=0))
    return shape_of(box_corners((triple(low), triple(high))))


def drive_plate(p: DrivePlate) -> cq.Solid:
    """Make the plate."""
    stack = p.stack
    low, high = stack.tower_top, stack.tower_top + PLATE
    y0, y1 = stack.plate_y
    with building(DRIVE_PLATE, "plate and feet", "holes", p.holes) as checked:
        plate = solids.prism(outlines.octagon(stack.plate_x, (y1 - y0) / 2, 3.0, (y0 + y1) / 2), low, high)
        feet = [solids.upright(FOOT_RADIUS, p.ears, low + 1.0, x, y) for x, y in p.holes]
        body = checked(plate.fuse(*feet))
    with building(DRIVE_PLATE, "opening, holes and slots", "holes", p.holes) as checked:
        cuts: list[cq.Shape] = [solids.upright(p.opening, p.ears - 1.0, high + 1.0)]
        for x, y in p.holes:
            cuts.append(solids.upright(p.hole / 2, p.ears - 1.0, high + 1.0, x, y))
            cuts.append(solids.upright(p.screw.head_room, low + UNDER_HEAD, high + 1.0, x, y))
        for x in (-stack.slot_x, stack.slot_x):
            for _, y in stack.arms_y:
                cuts.append(solids.slot(p.slot / 2, (x - TRAVEL, y), (x + TRAVEL, y), low - 1.0, high + 1.0))
        plate = checked(body.cut(*cuts).clean())
    return plate.moved(solids.location(stack.turn(), stack.servo_origin() * [1.0, 1.0, 0.0]))
