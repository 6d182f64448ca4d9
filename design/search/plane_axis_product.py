"""Moments of all scan planes about all axes as matrix products, computed in tiles, and the lowest J of each."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numba import njit
from numpy import ndarray

from scanwright.design.arrays import Array, Ints, Mask
from scanwright.design.concurrency.blocked_product import blocked_product, product
from scanwright.design.concurrency.parallel import in_chunks
from scanwright.design.objective.named_objectives import Moment, Objective
from scanwright.design.search.constraints import Constraint

PIECE, PART = 128, 4096  # planes and axes of a tile, which fits in the cache

BothOrientations = Callable[[slice, slice], tuple[Array, Array]]
"""A moment of some planes about some axes, (planes, axes): with the planes not flipped, and flipped."""


def gathered(
    moment: Moment, weights: Float[ndarray, "axes nodes"], g: Float[ndarray, "planes nodes"]
) -> Float[ndarray, "planes axes"]:
    """Return a moment of planes about each axis, from their g over the nodes."""
    if moment.gathered == "mean":
        return np.asarray(g @ weights.T)
    seen = weights > 0
    return np.stack([np.where(seen, row, -np.inf).max(axis=1) for row in g])


@dataclass(frozen=True, slots=True)
class Lowest:
    """The lowest J of each plane and about each axis."""

    by_plane: Array  # lowest J of a plane class, not flipped and flipped, over the axes of the grid, (2, planes)
    its_class: Ints  # class of the axis with that J, (2, planes)
    its_flip: Ints  # whether that axis is flipped, (2, planes)
    by_axis: Array  # lowest J about an axis class, not flipped and flipped, over the planes of the grid, (2, axes)


def lowest(
    objective: Objective,
    orientations: list[BothOrientations],
    has_plane: Mask,
    has_axis: Mask,
    constraints: Sequence[Constraint] = (),
) -> tuple[Lowest, Lowest]:
    """Return the lowest J of all mounts of the grid, and of those that meet constraints (inf if there are none).

    `orientations` compute the moments; `has_plane` (2, planes) and `has_axis` (2, axes) state whether the grid has a
    class not flipped, and flipped.
    """
    closed_axis, closed_plane = (np.where(has, 0, np.inf).astype(np.float32, "C") for has in (has_axis, has_plane))
    plain, feasible = _Running.over(closed_plane, closed_axis), _Running.over(closed_plane, closed_axis)

    def after(planes: slice) -> tuple[_Running, _Running]:
        """Return the minima after some of the planes; each thread has separate planes and minima about axes."""
        of_all, of_feasible = plain.with_own_axes(), feasible.with_own_axes()
        for part in _slices(0, has_axis.shape[1], PART):
            for piece in _slices(planes.start, planes.stop, PIECE):
                pairs = [orientation(piece, part) for orientation in orientations]
                straight, turned = (_joined(objective, [pair[i] for pair in pairs]) for i in (0, 1))
                of_all.lower(straight, turned, piece, part)
                for constraint in constraints:
                    for J, broken in zip((straight, turned), constraint.broken(piece, part), strict=True):
                        np.copyto(J, np.inf, where=broken)
                if constraints:
                    of_feasible.lower(straight, turned, piece, part)
        return of_all, of_feasible

    parts = in_chunks(after, has_plane.shape[1], smallest=PIECE)
    lows = [side.lowest([part[i].by_axis for part in parts]) for i, side in enumerate((plain, feasible))]
    return lows[0], lows[1] if constraints else lows[0]


def _joined(objective: Objective, moments: list[Array]) -> Array:
    return np.asarray(objective.join(np.stack(moments) if len(moments) > 1 else moments[0][None]), dtype=np.float32)


def _slices(start: int, stop: int, size: int) -> list[slice]:
    return [slice(first, min(first + size, stop)) for first in range(start, stop, size)]


@dataclass(frozen=True, slots=True)
class _Running:
    """Running minima, which each tile lowers; see `Lowest` for their shapes. Closed planes and axes have inf, not 0."""

    closed_plane: Array
    closed_axis: Array
    by_plane: Array
    its_class: Ints
    its_flip: Ints
    by_axis: Array

    @classmethod
    def over(cls, closed_plane: Array, closed_axis: Array) -> _Running:
        """Return the minima before the first tile."""
        none = np.zeros(closed_plane.shape, np.intp)
        by_plane, by_axis = (np.full(closed.shape, np.inf, np.float32) for closed in (closed_plane, closed_axis))
        return cls(closed_plane, closed_axis, by_plane, none, none.copy(), by_axis)

    def with_own_axes(self) -> _Running:
        """Return minima that share the arrays of planes, with new minima about axes, for one of several threads."""
        return replace(self, by_axis=np.full_like(self.by_axis, np.inf))

    def lower(self, straight: Array, turned: Array, piece: slice, part: slice) -> None:
        """Lower the minima by a tile of J: planes `piece` about axes `part`, not flipped and flipped."""
        first = (piece.start, part.start)
        closed = (self.closed_plane, self.closed_axis)
        _lower_planes(straight, turned, *first, *closed, self.by_plane, self.its_class, self.its_flip)
        _lower_axes(straight, turned, *first, *closed, self.by_axis)

    def lowest(self, by_axis: list[Array]) -> Lowest:
        """Return the minima, with those about axes of all threads."""
        lowest_about = np.min(by_axis, axis=0).astype(float)
        return Lowest(self.by_plane.astype(float), self.its_class, self.its_flip, lowest_about)


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"nnan", "nsz", "reassoc"})
def _lower_planes(
    straight: Array,
    turned: Array,
    plane: int,
    axis: int,
    closed_plane: Array,
    closed_axis: Array,
    by_plane: Array,
    its_class: Array,
    its_flip: Array,
) -> None:
    """Lower the minima of the planes of a tile; `plane` and `axis` are the indices of its first plane and axis."""
    columns = straight.shape[1]
    closed = closed_axis[:, axis : axis + columns]
    for c in range(len(straight)):
        lows = np.full(2, np.float32(np.inf))
        for a in range(columns):
            # a flipped plane about a flipped axis has the J of both not flipped
            J0, J1 = straight[c, a] + closed[0, a], turned[c, a] + closed[1, a]
            J = J0 if J0 < J1 else J1
            lows[0] = J if lows[0] > J else lows[0]
            J0, J1 = turned[c, a] + closed[0, a], straight[c, a] + closed[1, a]
            J = J0 if J0 < J1 else J1
            lows[1] = J if lows[1] > J else lows[1]
        for flip in range(2):
            low = lows[flip]
            if not low + closed_plane[flip, plane + c] < by_plane[flip, plane + c]:
                continue
            by_plane[flip, plane + c] = low + closed_plane[flip, plane + c]
            same, cross = (straight[c], turned[c]) if flip == 0 else (turned[c], straight[c])
            for a in range(columns):
                unflipped = same[a] + closed[0, a] == low
                if unflipped or cross[a] + closed[1, a] == low:
                    its_class[flip, plane + c], its_flip[flip, plane + c] = axis + a, 0 if unflipped else 1
                    break


@njit(cache=True, nogil=True, error_model="numpy")
def _lower_axes(
    straight: Array, turned: Array, plane: int, axis: int, closed_plane: Array, closed_axis: Array, by_axis: Array
) -> None:
    """Lower the minima about the axes of a tile; arguments as for `_lower_planes`."""
    columns = straight.shape[1]
    closed, lowest = closed_axis[:, axis : axis + columns], by_axis[:, axis : axis + columns]
    for c in range(len(straight)):
        for flip in range(2):
            same, cross = (straight[c], turned[c]) if flip == 0 else (turned[c], straight[c])
            for a in range(columns):
                J0, J1 = same[a] + closed_plane[0, plane + c], cross[a] + closed_plane[1, plane + c]
                J = (J0 if J0 < J1 else J1) + closed[flip, a]
                lowest[flip, a] = J if lowest[flip, a] > J else lowest[flip, a]


def both_orientations(moment: Moment, g: Array, weights: Array) -> BothOrientations:
    """Return the function for a moment over an odd number of polar nodes, g (planes, nodes) and weights (axes, nodes).

    Reversing g changes only the sign of its odd part, so the moments of both orientations are the sum and the
    difference of one product of the even parts and one of the odd parts.
    """
    if moment.gathered == "highest":
        seen = weights > 0
        turned_g = np.ascontiguousarray(g[:, ::-1])
        return lambda piece, part: (_highest(g[piece], seen[part]), _highest(turned_g[piece], seen[part]))
    g_even, g_odd = (part.astype(np.float32) for part in _parts(g))
    w_even, w_odd = (np.ascontiguousarray(part.T, dtype=np.float32) for part in _parts(weights))
    w_even[:-1] *= 2
    w_odd *= 2
    buffers = threading.local()  # new memory for each tile would cost as much time as the product

    def pair(piece: slice, part: slice) -> tuple[Array, Array]:
        rows, columns = len(range(len(g))[piece]), len(range(len(weights))[part])
        if not hasattr(buffers, "own"):
            buffers.own = np.empty((3, PIECE * min(PART, len(weights))), np.float32)
        even, odd, straight = (flat[: rows * columns].reshape(rows, columns) for flat in buffers.own)
        blocked_product(g_even[piece], w_even[:, part], even)
        blocked_product(g_odd[piece], w_odd[:, part], odd)
        np.add(even, odd, out=straight)
        return straight, np.subtract(even, odd, out=even)

    return pair


def one_orientation(moment: Moment, g: Array, weights: Array) -> BothOrientations:
    """Return the function for a moment over directions, for which flipped planes are not distinguished."""
    if moment.gathered == "highest":
        seen = weights > 0
        return lambda piece, part: (_highest(g[piece], seen[part]),) * 2
    single, rows = np.ascontiguousarray(weights.T, dtype=np.float32), g.astype(np.float32)

    def same(piece: slice, part: slice) -> tuple[Array, Array]:
        out = product(rows[piece], single[:, part])
        return out, out

    return same


def _highest(g: Array, seen: Mask) -> Array:
    """Return the highest g at the nodes with weight about each axis, shape (planes, axes)."""
    parts = in_chunks(lambda chunk: _highest_of(g.astype(np.float32), seen[chunk]), len(seen))
    return np.concatenate(parts, axis=1)


@njit(cache=True, nogil=True, error_model="numpy")
def _highest_of(g: Array, seen: Array) -> Array:
    out = np.full((len(g), len(seen)), -np.inf, np.float32)
    for a in range(len(seen)):
        for k in range(seen.shape[1]):
            if seen[a, k]:
                for c in range(len(g)):
                    out[c, a] = max(out[c, a], g[c, k])
    return out


def _parts(rows: Array) -> tuple[Array, Array]:
    """Return the even part (middle node last) and the odd part of rows over an odd number of polar nodes."""
    half = rows.shape[1] // 2
    upper, lower = rows[:, : half + 1], rows[:, ::-1][:, : half + 1]
    return (upper + lower) / 2, ((upper - lower) / 2)[:, :half]
