"""All joints of one scanner: those of its drive, and those that every scanner has."""

from __future__ import annotations

import math
from collections.abc import Iterator

from scanwright.cad.layout import names
from scanwright.cad.layout.balance.counterweight import SCREW as BAR_SCREW
from scanwright.cad.layout.balance.counterweight import Counterweight
from scanwright.cad.layout.belt.joints import belt_joints
from scanwright.cad.layout.belt.stack import FOOT, BeltStack
from scanwright.cad.layout.belt.tower import UNDER_FOOT_NUT, tower_of
from scanwright.cad.layout.deck import FOOT_THICKNESS, UNDER_MOUNT_HEAD, Deck
from scanwright.cad.layout.direct.joints import direct_joints
from scanwright.cad.layout.envelope import EAR_SCREW, PLATE_THICKNESS, SUB_PLATE_THICKNESS
from scanwright.cad.layout.joints import (
    DECK_MM,
    Joint,
    fixing_of,
    held_in,
    inward_axes,
    lidar_thread_mm,
    placed_axes,
    upright_axes,
)
from scanwright.cad.layout.layout import Layout
from scanwright.cad.layout.linkage import CROSS_SCREW, cross_floor_mm, cross_seat_mm, cross_thread_mm
from scanwright.cad.layout.modules.tripod_foot import FLOOR, HEEL, OVER_NUTS, STANDS_OUT, TripodFoot
from scanwright.cad.screws import TRIPOD_SCREW


def joints_of(layout: Layout) -> list[Joint]:
    """All joints, in the order of the parts; those with slots last.

    Raises:
        BuildError: the case of the servo has no holes where they are needed.
    """
    scanner, stack = layout.scanner, layout.stack
    drive = belt_joints(scanner, stack) if isinstance(stack, BeltStack) else direct_joints(scanner, stack)
    joints = [*drive, _crossed(layout), *_of_lidar(layout), *_on_deck(layout)]
    if isinstance(layout.counterweight, Counterweight):
        joints.append(_bar(layout.counterweight))
    return sorted(joints, key=lambda joint: joint.slot_mm is not None)


def _crossed(layout: Layout) -> Joint:
    """The hub on the shaft: cap screws through its wall into threads or nuts of the shaft, which no play lets out."""
    p, stack = layout.linkage, layout.stack
    heads = cross_seat_mm(stack)
    return Joint(
        names.ALIGNMENT_LINKAGE,
        layout.drive.shaft,
        "thread" if p.cross_thread is None else held_in(p.cross_thread),
        CROSS_SCREW,
        inward_axes(p.cross_azimuths, heads, stack.cross),
        grip_mm=heads - min(cross_floor_mm(p, azimuth) for azimuth in p.cross_azimuths),
        thread_mm=cross_thread_mm(p),
        thread=p.cross_thread,
    )


def _of_lidar(layout: Layout) -> Iterator[Joint]:
    """The lidar on the linkage, or on a sub-plate and that on the linkage."""
    p, R = layout.linkage, layout.stack.R()
    part, grip = names.ALIGNMENT_LINKAGE, PLATE_THICKNESS
    if p.ears is not None:
        part, grip = names.SUB_PLATE, SUB_PLATE_THICKNESS
    deep = lidar_thread_mm(layout.scanner.lidar)
    axes = placed_axes(upright_axes(p.holes, p.seat - grip, 1.0), R)
    slot = (p.screw_hole, p.screw_hole + 2 * p.screw_travel) if p.screw_travel > 0 else None
    how = fixing_of(layout.scanner.lidar.base)
    heel = min(layout.scanner.lidar.half_mm) if len(p.holes) == 2 else None
    yield Joint(part, names.LIDAR_BODY, how, p.screw, axes, grip_mm=grip, thread_mm=deep, slot_mm=slot, heel_mm=heel)
    if p.ears is not None:
        thread = p.ear_thread
        deep = PLATE_THICKNESS - (0.0 if thread.trap is None else thread.trap.depth)
        axes = placed_axes(upright_axes(p.ear_screws, p.seat, -1.0), R)
        onto, into = names.ALIGNMENT_LINKAGE, held_in(thread)
        yield Joint(part, onto, into, EAR_SCREW, axes, grip_mm=grip, thread_mm=deep, thread=thread)


def _on_deck(layout: Layout) -> Iterator[Joint]:
    """What the mount holds, and the mount on the deck; or the servo on the deck."""
    mounted, deck, stack = layout.drive.mounted, layout.deck, layout.stack
    if deck.flat:
        axes = upright_axes(mounted.holes, mounted.rear - DECK_MM, 1.0)
        yield Joint(
            names.DECK, mounted.onto, mounted.fixing, mounted.screw, axes, grip_mm=DECK_MM, thread_mm=mounted.ear_mm
        )
        return
    thread = tower_of(layout.scanner, stack).foot if isinstance(stack, BeltStack) else None
    deep = mounted.ear_mm
    if thread is not None:
        deep = FOOT - 1.0 if thread.trap is None else UNDER_FOOT_NUT
    yield Joint(
        names.BASE_MOUNT,
        mounted.onto,
        mounted.fixing if thread is None else held_in(thread),
        mounted.screw,
        upright_axes(mounted.holes, mounted.ears - UNDER_MOUNT_HEAD, 1.0),
        grip_mm=UNDER_MOUNT_HEAD,
        thread_mm=deep,
        thread=thread,
    )
    if deck.tripod is not None:
        yield from _on_tripod(deck, deck.tripod)
        return
    axes = placed_axes(upright_axes(deck.deck_holes, FOOT_THICKNESS, -1.0), deck.rotation(), deck.centre)
    yield Joint(names.BASE_MOUNT, names.DECK, "deck", deck.screw, axes, grip_mm=FOOT_THICKNESS, thread_mm=DECK_MM)


def _on_tripod(deck: Deck, foot: TripodFoot) -> Iterator[Joint]:
    """The mount on its plate, and that on the tripod."""
    R = deck.rotation()
    yield Joint(
        names.BASE_MOUNT,
        names.TRIPOD_FOOT,
        held_in(foot.mount),
        deck.screw,
        placed_axes(upright_axes(deck.deck_holes, FOOT_THICKNESS, -1.0), R, deck.centre),
        grip_mm=FOOT_THICKNESS,
        thread_mm=foot.thickness if foot.mount.trap is None else OVER_NUTS,
        thread=foot.mount,
    )
    yield Joint(
        names.TRIPOD,
        names.TRIPOD_FOOT,
        held_in(foot.tripod),
        TRIPOD_SCREW,
        placed_axes(upright_axes([(0.0, 0.0)], -foot.thickness - DECK_MM, 1.0), R, deck.centre),
        grip_mm=DECK_MM,
        thread_mm=foot.thickness if foot.tripod.trap is None else FLOOR,
        thread=foot.tripod,
        stands_out_mm=STANDS_OUT,
        heel_mm=HEEL,
    )


def _bar(bar: Counterweight) -> Joint:
    """The counterweight on the ear of the hub, from below."""
    ear, slide = bar.ear, bar.ear.slots[0]
    x, y = math.cos(ear.azimuth), math.sin(ear.azimuth)
    return Joint(
        names.ALIGNMENT_LINKAGE,
        names.COUNTERWEIGHT,
        "thread",
        BAR_SCREW,
        upright_axes(((at * x, at * y) for at in bar.screws), ear.low, 1.0),
        grip_mm=ear.high - ear.low,
        thread_mm=bar.section[1],
        slot_mm=(ear.slot_width, slide[1] - slide[0] + ear.slot_width),
    )
