"""Products of all scan planes with all axes, made in pieces, of which only the lowest along each side stays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numba import njit
from numpy import ndarray

from design.arrays import Array, Ints, Mask
from design.concurrency.parallel import in_chunks
from design.objective.named_objectives import Moment, Objective
from design.search.constraints import Constraint

PIECE = 128  # planes per piece of the product

BothWays = Callable[[slice], tuple[Array, Array]]
"""A moment of a piece of planes about all axes, (planes, axes): straight, and with the planes turned round."""


def gathered(moment: Moment, weights: Float[ndarray, "... axes nodes"], g: Float[ndarray, " nodes"]) -> Array:
    """A moment of one plane about each axis, from its g over the nodes, shape (axes,)."""
    return weights @ g if moment.gathered == "mean" else np.where(weights > 0, g, -np.inf).max(axis=1)


@dataclass(frozen=True, slots=True)
class Lowest:
    """The lowest J along each side of the products.

    Attributes:
        by_plane: lowest J of a plane class, not flipped and flipped, over the axes of the grid, (2, planes).
        its_class: axis class where that was, (2, planes).
        its_flip: whether that axis is flipped, (2, planes).
        by_axis: lowest J about an axis class, not flipped and flipped, over the planes of the grid, (2, axes).
    """

    by_plane: Array
    its_class: Ints
    its_flip: Ints
    by_axis: Array


def lowest(
    objective: Objective,
    ways: list[BothWays],
    has_plane: Mask,
    has_axis: Mask,
    constraints: Sequence[Constraint] = (),
) -> tuple[Lowest, Lowest]:
    """Lowest J of every plane and about every axis: of all settings of the grid, and of those that keep constraints.

    Args:
        objective: joins the moments.
        ways: of each moment.
        has_plane: whether the grid has a plane class not flipped, and flipped, (2, planes).
        has_axis: the same of axes, (2, axes).
        constraints: what settings must keep; where none keeps them J is inf.
    """
    closed_axis = np.where(has_axis, 0, np.inf).astype(np.float32)
    closed_plane = np.where(has_plane, 0, np.inf).astype(np.float32)
    plain: list[_Piece] = []
    kept: list[_Piece] = []
    for first in range(0, has_plane.shape[1], PIECE):
        piece = slice(first, min(first + PIECE, has_plane.shape[1]))
        pairs = [way(piece) for way in ways]
        both = [np.ascontiguousarray(objective.join(np.stack([pair[i] for pair in pairs]))) for i in (0, 1)]
        plain.append(_lowest_of_piece(both, closed_plane[:, piece], closed_axis))
        for constraint in constraints:
            for J, broken in zip(both, constraint.broken(piece), strict=True):
                J[broken] = np.inf
        kept.append(_lowest_of_piece(both, closed_plane[:, piece], closed_axis) if constraints else plain[-1])
    return _joined(plain), _joined(kept)


_Piece = tuple[Array, Ints, Ints, Array]


def _joined(pieces: list[_Piece]) -> Lowest:
    by_plane, its_class, its_flip = (np.concatenate([piece[i] for piece in pieces], axis=1) for i in range(3))
    by_axis = np.minimum.reduce([piece[3] for piece in pieces])
    return Lowest(by_plane.astype(float), its_class, its_flip, by_axis.astype(float))


def _lowest_of_piece(both: list[Array], closed_plane: Array, closed_axis: Array) -> _Piece:
    parts = _in_parts(both[0], both[1], closed_plane, closed_axis)
    starts = np.cumsum([0, *(part[3].shape[1] for part in parts)])[:-1]
    lows = np.stack([part[0] for part in parts])
    which = lows.argmin(axis=0)
    flips, rows = np.indices(which.shape)
    its_class = np.stack([part[1] for part in parts])[which, flips, rows] + starts[which]
    its_flip = np.stack([part[2] for part in parts])[which, flips, rows]
    return lows[which, flips, rows], its_class, its_flip, np.concatenate([part[3] for part in parts], axis=1)


def _in_parts(
    straight: Array, turned: Array, closed_plane: Array, closed_axis: Array
) -> list[tuple[Array, Ints, Ints, Array]]:
    """`_lowest_of` the axes in parts, on all cores."""
    return in_chunks(
        lambda chunk: _lowest_of(straight[:, chunk], turned[:, chunk], closed_plane, closed_axis[:, chunk]),
        straight.shape[1],
        smallest=256,
    )


@njit(cache=True, nogil=True)
def _lowest_of(
    straight: Array, turned: Array, closed_plane: Array, closed_axis: Array
) -> tuple[Array, Array, Array, Array]:
    """Lowest J of planes, the axis it is about and its flip, (2, planes) each, and about axes, (2, axes)."""
    planes, axes = straight.shape
    by_plane = np.full((2, planes), np.float32(np.inf))
    its_class = np.zeros((2, planes), np.intp)
    its_flip = np.zeros((2, planes), np.intp)
    by_axis = np.full((2, axes), np.float32(np.inf))
    for c in range(planes):
        for flip in range(2):
            low, where, other = np.float32(np.inf), 0, 0
            for a in range(axes):
                same = straight[c, a] if flip == 0 else turned[c, a]
                cross = turned[c, a] if flip == 0 else straight[c, a]
                # an axis that is flipped as well comes the same way round
                J0 = same + closed_axis[0, a]
                J1 = cross + closed_axis[1, a]
                if low > J0:
                    low, where, other = J0, a, 0
                if low > J1:
                    low, where, other = J1, a, 1
            by_plane[flip, c] = low + closed_plane[flip, c]
            its_class[flip, c], its_flip[flip, c] = where, other
        for flip in range(2):
            for a in range(axes):
                same = straight[c, a] if flip == 0 else turned[c, a]
                cross = turned[c, a] if flip == 0 else straight[c, a]
                J = min(same + closed_plane[0, c], cross + closed_plane[1, c]) + closed_axis[flip, a]
                by_axis[flip, a] = min(by_axis[flip, a], J)
    return by_plane, its_class, its_flip, by_axis


def both_ways(moment: Moment, g: Array, weights: Array) -> BothWays:
    """A moment over polar nodes, an odd number of them, g (planes, nodes) and weights (axes, nodes).

    Reversing g changes the sign of its odd part only, so both ways round cost one product of the even parts and one
    of the odd parts: the moments are their sum and their difference.
    """
    if moment.gathered == "highest":
        seen = weights > 0
        return lambda piece: (_highest(g[piece], seen), _highest(np.ascontiguousarray(g[piece, ::-1]), seen))
    g_even, g_odd = (part.astype(np.float32) for part in _parts(g))
    w_even, w_odd = (np.ascontiguousarray(part.T, dtype=np.float32) for part in _parts(weights))
    w_even[:-1] *= 2
    w_odd *= 2

    room = np.empty((3, PIECE, len(weights)), np.float32)  # fresh memory for each piece costs more than its product

    def pair(piece: slice) -> tuple[Array, Array]:
        rows = len(range(len(g))[piece])
        even, odd, straight = room[:, :rows]
        np.matmul(g_even[piece], w_even, out=even)
        np.matmul(g_odd[piece], w_odd, out=odd)
        np.add(even, odd, out=straight)
        return straight, np.subtract(even, odd, out=even)

    return pair


def one_way(moment: Moment, g: Array, weights: Array) -> BothWays:
    """A moment over directions that nothing turns round: both ways are the same, and the grid has only one."""
    if moment.gathered == "highest":
        seen = weights > 0
        return lambda piece: (_highest(g[piece], seen),) * 2
    single = np.ascontiguousarray(weights.T, dtype=np.float32)
    return lambda piece: (g[piece].astype(np.float32) @ single,) * 2


def _highest(g: Array, seen: Mask) -> Array:
    """The highest g among the nodes that each axis sees, shape (planes, axes)."""
    parts = in_chunks(lambda chunk: _highest_of(g.astype(np.float32), seen[chunk]), len(seen))
    return np.concatenate(parts, axis=1)


@njit(cache=True, nogil=True)
def _highest_of(g: Array, seen: Array) -> Array:
    out = np.full((len(g), len(seen)), -np.inf, np.float32)
    for a in range(len(seen)):
        for k in range(seen.shape[1]):
            if seen[a, k]:
                for c in range(len(g)):
                    out[c, a] = max(out[c, a], g[c, k])
    return out


def _parts(rows: Array) -> tuple[Array, Array]:
    """Even part (middle node last) and odd part of rows over an odd number of polar nodes."""
    half = rows.shape[1] // 2
    upper, lower = rows[:, : half + 1], rows[:, ::-1][:, : half + 1]
    return (upper + lower) / 2, ((upper - lower) / 2)[:, :half]
