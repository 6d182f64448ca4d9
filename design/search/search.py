"""The search over the four mounting angles: fold the grid, find J of all of it, show the best families."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from design.errors import TaskError
from design.left_out import LeftOut
from design.objective.problem import Problem
from design.objective.score import score
from design.search.coarse import Landscape, Progress, coarse_landscape
from design.search.coarse_sweep import swept_landscape
from design.search.families import Family, best_leader, find_leaders, refine_leaders
from design.search.grid_classes import Folded, fold_axes, fold_planes, mirrors_of, unfolded
from design.search.limits import allowed_planes, keeps, planes_keep
from design.task.task import NAMES, AngleRanges, Limits

LEADERS_STEP_DEG = 5.0
NONE = Limits()


@dataclass(frozen=True, slots=True)
class SearchResult:
    """What the search found.

    Attributes:
        best: families, best first.
        covered: grid settings that the answer stands for.
        evaluated: distinct values of J computed.
        seconds: time of the search and the rescoring.
        left_out: what was skipped.
        planes: one row per scan-plane setting of the grid: alpha_laser, beta_laser [deg], the lowest J of the search
            over all axes, and the axis alpha_rot, beta_rot [deg] it was found about.
        axes: one row per axis of the grid: alpha_rot, beta_rot [deg], the lowest J of the search over all planes.
    """

    best: tuple[Family, ...]
    covered: int
    evaluated: int
    seconds: float
    left_out: tuple[LeftOut, ...]
    planes: Float[ndarray, "planes columns"]
    axes: Float[ndarray, "axes 3"]


def search(
    problem: Problem,
    ranges: AngleRanges,
    progress: Progress = lambda _: None,
    limits: Limits = NONE,
) -> SearchResult:
    """Find the best families of settings in the ranges of a task that keep its limits.

    Raises:
        TaskError: no direction has a weight, or no setting keeps the limits.
    """
    start = time.perf_counter()
    mirrors = mirrors_of(problem.bearings_rad)
    if problem.sweep is None:
        axes, planes = fold_axes(ranges), allowed_planes(problem, fold_planes(ranges, mirrors), limits)
        progress(f"{len(planes.first):,} different scan planes x {len(axes.first):,} axes, both ways round")
        land, exact = coarse_landscape(problem, planes, axes, progress)
    else:
        mirrors, (axes, planes) = mirrors[:1], unfolded(ranges)
        planes = allowed_planes(problem, planes, limits)
        progress(f"{len(planes.first):,} scan planes x {len(axes.first):,} mountings of the servo")
        land, exact = swept_landscape(problem, planes, axes, progress)
    if ranges.step_deg >= LEADERS_STEP_DEG or problem.sweep is not None:
        leaders = find_leaders(land, planes, axes, mirrors)
    else:  # a basin is wider than the fine grid: look for the leaders on a coarse one, for the winner on both
        coarse = ranges.model_copy(update={"step_deg": LEADERS_STEP_DEG})
        coarse_axes, coarse_planes = fold_axes(coarse), allowed_planes(problem, fold_planes(coarse, mirrors), limits)
        coarse_land, _ = coarse_landscape(problem, coarse_planes, coarse_axes, progress)
        leaders = [best_leader(land, planes, axes), *find_leaders(coarse_land, coarse_planes, coarse_axes, mirrors)]
    progress("rescoring the leaders exactly, refining the minima")
    families = _kept(refine_leaders(problem, ranges, leaders), problem, limits)
    covered = len(axes.settings_deg) * len(planes.settings_deg)
    different = _different(planes, axes)
    return SearchResult(
        best=families,
        covered=covered,
        evaluated=different,
        seconds=time.perf_counter() - start,
        left_out=_left_out(ranges, covered, different, len(planes.first) - exact),
        planes=_plane_table(planes, axes, land),
        axes=np.column_stack([axes.settings_deg, land.by_axis[axes.flip.astype(int), axes.classes]]),
    )


def _kept(families: tuple[Family, ...], problem: Problem, limits: Limits) -> tuple[Family, ...]:
    """The families that keep the limits; where refining has left them, the setting of the grid stands again.

    Raises:
        TaskError: none does.
    """
    planes_rad = np.array([family.angles_rad[2:] for family in families])
    within = planes_keep(problem, planes_rad, limits)
    families = tuple(f if keep else _on_the_grid(problem, f) for f, keep in zip(families, within, strict=True))
    kept = tuple(family for family in families if keeps(family.score, limits))
    if not within.all():
        kept = tuple(sorted(kept, key=lambda family: family.score.J))
    if not kept:
        least = max(family.score.least for family in families)
        blind = min(family.score.blind_weight for family in families)
        raise TaskError(
            f"limits: none of the {len(families)} best families keeps them: min_density reaches {least}, "
            f"max_blind_weight {blind:.2g}; a longer period helps, or a smaller region"
        )
    return kept


def _on_the_grid(problem: Problem, family: Family) -> Family:
    assert family.grid_deg is not None
    return replace(family, angles_deg=family.grid_deg, score=score(problem, np.radians(family.grid_deg)))


def _different(planes: Folded, axes: Folded) -> int:
    """Number of different J: every pair of classes both ways round, but once where both come in one way only."""
    one_way = int((~(planes.has | planes.own).all(axis=0)).sum()) * int((~axes.has.all(axis=0)).sum())
    return 2 * len(planes.first) * len(axes.first) - one_way


def _plane_table(planes: Folded, axes: Folded, land: Landscape) -> Float[ndarray, "planes 5"]:
    """See `SearchResult.planes`."""
    flip = planes.flip.astype(int)
    J = land.by_plane[flip, planes.classes]
    its_class, its_flip = (side[flip, planes.classes] for side in land.its_axis)
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
