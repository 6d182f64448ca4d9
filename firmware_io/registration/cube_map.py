"""Cube map of directions, to look up in constant time what a scanner measured in a direction.

The faces are cut evenly in angle (the tangent warp), so that the solid angles of the cells differ by a third at most.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from numba import njit
from numpy import ndarray
from numpy.typing import NDArray

from scanwright.design.arrays import Floats


@njit(cache=True)
def cells_of(points_m: Floats, side: int) -> NDArray[np.int32]:
    """Return the cell of the direction from the origin to each point, (n,), of `6 * side * side` cells."""
    cells = np.empty(points_m.shape[0], np.int32)
    for i in range(points_m.shape[0]):
        x, y, z = points_m[i, 0], points_m[i, 1], points_m[i, 2]
        ax, ay, az = abs(x), abs(y), abs(z)
        if ax >= ay and ax >= az:
            face, major, u, v = (0 if x > 0 else 1), ax, y, z
        elif ay >= az:
            face, major, u, v = (2 if y > 0 else 3), ay, z, x
        else:
            face, major, u, v = (4 if z > 0 else 5), az, x, y
        column = min(side - 1, int((np.arctan2(u, major) / (np.pi / 2) + 0.5) * side))
        row = min(side - 1, int((np.arctan2(v, major) / (np.pi / 2) + 0.5) * side))
        cells[i] = (face * side + row) * side + column
    return cells


def solid_angles_sr(side: int) -> Float64[ndarray, " cells"]:
    """Return the exact solid angle of every cell, shape (6 * side * side,)."""
    edge = np.tan(np.linspace(-np.pi / 4, np.pi / 4, side + 1))
    u, v = np.meshgrid(edge, edge)
    corner = np.arctan2(u * v, np.sqrt(u**2 + v**2 + 1))
    face = corner[1:, 1:] - corner[:-1, 1:] - corner[1:, :-1] + corner[:-1, :-1]
    return np.tile(face.ravel(), 6)


@dataclass(frozen=True, slots=True, eq=False)
class DepthMap:
    """Ranges to the nearest and the farthest surface that a scanner measured, shape (6 * side * side,) each."""

    side: int  # cells along an edge of the cube
    # of a cell and its neighbours, since the range changes much within a cell on a slanted surface; +inf if none
    near_m: Float64[ndarray, " cells"]
    far_m: Float64[ndarray, " cells"]  # of a cell alone, -inf if nothing was seen


def depth_map(points_m: Float64[ndarray, "n 3"], side: int) -> DepthMap:
    """Return the depth map of points, shape (n, 3), as measured by a scanner at the origin."""
    near, far = _extremes(points_m, cells_of(points_m, side), 6 * side * side)
    step = np.pi / 2 / side
    shifts = [(du, dv) for du in (-step, 0.0, step) for dv in (-step, 0.0, step)]
    return DepthMap(side, np.min([near[cells_of(_centres(side, *shift), side)] for shift in shifts], axis=0), far)


def _centres(side: int, du_rad: float, dv_rad: float) -> Float64[ndarray, "cells 3"]:
    """Return a point in the direction of every cell's centre, moved along its face, beyond an edge on the next face."""
    middle = (np.arange(side) + 0.5) / side * np.pi / 2 - np.pi / 4
    u, v = np.meshgrid(np.tan(middle + du_rad), np.tan(middle + dv_rad))
    faces = [np.roll([np.full_like(u, end), u, v], axis, 0) for axis in range(3) for end in (1.0, -1.0)]
    return np.ascontiguousarray(np.moveaxis(np.array(faces), 1, -1).reshape(-1, 3))


@njit(cache=True)
def _extremes(points_m: Floats, cells: NDArray[np.int32], count: int) -> tuple[Floats, Floats]:
    near, far = np.full(count, np.inf), np.full(count, -np.inf)
    for i in range(cells.size):
        r = np.sqrt(points_m[i, 0] ** 2 + points_m[i, 1] ** 2 + points_m[i, 2] ** 2)
        near[cells[i]] = min(near[cells[i]], r)
        far[cells[i]] = max(far[cells[i]], r)
    return near, far
