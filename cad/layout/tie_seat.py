"""A slotted tab for a cable tie. Millimetres."""

import math
from dataclasses import dataclass

import numpy as np

from scanwright.design.arrays import Array

SLOT_ALONG, SLOT_ACROSS = 3.2, 1.8  # for a tie 2.5 wide and 1.1 thick
SLOT_WALL = 2.0  # outside a slot
GROOVE = 1.6  # depth of the tie's groove if something is on the tab


@dataclass(frozen=True, slots=True, kw_only=True)
class TieSeat:
    """A tab with a slot on either side of the cable, along a direction across z."""

    azimuth: float  # of the direction [rad]
    aside: float = 0.0  # distance of its middle line from the z axis, counter-clockwise from the direction
    inner: float  # its start, inside of the part that carries it
    first: float  # start of the slots
    low: float  # its lower face
    high: float  # its upper face
    half: float  # half distance of the slots
    grooved: bool = False  # whether the tie is in a groove of its upper face, or of the lower one if `below`
    below: bool = False  # see `grooved`

    @property
    def last(self) -> float:
        """Where the slots end."""
        return self.first + SLOT_ALONG

    @property
    def end(self) -> float:
        """Where it ends."""
        return self.last + SLOT_WALL

    @property
    def half_width(self) -> float:
        """Half the width of the entire tab."""
        return self.half + SLOT_ACROSS + SLOT_WALL

    def direction(self) -> Array:
        """Return the unit vector outwards, shape (3,)."""
        return np.array([math.cos(self.azimuth), math.sin(self.azimuth), 0.0])

    def points(self, along: Array, across: Array, z: Array) -> Array:
        """Return the grid of points at places along, across and above it, shape (n, 3)."""
        x, y, height = (each.ravel() for each in np.meshgrid(along, across + self.aside, z, indexing="ij"))
        out = self.direction()
        return x[:, None] * out + y[:, None] * [-out[1], out[0], 0.0] + height[:, None] * [0.0, 0.0, 1.0]

    def corners(self, inner: float) -> Array:
        """Return corners of the tab from a place outwards, shape (8, 3)."""
        across = np.array([-self.half_width, self.half_width])
        return self.points(np.array([inner, self.end]), across, np.array([self.low, self.high]))
