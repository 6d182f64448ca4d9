"""Quadrature over the polar angle about an axis.

In coordinates about the axis an integral over the sphere is one-dimensional. Its segments end where a circle touches
an edge or passes a corner of the region, and at further breaks that the caller gives. The sum of the weights does not
depend on the axis: a rule with another sum is refined, or is an error.

A region of many edges (fine maps, meshes, hundreds of bands) has too many breaks. Each node then gets the weight of the
directions around it, from one set of directions for all axes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int64
from numba import njit
from numpy import ndarray

from scanwright.design.arrays import Array, Ints, Vector
from scanwright.design.sphere.corners import (
    MANY_EDGES,
    PROBE_RAD,
    breaking_planes,
    edge_corners,
    polar_about,
    touched_points,
)
from scanwright.design.sphere.directions import Samples, weighted_samples
from scanwright.design.sphere.regions import Field
from scanwright.design.sphere.total_weight import is_total, require_drawn, weight_error

GRID = 180  # segments that replace the breaks of a region of many edges
MANY_CORNERS = 64  # with more corners, segments between them cost more nodes than they save
PER_NODE = 256  # directions for each node of a region of many edges or corners
MOST_DIRECTIONS = 2_000_000
FINER = 1, 3, 9, 27  # times the nodes, until the sum of the weights is correct


@dataclass(frozen=True, slots=True)
class PolarRule:
    """Quadrature over the polar angle about an axis."""

    polar_rad: Float[ndarray, " n"]  # nodes, shape (n,)
    fine: Float[ndarray, " n"]  # contribution of each node to the integral of the weight, shape (n,)
    coarse: Float[ndarray, " n"]  # the same for the rule with a third of the nodes, 0 at the others, shape (n,)
    segment: Int64[ndarray, " n"]  # index of the segment of each node, shape (n,)

    def own_error(self) -> float:
        """Return an estimate of the error of the sum of weights, from the rule with a third of the nodes."""
        return float(np.abs(np.bincount(self.segment, self.fine - self.coarse)).sum())


def circle_rule(field: Field, axis: Vector, breaks_rad: Float[ndarray, " breaks"], nodes: int) -> PolarRule:
    """Return the midpoint rule on each segment, with denser nodes at its ends, where the integrand has square roots.

    `breaks_rad` are further breaks of the integrand. The rule has about `nodes` nodes, or none if no direction has a
    weight.

    Raises:
        NumericalError: the sum of the weights is not the integral of the weight.
        TaskError: the same, and the region is thinner than the resolution.
    """
    if not has_all_breaks(field):
        return _sampled_rule(field, axis, breaks_rad, nodes)
    segments = weighted_segments(field, axis, breaks_rad)
    for finer in FINER:
        rule = _rule_on(field, axis, segments, nodes * finer)
        got = float(rule.fine.sum())
        if is_total(field, got, rule.own_error()):
            return rule
    raise weight_error(field, got, f"about the axis {np.round(axis, 4).tolist()}")


def _rule_on(field: Field, axis: Vector, ends: Float[ndarray, "segments 2"], nodes: int) -> PolarRule:
    segment, k, s, step = _nodes_between(ends, nodes)
    length = np.diff(ends, axis=1)[segment, 0]
    t = ends[segment, 0] + length * np.sin(s / 2) ** 2
    width = length / 2 * np.sin(s) * step
    means, _ = field.on_circles(axis, t)
    fine = width * 2 * np.pi * np.sin(t) * means
    return PolarRule(t, fine, np.where(k % 3 == 1, 3 * fine, 0.0), segment)


def _sampled_rule(field: Field, axis: Vector, breaks_rad: Float[ndarray, " breaks"], nodes: int) -> PolarRule:
    """Return the rule whose nodes have the weight of the directions around them; every third makes the coarse rule."""
    breaks = np.unique(np.round(np.concatenate([[0, np.pi], _fold(breaks_rad)]), 12))
    ends = np.stack([breaks[:-1], breaks[1:]], axis=1)
    segment, k, s, step = _nodes_between(ends, nodes)
    length = np.diff(ends, axis=1)[segment, 0]
    upper = ends[segment, 0] + length * np.sin((s + step / 2) / 2) ** 2
    first = np.searchsorted(upper, np.linspace(0, np.pi, 4 * len(upper)))  # lookup table: first node of equal steps
    samples = _samples(field, min(PER_NODE * nodes, MOST_DIRECTIONS))
    fine, third = _gathered(samples.directions, samples.weights, axis, upper, np.minimum(first, len(upper) - 1))
    middle = np.flatnonzero(k % 3 == 1)
    coarse = np.zeros(len(fine))
    coarse[middle] = third.reshape(-1, 3).sum(axis=1)
    return PolarRule(ends[segment, 0] + length * np.sin(s / 2) ** 2, fine, coarse, segment)


@lru_cache(maxsize=8)
def _samples(field: Field, wanted: int) -> Samples:
    samples = weighted_samples(field, wanted)
    require_drawn(field, samples.weights)
    return samples


@njit(cache=True, nogil=True, error_model="numpy")
def _gathered(directions: Array, weights: Array, axis: Array, upper: Array, first: Ints) -> tuple[Array, Array]:
    """Return the weight of the directions of each bin of polar angles: of all, and three times that of every third."""
    fine, third = np.zeros(len(upper)), np.zeros(len(upper))
    per_rad = (len(first) - 1) / np.pi
    for i in range(len(directions)):
        c = directions[i, 0] * axis[0] + directions[i, 1] * axis[1] + directions[i, 2] * axis[2]
        t = np.arccos(min(1.0, max(-1.0, c)))
        k = first[int(t * per_rad)]
        while k < len(upper) - 1 and upper[k] < t:
            k += 1
        fine[k] += weights[i]
        if i % 3 == 1:
            third[k] += 3 * weights[i]
    return fine, third


def _nodes_between(
    ends: Float[ndarray, "segments 2"], nodes: int
) -> tuple[Int64[ndarray, " n"], Int64[ndarray, " n"], Float[ndarray, " n"], Float[ndarray, " n"]]:
    """Return segment, number in the segment, place in it (0 to pi) and step of about `nodes` nodes."""
    length = ends[:, 1] - ends[:, 0]
    least = 3 if 9 * len(ends) <= nodes else 1  # triples of nodes of a segment
    thirds = np.maximum(least, np.round(nodes / 3 * length / length.sum())).astype(int)
    segment = np.repeat(np.arange(len(ends)), 3 * thirds)
    k = np.arange(len(segment)) - np.repeat(np.cumsum(3 * thirds) - 3 * thirds, 3 * thirds)
    step = (np.pi / (3 * thirds))[segment]
    return segment, k, (k + 0.5) * step, step


def breaks_of(field: Field, axis: Vector, more_rad: Float[ndarray, " more"]) -> Float[ndarray, " n"]:
    """Return the polar angles at which the mean weight of a circle is not smooth, and `more_rad`, sorted, 0 to pi.

    For a region of many edges they include a regular grid in place of those of map cells.
    """
    points = np.concatenate([_touched_points(field, axis), edge_corners(field).points])
    grid = np.linspace(0, np.pi, GRID + 1 if field.edges > MANY_EDGES else 2)
    return np.unique(np.round(np.concatenate([grid, polar_about(axis, points), _fold(more_rad)]), 12))


def weighted_segments(field: Field, axis: Vector, more_rad: Float[ndarray, " n"]) -> Float[ndarray, "segments 2"]:
    """Return the ranges of the polar angle between breaks, without those of weight zero."""
    if not len(field.patches):  # such as logarithms of equal weights
        return np.empty((0, 2))
    breaks = breaks_of(field, axis, more_rad)
    ends = np.stack([breaks[:-1], breaks[1:]], axis=1)
    holds = field.on_circles(axis, ends.mean(axis=1))[0] > 0
    return ends[holds & (ends[:, 1] - ends[:, 0] > 1e-12)]


def has_all_breaks(field: Field) -> bool:
    """Return whether segments end at all edges and corners, so that one circle shows whether a segment has weight."""
    return field.edges <= MANY_EDGES and len(edge_corners(field).points) <= MANY_CORNERS


def _fold(polar_rad: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
    """Return polar angles reduced to 0 .. pi."""
    beyond = np.abs(polar_rad) % (2 * np.pi)
    return np.where(beyond > np.pi, 2 * np.pi - beyond, beyond)


def _touched_points(field: Field, axis: Vector) -> Float[ndarray, "n 3"]:
    """Return the points at which a circle about `axis` touches an edge at which the weight changes."""
    planes = breaking_planes(field)
    touched = touched_points(planes, axis)
    across = np.tile(planes[:, :3], (2, 1))
    across -= touched * np.einsum("ij,ij->i", touched, across)[:, None]  # tangent to the sphere
    across *= PROBE_RAD / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
    inside, outside = field.weight_at(np.concatenate([touched + across, touched - across])).reshape(2, -1)
    return touched[inside != outside]
