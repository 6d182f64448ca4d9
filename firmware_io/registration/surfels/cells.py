"""Flat pieces of the common surfaces of two scan positions: cubes of an octree in which all points lie on a plane.

The planes found here are a start only. A beam belongs to a piece if it crosses the piece's plane there
(`firmware_io.registration.surfels.beams`), regardless of the noise of the point: else the cube behind a wall, which
contains the far tail of the noise, would count as a separate wall.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64, Int64
from numpy import ndarray

from scanwright.design.arrays import Floats, Ints
from scanwright.firmware_io.clouds.filters import voxel_sums

_LEVELS = 4  # edges of 1, 2, 4 and 8 spacings
_FINEST = 2.5  # times the spacing: the edge of the smallest cubes
_REACH = 1.5  # times the spacing: largest distance of a beam's end from the plane of its piece
_THICK = 0.5  # times the spacing: standard deviation across the plane
_FLAT = 0.05  # of the variance along the plane's short side, at most, lies across
_FOREIGN = 0.01  # share of the points of a cube that may lie off its plane
_FEW = 10  # points of either scan position
_BITS = 21  # of a cell along each axis: three of them fit an int64


class Cells(NamedTuple):
    """Pieces of surface in the frame of the first cloud, in the order in which a beam is tested against them."""

    low_m: Floats  # lowest corner of the cube, shape (n, 3)
    edge_m: Floats  # its edge, shape (n,)
    centre_m: Floats  # a point of the plane, shape (n, 3)
    axes: Floats  # rows are two directions in the plane and its normal, shape (n, 3, 3)
    reach_m: float  # largest distance of a beam's end from the plane of its piece

    @property
    def number(self) -> int:
        """Number of pieces."""
        return len(self.edge_m)

    def select(self, keep: Bool[ndarray, " n"]) -> Cells:
        """Return the pieces that are True in `keep`."""
        return Cells(self.low_m[keep], self.edge_m[keep], self.centre_m[keep], self.axes[keep], self.reach_m)

    def moved(self, shift: Float64[ndarray, "n 3"], reach_m: float) -> Cells:
        """Return the pieces with planes raised by `shift` [m]: at the centre, and one edge from it on either axis."""
        u, v, normal = np.moveaxis(self.axes, 1, 0)
        height, slope = shift[:, :1], shift[:, 1:] / self.edge_m[:, None]
        tilted = normal - slope[:, :1] * u - slope[:, 1:] * v
        tilted /= np.linalg.norm(tilted, axis=1)[:, None]
        u = u - np.einsum("ij,ij->i", u, tilted)[:, None] * tilted
        u /= np.linalg.norm(u, axis=1)[:, None]
        axes = np.stack([u, np.cross(tilted, u), tilted], axis=1)
        return self._replace(centre_m=self.centre_m + height * normal, axes=axes, reach_m=reach_m)


class Lookup(NamedTuple):
    """Index from small cubes to the pieces that a point in them may belong to."""

    edge_m: float  # of the small cubes
    keys: Ints  # numbers of the cubes with a piece near, ascending, shape (k,)
    first: Ints  # index of the first piece of each in `cells`, shape (k + 1,)
    cells: Ints  # numbers of pieces, ascending within a cube


def find_cells(
    points_m: Float64[ndarray, "n 3"],
    counts: Int64[ndarray, " n"],
    of_first: Bool[ndarray, " n"],
    eyes_m: Float64[ndarray, "2 3"],
    spacing_m: float,
) -> Cells:
    """Return the largest cubes of the octree with all points on one plane, measured from the same side by both clouds.

    The points are means of voxels of both clouds in one frame, with the points in each counted and those of the first
    cloud marked; `eyes_m` are the optical centres.
    """
    results = []
    reach_m = _REACH * spacing_m
    for level in reversed(range(_LEVELS)):
        edge_m = _FINEST * spacing_m * 2**level
        _, cube = np.unique(cube_keys(points_m, edge_m), return_inverse=True)
        total = np.bincount(cube, counts)
        mean = voxel_sums(cube, points_m * counts[:, None]) / total[:, None]
        off = points_m - mean[cube]
        spread = voxel_sums(cube, (off[:, :, None] * off[:, None] * counts[:, None, None]).reshape(-1, 9))
        values, vectors = np.linalg.eigh((spread / total[:, None]).reshape(-1, 3, 3))
        axes = np.ascontiguousarray(np.swapaxes(vectors, 1, 2)[:, ::-1])
        across = np.abs(np.einsum("ij,ij->i", off, axes[cube, 2]))
        foreign = np.bincount(cube, counts * (across > reach_m))
        of_second = np.bincount(cube, counts * ~of_first)
        sides = np.einsum("cj,ecj->ec", axes[:, 2], eyes_m[:, None] - mean)
        flat = (
            (values[:, 0] < (_THICK * spacing_m) ** 2)
            & (values[:, 0] < _FLAT * values[:, 1])
            & (foreign <= _FOREIGN * total)
            & (np.minimum(of_second, total - of_second) >= _FEW)
            & (sides[0] * sides[1] > 0)
        )
        low_m = np.floor(mean[flat] / edge_m) * edge_m
        results.append((low_m, np.full(len(low_m), edge_m), mean[flat], axes[flat]))
        rest = ~flat[cube]
        points_m, counts, of_first = points_m[rest], counts[rest], of_first[rest]
        if not len(points_m):
            break
    low_m, edge, centre, directions = (np.concatenate(parts) for parts in zip(*results, strict=True))
    return Cells(low_m, edge, centre, directions, reach_m)


def look_up(cells: Cells) -> Lookup:
    """Sort the pieces into small cubes: each cube lists the pieces within reach."""
    edge_m = float(cells.edge_m.min())
    keys, numbers = [], []
    for edge in np.unique(cells.edge_m):
        some = np.flatnonzero(cells.edge_m == edge)
        margin = int(np.ceil(cells.reach_m / edge_m))
        steps = np.arange(-margin, round(edge / edge_m) + margin) + 0.5
        grid = edge_m * np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
        middle = cells.low_m[some, None] + grid
        off = np.einsum("cgj,cj->cg", middle - cells.centre_m[some, None], cells.axes[some, 2])
        row, column = np.nonzero(np.abs(off) < cells.reach_m + np.sqrt(0.75) * edge_m)
        keys.append(cube_keys(middle[row, column], edge_m))
        numbers.append(some[row])
    key, number = np.concatenate(keys), np.concatenate(numbers)
    order = np.lexsort((number, key))
    unique, first = np.unique(key[order], return_index=True)
    return Lookup(edge_m, unique, np.append(first, len(key)), number[order])


def cube_keys(points_m: Float64[ndarray, "n 3"], edge_m: float) -> Int64[ndarray, " n"]:
    """Return the number of the cube around each point, shape (n,)."""
    a, b, c = (np.floor(points_m / edge_m).astype(np.int64) + (1 << (_BITS - 1))).T
    return (a << 2 * _BITS) | (b << _BITS) | c
