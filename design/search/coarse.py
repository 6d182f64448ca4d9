"""Coarse J of every scan plane about every axis, by one matrix product for each moment.

A moment of a scan plane about an axis is the product of its `<g(d)>` and the weight about the axis, over the polar
angle. g of the mean count bounds J from below since g is convex. Planes are made exact in the order of that bound until
no bound is below the best J. Only the lowest J of every plane and about every axis is stored.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from scanwright.design.arrays import Array, Ints, Mask
from scanwright.design.objective.named_objectives import Objective
from scanwright.design.progress import Progress
from scanwright.design.search.coarse_nodes import Circles, Directions, Nodes
from scanwright.design.search.constraints import AtMost, Constraint
from scanwright.design.search.plane_axis_product import Lowest, gathered, lowest
from scanwright.design.search.space import SearchSpace
from scanwright.design.sphere.regions import Field

MARGIN = 0.15  # error of the coarse J: up to 0.134 was measured, for a ball of 0.5 deg
BLIND_MARGIN = 0.02  # error of a blind share computed on nodes
REPORT = 1000  # planes between two progress reports
SCOUTS = 1500  # axes of which the first bounds are computed, a subset of all
SCOUTED = 0.05  # how far the lowest J over this subset may be above that over all axes


@dataclass(frozen=True, slots=True)
class Landscape:
    """Coarse J over all planes and axes: the factors of its products, and the lowest of each plane and axis."""

    space: SearchSpace  # the mounts
    nodes: Nodes  # over which the factors are given
    objective: Objective  # joins the moments to J
    g: Array  # `<g(d)>` of each moment and plane class, or its bound, (moments, planes, nodes)
    # for each moment, the share of its weight at the nodes about each axis class, (axes, nodes)
    weights: tuple[Array, ...]
    blind: Array  # 1 if a node is blind for a plane class, else 0, (planes, nodes)
    constraints: tuple[Constraint, ...]  # of the mounts
    plain: Lowest  # lowest J of all mounts
    feasible: Lowest  # lowest J of the mounts that meet the constraints

    def about_axes(self, planes: slice) -> Float[ndarray, "planes orientations axes"]:
        """Return J of plane classes, not flipped, about each axis class, not flipped and flipped: (planes, 2, axes)."""
        parts = [
            np.stack([gathered(moment, w, g[planes]), gathered(moment, w, g[planes, ::-1])], axis=1)
            for moment, w, g in zip(self.objective.moments, self.weights, self.g, strict=True)
        ]
        return self.objective.join(np.stack(parts))

    def broken(self, planes: slice) -> Bool[ndarray, "planes orientations axes"]:
        """Return whether the mounts of `about_axes` break a constraint, shape (planes, 2, axes)."""
        result = [np.stack(constraint.broken(planes, slice(None)), axis=1) for constraint in self.constraints]
        return np.any(result, axis=0) if result else np.zeros((1, 1, 1), dtype=bool)


@dataclass(frozen=True, slots=True)
class Effort:
    """Numerical choices of a search, whose effect `benchmarks/trials/search_effort.py` measures."""

    fineness: float = 1.0  # factor of the number of nodes or directions of coarse J
    margin: float = MARGIN  # assumed error of coarse J: planes whose bound is farther above the best are not made exact
    rounds: int = 2  # of refinement: 0 none, 1 rough, 2 rough and fine


USUAL = Effort()


def coarse_landscape(space: SearchSpace, progress: Progress, effort: Effort = USUAL) -> tuple[Landscape, int]:
    """Return coarse J of all mounts, and the number of planes with exact J; the others have a bound above the best.

    Raises:
        TaskError: no direction has a weight, or the grid of a sweep has too many mounts.
    """
    problem, limits, planes, axes = space.problem, space.limits, space.planes, space.axes
    moments = problem.objective.moments
    nodes = (Circles if problem.sweep is None else Directions)(space, effort.fineness)
    over: dict[int, Array] = {}  # cache, since moments share fields

    def weights_of(field: Field) -> Array:
        if id(field) not in over:
            over[id(field)] = nodes.weights(field)
        return over[id(field)]

    progress(f"weights of the region and mean densities of {len(planes.first):,} scan planes")
    weights = tuple(weights_of(moment.field) for moment in moments)
    mean = nodes.means()
    g = np.stack([moment.g(mean) for moment in moments])
    blind = nodes.blind(mean)
    thin = np.zeros((0, 0), np.float32)
    constraints: list[Constraint] = []
    if space.avoid_holes:
        constraints.append(nodes.no_hole(problem.field, blind, weights_of(problem.field)))
    if limits.min_density is not None:  # the lowest count is at most the mean count, until it is exact
        least = np.floor(mean / problem.lines.repeats + 1e-9) * problem.lines.repeats
        thin = (least < limits.min_density).astype(np.float32)
        constraints.append(AtMost(thin, nodes.inside(weights_of(problem.field)), 0.5, nodes.turns))
    if limits.max_blind_weight is not None:
        shares = weights_of(problem.field).astype(np.float32)
        constraints.append(AtMost(blind, shares, limits.max_blind_weight + BLIND_MARGIN, nodes.turns))
    allowed_planes = planes.has | planes.own

    def lowest_of(these: slice | Ints, every: slice) -> tuple[Lowest, Lowest]:
        sides = zip(moments, g, weights, strict=True)
        orientations = [nodes.orientations(moment, of_g[these], w[every]) for moment, of_g, w in sides]
        feasible = [constraint.of(these, every) for constraint in constraints]
        return lowest(problem.objective, orientations, allowed_planes[:, these], axes.has[:, every], feasible)

    def make_exact(batch: Ints) -> None:
        g[:, batch], least = nodes.exact(batch)
        if limits.min_density is not None:
            thin[batch] = least < limits.min_density

    size = g.shape[1], len(axes.first)
    plain, feasible, exact = lowest_within(lowest_of, make_exact, size, nodes.batch, effort.margin, progress)
    return Landscape(space, nodes, problem.objective, g, weights, blind, tuple(constraints), plain, feasible), exact


def lowest_within(
    lowest_of: Callable[[slice | Ints, slice], tuple[Lowest, Lowest]],
    make_exact: Callable[[Ints], None],
    size: tuple[int, int],
    batch_size: int,
    margin: float,
    progress: Progress,
) -> tuple[Lowest, Lowest, int]:
    """Return the lowest J of all mounts and of those that meet the constraints, and the number of exact planes.

    `lowest_of` returns both for some planes about some axes. `make_exact` replaces the bounds of a batch of planes by
    exact values, until no bound is within `margin` of the lowest J. `size` are the numbers of planes and axes.
    """
    step = max(1, size[1] // SCOUTS)
    everything, scouts = slice(None), slice(None, None, step)
    near = margin + (SCOUTED if step > 1 else 0.0)
    bounds = _by_plane(lowest_of(everything, scouts))
    exact = np.zeros(size[0], dtype=bool)
    best = np.full(2, np.inf)  # of all mounts, and of those that meet the constraints
    while True:
        for batch in _batches(bounds, batch_size):
            batch = batch[_may_win(bounds[:, batch], best + near) & ~exact[batch]]
            if not len(batch):
                continue
            if exact.sum() // REPORT > (exact.sum() - batch_size) // REPORT:
                progress("exact densities of the scan planes", exact.mean())
            make_exact(batch)
            exact[batch] = True
            best = np.minimum(best, _by_plane(lowest_of(batch, scouts)).min(axis=1))
        progress("all axes of all scan planes")
        plain, feasible = lowest_of(everything, everything)
        bounds = _by_plane((plain, feasible))
        best = np.where(exact, bounds, np.inf).min(axis=1)
        if not np.any(_may_win(bounds, best + margin) & ~exact):
            return plain, feasible, int(exact.sum())


def _by_plane(both: tuple[Lowest, Lowest]) -> Float[ndarray, "2 planes"]:
    """Return the lowest J of each plane in both orientations: of all mounts, and of those that meet the constraints."""
    return np.stack([side.by_plane.min(axis=0) for side in both])


def _may_win(bounds: Float[ndarray, "2 planes"], best: Float[ndarray, " 2"]) -> Mask:
    """Return whether either bound of each plane is at most the best."""
    return (np.isfinite(bounds) & (bounds <= best[:, None])).any(axis=0)


def _batches(bounds: Float[ndarray, "2 planes"], size: int) -> list[Ints]:
    """Return batches of planes in the order of their bounds; the first two have one plane, to get a good best early."""
    finite = np.isfinite(bounds)
    lowest_of_all = np.where(finite.any(axis=1), np.where(finite, bounds, np.inf).min(axis=1), 0.0)
    order = np.argsort((bounds - lowest_of_all[:, None]).min(axis=0), kind="stable")
    return [order[:1], order[1:2], *(order[i : i + size] for i in range(2, len(order), size))]
