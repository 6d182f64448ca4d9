"""Joints of a servo beside the axis: pulleys, tower, capsule, and the plate that tightens the belt."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from scanwright.cad.layout import names
from scanwright.cad.layout.belt import plate as of_plate
from scanwright.cad.layout.belt.plate import plate_of
from scanwright.cad.layout.belt.stack import (
    BOSS,
    DISC,
    GRUB,
    GRUBS_DEG,
    PLATE,
    PLATE_GRIP,
    PLATE_SCREW,
    RING_SCREW,
    RING_SCREWS_DEG,
    SHELF,
    TRAVEL,
    BeltStack,
)
from scanwright.cad.layout.belt.tower import (
    DISC_SCREW,
    SCREW_DEPTH,
    UNDER_HEAD,
    disc_azimuths,
    flange_centres,
    tower_of,
)
from scanwright.cad.layout.joints import (
    Joint,
    fixing_of,
    held_in,
    horn_joint,
    inward_axes,
    placed_axes,
    round_wall_mm,
    upright_axes,
)
from scanwright.cad.screws import SCREWS, passing_hole, thread_in_part
from scanwright.design.scanner import Scanner


def belt_joints(scanner: Scanner, stack: BeltStack) -> Iterator[Joint]:
    """In the order of the parts.

    Raises:
        BuildError: the case has no holes beside the pulley.
    """
    fit, tube = scanner.printer.fit_clearance_mm, stack.tube_diameter / 2
    yield _grub(scanner, stack, names.SHAFT_PULLEY, tube + fit / 4, stack.pulley_top - BOSS / 2)
    yield _ring(scanner, stack)
    yield from _in_tower(scanner, stack)
    yield from _of_servo(scanner, stack)


def _grub(scanner: Scanner, stack: BeltStack, part: str, bore: float, z: float) -> Joint:
    """Of what a boss holds on the shaft."""
    thread = thread_in_part(GRUB, scanner.printer, room_for_nut=False)
    axes = inward_axes((math.radians(azimuth) for azimuth in GRUBS_DEG), stack.boss_radius, z)
    wall = round_wall_mm(bore, stack.boss_radius, thread.hole)
    return Joint(part, names.MAIN_SHAFT, "grub", GRUB, axes, grip_mm=wall, thread_mm=0.0, thread=thread)


def _ring(scanner: Scanner, stack: BeltStack) -> Joint:
    """The ring under the lower bearing, which keeps the shaft in where the axis hangs."""
    bore = (stack.tube_diameter + scanner.printer.fit_clearance_mm) / 2
    hole = passing_hole(RING_SCREW, scanner.printer) / 2
    return Joint(
        names.SHAFT_RING,
        names.MAIN_SHAFT,
        "thread",
        RING_SCREW,
        inward_axes((math.radians(azimuth) for azimuth in RING_SCREWS_DEG), stack.ring_seat, stack.ring_screws),
        grip_mm=stack.ring_seat - math.sqrt(bore**2 - hole**2),
        thread_mm=(stack.tube_diameter - stack.shaft_bore) / 2,
    )


def _in_tower(scanner: Scanner, stack: BeltStack) -> Iterator[Joint]:
    """The disc in the tower, and the capsule on it."""
    tower, heads = tower_of(scanner, stack), stack.chamber_radius + UNDER_HEAD
    radial = inward_axes(disc_azimuths(stack), heads, stack.disc_top - DISC / 2)
    yield Joint(
        names.BEARING_TOWER,
        names.SLIP_RING_ADAPTER,
        "thread",
        DISC_SCREW,
        placed_axes(radial, stack.turn()),
        grip_mm=round_wall_mm(stack.chamber_radius, heads, tower.disc_hole),
        thread_mm=SCREW_DEPTH - tower.fit / 2,
        thread=thread_in_part(DISC_SCREW, scanner.printer, room_for_nut=False),
    )
    screw, thickness = SCREWS[stack.flange.screw], stack.flange.thickness_mm
    axes = placed_axes(upright_axes(flange_centres(stack), stack.disc_top - DISC, 1.0), stack.turn())
    yield Joint(names.SLIP_RING_ADAPTER, names.RING_STATOR, "nut", screw, axes, grip_mm=DISC, thread_mm=thickness)


def _of_servo(scanner: Scanner, stack: BeltStack) -> Iterator[Joint]:
    """The servo on its plate, the pulley on its horn, and the plate on the tower."""
    plate, thread = plate_of(scanner, stack), tower_of(scanner, stack).plate
    R, t = stack.turn(), stack.beside() * [1.0, 1.0, 0.0]
    heads = stack.tower_top + of_plate.UNDER_HEAD
    axes, grip = placed_axes(upright_axes(plate.holes, heads, -1.0), R, t), heads - plate.ears
    yield Joint(
        names.DRIVE_PLATE,
        names.SERVO_CASE,
        fixing_of(scanner.servo.front),
        plate.screw,
        axes,
        grip_mm=grip,
        thread_mm=scanner.servo.front.depth_mm,
    )
    grip = stack.pulley_seat - stack.horn
    horn = horn_joint(scanner.servo, names.DRIVE_PULLEY, names.SERVO_OUTPUT, stack.pulley_seat, grip)
    yield replace(horn, axes=placed_axes(horn.axes, R, t))
    slots = [(x, y) for x in (-stack.slot_x, stack.slot_x) for _, y in stack.arms_y]
    yield Joint(
        names.DRIVE_PLATE,
        names.BEARING_TOWER,
        held_in(thread),
        PLATE_SCREW,
        placed_axes(upright_axes(slots, stack.tower_top + PLATE, -1.0), R, t),
        grip_mm=PLATE,
        thread_mm=SHELF if thread.trap is None else PLATE_GRIP,
        thread=thread,
        slot_mm=(plate.slot, plate.slot + 2 * TRAVEL),
    )
