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

MARGIN = 0.15  # what the coarse J of the search may be off by: 0.134 was seen, for a ball of 0.5 deg
BLIND_MARGIN = 0.02  # what a blind share told from nodes may be off by: the few best settings are asked exactly
REPORT = 1000  # planes between two lines of progress
SCOUTED = 0.05  # what a bound over the scouts may be above that over all axes: else all are visited twice
SCOUTS = 1500  # axes that tell how low a plane's bound comes, before all are visited


@dataclass(frozen=True, slots=True)
class Landscape:
    """Coarse J over all planes and axes, as the factors of its products and the lowest along each side.

    Attributes:
        space: the mounts.
        nodes: what the factors are over.
        objective: how moments become J.
        g: `<g(d)>` of each moment and plane class over the polar nodes, or its bound, (moments, planes, nodes).
        weights: share of each moment's weight about each axis class over the nodes, (axes, nodes) each.
        blind: whether nodes are beyond a ball radius of the fan of a plane class, 1 or 0, (planes, nodes).
        constraints: what settings must keep.
        plain: lowest J of all settings.
        feasible: lowest J of those that keep the constraints.
    """

    space: SearchSpace
    nodes: Nodes
    objective: Objective
    g: Array
    weights: tuple[Array, ...]
    blind: Array
    constraints: tuple[Constraint, ...]
    plain: Lowest
    feasible: Lowest

    def about_axes(self, planes: slice) -> Float[ndarray, "planes ways axes"]:
        """J of plane classes, not flipped, about each axis class, not flipped and flipped, shape (planes, 2, axes)."""
        parts = [
            np.stack([gathered(moment, w, g[planes]), gathered(moment, w, g[planes, ::-1])], axis=1)
            for moment, w, g in zip(self.objective.moments, self.weights, self.g, strict=True)
        ]
        return self.objective.join(np.stack(parts))

    def broken(self, planes: slice) -> Bool[ndarray, "planes ways axes"]:
        """Settings of those plane classes that break a constraint, shape (planes, 2, axes)."""
        result = [np.stack(constraint.broken(planes, slice(None)), axis=1) for constraint in self.constraints]
        return np.any(result, axis=0) if result else np.zeros((1, 1, 1), dtype=bool)


@dataclass(frozen=True, slots=True)
class Effort:
    """What a search spends where it has a choice: `design.accuracy.search_trials` measures what more of it brings.

    Attributes:
        fineness: of the nodes or directions that coarse J is taken from, 1 as `coarse_landscape` says.
        margin: what coarse J may be off by: planes whose bound is further above the best stay a bound.
        rounds: of refinement: 0 none, 1 a rough one, 2 a rough and a fine one.
    """

    fineness: float = 1.0
    margin: float = MARGIN
    rounds: int = 2


USUAL = Effort()


def coarse_landscape(space: SearchSpace, progress: Progress, effort: Effort = USUAL) -> tuple[Landscape, int]:
    """Coarse J of everything, and how many planes of it are exact.

    The others keep their bound, g of the mean count: it is above the best by more than the search may be off.

    Raises:
        TaskError: no direction has a weight, or the grid of a sweep has too many mounts.
    """
    problem, limits, planes, axes = space.problem, space.limits, space.planes, space.axes
    moments = problem.objective.moments
    nodes = (Circles if problem.sweep is None else Directions)(space, effort.fineness)
    over: dict[int, Array] = {}  # moments share fields

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
    if limits.min_density is not None:  # at most the mean count, until it is exact
        least = np.floor(mean / problem.lines.repeats + 1e-9) * problem.lines.repeats
        thin = (least < limits.min_density).astype(np.float32)
        constraints.append(AtMost(thin, nodes.inside(weights_of(problem.field)), 0.5, nodes.turns))
    if limits.max_blind_weight is not None:
        shares = weights_of(problem.field).astype(np.float32)
        constraints.append(AtMost(blind, shares, limits.max_blind_weight + BLIND_MARGIN, nodes.turns))
    open_planes = planes.has | planes.own

    def lowest_of(these: slice | Ints, every: slice) -> tuple[Lowest, Lowest]:
        sides = zip(moments, g, weights, strict=True)
        orientations = [nodes.orientations(moment, of_g[these], w[every]) for moment, of_g, w in sides]
        feasible = [constraint.of(these, every) for constraint in constraints]
        return lowest(problem.objective, orientations, open_planes[:, these], axes.has[:, every], feasible)

    def look(batch: Ints) -> None:
        g[:, batch], least = nodes.exact(batch)
        if limits.min_density is not None:
            thin[batch] = least < limits.min_density

    size = g.shape[1], len(axes.first)
    plain, feasible, exact = settled(lowest_of, look, size, nodes.batch, effort.margin, progress)
    return Landscape(space, nodes, problem.objective, g, weights, blind, tuple(constraints), plain, feasible), exact


def settled(
    lowest_of: Callable[[slice | Ints, slice], tuple[Lowest, Lowest]],
    look: Callable[[Ints], None],
    size: tuple[int, int],
    batch_size: int,
    margin: float,
    progress: Progress,
) -> tuple[Lowest, Lowest, int]:
    """The lowest J of all settings and of those that keep the constraints, once no bound can beat it; exact planes.

    Args:
        lowest_of: both of some planes about some axes.
        look: makes the g of some planes exact, where it was a bound from below.
        size: numbers of planes and axes.
        batch_size: planes that are made exact before the bounds are asked again.
        margin: what J may be off by.
        progress: called every `REPORT` planes, with the share of the planes that are exact: not all need to be.
    """
    step = max(1, size[1] // SCOUTS)
    everything, scouts = slice(None), slice(None, None, step)
    mark = margin + (SCOUTED if step > 1 else 0.0)
    bounds = _by_plane(lowest_of(everything, scouts))
    exact = np.zeros(size[0], dtype=bool)
    best = np.full(2, np.inf)  # of all settings, and of those that keep the constraints
    while True:
        for batch in _batches(bounds, batch_size):
            batch = batch[_may_win(bounds[:, batch], best + mark) & ~exact[batch]]
            if not len(batch):
                continue
            if exact.sum() // REPORT > (exact.sum() - batch_size) // REPORT:
                progress("exact densities of the scan planes", exact.mean())
            look(batch)
            exact[batch] = True
            best = np.minimum(best, _by_plane(lowest_of(batch, scouts)).min(axis=1))
        progress("all axes of all scan planes")
        plain, feasible = lowest_of(everything, everything)
        bounds = _by_plane((plain, feasible))
        best = np.where(exact, bounds, np.inf).min(axis=1)
        if not np.any(_may_win(bounds, best + margin) & ~exact):
            return plain, feasible, int(exact.sum())


def _by_plane(both: tuple[Lowest, Lowest]) -> Float[ndarray, "2 planes"]:
    """Lowest J of each plane either way round: of all settings, and of those that keep the constraints."""
    return np.stack([side.by_plane.min(axis=0) for side in both])


def _may_win(bounds: Float[ndarray, "2 planes"], best: Float[ndarray, " 2"]) -> Mask:
    """Planes whose bound is not above the best: that of all settings, or that of those that keep the constraints."""
    return (np.isfinite(bounds) & (bounds <= best[:, None])).any(axis=0)


def _batches(bounds: Float[ndarray, "2 planes"], size: int) -> list[Ints]:
    """Planes by how far their bounds are above the lowest: the first alone, as they set the mark for all others."""
    finite = np.isfinite(bounds)
    lowest_of_all = np.where(finite.any(axis=1), np.where(finite, bounds, np.inf).min(axis=1), 0.0)
    order = np.argsort((bounds - lowest_of_all[:, None]).min(axis=0), kind="stable")
    return [order[:1], order[1:2], *(order[i : i + size] for i in range(2, len(order), size))]
