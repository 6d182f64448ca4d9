"""Joints of a servo on the axis: shaft on its horn, adapter or cage on its case."""

from __future__ import annotations

from collections.abc import Iterator

from scanwright.cad.layout import names
from scanwright.cad.layout.direct import cage as of_cage
from scanwright.cad.layout.direct.adapter import adapter_of
from scanwright.cad.layout.direct.cage import BearingCage, cage_of
from scanwright.cad.layout.direct.frame import GRIP, frame_of, needs_frame
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.joints import Joint, fixing_of, held_in, horn_joint, inward_axes, round_wall_mm, upright_axes
from scanwright.design.scanner import Scanner


def direct_joints(scanner: Scanner, stack: DirectStack) -> Iterator[Joint]:
    """From the horn upwards, to the bearing.

    Raises:
        BuildError: the case has no holes beside the turning flange.
    """
    heads = stack.horn + stack.horn_grip
    yield horn_joint(scanner.servo, stack.shaft, names.SERVO_HORN, heads, stack.horn_grip)
    if needs_frame(scanner.servo):
        p, front = frame_of(scanner, stack), scanner.servo.front
        axes = upright_axes(p.holes, p.high, -1.0)
        yield Joint(
            names.SERVO_FRAME,
            names.SERVO_CASE,
            fixing_of(front),
            p.screw,
            axes,
            grip_mm=GRIP,
            thread_mm=front.depth_mm,
            heel_mm=p.heel_mm if len(p.holes) == 2 else None,
        )
    has_ring, cage = scanner.slip_ring is not None, cage_of(scanner, stack)
    base = names.SLIP_RING_ADAPTER if has_ring else names.CAGE_BASE
    on_case = adapter_of(scanner, stack) if has_ring and cage is None else cage
    if on_case is not None:
        heads = on_case.front + of_cage.SEAT_GAP + of_cage.UNDER_HEAD
        axes, grip = upright_axes(on_case.holes, heads, -1.0), heads - on_case.ears
        yield Joint(
            base,
            names.SERVO_CASE,
            fixing_of(scanner.servo.front),
            on_case.screw,
            axes,
            grip_mm=grip,
            thread_mm=scanner.servo.front.depth_mm,
        )
    if cage is not None:
        yield _bell(stack, cage, base)


def _bell(stack: DirectStack, cage: BearingCage, base: str) -> Joint:
    """The bell on its base, by radial screws."""
    heads = stack.cage_inner + of_cage.UNDER_CAGE_HEAD
    return Joint(
        names.BEARING_CAGE,
        base,
        held_in(cage.thread),
        of_cage.CAGE_SCREW,
        inward_axes(cage.legs, heads, (cage.foot + cage.high) / 2),
        grip_mm=round_wall_mm(stack.cage_inner, heads, cage.cage_hole),
        thread_mm=of_cage.SCREW_DEPTH - cage.fit / 2 if cage.thread.trap is None else of_cage.TRAP_WALL,
        thread=cage.thread,
    )
