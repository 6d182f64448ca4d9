"""Flat pieces of the surfaces that two stands have in common: cubes of an octree in which all points lie on a plane.

The planes found here are a start only. A beam belongs to a piece if it crosses the piece's plane there
(`firmware_io.registration.surfels.beams`), whatever its noise did to the point: else the cube behind a wall, which
catches the far tail of the noise, would count as a wall of its own.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64, Int64
from numpy import ndarray

from scanwright.design.arrays import Floats, Ints

_LEVELS = 4  # edges of 1, 2, 4 and 8 spacings
_FINEST = 2.5  # times the spacing: the edge of the smallest cubes
_REACH = 1.5  # times the spacing: how far off its plane a beam of a piece may end
_THICK = 0.5  # times the spacing: standard deviation across the plane
_FLAT = 0.05  # of the variance along the plane's short side, at most, lies across
_FOREIGN = 0.01  # share of the points of a cube that may lie off its plane
_FEW = 10  # points of either stand
_BITS = 21  # of a cell along each axis: three of them fit an int64


class Cells(NamedTuple):
    """Pieces of surface in the frame of the first stand, in the order in which a beam is tested against them."""

    low_m: Floats  # lowest corner of the cube, shape (n, 3)
    edge_m: Floats  # its edge, shape (n,)
    centre_m: Floats  # a point of the plane, shape (n, 3)
    axes: Floats  # rows are two directions in the plane and its normal, shape (n, 3, 3)
    reach_m: float  # how far off its plane a beam of a piece may end

    @property
    def number(self) -> int:
        """How many."""
        return len(self.edge_m)

    def select(self, keep: Bool[ndarray, " n"]) -> Cells:
        """Those that are marked."""
        return Cells(self.low_m[keep], self.edge_m[keep], self.centre_m[keep], self.axes[keep], self.reach_m)

    def moved(self, shift: Float64[ndarray, "n 3"], reach_m: float) -> Cells:
        """With planes raised by `shift` [m]: at the centre, and at one edge from it along either axis."""
        u, v, normal = np.moveaxis(self.axes, 1, 0)
        height, slope = shift[:, :1], shift[:, 1:] / self.edge_m[:, None]
        tilted = normal - slope[:, :1] * u - slope[:, 1:] * v
        tilted /= np.linalg.norm(tilted, axis=1)[:, None]
        u = u - np.einsum("ij,ij->i", u, tilted)[:, None] * tilted
        u /= np.linalg.norm(u, axis=1)[:, None]
        axes = np.stack([u, np.cross(tilted, u), tilted], axis=1)
        return self._replace(centre_m=self.centre_m + height * normal, axes=axes, reach_m=reach_m)


class Lookup(NamedTuple):
    """The pieces that a point may belong to, by small cubes."""

    edge_m: float  # of the cubes that are looked up
    keys: Ints  # numbers of those that have a piece near, ascending, shape (k,)
    first: Ints  # where the pieces of each begin in `cells`, shape (k + 1,)
    cells: Ints  # numbers of pieces, ascending within a cube


def find_cells(
    points_m: Float64[ndarray, "n 3"],
    counts: Int64[ndarray, " n"],
    ours: Bool[ndarray, " n"],
    eyes_m: Float64[ndarray, "2 3"],
    spacing_m: float,
) -> Cells:
    """The largest cubes of the octree in which all lies on one plane that both stands saw from the same side.

    Args:
        points_m: means of voxels of both stands in one frame, shape (n, 3).
        counts: points in each voxel, shape (n,).
        ours: whether they are the first stand's, shape (n,).
        eyes_m: the optical centres of both, shape (2, 3).
        spacing_m: edge of the voxels.
    """
    results = []
    reach_m = _REACH * spacing_m
    for level in reversed(range(_LEVELS)):
        edge_m = _FINEST * spacing_m * 2**level
        _, cube = np.unique(cube_keys(points_m, edge_m), return_inverse=True)
        total = np.bincount(cube, counts)
        mean = _sums(cube, points_m * counts[:, None]) / total[:, None]
        off = points_m - mean[cube]
        spread = _sums(cube, (off[:, :, None] * off[:, None] * counts[:, None, None]).reshape(-1, 9))
        values, vectors = np.linalg.eigh((spread / total[:, None]).reshape(-1, 3, 3))
        axes = np.ascontiguousarray(np.swapaxes(vectors, 1, 2)[:, ::-1])
        across = np.abs(np.einsum("ij,ij->i", off, axes[cube, 2]))
        foreign = np.bincount(cube, counts * (across > reach_m))
        theirs = np.bincount(cube, counts * ~ours)
        sides = np.einsum("cj,ecj->ec", axes[:, 2], eyes_m[:, None] - mean)
        flat = (
            (values[:, 0] < (_THICK * spacing_m) ** 2)
            & (values[:, 0] < _FLAT * values[:, 1])
            & (foreign <= _FOREIGN * total)
            & (np.minimum(theirs, total - theirs) >= _FEW)
            & (sides[0] * sides[1] > 0)
        )
        low_m = np.floor(mean[flat] / edge_m) * edge_m
        results.append((low_m, np.full(len(low_m), edge_m), mean[flat], axes[flat]))
        rest = ~flat[cube]
        points_m, counts, ours = points_m[rest], counts[rest], ours[rest]
        if not len(points_m):
            break
    low_m, edge, centre, directions = (np.concatenate(parts) for parts in zip(*results, strict=True))
    return Cells(low_m, edge, centre, directions, reach_m)


def look_up(cells: Cells) -> Lookup:
    """Sort the pieces into small cubes: each cube lists the pieces within reach."""
    edge_m = float(cells.edge_m.min())
    keys, numbers = [], []
    for edge in np.unique(cells.edge_m):
        mine = np.flatnonzero(cells.edge_m == edge)
        margin = int(np.ceil(cells.reach_m / edge_m))
        steps = np.arange(-margin, round(edge / edge_m) + margin) + 0.5
        grid = edge_m * np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
        middle = cells.low_m[mine, None] + grid
        off = np.einsum("cgj,cj->cg", middle - cells.centre_m[mine, None], cells.axes[mine, 2])
        row, column = np.nonzero(np.abs(off) < cells.reach_m + np.sqrt(0.75) * edge_m)
        keys.append(cube_keys(middle[row, column], edge_m))
        numbers.append(mine[row])
    key, number = np.concatenate(keys), np.concatenate(numbers)
    order = np.lexsort((number, key))
    unique, first = np.unique(key[order], return_index=True)
    return Lookup(edge_m, unique, np.append(first, len(key)), number[order])


def cube_keys(points_m: Float64[ndarray, "n 3"], edge_m: float) -> Int64[ndarray, " n"]:
    """Number of the cube around each point, shape (n,)."""
    a, b, c = (np.floor(points_m / edge_m).astype(np.int64) + (1 << (_BITS - 1))).T
    return (a << 2 * _BITS) | (b << _BITS) | c


def _sums(cube: Int64[ndarray, " n"], values: Floats) -> Floats:
    """Column sums by cube."""
    return np.stack([np.bincount(cube, column) for column in values.T], axis=1)
