"""Coarse J over every scan plane and every axis: one matrix product.

J of a scan plane about an axis is its `<g(d)>` over the polar angle times the weight about the axis over the polar
angle. g of the mean count bounds J from below (g is convex): planes are taken in the order of that bound, and the
exact `<g(d)>` is computed until no bound can beat the best. The product is made in pieces, and only the lowest J of
every plane and about every axis is kept.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit

from design.beams import beam_directions_rot, polar_and_azimuth
from design.density import mean_count, zones
from design.errors import TaskError
from design.folding import Folded, Mask
from design.frames import Array
from design.objective import MANY_EDGES, Problem, log_density
from design.parallel import in_chunks
from design.sphere import EMPTY, Samples, equal_angle_grid, weighted_samples

FEW_AXES = 4000  # up to here the polar angle gets a node every 0.5 deg, beyond every 1 deg
MOST_NODES = 1441  # for balls below half a degree
BATCH = 64  # planes whose exact densities are computed before the bound is asked again
DIRECTIONS = 20_000  # that stand for a map, where circles would be slower
MARGIN = 0.15  # what the coarse J of the search may be off by: 0.134 was seen, for a ball of 0.5 deg
REPORT = 1000  # planes between two lines of progress
PIECE = 128  # planes per piece of the product
SCOUTED = 0.05  # what a bound over the scouts may be above that over all axes: else all are visited twice
SCOUTS = 1500  # axes that tell how low a plane's bound comes, before all are visited

Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Landscape:
    """Coarse J over all planes and axes, as the factors of its matrix product and the lowest along each side.

    `g` and `weights` give J of plane class c about axis class a: `g[c] @ weights[a]`, with `g[c]` reversed where just
    one of the two is flipped.

    Attributes:
        g: `<g(d)>` of each plane class over the polar nodes, or its bound, (planes, nodes).
        weights: share of the weight about each axis class, (axes, nodes).
        by_plane: lowest J of a plane class, not flipped and flipped, over the axes of the grid, (2, planes).
        its_axis: axis class where that was, and whether it is flipped, (2, planes) each.
        by_axis: lowest J about an axis class, not flipped and flipped, over the planes of the grid, (2, axes).
    """

    g: Array
    weights: Array
    by_plane: Array
    its_axis: tuple[Array, Array]
    by_axis: Array

    def about_axes(self, plane: int) -> Array:
        """J of one plane class, not flipped, about each axis class, not flipped and flipped, shape (2, axes)."""
        return np.stack([self.weights @ self.g[plane], self.weights @ self.g[plane, ::-1]])


def landscape_of(problem: Problem, planes: Folded, axes: Folded, progress: Progress) -> tuple[Landscape, int]:
    """Coarse J of everything, and how many planes of it are exact.

    The others keep their bound, g of the mean count: it is above the best by more than the search may be off.
    """
    few = len(axes.first) <= FEW_AXES
    # caustics are as wide as the ball: a node every quarter of it, and every 0.5 deg at least
    nodes = min(MOST_NODES, int(max(360, 4 * np.pi / problem.ball_rad)) + 1) if few else 181
    circles = max(nodes - 1, 720 - 720 % (nodes - 1)) if few else nodes - 1
    polar = np.linspace(0, np.pi, nodes)
    weights = _weights_over_polar(problem, axes.representatives, nodes, circles)
    shown = np.radians(planes.settings_deg[planes.first])
    swept = [polar_and_azimuth(beam_directions_rot(problem.bearings_rad, *plane)) for plane in shown]
    means = in_chunks(
        lambda chunk: [
            mean_count(polar, swept[i][0], problem.lines, problem.ball_rad) for i in range(len(swept))[chunk]
        ],
        len(swept),
        smallest=1,
    )
    g = log_density(np.stack([mean for part in means for mean in part]))
    open_planes = planes.has | planes.own
    scouts = slice(None, None, max(1, len(weights) // SCOUTS))
    bounds = _lowest(g, weights[scouts], open_planes, axes.has[:, scouts])[0].min(axis=0)
    exact = np.zeros(len(g), dtype=bool)
    best = np.inf
    while True:
        for todo in _batches(np.argsort(bounds, kind="stable")):
            todo = todo[(bounds[todo] <= best + MARGIN + SCOUTED) & ~exact[todo]]
            if not len(todo):
                continue
            if exact.sum() // REPORT > (exact.sum() - BATCH) // REPORT:
                progress(f"exact densities: {exact.sum()} of at most {len(g):,} scan planes")
            g[todo] = _exact(problem, polar, [swept[i] for i in todo])
            exact[todo] = True
            here = _lowest(g[todo], weights[scouts], open_planes[:, todo], axes.has[:, scouts])[0]
            best = min(best, float(here.min()))
        progress(f"all axes of all {len(g):,} scan planes")
        by_plane, its_class, its_flip, by_axis = _lowest(g, weights, open_planes, axes.has)
        bounds = by_plane.min(axis=0)
        best = float(bounds[exact].min())
        if not np.any(bounds[~exact] <= best + MARGIN):
            break
    return Landscape(g, weights, by_plane, (its_class, its_flip), by_axis), int(exact.sum())


def _batches(order: Array) -> list[Array]:
    """The first one alone, as it sets the mark for all others; then `BATCH` at a time."""
    return [order[:1], *(order[i : i + BATCH] for i in range(1, len(order), BATCH))]


def _exact(problem: Problem, polar: Array, swept: list[tuple[Array, Array]]) -> Array:
    """`<g(d)>` of scan planes (beam polar angles and azimuths) at polar angles, shape (planes, nodes)."""
    parts = in_chunks(
        lambda chunk: [
            zones(polar, beams, azimuths, problem.lines, problem.ball_rad, problem.g).mean_g
            for beams, azimuths in swept[chunk]
        ],
        len(swept),
        smallest=1,
    )
    return np.stack([row for part in parts for row in part])


def _lowest(g: Array, weights: Array, has_plane: Mask, has_axis: Mask) -> tuple[Array, Array, Array, Array]:
    """Lowest J of every plane (with the axis it is about) and about every axis, for the flips that the grid holds.

    Reversing g changes the sign of its odd part only, so both ways round cost one product of the even parts and one
    of the odd parts: J is their sum and their difference.
    """
    g_even, g_odd = _parts(g)
    w_even, w_odd = (np.ascontiguousarray(part.T, dtype=np.float32) for part in _parts(weights))
    w_even[:-1] *= 2
    w_odd *= 2
    closed_axis = np.where(has_axis, 0, np.inf).astype(np.float32)
    closed_plane = np.where(has_plane, 0, np.inf).astype(np.float32)
    by_plane = np.empty((2, len(g)), np.float32)
    its_class: Array = np.empty((2, len(g)), np.intp)
    its_flip: Array = np.empty((2, len(g)), np.intp)
    by_axis = np.full((2, len(weights)), np.inf, np.float32)
    full = bool(has_plane.all() and has_axis.all())
    for first in range(0, len(g), PIECE):
        piece = slice(first, first + PIECE)
        even = g_even[piece].astype(np.float32) @ w_even
        odd = g_odd[piece].astype(np.float32) @ w_odd
        rows = np.arange(len(even))
        if full:  # nothing is closed: both flips see the lower of the two ways round
            both = even - np.abs(odd)
            by_axis[:] = np.minimum(by_axis, both.min(axis=0))
            where = both.argmin(axis=1)
            way = (odd[rows, where] > 0).astype(int)
            for flip in (0, 1):
                by_plane[flip, piece], its_class[flip, piece] = both[rows, where], where
                its_flip[flip, piece] = flip ^ way
            continue
        J = (even + odd, even - odd)
        for flip in (0, 1):
            flat = np.hstack([J[flip ^ other] + closed_axis[other] for other in (0, 1)])
            where = flat.argmin(axis=1)
            by_plane[flip, piece] = flat[rows, where] + closed_plane[flip, piece]
            its_flip[flip, piece], its_class[flip, piece] = np.divmod(where, len(weights))
            about = np.minimum(*(J[flip ^ other] + closed_plane[other, piece, None] for other in (0, 1)))
            by_axis[flip] = np.minimum(by_axis[flip], about.min(axis=0) + closed_axis[flip])
    return by_plane.astype(float), its_class, its_flip, by_axis.astype(float)


def _parts(rows: Array) -> tuple[Array, Array]:
    """Even part (middle node last) and odd part of rows over an odd number of polar nodes."""
    half = rows.shape[1] // 2
    upper, lower = rows[:, : half + 1], rows[:, ::-1][:, : half + 1]
    return (upper + lower) / 2, ((upper - lower) / 2)[:, :half]


def _weights_over_polar(problem: Problem, axes: Array, nodes: int, circles: int) -> Array:
    """Share of the weight near each polar node about each axis, shape (axes, nodes); rows sum to 1."""
    field = problem.field
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
