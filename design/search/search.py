"""The search over the four mounting angles: fold the grid, find J of all of it, show the best families."""

from __future__ import annotations

import time
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
from scanwright.design.search.coarse_sweep import swept_landscape
from scanwright.design.search.constraints import Requirements
from scanwright.design.search.families import Candidate, Family, best_candidate, find_candidates, refine_candidates
from scanwright.design.search.grid_classes import Folded, fold_axes, fold_planes, mirrors_of, unfolded
from scanwright.design.search.limits import allowed_planes, blinding_words
from scanwright.design.search.mounts.simplest import simplest_first
from scanwright.design.search.plane_axis_product import Lowest, both_orientations, lowest, one_orientation
from scanwright.design.task.angle_ranges import NAMES, AngleRanges
from scanwright.design.task.task import Limits

CANDIDATES_STEP_DEG = 5.0
NONE = Limits()
DENSER = 1.05  # where a density is not kept between the nodes


@dataclass(frozen=True, slots=True)
class SearchResult:
    """What the search found.

    Attributes:
        best: families, best first; all keep the limits, and none has a hole where they can be avoided. With
            `prefer = "simple"` the simplest mount comes first.
        plain: the optimum of J alone, where holes are avoided and it has some.
        least_blind: where every setting has holes that were to be avoided, the smallest share of weight in them.
        covered: grid settings that the answer stands for.
        evaluated: distinct values of J computed.
        seconds: time of the search and the rescoring.
        left_out: what was skipped.
        lowest: the family of the lowest J, to which the simplest mount is preferred; None if that is not asked for.
        planes: one row per scan-plane setting of the grid: alpha_laser, beta_laser [deg], the lowest J of the search
            over all axes, and the axis alpha_rot, beta_rot [deg] it was found about.
        axes: one row per axis of the grid: alpha_rot, beta_rot [deg], the lowest J of the search over all planes.
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
    """Find the best families of settings in the ranges of a task that keep its limits and, if they can, have no hole.

    Raises:
        TaskError: no direction has a weight, no setting keeps the limits, or they leave only settings with a hole and
            without them there are others.
    """
    start = time.perf_counter()
    mirrors = mirrors_of(problem.bearings_rad)[: None if problem.sweep is None else 1]
    fine = _grid(problem, ranges, limits)
    progress(_looked_over(problem, fine))
    avoid = ranges.holes == "avoid"
    least_blind = None
    required = Requirements(problem, limits, avoid)
    result = _best(required, fine, progress, effort)
    if avoid and result.candidate is None:  # nothing is free of holes: the lowest J of all
        _refuse_limits_that_blind(required, ranges, progress, effort)
        least_blind = _least_blind(problem, result.land, fine)
        progress("no setting of the grid sees all of the region: the lowest J of all")
        avoid, required = False, replace(required, avoid_holes=False)
        result = _best(required, fine, progress, effort)
    land, winner = result.land, result.candidate
    if winner is None:
        raise TaskError(_none_keeps(problem, land, fine, limits))
    if ranges.step_deg >= CANDIDATES_STEP_DEG or problem.sweep is not None:
        candidates = find_candidates(land, *fine, mirrors, required)
    else:  # a basin is wider than the fine grid: look for the candidates on a coarse one, for the winner on both
        coarse = _grid(problem, ranges.model_copy(update={"step_deg": CANDIDATES_STEP_DEG}), limits)
        candidates = find_candidates(
            _landscape(problem, coarse, progress, result.asked, avoid, effort)[0], *coarse, mirrors, required
        )
    progress("refining the minima")
    families = refine_candidates(problem, ranges, [winner, *candidates], required, effort.rounds, progress)
    simple = ranges.prefer == "simple"
    covered = len(fine[1].settings_deg) * len(fine[0].settings_deg)
    different = _different(*fine)
    return SearchResult(
        best=simplest_first(required, ranges, families) if simple else families,
        plain=_plain(problem, ranges, limits, land, fine, families[0]) if avoid else None,
        least_blind=least_blind,
        covered=covered,
        evaluated=different,
        seconds=time.perf_counter() - start,
        left_out=_left_out(ranges, covered, different, len(fine[0].first) - result.exact),
        lowest=families[0] if simple else None,
        planes=_plane_table(*fine, land.plain),
        axes=np.column_stack([fine[1].settings_deg, land.plain.by_axis[fine[1].flip.astype(int), fine[1].classes]]),
    )


Grid = tuple[Folded, Folded]
"""Scan planes and axes."""


@dataclass(frozen=True, slots=True)
class _Best:
    """The setting of a grid that is best.

    Attributes:
        land: what it is the lowest of.
        exact: scan planes that were looked at.
        asked: limits of the nodes; those of a task, or more where what keeps them at the nodes does not between them.
        candidate: it; None where no setting keeps what is asked.
    """

    land: Landscape
    exact: int
    asked: Limits
    candidate: Candidate | None


def _best(required: Requirements, grid: Grid, progress: Progress, effort: Effort) -> _Best:
    problem, asked, avoid = required.problem, required.limits, required.avoid_holes
    land, exact = _landscape(problem, grid, progress, asked, avoid, effort)
    candidate = best_candidate(land, *grid, required)
    while candidate is None and asked.min_density is not None and np.isfinite(land.feasible.by_plane).any():
        asked = asked.model_copy(update={"min_density": DENSER * asked.min_density})
        land, exact = _landscape(problem, grid, progress, asked, avoid, effort)
        candidate = best_candidate(land, *grid, required)
    return _Best(land, exact, asked, candidate)


def _refuse_limits_that_blind(required: Requirements, ranges: AngleRanges, progress: Progress, effort: Effort) -> None:
    """Nothing, unless the limits on scan planes forbid settings that see all of the region.

    Raises:
        TaskError: they do.
    """
    limits = required.limits.model_copy(update={"max_line_gap_deg": None, "max_blind_cone_deg": None})
    if limits == required.limits:
        return
    free = _best(replace(required, limits=limits), _grid(required.problem, ranges, limits), progress, effort)
    if free.candidate is not None:
        raise TaskError(blinding_words(required.problem, required.limits, free.candidate.angles_deg))


def _grid(problem: Problem, ranges: AngleRanges, limits: Limits) -> Grid:
    if problem.sweep is None:
        return allowed_planes(problem, fold_planes(ranges, mirrors_of(problem.bearings_rad)), limits), fold_axes(ranges)
    axes, planes = unfolded(ranges)
    return allowed_planes(problem, planes, limits), axes


def _looked_over(problem: Problem, grid: Grid) -> str:
    planes, axes = (len(side.first) for side in grid)
    if problem.sweep is None:
        return f"{planes:,} different scan planes x {axes:,} axes, both ways round"
    return f"{planes:,} scan planes x {axes:,} mountings of the servo"


def _landscape(
    problem: Problem, grid: Grid, progress: Progress, limits: Limits, avoid_holes: bool, effort: Effort
) -> tuple[Landscape, int]:
    make = coarse_landscape if problem.sweep is None else swept_landscape
    return make(problem, *grid, progress, limits, avoid_holes, effort)


def _plain(
    problem: Problem, ranges: AngleRanges, limits: Limits, land: Landscape, grid: Grid, best: Family
) -> Family | None:
    """The optimum of J alone, where it has a hole: what the answer is compared with."""
    required = Requirements(problem, limits, avoid_holes=False)
    candidate = best_candidate(land, *grid, required, feasible=False)
    if candidate is None or candidate.score is None or candidate.score.blind_weight <= NO_BLIND_WEIGHT:
        return None
    plain = refine_candidates(problem, ranges, [candidate], required, rounds=1)[0]
    return plain if plain.score.J < best.score.J else None


def _least_blind(problem: Problem, land: Landscape, grid: Grid) -> float:
    """The smallest share of weight that a setting of the grid leaves blind."""
    planes, axes = grid
    moment = Moment(problem.field, np.asarray)
    blind = Objective("blind", problem.field, (moment,), lambda moments: np.asarray(moments[0]))
    shared = zip(land.objective.moments, land.weights, strict=True)
    weights = np.sum([each.share * w for each, w in shared if each.share], axis=0)
    orientations = (both_orientations if problem.sweep is None else one_orientation)(moment, land.blind, weights)
    low, _ = lowest(blind, [orientations], planes.has | planes.own, axes.has)
    least = replace(
        land, objective=blind, g=land.blind[None], weights=(weights,), constraints=(), plain=low, feasible=low
    )
    candidate = best_candidate(least, planes, axes, Requirements(problem, NONE, avoid_holes=False))
    assert candidate is not None and candidate.score is not None
    return candidate.score.blind_weight


def _none_keeps(problem: Problem, land: Landscape, grid: Grid, limits: Limits) -> str:
    """Why a search has no answer, with what the setting of the lowest J reaches."""
    nearest = best_candidate(land, *grid, Requirements(problem, NONE, avoid_holes=False), feasible=False)
    if nearest is None or nearest.score is None:
        return "weight: no setting of the grid brings a beam near the region: widen it, the angles, or ball_radius_deg"
    asked = ", ".join(
        f"{name} = {value:g}"
        for name, value in (("min_density", limits.min_density), ("max_blind_weight", limits.max_blind_weight))
        if value is not None
    )
    return (
        f"limits: {asked}: no setting of the grid keeps them; the one of the lowest J has min_density "
        f"{nearest.score.least} and max_blind_weight {nearest.score.blind_weight:.2g}; a longer period helps, or a "
        "smaller region"
    )


def _different(planes: Folded, axes: Folded) -> int:
    """Number of different J: every pair of classes both ways round, but once where both come in one way only."""
    one_orientation = int((~(planes.has | planes.own).all(axis=0)).sum()) * int((~axes.has.all(axis=0)).sum())
    return 2 * len(planes.first) * len(axes.first) - one_orientation


def _plane_table(planes: Folded, axes: Folded, low: Lowest) -> Float[ndarray, "planes 5"]:
    """See `SearchResult.planes`."""
    flip = planes.flip.astype(int)
    J = low.by_plane[flip, planes.classes]
    its_class, its_flip = (side[flip, planes.classes] for side in (low.its_class, low.its_flip))
    setting = np.full((2, len(axes.first)), -1)
    order = np.arange(len(axes.settings_deg))[::-1]  # the first setting of each class stays
    setting[axes.flip[order].astype(int), axes.classes[order]] = order
    setting = np.where(setting < 0, setting[::-1], setting)
    return np.column_stack([planes.settings_deg, J, axes.settings_deg[setting[its_flip, its_class]]])


def _left_out(ranges: AngleRanges, covered: int, different: int, bounded: int) -> tuple[LeftOut, ...]:
    out = []
    fixed = [f"{name}_deg" for name in NAMES if len(ranges.grid_deg(name)) == 1]
    if fixed:
        out.append(LeftOut("search over " + ", ".join(fixed), "the task fixes them", len(fixed), "angles"))
    if covered > different:
        why = "same J by symmetry of scan plane and axis"
        out.append(LeftOut("equivalent settings", why, covered - different, "settings"))
    if bounded:
        why = "the bound from their mean density cannot beat the best setting"
        out.append(LeftOut("exact densities", why, bounded, "scan planes"))
    return tuple(out)
