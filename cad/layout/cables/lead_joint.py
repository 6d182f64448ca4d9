"""The joint of a lead's wires with those of the ring, in a straight piece of its path."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from scanwright.cad.layout.cables.obstacles import farther
from scanwright.cad.layout.cables.route import GAP, CableSpace, Path, PathPiece
from scanwright.design.arrays import Array

JOINT_LENGTH = 12.0  # mm, crimps side by side, and a shrink tube over them
TUBE_WALL = 0.5  # of the shrink tube; a tenth of the gap to other leads remains
JOINT_STEP = 3.0  # between two tested places, and two points of a joint


@dataclass(frozen=True, slots=True)
class LeadJoint:
    """The piece of a path with the joint of `JOINT_LENGTH`, and the offset from the middle of the piece."""

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
        return np.asarray(
            self.middle
            + np.arange(-JOINT_LENGTH / 2, JOINT_LENGTH / 2 + JOINT_STEP / 2, JOINT_STEP)[:, None] * self.along
        )


def joint_of(path: Path, half: float, space: CableSpace, others: Sequence[tuple[Array, float]]) -> LeadJoint | None:
    """Return the joint of a lead with radius `half`; None if no straight piece is long enough.

    `others` are middles of the other leads, shape (n, 3), and their distance from the middle of the joint.
    """
    places = [place for piece in straights(path) for place in _places(piece)]
    for place in places:
        points = place.points()
        if space.free(points, half + TUBE_WALL, GAP - TUBE_WALL).all() and all(
            farther(points, *other).all() for other in others
        ):
            return place
    return places[0] if places else None  # the check of clearances then fails


def straights(path: Path) -> list[PathPiece]:
    """Return the straight pieces behind the first bend, the longest first."""
    pieces = path.pieces()
    bend = next((i for i, piece in enumerate(pieces) if not piece.straight), -1)
    return sorted((piece for piece in pieces[bend + 1 :] if piece.straight), key=lambda piece: -piece.length)


def _places(piece: PathPiece) -> list[LeadJoint]:
    """Return joints from the middle of a piece to its ends."""
    most = (piece.length - JOINT_LENGTH) / 2
    steps = np.linspace(0.0, most, math.ceil(most / JOINT_STEP) + 1).tolist() if most >= 0 else []
    return [LeadJoint(piece, off) for off in dict.fromkeys(side * step for step in steps for side in (-1.0, 1.0))]


def first_with_place(paths: Iterable[Path | None]) -> Path | None:
    """Return the first path with place for a joint; if there is none, the first path."""
    first: Path | None = None
    for path in paths:
        if path is not None and any(_places(piece) for piece in straights(path)):
            return path
        first = first or path
        if first is None:  # longer pieces do not help
            break
    return first
