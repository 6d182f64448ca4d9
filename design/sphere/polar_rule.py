"""Quadrature over the polar angle about an axis: where a region breaks, and the nodes between.

In coordinates about the axis an integral over the sphere is one-dimensional. Its segments end where a circle touches
an edge of the region or passes a corner of it, and at the further breaks that the caller names. The sum of the weights
does not depend on the axis: a rule whose sum differs from it is made finer, or is an error.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int64
from numpy import ndarray

from scanwright.design.arrays import Vector
from scanwright.design.errors import NumericalError
from scanwright.design.sphere.corners import (
    LOOK_RAD,
    MANY_EDGES,
    MOST_CORNERED,
    breaking_planes,
    edge_corners,
    polar_about,
    touched_points,
)
from scanwright.design.sphere.painting import BAND, CONE, MAP, POLYGON, VALUE
from scanwright.design.sphere.rectangle import seen_rectangle
from scanwright.design.sphere.regions import Field
from scanwright.design.sphere.total_weight import total_weight

GRID = 180  # segments of that grid
MANY_CORNERS = 64  # above this the corners are no breaks: segments between them would cost more nodes than the bends
WEIGHT_OFF = 1e-3  # share of the integral of the weight that the sum over the nodes may be off by
FINER = 1, 3, 9, 27  # times the nodes until it is not


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

    def own_error(self) -> float:
        """What its sum of weights is off by as its nodes are few, from the rule with a third of them."""
        return float(np.abs(np.bincount(self.segment, self.fine - self.coarse)).sum())


def circle_rule(field: Field, axis: Vector, breaks_rad: Float[ndarray, " breaks"], nodes: int) -> PolarRule:
    """Midpoint rule on each segment, nodes gathered at its ends: there the integrand starts like a square root.

    Args:
        field: the weights.
        axis: unit vector.
        breaks_rad: further breaks of the integrand.
        nodes: about how many, spread over the segments; 0 if no direction has a weight.

    Raises:
        NumericalError: weight is missing: the nodes sum to less or more than its integral.
    """
    segments, expected = weighted_segments(field, axis, breaks_rad), total_weight(field)
    for finer in FINER:
        rule = _rule_on(field, axis, segments, nodes * finer)
        got = float(rule.fine.sum())
        if abs(got - expected) <= WEIGHT_OFF * expected + rule.own_error():
            return rule
    about = np.round(axis, 4).tolist()
    raise NumericalError(f"weight: about the axis {about} it sums to {got:.6g}, and not to {expected:.6g}")


def _rule_on(field: Field, axis: Vector, ends: Float[ndarray, "segments 2"], nodes: int) -> PolarRule:
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
    field: Field, axis: Vector, more_rad: Float[ndarray, " more"], *, every_corner: bool = True
) -> Float[ndarray, " n"]:
    """Polar angles about an axis where the circle mean of the weight breaks, with some more, sorted, 0 to pi.

    At corners it only bends: with `every_corner` False they are left out if they are many.
    """
    points = _touched_points(field, axis)
    if every_corner or not _has_many_corners(field):
        points = np.concatenate([points, edge_corners(field).points])
    grid = np.linspace(0, np.pi, GRID + 1 if field.edges > MANY_EDGES else 2)
    return np.unique(np.round(np.concatenate([grid, polar_about(axis, points), _fold(more_rad)]), 12))


def weighted_segments(field: Field, axis: Vector, more_rad: Float[ndarray, " n"]) -> Float[ndarray, "segments 2"]:
    """Ranges of the polar angle between breaks, shape (segments, 2); those of weight zero are left out."""
    if not len(field.patches):  # as the logarithms of equal weights are
        return np.empty((0, 2))
    breaks = breaks_of(field, axis, more_rad, every_corner=False)
    ends = np.stack([breaks[:-1], breaks[1:]], axis=1)
    if has_all_breaks(field):
        holds = field.on_circles(axis, ends.mean(axis=1))[0] > 0
    else:
        # weight may begin within a segment: every segment that any cell reaches stays, whatever covers the cell
        low, high = np.concatenate([_reach(field, k, axis) for k in range(len(field.patches))], axis=1)
        ended = np.searchsorted(np.sort(high), breaks[:-1], side="left")
        begun = np.searchsorted(np.sort(low), breaks[1:], side="right")
        holds = begun > ended
    return ends[holds & (ends[:, 1] - ends[:, 0] > 1e-12)]


def has_all_breaks(field: Field) -> bool:
    """Whether segments end wherever weight begins or ends, so that one circle decides for each whether it has any."""
    return field.edges <= min(MANY_EDGES, MOST_CORNERED) and not _has_many_corners(field)


def _has_many_corners(field: Field) -> bool:
    return len(edge_corners(field).points) > MANY_CORNERS


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
    polar = polar_about(axis, centres)
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


def _touched_points(field: Field, axis: Vector) -> Float[ndarray, "n 3"]:
    """Points at which a circle about `axis` touches an edge of the region, shape (n, 3)."""
    planes = breaking_planes(field)
    touched = touched_points(planes, axis)
    across = LOOK_RAD * np.concatenate([planes[:, :3], planes[:, :3]])
    inside, outside = field.weight_at(np.concatenate([touched + across, touched - across])).reshape(2, -1)
    return touched[inside != outside]
