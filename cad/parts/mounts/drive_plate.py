"""Drive plate of the belt layout: holds the servo by its front ears and slides on the tower's arms to tighten the belt.

Frame: rotation frame at gamma = 0 (`cad/layout/belt/stack.py`), mm. A flat plate with an opening for horn and pulley,
feet down to the ears, or a pad on the entire front of a servo with two holes, and four slots along the line of centres.
"""

import math
from functools import partial

import cadquery as cq

from scanwright.cad import solids
from scanwright.cad.layout.belt.stack import PLATE, PLATE_GRIP, PLATE_SCREW, SHELF, TRAVEL, BeltStack, shelf_corners
from scanwright.cad.layout.cables.obstacles import shape_of
from scanwright.cad.layout.drive import Ears
from scanwright.cad.layout.joints import Joint, fixing_in, front_joint, placed_axes, screws, upright_axes
from scanwright.cad.layout.names import BEARING_TOWER, DRIVE_PLATE, SERVO, SERVO_CASE
from scanwright.cad.layout.placement import Placement
from scanwright.cad.parts.mounts.bearing_cage import head_recess
from scanwright.cad.parts.part_spec import PartSpec, Step, to_centre
from scanwright.cad.screws import passing_hole, thread_in_part
from scanwright.cad.solids import building

FOOT_RADIUS = 3.0
UNDER_HEAD = 2.5  # of the plate


def plate_spec(place: Placement) -> PartSpec | None:
    """Return the plate of one scanner; None without a belt."""
    p, stack, printer = place.drive.of(Ears), place.drive.of(BeltStack), place.scanner.printer
    if p is None or stack is None:
        return None
    words = (
        f"{to_centre(place.scanner.servo)} Put the plate on the servo's front, the horn through its hole. "
        f"{screws(SERVO_CASE)}"
    )
    R, t, heads = stack.turn(), stack.servo_origin() * [1.0, 1.0, 0.0], stack.tower_top + UNDER_HEAD
    axes = placed_axes(upright_axes(p.holes, heads, -1.0), R, t)
    slots = [(x, y) for x in (-stack.slot_x, stack.slot_x) for _, y in stack.arms_y]
    slot, thread = passing_hole(PLATE_SCREW, printer), thread_in_part(PLATE_SCREW, printer)
    return PartSpec(
        name=DRIVE_PLATE,
        turns=False,
        make=partial(drive_plate, stack, p, slot),
        step=Step("Servo on its plate", words, "the horn still turns freely in the hole of the plate", (SERVO,)),
        axis=stack.horn_axis,
        shaped_by=("servo.case_max_mm", "servo.holes", "servo.horn_diameter_mm"),
        shapes={"belt.teeth": "the place of the servo"},
        joints=(
            front_joint(place.scanner.servo, DRIVE_PLATE, SERVO_CASE, axes, heads - stack.horn - p.seats, p.heel_mm),
            Joint(
                DRIVE_PLATE,
                BEARING_TOWER,
                fixing_in(thread),
                PLATE_SCREW,
                placed_axes(upright_axes(slots, stack.tower_top + PLATE, -1.0), R, t),
                grip_mm=PLATE,
                thread_mm=SHELF if thread.trap is None else PLATE_GRIP,
                thread=thread,
                slot_mm=(slot, slot + 2 * TRAVEL),
            ),
        ),
        avoid=(shape_of(shelf_corners(stack)),),
    )


def drive_plate(stack: BeltStack, p: Ears, slot: float) -> cq.Solid:
    """Make the plate; `slot` is the width of its slots."""
    seats = stack.horn + p.seats
    low, high = stack.tower_top, stack.tower_top + PLATE
    y0, y1 = stack.plate_y
    with building(DRIVE_PLATE, "plate and feet", "holes", p.holes) as checked:
        plate = solids.plate(stack.plate_x, (y1 - y0) / 2, 3.0, low, high, y=(y0 + y1) / 2)
        feet = [solids.upright(FOOT_RADIUS, seats, low + 1.0, x, y) for x, y in p.holes]
        if p.heel_mm is not None:
            (x0, y0, _), (x1, y1, _) = stack.servo.case_min_mm, stack.servo.case_max_mm
            feet = [solids.box((x0, y0, seats), (x1, y1, low + 1.0))]
        body = checked(plate.fuse(*feet))
    with building(DRIVE_PLATE, "opening, holes and slots", "holes", p.holes) as checked:
        cuts: list[cq.Shape] = [solids.upright(p.opening, seats - 1.0, high + 1.0)]
        for x, y in p.holes:
            cuts.append(solids.upright(p.hole / 2, seats - 1.0, high + 1.0, x, y))
            radius, ends = p.screw.driver_radius, (low + UNDER_HEAD, high + 1.0)
            cuts.append(
                head_recess(p, p.screw, x, y, *ends)
                if math.hypot(x, y) - radius > p.opening
                else solids.upright(radius, *ends, x, y)
            )
        for x in (-stack.slot_x, stack.slot_x):
            for _, y in stack.arms_y:
                cuts.append(solids.slot(slot / 2, (x - TRAVEL, y), (x + TRAVEL, y), low - 1.0, high + 1.0))
        plate = checked(body.cut(*cuts).clean())
    return plate.moved(solids.location(stack.turn(), stack.servo_origin() * [1.0, 1.0, 0.0]))
