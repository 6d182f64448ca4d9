"""Where a cable may run that stands still: beside servo, ring and mount, over the deck, below all that turns.

Rotation frame at gamma = 0, mm. Parts are taken for boxes, cylinders and hulls around them, as those of the rotor are.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from scanwright.cad import outlines
from scanwright.cad.layout.belt.stack import FOOT, FOOT_HALF, PLATE, SHELF, BeltStack, case_corners, drive_corners
from scanwright.cad.layout.cables.obstacles import Shape, around_axis, beside, farther, shape_of
from scanwright.cad.layout.deck import (
    BACK_THICKNESS,
    FOOT_THICKNESS,
    PLUG_GAP,
    RAIL_INSET,
    STRUT_BEHIND,
    Deck,
    strut_corners,
)
from scanwright.cad.layout.direct import adapter
from scanwright.cad.layout.direct.cage import SEAT_GAP, plate_half_x
from scanwright.cad.layout.direct.frame import frame_of, needs_frame
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.envelope import box_corners
from scanwright.cad.layout.layout import Layout
from scanwright.cad.screws import SCREWS
from scanwright.design.arrays import Array, Mask

RAIL_HALF = 5.0  # of the mount's rails, at most


@dataclass(frozen=True, slots=True)
class StandingRoom:
    """What a cable that stands still must stay clear of.

    Attributes:
        shapes: convex shapes.
        ceiling: height below all that turns.
        deck: that it lies on.
        others: middles of cables that run already, shape (n, 3), and the largest radius of one.
    """

    shapes: tuple[Shape, ...]
    ceiling: float
    deck: Deck
    others: tuple[Array, float]

    def free(self, points: Array, half: float, gap: float) -> Mask:
        """Whether a ball of radius `half` about each point, shape (n, 3), keeps `gap` to everything, shape (n,)."""
        room = half + gap
        over_deck = (points - np.array(self.deck.centre)) @ np.array(self.deck.normal)
        clear = (points[:, 2] < self.ceiling - room) & (over_deck > half)
        middles, radius = self.others
        left = np.flatnonzero(clear)
        clear[left] = beside(self.shapes, points[left], room) & farther(points[left], middles, radius + room)
        return np.asarray(clear)

    def beside(self, middles: Array, radius: float) -> StandingRoom:
        """The room that is left beside a cable."""
        return replace(self, others=(np.concatenate([middles, self.others[0]]), max(radius, self.others[1])))


def standing_room_of(layout: Layout) -> StandingRoom:
    """The room around all that stands still, no cable in it yet."""
    stack = layout.stack
    if isinstance(stack, BeltStack):
        shapes, ceiling = [shape_of(corners) for corners in _belt(stack)], stack.tower_top - SHELF
    else:
        shapes = [shape_of(corners) for corners in _direct(layout, stack)]
        ceiling = stack.ring_top if stack.bearing is None else stack.cage_top
    if not layout.deck.flat:
        shapes += _mount(layout)
    return StandingRoom(tuple(shapes), ceiling, layout.deck, (np.zeros((0, 3)), 0.0))


def _direct(layout: Layout, stack: DirectStack) -> Iterator[Array]:
    """Case, ring, and what stands on the case around it."""
    servo = layout.scanner.servo
    (x0, y0, z0), (x1, y1, z1) = servo.case_min_mm, servo.case_max_mm
    front = stack.horn + z1 + SEAT_GAP
    yield box_corners(((x0, y0, stack.horn + z0), (x1, y1, stack.horn + z1)))
    if needs_frame(servo):
        yield from (box_corners(leg) for leg in frame_of(layout.scanner, stack).legs())
    if stack.bearing is not None:
        yield around_axis(stack.cage_outer, front, stack.cage_top)
        wide = plate_half_x(servo, SCREWS[servo.front.screw])
        yield box_corners(((-wide, y0, front), (wide, 0.0, stack.ring_bottom)))
    elif stack.ring_length > 0:
        outer = max(stack.ring_radius + adapter.PLAY + adapter.ARM, plate_half_x(servo, SCREWS[servo.front.screw]))
        yield around_axis(stack.ring_radius, stack.ring_bottom, stack.ring_top)
        yield box_corners(((-outer, -adapter.ARM_HALF_WIDTH, front), (outer, adapter.ARM_HALF_WIDTH, stack.ring_top)))
        yield box_corners(((-outer, y0, front), (outer, adapter.ARM_HALF_WIDTH, front + adapter.PLATE)))


def _belt(stack: BeltStack) -> Iterator[Array]:
    """Tower with its foot, the servo beside it and its plate."""
    yield around_axis(stack.wide_radius, stack.tower_bottom, stack.tower_top)
    flares = max(0.0, math.sqrt(2) * FOOT_HALF - stack.wide_radius)  # the cone on the foot, at 45 deg
    foot = stack.tower_bottom + FOOT + flares
    yield box_corners(((-FOOT_HALF, -FOOT_HALF, stack.tower_bottom), (FOOT_HALF, FOOT_HALF, foot)))
    yield case_corners(stack)
    corners = drive_corners(stack)
    low = np.where(np.arange(3) == 2, stack.tower_top - SHELF, corners.min(axis=0))
    high = np.where(np.arange(3) == 2, stack.tower_top + PLATE, corners.max(axis=0))
    yield box_corners((tuple(low.tolist()), tuple(high.tolist())))


def _mount(layout: Layout) -> list[Shape]:
    """Back plate, rails, strut and foot; what is under the foot is below the face of the deck."""
    deck, mounted = layout.deck, layout.drive.mounted
    (x, y), (_, cy, cz) = deck.back_half, deck.back_centre
    boxes = [((-x, cy - y, cz - BACK_THICKNESS), (x, cy + y, cz))]
    for side in (1.0, -1.0):
        middle, along = side * abs(mounted.holes[0][0]), y - RAIL_INSET
        boxes.append(((middle - RAIL_HALF, cy - along, cz), (middle + RAIL_HALF, cy + along, cz + PLUG_GAP)))
    strut = shape_of(strut_corners(deck))
    front = np.array([[0.0, 0.0, 1.0, STRUT_BEHIND - cz]])
    outline = outlines.octagon(*deck.foot)
    layers = [np.column_stack([outline, np.full(8, z)]) for z in (0.0, FOOT_THICKNESS)]
    foot = np.concatenate(layers) @ deck.rotation().T + np.array(deck.centre)
    return [
        *(shape_of(box_corners(box)) for box in boxes),
        replace(strut, planes=np.concatenate([strut.planes, front])),
        shape_of(foot),
    ]
