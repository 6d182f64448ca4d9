"""Joint of a lidar's cable with a lead of the ring: crimps side by side in a shrink tube.

The tube is thicker than the bundle: it is on the longest straight piece with enough space for it, behind the first
bend.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scanwright.cad.layout.cables.obstacles import farther
from scanwright.cad.layout.cables.path import Path, PathPiece
from scanwright.cad.layout.cables.route import GAP, CableSpace
from scanwright.design.arrays import Array

LENGTH = 12.0  # crimps side by side, and a shrink tube over them
WALL = 0.5  # of the shrink tube; a tenth of the gap to other leads remains
STEP = 3.0  # between two tested places, and two points of a joint


@dataclass(frozen=True, slots=True)
class LeadJoint:
    """The piece of a path with the joint of `LENGTH`, and the offset from the middle of the piece."""

    piece: PathPiece
    off: float

    @property
    def along(self) -> Array:
        """Its direction, shape (3,)."""
        return np.asarray((self.piece.end - self.piece.start) / self.piece.length)

    @property
    def middle(self) -> Array:
        """Shape (3,)."""
        return self.piece.middle + self.off * self.along

    def points(self) -> Array:
        """Return points from one end to the other, shape (n, 3)."""
        return np.asarray(self.middle + np.arange(-LENGTH / 2, LENGTH / 2 + STEP / 2, STEP)[:, None] * self.along)


def joint_of(path: Path, half: float, space: CableSpace, others: Sequence[tuple[Array, float]]) -> LeadJoint | None:
    """Return the joint of a lead with radius `half`; None if no straight piece is long enough.

    `others` are middles of the other leads, shape (n, 3), and their distance from the middle of the joint.
    """
    places = [place for piece in straights(path) for place in _places(piece)]
    for place in places:
        points = place.points()
        if space.free(points, half + WALL, GAP - WALL).all() and all(farther(points, *other).all() for other in others):
            return place
    return places[0] if places else None  # the check of clearances then fails


def straights(path: Path) -> list[PathPiece]:
    """Return the straight pieces behind the first bend, the longest first."""
    pieces = path.pieces()
    bend = next((i for i, piece in enumerate(pieces) if not piece.straight), -1)
    return sorted((piece for piece in pieces[bend + 1 :] if piece.straight), key=lambda piece: -piece.length)


def _places(piece: PathPiece) -> list[LeadJoint]:
    """Return joints from the middle of a piece to its ends."""
    most = (piece.length - LENGTH) / 2
    steps = np.linspace(0.0, most, math.ceil(most / STEP) + 1).tolist() if most >= 0 else []
    return [LeadJoint(piece, off) for off in dict.fromkeys(side * step for step in steps for side in (-1.0, 1.0))]
