"""Coarse J over every scan plane and every axis: one matrix product a moment.

A moment of a scan plane about an axis is its `<g(d)>` over the polar angle times the weight about the axis over it.
g of the mean count bounds J from below (g is convex): planes are taken in the order of that bound, and the
exact `<g(d)>` is computed until no bound can beat the best. The product is made in pieces, and only the lowest J of
every plane and about every axis is kept.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numba import njit
from numpy import ndarray

from design.arrays import Array, Ints
from design.concurrency.parallel import in_chunks
from design.density.beams import beam_directions_rot, polar_and_azimuth, polar_of_planes
from design.density.spin import mean_count, zones
from design.errors import TaskError
from design.objective.named_objectives import Objective
from design.objective.problem import Problem
from design.search.grid_classes import Folded
from design.search.plane_axis_product import BothWays, both_ways, gathered, lowest
from design.sphere.directions import EMPTY, Samples, equal_angle_grid, weighted_samples
from design.sphere.polar_rule import MANY_EDGES
from design.sphere.regions import Field

FEW_AXES = 4000  # up to here the polar angle gets a node every 0.5 deg, beyond every 1 deg
MOST_NODES = 1441  # for balls below half a degree
BATCH = 64  # planes whose exact densities are computed before the bound is asked again
DIRECTIONS = 20_000  # that stand for a map, where circles would be slower
MARGIN = 0.15  # what the coarse J of the search may be off by: 0.134 was seen, for a ball of 0.5 deg
REPORT = 1000  # planes between two lines of progress
SCOUTED = 0.05  # what a bound over the scouts may be above that over all axes: else all are visited twice
SCOUTS = 1500  # axes that tell how low a plane's bound comes, before all are visited

Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Landscape:
    """Coarse J over all planes and axes, as the factors of its products and the lowest along each side.

    Attributes:
        objective: how moments become J.
        g: `<g(d)>` of each moment and plane class over the polar nodes, or its bound, (moments, planes, nodes).
        weights: share of each moment's weight about each axis class over the nodes, (axes, nodes) each.
        by_plane: lowest J of a plane class, not flipped and flipped, over the axes of the grid, (2, planes).
        its_axis: axis class where that was, and whether it is flipped, (2, planes) each.
        by_axis: lowest J about an axis class, not flipped and flipped, over the planes of the grid, (2, axes).
    """

    objective: Objective
    g: Array
    weights: tuple[Array, ...]
    by_plane: Array
    its_axis: tuple[Ints, Ints]
    by_axis: Array

    def about_axes(self, plane: int) -> Float[ndarray, "ways axes"]:
        """J of one plane class, not flipped, about each axis class, not flipped and flipped, shape (2, axes)."""
        parts = [
            np.stack([gathered(moment, w, g[plane]), gathered(moment, w, g[plane, ::-1])])
            for moment, w, g in zip(self.objective.moments, self.weights, self.g, strict=True)
        ]
        return self.objective.join(np.stack(parts))


def coarse_landscape(problem: Problem, planes: Folded, axes: Folded, progress: Progress) -> tuple[Landscape, int]:
    """Coarse J of everything, and how many planes of it are exact.

    The others keep their bound, g of the mean count: it is above the best by more than the search may be off.
    """
    few = len(axes.first) <= FEW_AXES
    # caustics are as wide as the ball: a node every quarter of it, and every 0.5 deg at least
    nodes = min(MOST_NODES, int(max(360, 4 * np.pi / problem.ball_rad)) + 1) if few else 181
    circles = max(nodes - 1, 720 - 720 % (nodes - 1)) if few else nodes - 1
    polar = np.linspace(0, np.pi, nodes)
    moments = problem.objective.moments
    over: dict[int, Array] = {}  # moments share fields
    for moment in moments:
        if id(moment.field) not in over:
            over[id(moment.field)] = _weights_over_polar(problem, moment.field, axes.representatives, nodes, circles)
    weights = tuple(over[id(moment.field)] for moment in moments)
    shown = np.radians(planes.settings_deg[planes.first])
    means = in_chunks(lambda chunk: _means(problem, polar, shown[chunk]), len(shown), smallest=8)
    mean = np.concatenate(means)
    g = np.stack([moment.g(mean) for moment in moments])
    open_planes = planes.has | planes.own

    def ways_of(g: Array, weights: tuple[Array, ...]) -> list[BothWays]:
        return [both_ways(moment, of_g, w) for moment, of_g, w in zip(moments, g, weights, strict=True)]

    every = max(1, len(axes.first) // SCOUTS)
    scouted = tuple(w[::every] for w in weights)
    bounds = lowest(problem.objective, ways_of(g, scouted), open_planes, axes.has[:, ::every])[0].min(axis=0)
    exact = np.zeros(g.shape[1], dtype=bool)
    best = np.inf
    while True:
        for todo in _batches(np.argsort(bounds, kind="stable")):
            todo = todo[(bounds[todo] <= best + MARGIN + SCOUTED) & ~exact[todo]]
            if not len(todo):
                continue
            if exact.sum() // REPORT > (exact.sum() - BATCH) // REPORT:
                progress(f"exact densities: {exact.sum()} of at most {len(exact):,} scan planes")
            g[:, todo] = _exact(problem, polar, shown[todo])
            exact[todo] = True
            here = lowest(problem.objective, ways_of(g[:, todo], scouted), open_planes[:, todo], axes.has[:, ::every])[
                0
            ]
            best = min(best, float(here.min()))
        progress(f"all axes of all {len(exact):,} scan planes")
        by_plane, its_class, its_flip, by_axis = lowest(problem.objective, ways_of(g, weights), open_planes, axes.has)
        bounds = by_plane.min(axis=0)
        best = float(bounds[exact].min())
        if not np.any(bounds[~exact] <= best + MARGIN):
            break
    return Landscape(problem.objective, g, weights, by_plane, (its_class, its_flip), by_axis), int(exact.sum())


def _batches(order: Ints) -> list[Ints]:
    """The first one alone, as it sets the mark for all others; then `BATCH` at a time."""
    return [order[:1], *(order[i : i + BATCH] for i in range(1, len(order), BATCH))]


def _means(problem: Problem, polar: Array, planes_rad: Array) -> Array:
    """Mean counts of scan planes (n, 2) at polar angles, shape (n, nodes)."""
    beams = polar_of_planes(problem.bearings_rad, planes_rad)
    return np.stack([mean_count(polar, row, problem.lines, problem.ball_rad) for row in beams])


def _exact(problem: Problem, polar: Array, planes_rad: Float[ndarray, "n 2"]) -> Array:
    """`<g(d)>` of scan planes (alpha_laser, beta_laser) (n, 2) at polar angles, shape (moments, n, nodes)."""

    def rows(plane: Array) -> Array:
        beams, azimuths = polar_and_azimuth(beam_directions_rot(problem.bearings_rad, *plane))
        out = []
        for moment, table in zip(problem.objective.moments, problem.tables, strict=True):
            z = zones(polar, beams, azimuths, problem.lines, problem.ball_rad, table)
            out.append(z.mean_g if moment.gathered == "mean" else moment.g(z.least))
        return np.stack(out)

    parts = in_chunks(lambda chunk: [rows(plane) for plane in planes_rad[chunk]], len(planes_rad), smallest=1)
    return np.stack([row for part in parts for row in part], axis=1)


def _weights_over_polar(
    problem: Problem, field: Field, axes: Float[ndarray, "axes 3"], nodes: int, circles: int
) -> Array:
    """Share of a weight near each polar node about each axis, shape (axes, nodes); rows sum to 1."""
    if problem.grid_step_deg or field.edges > MANY_EDGES:
        if problem.grid_step_deg:
            directions = equal_angle_grid(problem.grid_step_deg)
            samples = Samples(directions, field.weight_at(directions))
        else:
            samples = weighted_samples(field, DIRECTIONS)
        parts = in_chunks(
            lambda chunk: _polar_histogram(samples.directions, samples.weights, axes[chunk], nodes), len(axes), 4
        )
        rows = np.concatenate(parts)
    else:
        polar = (np.arange(circles) + 0.5) * (np.pi / circles)
        rows = _share_between_nodes(field.on_circles_about(axes, polar) * np.sin(polar), nodes)
    total = rows.sum(axis=1, keepdims=True)
    if not (total > 0).all():
        raise TaskError(EMPTY)
    return rows / total


def _share_between_nodes(circles: Array, nodes: int) -> Array:
    """Weights at circle middles, shape (axes, circles), shared linearly between the nodes on both sides."""
    cells = circles.reshape(len(circles), nodes - 1, -1)
    upper = (np.arange(cells.shape[2]) + 0.5) / cells.shape[2]
    shared = np.zeros((len(circles), nodes))
    shared[:, :-1] += cells @ (1 - upper)
    shared[:, 1:] += cells @ upper
    return shared


@njit(cache=True, nogil=True)
def _polar_histogram(directions: Array, weights: Array, axes: Array, nodes: int) -> Array:
    """Weight by polar angle, each direction shared linearly between its two nodes."""
    out = np.zeros((len(axes), nodes))
    for a in range(len(axes)):
        for i in range(len(directions)):
            c = directions[i, 0] * axes[a, 0] + directions[i, 1] * axes[a, 1] + directions[i, 2] * axes[a, 2]
            at = np.arccos(min(1.0, max(-1.0, c))) * ((nodes - 1) / np.pi)
            k = min(int(at), nodes - 2)
            out[a, k] += weights[i] * (k + 1 - at)
            out[a, k + 1] += weights[i] * (at - k)
    return out
