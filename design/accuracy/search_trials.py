"""Regret against run time of what the search spends: grid, nodes of the coarse J, margin, rounds of refinement.

The scanner of a task searches for other regions, drawn at random; the regret of a search is how far its J lies above
the lowest that any of them found. What is spent on one choice is varied while the others stay as they are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from scanwright.design.accuracy.trials import Trial
from scanwright.design.motion import Sweep
from scanwright.design.objective.problem import problem_of
from scanwright.design.search.coarse import MARGIN, USUAL, Effort
from scanwright.design.search.search import search
from scanwright.design.task.angle_ranges import AngleRanges
from scanwright.design.task.shapes import BandRegion, ConeRegion, Region
from scanwright.design.task.task import LoadedTask

TASKS = 5
SEED = 1
STEPS_DEG = 30.0, 20.0, 10.0, 5.0, 2.5
SWEPT_STEPS_DEG = STEPS_DEG[:-1]  # nothing folds there: a finer grid holds too many settings
FINENESS = 0.1, 0.25, 0.5, 1.0, 2.0
MARGINS = 0.0, 0.05, MARGIN, 0.5
ROUNDS = 0, 1, 2
LEAST_REGRET = 1e-7  # J is rescored to no more digits


@dataclass(frozen=True, slots=True)
class _Way:
    """One way to search: of which choice it is a setting, and what is spent."""

    choice: str
    setting: str
    ranges: AngleRanges
    effort: Effort
    chosen: bool


def search_trials(loaded: LoadedTask, progress: Callable[[str], None]) -> Iterator[Trial]:
    """Each choice at each setting, over the same random tasks; the error is the mean regret.

    Raises:
        TaskError: a grid holds too many settings.
    """
    rng = np.random.default_rng(SEED)
    problems = [problem_of(_elsewhere(loaded, rng)) for _ in range(TASKS)]
    steps = SWEPT_STEPS_DEG if isinstance(loaded.task.motion, Sweep) else STEPS_DEG
    ways = _ways(loaded.task.angles, steps)
    search(problems[0], loaded.task.angles.model_copy(update={"step_deg": STEPS_DEG[0]}))  # compiles
    found, seconds = np.empty((len(ways), TASKS)), np.empty((len(ways), TASKS))
    for i, way in enumerate(ways):
        progress(f"{way.choice}: {way.setting}")
        for k, problem in enumerate(problems):
            result = search(problem, way.ranges, effort=way.effort)
            found[i, k], seconds[i, k] = result.best[0].score.J, result.seconds
    regret = np.maximum(found - found.min(axis=0), LEAST_REGRET)
    for way, lost, spent in zip(ways, regret, seconds, strict=True):
        yield Trial(
            choice=way.choice,
            method="search",
            setting=way.setting,
            error=float(lost.mean()),
            unit="of J",
            seconds=tuple(sorted(spent.tolist())),
            size=f"worst {lost.max():.0e} of {TASKS} tasks",
            chosen=way.chosen,
        )


def _ways(ranges: AngleRanges, steps_deg: tuple[float, ...]) -> list[_Way]:
    ways = []
    for step in sorted({*steps_deg, ranges.step_deg}, reverse=True):
        its = ranges.model_copy(update={"step_deg": step})
        ways.append(_Way("grid of the search", f"{step:g} deg", its, USUAL, step == ranges.step_deg))
    for fineness in FINENESS:
        effort = replace(USUAL, fineness=fineness)
        ways.append(_Way("nodes of the coarse J", f"{fineness:g} times", ranges, effort, effort == USUAL))
    for margin in MARGINS:
        effort = replace(USUAL, margin=margin)
        ways.append(_Way("margin of the coarse J", f"{margin:g}", ranges, effort, effort == USUAL))
    for rounds in ROUNDS:
        effort = replace(USUAL, rounds=rounds)
        ways.append(_Way("refinement", f"{rounds} rounds", ranges, effort, effort == USUAL))
    return ways


def _elsewhere(loaded: LoadedTask, rng: np.random.Generator) -> LoadedTask:
    """The task with one or two random regions for its own, without mask, scene and limits."""
    regions: list[Region] = []
    for _ in range(rng.integers(1, 3)):
        if rng.random() < 0.5:
            axis = tuple(rng.normal(size=3).tolist())
            regions.append(ConeRegion(shape="cone", axis=axis, half_angle_deg=float(rng.uniform(8, 60))))
        else:
            theta, phi = np.sort(rng.uniform(0, 180, 2)), np.sort(rng.uniform(-180, 180, 2))
            spans = {"theta_deg": tuple(theta.tolist()), "phi_deg": tuple(phi.tolist())}
            regions.append(BandRegion(shape="band", value=float(rng.uniform(0.2, 1)), **spans))
    density = loaded.task.density.model_copy(update={"background": 0.0})
    if density.objective == "required":
        density = density.model_copy(update={"required": float(10 ** rng.uniform(0, 2))})
    plain = {"weight": tuple(regions), "mask": (), "scene": None, "limits": type(loaded.task.limits)()}
    task = loaded.task.model_copy(update={"density": density, **plain})
    return replace(loaded, task=task, maps=(), surface=None)
