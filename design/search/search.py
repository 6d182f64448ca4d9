"""The search over the four mounting angles: coarse J of the grid, candidates, and their refinement."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from scanwright.design.errors import TaskError
from scanwright.design.left_out import LeftOut
from scanwright.design.objective.holes import NO_BLIND_WEIGHT
from scanwright.design.objective.named_objectives import Moment, Objective
from scanwright.design.objective.problem import Problem
from scanwright.design.progress import Progress, no_progress
from scanwright.design.search.coarse import USUAL, Effort, Landscape, coarse_landscape
from scanwright.design.search.constraints import blinding_words
from scanwright.design.search.families import (
    Candidate,
    Family,
    best_candidate,
    find_candidates,
    joined,
    refine_candidates,
)
from scanwright.design.search.mounts.simplest import simplest_first
from scanwright.design.search.plane_axis_product import lowest
from scanwright.design.search.space import SearchSpace
from scanwright.design.task.angle_ranges import NAMES, AngleRanges
from scanwright.design.task.task import Limits

CANDIDATES_STEP_DEG = 5.0
NONE = Limits()
DENSER = 1.05  # factor of the required density if it is not met between the nodes


@dataclass(frozen=True, slots=True)
class SearchResult:
    """Result of a search.

    Attributes:
        best: families within the limits, best first, without blind spots if possible; with `prefer = "simple"` the
            simplest mount is first.
        plain: the optimum of J alone, if blind spots are avoided and it has some.
        least_blind: the smallest blind share of the weight, if blind spots are to be avoided but every mount has some.
        covered: mounts of the grid.
        evaluated: distinct values of J computed.
        seconds: time of the search.
        left_out: skipped work.
        lowest: the family of the lowest J, if `prefer = "simple"`.
        planes: one row per scan plane of the grid: alpha_laser, beta_laser [deg], the lowest J over all axes, and
            alpha_rot, beta_rot [deg] of its axis.
        axes: one row per axis of the grid: alpha_rot, beta_rot [deg], and the lowest J over all planes.
    """

    best: tuple[Family, ...]
    plain: Family | None
    least_blind: float | None
    covered: int
    evaluated: int
    seconds: float
    left_out: tuple[LeftOut, ...]
    lowest: Family | None
    planes: Float[ndarray, "planes columns"]
    axes: Float[ndarray, "axes 3"]


def search(
    problem: Problem,
    ranges: AngleRanges,
    progress: Progress = no_progress,
    limits: Limits = NONE,
    effort: Effort = USUAL,
) -> SearchResult:
    """Return the best mounts in the ranges of a task that meet its limits and, if possible, have no blind spot.

    Raises:
        TaskError: no direction has a weight, no mount meets the limits, or only the limits cause blind spots.
    """
    start = time.perf_counter()
    space = SearchSpace(problem, ranges, limits, avoid_holes=ranges.holes == "avoid")
    progress(_size_words(space))
    least_blind = None
    land, exact, winner = _best(space, progress, effort)
    if space.avoid_holes and problem.sweep is not None and winner is None:
        space = replace(space, to_the_outline=False)
        winner = best_candidate(land, space)
    if space.avoid_holes and winner is None:  # every mount has a blind spot: use the lowest J
        _reject_blinding_limits(space, progress, effort)
        least_blind = _least_blind(land)
        progress("no mount of the grid sees all of the region: the lowest J of all")
        space = replace(space, avoid_holes=False)
        land, exact, winner = _best(space, progress, effort)
    if winner is None:
        raise TaskError(_none_keeps(land, limits))
    coarse_land = land
    if ranges.step_deg < CANDIDATES_STEP_DEG and problem.sweep is None:
        # basins are wider than a fine grid: a coarse one is enough for the other candidates
        coarse = ranges.model_copy(update={"step_deg": CANDIDATES_STEP_DEG})
        coarse_land, _ = coarse_landscape(replace(land.space, ranges=coarse), progress, effort)
    candidates = find_candidates(coarse_land, space)
    progress("refining the minima")
    families = refine_candidates(space, [winner, *candidates], effort.rounds, progress)
    simple = ranges.prefer == "simple"
    axes = space.axes
    return SearchResult(
        best=simplest_first(space, families) if simple else families,
        plain=_plain(space, land, families[0]) if space.avoid_holes else None,
        least_blind=least_blind,
        covered=space.covered,
        evaluated=space.different,
        seconds=time.perf_counter() - start,
        left_out=_left_out(space, len(space.planes.first) - exact),
        lowest=families[0] if simple else None,
        planes=_plane_table(land),
        axes=np.column_stack([axes.settings_deg, land.plain.by_axis[axes.flip.astype(int), axes.classes]]),
    )


def with_starts(
    problem: Problem,
    ranges: AngleRanges,
    limits: Limits,
    result: SearchResult,
    starts: Iterable[tuple[float, ...]],
    progress: Progress = no_progress,
) -> SearchResult:
    """Return the result of a search after refinement of those starts [deg] that are better than its lowest J.

    A region can be free of blind spots only at mounts between those of the grid. With a tolerance of the mounting the
    result stays, since its best mount does not have the lowest J.
    """
    space = SearchSpace(problem, ranges, limits, avoid_holes=ranges.holes == "avoid" and result.least_blind is None)
    lowest = min(result.best, key=lambda family: family.score.J).score
    better = []
    for start in [] if ranges.tolerance_deg else starts:
        own = space.score(np.array(start))
        if own is not None and own.J + own.J_error < lowest.J - lowest.J_error:
            better.append(Candidate(np.array(start), own.J, own, 1, 1, False))
    if not better:
        return result
    families = joined(refine_candidates(space, better, USUAL.rounds, progress), result.best)
    simple = ranges.prefer == "simple"
    plain = result.plain if result.plain is not None and result.plain.score.J < families[0].score.J else None
    return replace(
        result,
        best=simplest_first(space, families) if simple else families,
        lowest=families[0] if simple else None,
        plain=plain,
    )


def _best(space: SearchSpace, progress: Progress, effort: Effort) -> tuple[Landscape, int, Candidate | None]:
    """Return the landscape of a grid, its number of planes with exact J, and its best mount within the limits, if any.

    The density limit of the landscape can be above that of the task, to meet that between the nodes.
    """
    stricter = space
    while True:
        land, exact = coarse_landscape(stricter, progress, effort)
        candidate = best_candidate(land, space)
        density = stricter.limits.min_density
        if candidate is not None or density is None or not np.isfinite(land.feasible.by_plane).any():
            return land, exact, candidate
        stricter = replace(stricter, limits=stricter.limits.model_copy(update={"min_density": DENSER * density}))


def _reject_blinding_limits(space: SearchSpace, progress: Progress, effort: Effort) -> None:
    """Raise an error if there are mounts without blind spots that the limits on scan planes exclude.

    Raises:
        TaskError: there are.
    """
    limits = space.limits.model_copy(update={"max_line_gap_deg": None, "max_blind_cone_deg": None})
    if limits == space.limits:
        return
    _, _, free = _best(replace(space, limits=limits), progress, effort)
    if free is not None:
        raise TaskError(blinding_words(space.problem, space.limits, free.angles_deg))


def _size_words(space: SearchSpace) -> str:
    planes, axes = len(space.planes.first), len(space.axes.first)
    if space.problem.sweep is None:
        return f"{planes:,} different scan planes x {axes:,} axes, both ways round"
    return f"{planes:,} scan planes x {axes:,} mountings of the servo"


def _plain(space: SearchSpace, land: Landscape, best: Family) -> Family | None:
    """Return the optimum of J alone, if it has a blind spot, to compare the result with it."""
    free = replace(space, avoid_holes=False)
    candidate = best_candidate(land, free, feasible=False)
    if candidate is None or candidate.score is None or candidate.score.blind_weight <= NO_BLIND_WEIGHT:
        return None
    plain = refine_candidates(free, [candidate], rounds=1)[0]
    return plain if plain.score.J < best.score.J else None


def _least_blind(land: Landscape) -> float:
    """Return the smallest blind share of the weight of any mount of the grid."""
    space = land.space
    field = space.problem.field
    moment = Moment(field, np.asarray)
    blind = Objective("blind", field, (moment,), lambda moments: np.asarray(moments[0]))
    shared = zip(land.objective.moments, land.weights, strict=True)
    weights = np.sum([each.share * w for each, w in shared if each.share], axis=0)
    orientations = land.nodes.orientations(moment, land.blind, weights)
    low, _ = lowest(blind, [orientations], space.planes.has | space.planes.own, space.axes.has)
    least = replace(
        land, objective=blind, g=land.blind[None], weights=(weights,), constraints=(), plain=low, feasible=low
    )
    candidate = best_candidate(least, replace(space, limits=NONE, avoid_holes=False))
    assert candidate is not None and candidate.score is not None
    return candidate.score.blind_weight


def _none_keeps(land: Landscape, limits: Limits) -> str:
    """Return the message of a search without a result, with the figures of the mount of the lowest J."""
    nearest = best_candidate(land, replace(land.space, limits=NONE, avoid_holes=False), feasible=False)
    if nearest is None or nearest.score is None:
        return "weight: no setting of the grid brings a beam near the region: widen it, the angles, or ball_radius_deg"
    required = ", ".join(
        f"{name} = {value:g}"
        for name, value in (("min_density", limits.min_density), ("max_blind_weight", limits.max_blind_weight))
        if value is not None
    )
    return (
        f"limits: {required}: no setting of the grid keeps them; the one of the lowest J has min_density "
        f"{nearest.score.least} and max_blind_weight {nearest.score.blind_weight:.2g}; a longer period helps, or a "
        "smaller region"
    )


def _plane_table(land: Landscape) -> Float[ndarray, "planes 5"]:
    """See `SearchResult.planes`."""
    planes, axes, low = land.space.planes, land.space.axes, land.plain
    flip = planes.flip.astype(int)
    J = low.by_plane[flip, planes.classes]
    its_class, its_flip = (side[flip, planes.classes] for side in (low.its_class, low.its_flip))
    setting = np.full((2, len(axes.first)), -1)
    order = np.arange(len(axes.settings_deg))[::-1]  # the first of each class is written last
    setting[axes.flip[order].astype(int), axes.classes[order]] = order
    setting = np.where(setting < 0, setting[::-1], setting)
    return np.column_stack([planes.settings_deg, J, axes.settings_deg[setting[its_flip, its_class]]])


def _left_out(space: SearchSpace, bounded: int) -> tuple[LeftOut, ...]:
    covered, different = space.covered, space.different
    out = []
    fixed = [f"{name}_deg" for name in NAMES if len(space.ranges.grid_deg(name)) == 1]
    if fixed:
        out.append(LeftOut("search over " + ", ".join(fixed), "the task fixes them", len(fixed), "angles"))
    if covered > different:
        why = "same J by symmetry of scan plane and axis"
        out.append(LeftOut("equivalent settings", why, covered - different, "settings"))
    if bounded:
        why = "the bound from their mean density cannot beat the best setting"
        out.append(LeftOut("exact densities", why, bounded, "scan planes"))
    return tuple(out)
