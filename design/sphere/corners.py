"""Where edges of a region meet, and where circles about an axis touch them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from scanwright.design.arrays import Vector
from scanwright.design.sphere.regions import Field, cross, frames_about

LOOKS_AROUND = 12  # at what lies around a point of an edge
LOOK_RAD = 2e-7  # how far from it: what masks leave of a region may be as thin; 1e-8 would lose tiny cones to `EDGE`
MANY_EDGES = 64  # above this (maps) the edges of cells are no breaks: a grid of segments replaces them
MOST_CORNERED = 256  # edges of bands and cones whose corners are looked for: pairs of them


def breaking_planes(field: Field) -> Float[ndarray, "edges 4"]:
    """Planes of the edges whose circles are looked at one by one."""
    return field.planes if field.edges > MANY_EDGES else np.concatenate([field.planes, field.map_planes])


@dataclass(frozen=True, slots=True)
class Corners:
    """Points at which edges of a region cross.

    Attributes:
        points: unit vectors, shape (n, 3).
        weights: of directions next to each, all around it, shape (n, looks).
    """

    points: Float[ndarray, "n 3"]
    weights: Float[ndarray, "n looks"]


@lru_cache(maxsize=64)
def edge_corners(field: Field) -> Corners:
    """Corners of the region, the same about every axis: most crossings lie within a region, or outside all."""
    points, sectors = _crossings(breaking_planes(field)[:MOST_CORNERED])
    if not len(points):
        return Corners(points, np.empty((0, 0)))
    tries = np.concatenate([around(points), sectors], axis=1)
    weights = field.weight_at(tries.reshape(-1, 3)).reshape(len(points), -1)
    edge = np.ptp(weights, axis=1) > 0
    return Corners(points[edge], weights[edge])


def around(points: Float[ndarray, "n 3"]) -> Float[ndarray, "n looks 3"]:
    """Directions on a small ring about each unit vector (n, 3): what lies on the sides of an edge that it is on."""
    e1, e2, centre = (frames_about(points)[:, None, i] for i in range(3))
    turn = (2 * np.pi * np.arange(LOOKS_AROUND) / LOOKS_AROUND + 0.1)[None, :, None]
    return _unit(centre + LOOK_RAD * (np.cos(turn) * e1 + np.sin(turn) * e2))


def touched_points(planes: Float[ndarray, "edges 4"], axis: Vector) -> Float[ndarray, "n 3"]:
    """Points of each edge circle nearest to the axis and farthest from it, shape (n, 3)."""
    normals, offsets = planes[:, :3], planes[:, 3:]
    across = axis - normals * (normals @ axis)[:, None]
    length = np.linalg.norm(across, axis=1, keepdims=True)
    tilted = length[:, 0] > 1e-12  # a circle about the axis itself is at one polar angle: any point of it will do
    side = across / np.maximum(length, 1e-300)
    if not tilted.all():
        side = np.where(tilted[:, None], side, frames_about(normals)[:, 0])
    radius = np.sqrt(np.maximum(1 - offsets**2, 0))
    return np.concatenate([normals * offsets + side * radius, normals * offsets - side * radius])


def polar_about(axis: Vector, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
    """Polar angles of unit vectors (n, 3) about an axis; accurate close to it too."""
    return np.arctan2(np.linalg.norm(cross(points, axis[None]), axis=1), points @ axis)


def _crossings(planes: Float[ndarray, "edges 4"]) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 4 3"]]:
    """Points of the sphere where two edge planes meet, (n, 3), and a direction in each sector between them, (n, 4, 3).

    However sharp a corner is, one of its directions lies inside it.
    """
    i, j = np.triu_indices(len(planes), 1)
    m, n = planes[i, :3], planes[j, :3]
    along = cross(m, n)
    square = (along**2).sum(axis=1)
    meet = square > 1e-18
    m, n, along, square = m[meet], n[meet], along[meet], square[meet]
    c, d = planes[i, 3][meet], planes[j, 3][meet]
    # the point of the common line next to the centre, then along the line to the sphere
    foot = (cross(n, along) * c[:, None] + cross(along, m) * d[:, None]) / square[:, None]
    rest = 1 - (foot**2).sum(axis=1)
    on = rest > 0
    reach = (along * np.sqrt(np.maximum(rest, 0) / square)[:, None])[on]
    points = np.concatenate([foot[on] + reach, foot[on] - reach])
    tangents = [_unit(cross(np.tile(normal[on], (2, 1)), points)) for normal in (m, n)]
    middles = [_unit(tangents[0] + tangents[1]), _unit(tangents[0] - tangents[1])]
    sectors = np.stack([points + sign * LOOK_RAD * middle for middle in middles for sign in (1, -1)], axis=1)
    return points, _unit(sectors)


def _unit(v: Float[ndarray, "... 3"]) -> Float[ndarray, "... 3"]:
    """Unit vectors; where edges touch and do not cross, a sector has no width and its direction is nothing."""
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-300)
