"""What moved: points that hang where another stand looked through.

The place of each point is looked up among the directions in which the other stand saw something. If its nearest
beams all ended well behind the point, nothing stood there then, and what the point was seen on has come or gone.

Input that cannot be used raises RecordingError.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64
from numpy import ndarray
from scipy.spatial import cKDTree

from scanwright.design.arrays import Vector
from scanwright.design.errors import RecordingError

_BEAMS = 10  # fewer lie on one side of a point, or all miss a thin thing: benchmarks/firmware_io/mapping/
_REACH = 2.0  # times the usual angle to the tenth beam: if they are farther off, it was not observed
_SAMPLE = 2000  # beams that show the step between neighbours
_NEIGHBOURS = 8  # of a point: a moved surface has more than its half
_NEAR_M = 0.15  # what is farther is of another thing
_AT_ONCE = 1 << 16  # points: bounds the memory


@dataclass(frozen=True, slots=True, eq=False)
class Stand:
    """Points that one place saw, in the frame of the map."""

    points_m: Float64[ndarray, "n 3"]  # shape (n, 3), finite
    eye_m: Vector  # optical centre of the scanner, shape (3,); NaN if unknown


def seen_through(positions: Sequence[Stand], beyond_m: float = 0.1) -> list[Bool[ndarray, " n"]]:
    """Points of each stand where another one looked through, shape (n,) each.

    A point counts as moved if the ten beams of another stand that pass next to it all ended more than `beyond_m`
    behind it: so many surround it, so that of the surface that it lies on one ends before it, however flat the surface
    is seen. Then it goes with the majority of its neighbours within 0.15 m. A beam without a return is
    no evidence. Points within `beyond_m` of a fixed surface, such as the soles of a foot, stay.

    Args:
        positions: at least two with a known eye, of one frame; others are left as they are.
        beyond_m: more than three times the noise, and than what the poses are off by.
    """
    if not 0 < beyond_m < np.inf:
        raise RecordingError(f"seen_through_m = {beyond_m}: must be above 0 and finite; 0.1 is usual")
    known = [k for k, stand in enumerate(positions) if np.isfinite(stand.eye_m).all()]
    if len(known) < 2:
        raise RecordingError(
            f"seen_through_m: {len(known)} clouds with a known scanner position, minimum 2: assemble one cloud per "
            "turn, and pass the angle set (`angles`) or `poses`"
        )
    moved = [np.zeros(len(stand.points_m), bool) for stand in positions]
    for k in known:
        looked = _Looked(positions[k])
        for other in known:
            if other != k:
                left = np.flatnonzero(~moved[other])
                moved[other][left] = looked.through(positions[other].points_m[left], beyond_m)
    return [_as_neighbours(stand.points_m, one) for stand, one in zip(positions, moved, strict=True)]


class _Looked:
    """How far one stand saw in each direction."""

    def __init__(self, stand: Stand) -> None:
        self._eye_m = stand.eye_m
        along, self._range_m = self._directions(stand.points_m)
        self._tree = cKDTree(along)
        sample = along[:: max(1, len(along) // _SAMPLE)]
        self._reach = _REACH * float(np.median(self._tree.query(sample, _BEAMS + 1)[0][:, -1]))  # inf of a few points

    def through(self, points_m: Float64[ndarray, "n 3"], beyond_m: float) -> Bool[ndarray, " n"]:
        """Points that it looked through by more than `beyond_m`."""
        marked = np.zeros(len(points_m), bool)
        if not np.isfinite(self._reach):
            return marked
        along, range_m = self._directions(points_m)
        for here, off, beam in _nearest(self._tree, along, _BEAMS, self._reach):
            there = np.isfinite(off).all(axis=1)
            ends_m = np.append(self._range_m, -np.inf)[beam].min(axis=1)
            marked[here] = there & (ends_m > range_m[here] + beyond_m)
        return marked

    def _directions(self, points_m: Float64[ndarray, "n 3"]) -> tuple[Float64[ndarray, "n 3"], Float64[ndarray, " n"]]:
        """Unit vectors from the eye, and ranges; a point at the eye has no direction, and is near none."""
        along = points_m - self._eye_m
        range_m = np.linalg.norm(along, axis=1)
        return along / np.where(range_m > 0, range_m, 1.0)[:, None], range_m


def _as_neighbours(points_m: Float64[ndarray, "n 3"], moved: Bool[ndarray, " n"]) -> Bool[ndarray, " n"]:
    """What more than half of the neighbours of each point are, itself among them."""
    if not moved.any():
        return moved
    marked = np.zeros_like(moved)
    padded = np.append(moved, False)
    for here, off, index in _nearest(cKDTree(points_m), points_m, _NEIGHBOURS + 1, _NEAR_M):
        marked[here] = 2 * padded[index].sum(axis=1) > np.isfinite(off).sum(axis=1)
    return marked


def _nearest(
    tree: cKDTree, points: Float64[ndarray, "n 3"], count: int, reach: float
) -> Iterator[tuple[slice, Float64[ndarray, "m k"], Int64[ndarray, "m k"]]]:
    """Which rows, the distances of their nearest in the tree, and their indices; inf and the tree's size if none."""
    for begin in range(0, len(points), _AT_ONCE):
        here = slice(begin, begin + _AT_ONCE)
        off, index = tree.query(points[here], count, distance_upper_bound=reach, workers=-1)
        yield here, off, index
