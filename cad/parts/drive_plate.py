"""Drive plate of the belt layout: holds the servo by its front ears and slides on the tower's arms to tighten the belt.

Frame: rotation frame at gamma = 0 (`cad/layout/belt/stack.py`), mm; the servo's place and turn are those of the
stack. A flat plate with an opening for horn and pulley, feet down to the ears, and four slots along the line of
centres.
"""

from __future__ import annotations

from functools import partial

import cadquery as cq

from scanwright.cad import outlines, solids
from scanwright.cad.layout.belt.plate import UNDER_HEAD, DrivePlate, plate_of
from scanwright.cad.layout.belt.stack import PLATE, TRAVEL, BeltStack
from scanwright.cad.layout.fits import OnSheet
from scanwright.cad.layout.joints import screws
from scanwright.cad.layout.names import DRIVE_PLATE, SERVO, SERVO_CASE
from scanwright.cad.parts.part_spec import PartSpec, Step
from scanwright.cad.solids import building
from scanwright.design.scanner import Scanner

OF_SERVO = (
    "servo.case_max_mm",
    "servo.holes",
    "servo.horn_diameter_mm",
)
FOOT_RADIUS = 3.0


def plate_spec(scanner: Scanner, stack: BeltStack) -> PartSpec:
    """The plate of one scanner."""
    words = (
        "Turn the servo to its centre (position 2048 of 4096, 512 of 1024) and put the plate on its front. "
        f"{screws(SERVO_CASE)}"
    )
    return PartSpec(
        name=DRIVE_PLATE,
        turns=False,
        make=partial(drive_plate, plate_of(scanner, stack)),
        step=Step("Servo on its plate", words, "the horn still turns freely in the hole of the plate", (SERVO,)),
        sheet=OnSheet(axis=stack.horn_axis),
        shaped_by=OF_SERVO,
        shapes={"belt.teeth": "where the servo stands"},
    )


def drive_plate(p: DrivePlate) -> cq.Solid:
    """Make the plate.

    Raises:
        BuildError: a step did not give one valid solid.
    """
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
    return plate.moved(solids.location(stack.turn(), stack.beside() * [1.0, 1.0, 0.0]))
