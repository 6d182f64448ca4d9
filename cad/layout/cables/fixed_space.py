"""Space for a cable that does not turn: clear of servo, ring and mount, over the deck, below all that turns.

Rotation frame at gamma = 0, mm. Parts are represented by boxes, cylinders and hulls.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from scanwright.cad.layout.cables.obstacles import Shape, clear_of, farther, shape_of
from scanwright.cad.layout.deck import Deck
from scanwright.cad.layout.drive import Cuboid, Rod
from scanwright.cad.layout.envelope import around_axis, box_corners
from scanwright.cad.layout.placement import Placement
from scanwright.design.arrays import Array, Mask


@dataclass(frozen=True, slots=True)
class FixedSpace:
    """Space for a cable that does not turn."""

    shapes: tuple[Shape, ...]  # convex shapes to avoid
    ceiling: float  # height below all that turns
    deck: Deck  # that it lies on
    others: tuple[Array, float]  # middles of earlier cables, shape (n, 3), and the largest radius of one

    def free(self, points: Array, half: float, gap: float) -> Mask:
        """Return whether a ball of radius `half` at each point (n, 3) keeps `gap` to everything, shape (n,)."""
        apart = half + gap
        over_deck = (points - np.array(self.deck.centre)) @ np.array(self.deck.normal)
        clear = (points[:, 2] < self.ceiling - apart) & (over_deck > half)
        middles, radius = self.others
        left = np.flatnonzero(clear)
        clear[left] = clear_of(self.shapes, points[left], apart) & farther(points[left], middles, radius + apart)
        return np.asarray(clear)

    def with_cable(self, middles: Array, radius: float) -> FixedSpace:
        """Return the space that a cable leaves."""
        return replace(self, others=(np.concatenate([middles, self.others[0]]), max(radius, self.others[1])))


def fixed_space_of(place: Placement, avoid: Iterable[Shape]) -> FixedSpace:
    """Return the space around all that does not turn, without cables; `avoid` are shapes of parts."""
    products = [_around(each.shape) for each in place.drive.stations if each.shape is not None]
    shapes = (*(shape_of(corners) for corners in products), *avoid)
    return FixedSpace(shapes, place.drive.ceiling, place.deck, (np.zeros((0, 3)), 0.0))


def _around(shape: Cuboid | Rod) -> Array:
    if isinstance(shape, Rod):
        return around_axis(shape.radius, shape.low, shape.high)
    return box_corners((shape.low, shape.high))
