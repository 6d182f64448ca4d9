"""Occupancy grid of points and their beams: occupied, free, unknown. Unusable input raises RecordingError."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int8
from numba import njit
from numpy import ndarray
from numpy.typing import NDArray

from scanwright.design.arrays import Floats
from scanwright.design.errors import RecordingError

UNKNOWN, FREE, OCCUPIED = -1, 0, 100
"""Values of a cell, as in nav_msgs/OccupancyGrid."""
_MOST_CELLS = 1 << 26  # 400 x 400 m at 0.05 m
_FINEST_M, _COARSEST_M = 1e-3, 10.0
_HIGHEST_M = 100.0  # above any robot


@dataclass(frozen=True, slots=True)
class Heights:
    """Layer of obstacles of a robot; RecordingError if the heights are not in order."""

    floor_m: float  # height of the floor in the frame of the points
    from_m: float = 0.1  # lower bound of obstacles above the floor
    to_m: float = 1.8  # upper bound of obstacles above the floor

    def __post_init__(self) -> None:
        if not math.isfinite(self.floor_m):
            raise RecordingError(f"floor_m = {self.floor_m}: must be finite")
        if not 0 < self.from_m < self.to_m <= _HIGHEST_M:
            raise RecordingError(
                f"from_m = {self.from_m}, to_m = {self.to_m}: allowed 0 < from_m < to_m <= {_HIGHEST_M:g}"
            )


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyGrid:
    """Horizontal grid of square cells."""

    cells: Int8[ndarray, "rows columns"]  # `UNKNOWN`, `FREE` or `OCCUPIED`; rows along y, columns along x
    resolution_m: float  # edge of a cell
    origin_m: Float64[ndarray, " 2"]  # corner of cell (0, 0) with the smallest x and y, a multiple of the resolution

    def count(self, value: int) -> int:
        """Return the number of cells of a value."""
        return int(np.count_nonzero(self.cells == value))

    def area_m2(self, value: int) -> float:
        """Return the area of all cells of a value."""
        return self.count(value) * self.resolution_m**2


def check_resolution(resolution_m: float) -> None:
    """Raise RecordingError if the edge of a cell is out of range."""
    if not _FINEST_M <= resolution_m <= _COARSEST_M:
        raise RecordingError(f"resolution_m = {resolution_m}: allowed {_FINEST_M:g} to {_COARSEST_M:g}")


def occupancy_grid(
    points_m: Float64[ndarray, "n 3"],
    eyes_m: Float64[ndarray, "n 3"],
    heights: Heights,
    resolution_m: float = 0.05,
) -> OccupancyGrid:
    """Return the grid of occupied, free and unknown cells.

    A cell is occupied if it has a point between the two heights. It is free if it is not occupied and a beam crossed it
    below the lower height: a higher beam is no evidence of free space under it, as above a table. A beam counts until
    one cell before its point, so that its noise frees no cell behind a wall. All other cells are unknown.

    Cells are traversed as in J. Amanatides and A. Woo, "A Fast Voxel Traversal Algorithm for Ray Tracing"
    (Eurographics 1987).

    Args:
        points_m: shape (n, 3), finite, z up.
        eyes_m: position of the scanner for each point, shape (n, 3); NaN if unknown: such a point frees no cell.
        heights: of the layer of obstacles.
        resolution_m: edge of a cell.
    """
    check_resolution(resolution_m)
    low_m, high_m = heights.floor_m + heights.from_m, heights.floor_m + heights.to_m
    hits_m = points_m[(points_m[:, 2] >= low_m) & (points_m[:, 2] <= high_m), :2]
    # at most half the lower height, so that a vertical beam has a part below it
    short_m = min(resolution_m, heights.from_m / 2)
    paths_m = _paths_within(points_m, eyes_m, heights.floor_m - heights.from_m, low_m, short_m)
    ends_m = np.concatenate([hits_m, paths_m[:, :2], paths_m[:, 2:]])
    if not ends_m.size:
        raise RecordingError(
            f"no point and no beam between {heights.from_m:g} and {heights.to_m:g} m above the floor at "
            f"z = {heights.floor_m:z.2f} m: set floor_m, from_m or to_m"
        )
    first = np.floor(ends_m.min(axis=0) / resolution_m) - 1
    columns, rows = (np.floor(ends_m.max(axis=0) / resolution_m) - first + 2).astype(np.int64)
    if columns * rows > _MOST_CELLS:
        raise RecordingError(
            f"resolution_m = {resolution_m:g}: {columns:,} x {rows:,} cells, maximum {_MOST_CELLS:,} in all: choose "
            "larger cells, or assemble the cloud with a shorter max_range_m"
        )
    cells = np.full((rows, columns), UNKNOWN, np.int8)
    _free(cells, paths_m / resolution_m - np.tile(first, 2))
    column, row = np.floor(hits_m / resolution_m - first).astype(np.int64).T
    cells[row, column] = OCCUPIED
    return OccupancyGrid(cells, resolution_m, first * resolution_m)


@njit(cache=True)
def _paths_within(points_m: Floats, eyes_m: Floats, low_m: float, high_m: float, short_m: float) -> Floats:
    """Return the part of each beam between two heights until `short_m` before its point: (m, 4) from x y, to x y."""
    paths = np.empty((points_m.shape[0], 4))
    count = 0
    for i in range(points_m.shape[0]):
        x, y, z = eyes_m[i, 0], eyes_m[i, 1], eyes_m[i, 2]
        dx, dy, dz = points_m[i, 0] - x, points_m[i, 1] - y, points_m[i, 2] - z
        length = np.sqrt(dx * dx + dy * dy + dz * dz)
        if not length > short_m:  # also for an unknown eye
            continue
        begin, end = 0.0, 1.0 - short_m / length
        if dz == 0.0:
            if z < low_m or z > high_m:
                continue
        else:
            a, b = (low_m - z) / dz, (high_m - z) / dz
            begin, end = max(begin, min(a, b)), min(end, max(a, b))
        if begin < end:
            paths[count, 0], paths[count, 1] = x + begin * dx, y + begin * dy
            paths[count, 2], paths[count, 3] = x + end * dx, y + end * dy
            count += 1
    return paths[:count]


@njit(cache=True)
def _free(cells: NDArray[np.int8], paths: Floats) -> None:
    """Free all cells that a path crosses; paths of shape (m, 4) in cells, x y from and x y to."""
    for i in range(paths.shape[0]):
        x, y = int(np.floor(paths[i, 0])), int(np.floor(paths[i, 1]))
        dx, dy = paths[i, 2] - paths[i, 0], paths[i, 3] - paths[i, 1]
        step_x, step_y = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
        per_x, per_y = (1 / abs(dx) if dx else np.inf), (1 / abs(dy) if dy else np.inf)
        next_x = (x + (dx > 0) - paths[i, 0]) / dx if dx else np.inf
        next_y = (y + (dy > 0) - paths[i, 1]) / dy if dy else np.inf
        cells[y, x] = 0
        while min(next_x, next_y) < 1.0:
            if next_x < next_y:
                x += step_x
                next_x += per_x
            else:
                y += step_y
                next_y += per_y
            cells[y, x] = 0
