"""Quadrature over the polar angle about an axis: where a region breaks, and the nodes between.

In coordinates about the axis an integral over the sphere is one-dimensional. Its segments end where a circle touches
an edge of the region or passes a corner of it, and wherever the caller says that the integrand breaks.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float, Int64
from numpy import ndarray

from design.arrays import Vector
from design.sphere.painting import BAND, CONE, MAP, POLYGON, VALUE
from design.sphere.rectangle import seen_rectangle
from design.sphere.regions import Field, cross, frames_about

LOOKS_AROUND, LOOK_RAD = 12, 1e-5  # at what lies around a point of an edge
MANY_EDGES = 64  # above this (maps) the edges of cells are no breaks: a grid of segments stands in for them
GRID = 180  # segments of that grid
MANY_CORNERS = 64  # above this (maps) segments between them would cost more nodes than the bends at them
MOST_CORNERED = 256  # edges of bands and cones whose corners are looked for: pairs of them


@dataclass(frozen=True, slots=True)
class PolarRule:
    """Quadrature over the polar angle about an axis.

    Attributes:
        polar_rad: nodes, shape (n,).
        fine: what each node adds to `int w dO`, shape (n,).
        coarse: the same for the rule with a third of the nodes: zero on two of three, shape (n,).
        segment: the segment that each node belongs to, shape (n,).
    """

    polar_rad: Float[ndarray, " n"]
    fine: Float[ndarray, " n"]
    coarse: Float[ndarray, " n"]
    segment: Int64[ndarray, " n"]


def circle_rule(field: Field, axis: Vector, breaks_rad: Float[ndarray, " breaks"], nodes: int) -> PolarRule:
    """Midpoint rule on each segment, nodes gathered at its ends: there the integrand starts like a square root.

    Args:
        field: the weights.
        axis: unit vector.
        breaks_rad: where else the integrand breaks.
        nodes: about how many, spread over the segments; none where no direction has a weight.
    """
    ends = np.array(weighted_segments(field, axis, breaks_rad)).reshape(-1, 2)
    length = ends[:, 1] - ends[:, 0]
    least = 3 if 9 * len(ends) <= nodes else 1  # thirds of a segment: of a map there are many
    thirds = np.maximum(least, np.round(nodes / 3 * length / length.sum())).astype(int)
    segment = np.repeat(np.arange(len(ends)), 3 * thirds)
    k = np.arange(len(segment)) - np.repeat(np.cumsum(3 * thirds) - 3 * thirds, 3 * thirds)
    step = (np.pi / (3 * thirds))[segment]
    s = (k + 0.5) * step
    t = ends[segment, 0] + length[segment] * np.sin(s / 2) ** 2
    width = length[segment] / 2 * np.sin(s) * step
    means, _ = field.on_circles(axis, t)
    fine = width * 2 * np.pi * np.sin(t) * means
    return PolarRule(t, fine, np.where(k % 3 == 1, 3 * fine, 0.0), segment)


def breaks_of(
    field: Field, axis: Vector, more_rad: Float[ndarray, " more"], most_corners: int | None = None
) -> Float[ndarray, " n"]:
    """Polar angles about an axis where the circle mean of the weight breaks, with some more, sorted, 0 to pi.

    At corners it only bends: all of them are left out where they are more than so many.
    """
    corners = edge_corners(field)
    corners = corners[:0] if most_corners is not None and len(corners) > most_corners else corners
    of_field = _breaks(field, axis, corners)
    return np.unique(np.round(np.concatenate([of_field, _fold(more_rad)]), 12))


def weighted_segments(field: Field, axis: Vector, more_rad: Float[ndarray, " n"]) -> list[tuple[float, float]]:
    """Ranges of the polar angle between breaks, those of weight zero left out."""
    breaks = breaks_of(field, axis, more_rad, MANY_CORNERS)
    if not len(field.patches):  # as the logarithms of equal weights are
        return []
    if field.edges > MANY_EDGES:
        # the breaks do not tell where the weight of a cell begins: what any cell reaches stays, whatever covers it
        low, high = np.concatenate([_reach(field, k, axis) for k in range(len(field.patches))], axis=1)
        ended = np.searchsorted(np.sort(high), breaks[:-1], side="left")
        begun = np.searchsorted(np.sort(low), breaks[1:], side="right")
        holds = begun > ended
    else:
        holds = field.on_circles(axis, (breaks[:-1] + breaks[1:]) / 2)[0] > 0
    return [(a, b) for a, b, held in zip(breaks[:-1], breaks[1:], holds, strict=True) if held and b - a > 1e-12]


def _fold(polar_rad: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
    """Bring polar angles past a pole back to 0 .. pi."""
    beyond = np.abs(polar_rad) % (2 * np.pi)
    return np.where(beyond > np.pi, 2 * np.pi - beyond, beyond)


def _reach(field: Field, patch: int, axis: Vector) -> Float[ndarray, "2 n"]:
    """Lowest and highest polar angle of caps about the axis that hold a patch, shape (2, caps)."""
    row = field.patches[patch]
    centres, radii = np.array([[0.0, 0.0, 1.0]]), np.array([np.pi])
    if row[0] == CONE:
        centres, radii = row[None, 1:4], np.arccos(row[4:5])
    elif row[0] == POLYGON:
        centre, radius = seen_rectangle(row[1:VALUE].reshape(4, 3)).cap()
        centres, radii = centre[None], np.array([radius])
    elif row[0] in (BAND, MAP):
        centres, radii = _cells(field, patch)
    polar = _polar_about(axis, centres)
    return np.stack([polar - radii, polar + radii]) + np.array([[-LOOK_RAD], [LOOK_RAD]])


@lru_cache(maxsize=64)
def _cells(field: Field, patch: int) -> tuple[Float[ndarray, "n 3"], Float[ndarray, " n"]]:
    """Caps that hold a band, or the cells of a map that have a weight: directions and angular radii."""
    row = field.patches[patch]
    if row[0] == BAND:
        theta, phi = np.arccos(np.clip(row[[2, 1], None], -1, 1)), np.array([np.arctan2(row[4], row[3])])
        half_phi = float(np.arccos(row[5]))
    else:
        height, width = int(row[2]), int(row[3])
        r, c = np.nonzero(field.weight.tables[int(row[1]), :height, :width])
        theta, phi = np.pi * np.stack([r, r + 1]) / height, 2 * np.pi * (c + 0.5) / width
        half_phi = np.pi / width
    middle = theta.mean(axis=0)
    # along the meridian, then along the widest parallel: never shorter than the way there
    across_equator = (theta[0] - np.pi / 2) * (theta[1] - np.pi / 2) <= 0
    widest = np.where(across_equator, 1.0, np.sin(theta).max(axis=0))
    centres = np.stack([np.sin(middle) * np.cos(phi), np.sin(middle) * np.sin(phi), np.cos(middle)], axis=1)
    return centres, (theta[1] - theta[0]) / 2 + half_phi * widest


def _breaks(field: Field, axis: Vector, corners: Float[ndarray, "corners 3"]) -> Float[ndarray, " n"]:
    """Polar angles at which a circle about `axis` touches an edge or passes a corner; 0 and pi too."""
    planes = _breaking(field)
    touched = _touched(planes, axis)
    across = LOOK_RAD * np.concatenate([planes[:, :3], planes[:, :3]])
    inside, outside = field.weight_at(np.concatenate([touched + across, touched - across])).reshape(2, -1)
    points = np.concatenate([touched[inside != outside], corners])
    grid = np.linspace(0, np.pi, GRID + 1) if field.edges > MANY_EDGES else np.array([0.0, np.pi])
    return np.concatenate([grid, _polar_about(axis, points)])


def _polar_about(axis: Vector, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
    """Polar angles of unit vectors (n, 3) about an axis; accurate close to it too."""
    return np.arctan2(np.linalg.norm(cross(points, axis[None]), axis=1), points @ axis)


def _breaking(field: Field) -> Float[ndarray, "edges 4"]:
    """Planes of the edges whose circles are looked at one by one."""
    return field.planes if field.edges > MANY_EDGES else np.concatenate([field.planes, field.map_planes])


@lru_cache(maxsize=64)
def edge_corners(field: Field) -> Float[ndarray, "n 3"]:
    """Corners of the region, the same about every axis, shape (n, 3)."""
    corners = _corners(_breaking(field)[:MOST_CORNERED])
    return corners[_is_edge(field, corners)]


def around(points: Float[ndarray, "n 3"]) -> Float[ndarray, "n looks 3"]:
    """Directions on a small ring about each unit vector (n, 3): what lies on the sides of an edge that it is on."""
    e1, e2, centre = (frames_about(points)[:, None, i] for i in range(3))
    turn = (2 * np.pi * np.arange(LOOKS_AROUND) / LOOKS_AROUND + 0.1)[None, :, None]
    ring = centre + LOOK_RAD * (np.cos(turn) * e1 + np.sin(turn) * e2)
    return ring / np.linalg.norm(ring, axis=2, keepdims=True)


def _is_edge(field: Field, points: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
    """Whether the weight changes around points of edge planes: most crossings lie within a region, or outside all."""
    if not len(points):
        return np.zeros(0, dtype=bool)
    values = field.weight_at(around(points).reshape(-1, 3)).reshape(len(points), -1)
    return np.ptp(values, axis=1) > 0


def _touched(planes: Float[ndarray, "edges 4"], axis: Vector) -> Float[ndarray, "n 3"]:
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


def _corners(planes: Float[ndarray, "edges 4"]) -> Float[ndarray, "n 3"]:
    """Points of the sphere where two edge planes meet, shape (n, 3)."""
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
    return np.concatenate([foot[on] + reach, foot[on] - reach])
