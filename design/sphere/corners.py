"""Corners of regions, and the points at which circles about an axis touch their edges."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from scanwright.design.arrays import Vector
from scanwright.design.sphere.regions import Field, cross, frames_about

PROBES = 12  # directions around a point of an edge at which the weight is evaluated
PROBE_RAD = 2e-7  # their distance from it: resolves thin rests of masked regions; with 1e-8 `EDGE` hides tiny cones
MANY_EDGES = 64  # regions with more edges (maps) are not integrated between the edges of their cells
MOST_CORNERED = 256  # edges of which all pairs are intersected


def breaking_planes(field: Field) -> Float[ndarray, "edges 4"]:
    """Return the planes of the edges that limit segments of the quadrature: without map cells if there are many."""
    return field.planes if field.edges > MANY_EDGES else np.concatenate([field.planes, field.map_planes])


@dataclass(frozen=True, slots=True)
class Corners:
    """Points at which edges of a region cross, and the weights of directions around each."""

    points: Float[ndarray, "n 3"]
    weights: Float[ndarray, "n probes"]


@lru_cache(maxsize=64)
def edge_corners(field: Field) -> Corners:
    """Return the crossings of edges at which the weight changes."""
    points, sectors = _crossings(breaking_planes(field)[:MOST_CORNERED])
    if not len(points):
        return Corners(points, np.empty((0, 0)))
    probes = np.concatenate([probes_around(points), sectors], axis=1)
    weights = field.weight_at(probes.reshape(-1, 3)).reshape(len(points), -1)
    edge = np.ptp(weights, axis=1) > 0
    return Corners(points[edge], weights[edge])


def probes_around(points: Float[ndarray, "n 3"]) -> Float[ndarray, "n probes 3"]:
    """Return directions on a ring of radius `PROBE_RAD` about each unit vector."""
    e1, e2, centre = (frames_about(points)[:, None, i] for i in range(3))
    turn = (2 * np.pi * np.arange(PROBES) / PROBES + 0.1)[None, :, None]
    return _unit(centre + PROBE_RAD * (np.cos(turn) * e1 + np.sin(turn) * e2))


def touched_points(planes: Float[ndarray, "edges 4"], axis: Vector) -> Float[ndarray, "n 3"]:
    """Return the points of each edge circle nearest to the axis, then those farthest from it."""
    normals, offsets = planes[:, :3], planes[:, 3:]
    across = axis - normals * (normals @ axis)[:, None]
    length = np.linalg.norm(across, axis=1, keepdims=True)
    tilted = length[:, 0] > 1e-12  # else the circle is about the axis itself, and any of its points is correct
    side = across / np.maximum(length, 1e-300)
    if not tilted.all():
        side = np.where(tilted[:, None], side, frames_about(normals)[:, 0])
    radius = np.sqrt(np.maximum(1 - offsets**2, 0))
    return np.concatenate([normals * offsets + side * radius, normals * offsets - side * radius])


def polar_about(axis: Vector, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
    """Return the polar angles [rad] of unit vectors about an axis; accurate close to the axis."""
    return np.arctan2(np.linalg.norm(cross(points, axis[None]), axis=1), points @ axis)


def _crossings(planes: Float[ndarray, "edges 4"]) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 4 3"]]:
    """Return the points of the sphere on two edge planes, and a direction in each of the four sectors between them.

    So one direction lies inside even the sharpest corner.
    """
    i, j = np.triu_indices(len(planes), 1)
    m, n = planes[i, :3], planes[j, :3]
    along = cross(m, n)
    square = (along**2).sum(axis=1)
    meet = square > 1e-18
    m, n, along, square = m[meet], n[meet], along[meet], square[meet]
    c, d = planes[i, 3][meet], planes[j, 3][meet]
    # the point of the common line nearest to the centre, then along the line to the sphere
    foot = (cross(n, along) * c[:, None] + cross(along, m) * d[:, None]) / square[:, None]
    rest = 1 - (foot**2).sum(axis=1)
    on = rest > 0
    reach = (along * np.sqrt(np.maximum(rest, 0) / square)[:, None])[on]
    points = np.concatenate([foot[on] + reach, foot[on] - reach])
    tangents = [_unit(cross(np.tile(normal[on], (2, 1)), points)) for normal in (m, n)]
    middles = [_unit(tangents[0] + tangents[1]), _unit(tangents[0] - tangents[1])]
    sectors = np.stack([points + sign * PROBE_RAD * middle for middle in middles for sign in (1, -1)], axis=1)
    return points, _unit(sectors)


def _unit(v: Float[ndarray, "... 3"]) -> Float[ndarray, "... 3"]:
    """Return unit vectors; zero vectors stay zero (sectors between edges that only touch)."""
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-300)
