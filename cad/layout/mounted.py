"""What a base mount holds, as the deck sees it. Plain numpy; rotation frame at gamma = 0, mm."""

from __future__ import annotations

from dataclasses import dataclass

from cad.screws import Screw
from design.frames import Array


@dataclass(frozen=True, slots=True)
class Carried:
    """The servo's case, or a tower, above the mount's rails.

    Attributes:
        rear: height of its face towards the mount.
        ears: height of the faces around its holes.
        screw: that goes through the mount into them.
        holes: x and y of the four.
        corners: of boxes around all that stands still, shape (n, 3).
        discs: radius and height of what else must stay clear of the deck, round about the axis.
        stands_alone: whether it may stand on a flat deck without a mount where the axis is upright.
    """

    rear: float
    ears: float
    screw: Screw
    holes: tuple[tuple[float, float], ...]
    corners: Array
    discs: tuple[tuple[float, float], ...]
    stands_alone: bool
