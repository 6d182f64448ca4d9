"""The window or head of a lidar in a mesh: its surfaces of revolution about an upright axis. Millimetres."""

from dataclasses import dataclass

import numpy as np

from scanwright.design.arrays import Array

PLANE_SHARE = 0.03  # of the surface: facets in such a large plane are no part of a round window
STEEP = 0.6  # largest z of the normal of a window
ABOVE = 0.3  # of the height: least middle of a window
CELL_MM = 0.5  # of the histogram of intersections
ON_AXIS_MM = 0.1  # between the normal of a facet and the axis
TRIES = 4000  # pairs of normals; most of them intersect at the axis
LEAST_SHARE = 0.01  # of the surface, round about the axis


@dataclass(frozen=True, slots=True)
class ScanWindow:
    """A band about the optical axis: place of the axis, largest radius, lower and upper edge."""

    axis: tuple[float, float]
    radius: float
    low: float
    high: float


def window_of(triangles: Array) -> ScanWindow | None:
    """Return the largest band that is round about an upright axis, in the upper part; None if there is none.

    Corners with z up [mm], shape (t, 3, 3).
    """
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) / 2
    area = np.linalg.norm(across, axis=1)
    low, high = triangles[..., 2].min(), triangles[..., 2].max()
    with np.errstate(invalid="ignore", divide="ignore"):
        normals = across / area[:, None]
    offsets = np.einsum("ij,ij->i", normals, triangles[:, 0])
    planes = np.unique(np.round(np.column_stack([normals, offsets]), 2), axis=0, return_inverse=True)[1].reshape(-1)
    in_plane = np.bincount(planes, area)[planes]
    upper = triangles.mean(axis=1)[:, 2] > low + ABOVE * (high - low)
    chosen = (area > 1e-9) & (in_plane < PLANE_SHARE * area.sum()) & upper & (np.abs(normals[:, 2]) < STEEP)
    if chosen.sum() < 8:
        return None
    triangles, area, total = triangles[chosen], area[chosen], area.sum()
    level = normals[chosen, :2] / np.linalg.norm(normals[chosen, :2], axis=1)[:, None]
    aside = np.stack([-level[:, 1], level[:, 0]], axis=1)
    reach = np.einsum("ijk,ik->ij", triangles[..., :2], aside)
    offset = (reach.min(axis=1) + reach.max(axis=1)) / 2  # the normal of a chord meets the axis from its middle
    axis = _meeting_point(aside, offset, area)
    outwards = np.einsum("ij,ij->i", triangles.mean(axis=1)[:, :2] - axis, level) > 0
    round_ = (np.abs(aside @ axis - offset) < ON_AXIS_MM) & outwards
    if area[round_].sum() < LEAST_SHARE * total:
        return None
    bands = np.round(np.stack([triangles[..., 2].min(axis=1), triangles[..., 2].max(axis=1)], axis=1)[round_], 1)
    edges, index = np.unique(bands, axis=0, return_inverse=True)
    best = int(np.argmax(np.bincount(index.reshape(-1), area[round_])))
    inside = triangles[round_][index.reshape(-1) == best]
    radius = float(np.linalg.norm(inside[..., :2] - axis, axis=2).max())
    return ScanWindow((float(axis[0]), float(axis[1])), radius, float(edges[best, 0]), float(edges[best, 1]))


def _meeting_point(aside: Array, offset: Array, area: Array) -> Array:
    """Return the point (2,) on most of the lines `aside . point = offset`, weighted by area."""
    random = np.random.default_rng(0)
    a, b = random.choice(len(area), (2, TRIES), p=area / area.sum())
    turn = aside[a, 0] * aside[b, 1] - aside[a, 1] * aside[b, 0]
    a, b, turn = a[np.abs(turn) > 0.2], b[np.abs(turn) > 0.2], turn[np.abs(turn) > 0.2]
    if not len(turn):
        return np.zeros(2)
    points = np.stack(
        [offset[a] * aside[b, 1] - offset[b] * aside[a, 1], offset[b] * aside[a, 0] - offset[a] * aside[b, 0]], axis=1
    )
    points /= turn[:, None]
    cells, index = np.unique(np.round(points / CELL_MM), axis=0, return_inverse=True)
    best = cells[int(np.argmax(np.bincount(index.reshape(-1))))] * CELL_MM
    return np.asarray(np.median(points[np.abs(points - best).max(axis=1) < CELL_MM], axis=0))
