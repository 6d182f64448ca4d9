"""Regret against run time of the choices of the search: grid, nodes of the coarse J, margin, rounds of refinement.

    uv run python -m benchmarks.trials.search_effort [TASK]

The scanner of a task is optimised for other regions, drawn at random. The regret of a search is the difference of its
J from the lowest J of all searches. One choice is varied at a time. Table and picture are written to
`out/accuracy/<task>/`.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from scanwright.cli.console import ConsoleProgress
from scanwright.design.accuracy.trials import Trial, report_trials
from scanwright.design.motion import Shortest, Sweep
from scanwright.design.objective.problem import problem_of
from scanwright.design.progress import Progress
from scanwright.design.search.coarse import MARGIN, USUAL, Effort
from scanwright.design.search.optimum import find_optimum
from scanwright.design.search.search import search
from scanwright.design.task.angle_ranges import AngleRanges
from scanwright.design.task.shapes import BandRegion, ConeRegion, Region
from scanwright.design.task.task import LoadedTask, load_task

TASKS = 5  # drawn at random
SEED = 1
STEPS_DEG = 30.0, 20.0, 10.0, 5.0, 2.5
SWEPT_STEPS_DEG = STEPS_DEG[:-1]  # no symmetry reduces it: a finer grid has too many settings
EFFORTS: tuple[tuple[str, str, str, tuple[float, ...]], ...] = (  # choice, field of `Effort`, label, values
    ("nodes of the coarse J", "fineness", "{:g} times", (0.1, 0.25, 0.5, 1.0, 2.0)),
    ("margin of the coarse J", "margin", "{:g}", (0.0, 0.05, MARGIN, 0.5)),
    ("refinement", "rounds", "{} rounds", (0, 1, 2)),
)
LEAST_REGRET = 1e-7  # of J: its final score has no more digits


@dataclass(frozen=True, slots=True)
class _Variant:
    """One variant of the search: the choice that it varies, its value, and the effort."""

    choice: str
    setting: str
    ranges: AngleRanges
    effort: Effort
    chosen: bool


def search_trials(loaded: LoadedTask, progress: Progress) -> Iterator[Trial]:
    """Yield a trial of each value of each choice over the same random tasks; its error is the mean regret.

    Raises:
        TaskError: a grid has too many settings.
    """
    rng = np.random.default_rng(SEED)
    problems = [problem_of(_elsewhere(loaded, rng)) for _ in range(TASKS)]
    steps = SWEPT_STEPS_DEG if isinstance(loaded.task.motion, Sweep) else STEPS_DEG
    variants = _variants(loaded.task.angles, steps)
    search(problems[0], loaded.task.angles.model_copy(update={"step_deg": STEPS_DEG[0]}))  # compiles
    J, seconds = np.empty((len(variants), TASKS)), np.empty((len(variants), TASKS))
    done: dict[tuple[float, Effort, int], tuple[float, float]] = {}  # all choices contain the default search
    for i, variant in enumerate(variants):
        progress(f"{variant.choice}: {variant.setting}", i / len(variants))
        for k, problem in enumerate(problems):
            key = variant.ranges.step_deg, variant.effort, k
            if key not in done:
                result = search(problem, variant.ranges, effort=variant.effort)
                done[key] = result.best[0].score.J, result.seconds
            J[i, k], seconds[i, k] = done[key]
    regret = np.maximum(J - J.min(axis=0), LEAST_REGRET)
    for variant, lost, spent in zip(variants, regret, seconds, strict=True):
        yield Trial(
            choice=variant.choice,
            method="search",
            setting=variant.setting,
            error=float(lost.mean()),
            unit="of J",
            seconds=tuple(sorted(spent.tolist())),
            size=f"worst {lost.max():.0e} of {TASKS} tasks",
            chosen=variant.chosen,
        )


def _variants(ranges: AngleRanges, steps_deg: tuple[float, ...]) -> list[_Variant]:
    variants = []
    for step in sorted({*steps_deg, ranges.step_deg}, reverse=True):
        its = ranges.model_copy(update={"step_deg": step})
        variants.append(_Variant("grid of the search", f"{step:g} deg", its, USUAL, step == ranges.step_deg))
    for choice, field, label, values in EFFORTS:
        for value in values:
            changed: dict[str, Any] = {field: value}
            effort = replace(USUAL, **changed)
            variants.append(_Variant(choice, label.format(value), ranges, effort, effort == USUAL))
    return variants


def _elsewhere(loaded: LoadedTask, rng: np.random.Generator) -> LoadedTask:
    """Return the task with one or two random regions in place of its own, without mask, scene and limits."""
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


def main(words: list[str] | None = None) -> None:
    """Measure all choices and print them."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.trials.search_effort")
    parser.add_argument("task", nargs="?", type=Path, default=Path("ground_ahead"))
    parser.add_argument("--out", type=Path, default=Path("out/accuracy"))
    asked = parser.parse_args(words)
    loaded, progress = load_task(asked.task), ConsoleProgress()
    fixed = find_optimum(loaded, progress).loaded if isinstance(loaded.task.motion, Shortest) else loaded
    print(*report_trials(list(search_trials(fixed, progress)), asked.out / loaded.task.name, "search"), sep="\n")


if __name__ == "__main__":
    main()
