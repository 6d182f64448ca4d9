"""Filled share of each small cube of a grid in a closed mesh: rays along z, in and out by the surface's normals."""

from dataclasses import dataclass

import numpy as np

from scanwright.design.arrays import Array
from scanwright.design.scene import ray_caster

RAYS = 2  # through a cube, along x and along y: a wall as thin as a cube keeps its thickness
SURFACES = 64  # that one column may pass
PAST_M = 1e-7  # beyond a surface that was hit


@dataclass(frozen=True, slots=True)
class Grid:
    """Cubic cells, each of `parts` cubes along an edge."""

    low: Array  # corner of the first cell [mm], shape (3,)
    edge: float  # of a cell [mm]
    shape: tuple[int, int, int]  # cells along x, y, z
    parts: int  # cubes along the edge of a cell

    def middles(self, axis: int) -> Array:
        """Return middles of the cubes along one axis [mm]."""
        return self.low[axis] + self.edge * (np.arange(self.shape[axis] * self.parts) + 0.5) / self.parts


def filled(triangles: Array, grid: Grid) -> Array:
    """Share of each cube that is inside: exact along z, the mean of RAYS x RAYS lines across it.

    Args:
        triangles: corners of a closed surface, counter-clockwise from outside, shape (t, 3, 3) [mm].
        grid: the cells.

    Returns:
        Shape (nx, ny, nz) * parts, 0 to 1.
    """
    solid = ray_caster.build_scene(triangles / 1000)
    below = min(float(grid.low[2]), float(triangles[:, :, 2].min())) - 1.0
    offsets = ((np.arange(RAYS) + 0.5) / RAYS - 0.5) * grid.edge / grid.parts
    return np.mean([_along_lines(solid, grid, below, dx, dy) for dx in offsets for dy in offsets], axis=0)


def _along_lines(solid: ray_caster.Scene, grid: Grid, below: float, dx: float, dy: float) -> Array:
    """Share of one line through each cube that is inside, its shift from the middle given."""
    x, y = grid.middles(0) + dx, grid.middles(1) + dy
    columns = np.stack(np.meshgrid(x, y, indexing="ij"), axis=2).reshape(-1, 2)
    height = np.full(len(columns), below)
    cube, levels = grid.edge / grid.parts, grid.shape[2] * grid.parts
    change = np.zeros((len(columns), levels + 2))
    left = np.arange(len(columns))
    for _ in range(SURFACES):
        origins = np.column_stack([columns[left], height[left]]) / 1000
        hits = ray_caster.cast(solid, origins, np.broadcast_to([0.0, 0.0, 1.0], origins.shape))
        met = hits.triangle >= 0
        left = left[met]
        if len(left) == 0:
            break
        height[left] += 1000 * hits.range_m[met]
        place = np.clip((height[left] - grid.low[2]) / cube, 0.0, levels)
        level = np.minimum(place.astype(np.intp), levels - 1)
        sense = np.where(solid.normals[hits.triangle[met], 2] < 0, 1.0, -1.0)
        beyond = level + 1.0 - place
        change[left, level] += sense * beyond
        change[left, level + 1] += sense * (1.0 - beyond)
        height[left] += 1000 * PAST_M
    share = np.clip(np.cumsum(change, axis=1)[:, :levels], 0.0, 1.0)
    return share.reshape(len(x), len(y), levels)
