"""Error against run time of every method to compute J, from which the numerical defaults are chosen.

The time is that of the first setting. The error is the worst of several settings, since at one setting few nodes can
be exact by chance.
"""

from __future__ import annotations

import time
import tracemalloc
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scanwright.design.accuracy import methods
from scanwright.design.accuracy.reference import Reference, is_smooth, reference
from scanwright.design.accuracy.trials import Trial, report_trials
from scanwright.design.arrays import Setting
from scanwright.design.errors import ScanwrightError
from scanwright.design.objective.problem import Problem
from scanwright.design.objective.stated_error import error_words
from scanwright.design.progress import Progress
from scanwright.design.search.optimum import find_optimum
from scanwright.design.task.angle_ranges import NAMES
from scanwright.design.task.task import LoadedTask

REPEATS = 5  # timed runs
SLOW_S = 2.0  # slower methods are timed once
OTHERS, OTHERS_DRAWN = 7, 2  # further settings; fewer if each reference is drawn at random
SEED = 0


@dataclass(frozen=True, slots=True)
class MethodsMeasured:
    """Results of all methods."""

    truths: tuple[Reference, ...]  # the reference at each setting, in order
    # one for each method and value of its parameter; errors below those of the references are 0
    trials: tuple[Trial, ...]
    failed: tuple[str, ...]  # methods without a result, with the reason


def report_precision(loaded: LoadedTask, folder: Path, progress: Progress) -> list[str]:
    """Measure every method to compute J at the optimum of a task; write `work_precision.csv` and `.png`; return lines.

    Raises:
        TaskError: no direction has a weight, or no setting meets the limits.
    """
    optimum = find_optimum(loaded, progress)
    measured = measure_methods(loaded, optimum.problem, optimum.search.best[0].angles_rad, progress)
    truth = measured.truths[0]
    return [
        f"reference J = {truth.J:.9f} +- {error_words(truth.J, truth.J_error)}; errors: the worst of "
        f"{len(measured.truths)} settings, this one and others of its ranges; times of this one",
        *report_trials(measured.trials, folder, "work_precision"),
        *measured.failed,
    ]


def measure_methods(loaded: LoadedTask, problem: Problem, first_rad: Setting, progress: Progress) -> MethodsMeasured:
    """Measure all methods with all values at one setting, and their errors at some others of the task."""
    settings, truths = _settings(loaded, problem, first_rad, progress)
    trials: list[Trial] = []
    failed: list[str] = []
    tried = methods.METHODS if problem.sweep is None else methods.SWEPT
    total = sum(len(values) for _, _, values in tried.values())
    for name, (method, parameter, values) in tried.items():
        for value in values:
            progress(f"{name}, {value} {parameter}", (len(trials) + len(failed)) / total)
            try:
                trials.append(_trial(problem, settings, truths, name, method, parameter, value))
            except (ScanwrightError, MemoryError, np.linalg.LinAlgError) as error:
                failed.append(f"{name}, {value} {parameter}: {error}")
    return MethodsMeasured(tuple(truths), tuple(trials), tuple(failed))


def _settings(
    loaded: LoadedTask, problem: Problem, first_rad: Setting, progress: Progress
) -> tuple[list[Setting], list[Reference]]:
    """Return the first setting and some drawn from the ranges of the task, with their references; omit blind ones."""
    low, high = np.radians([loaded.task.angles.limits(name) for name in NAMES]).T
    others = OTHERS if is_smooth(problem) else OTHERS_DRAWN
    drawn = np.random.default_rng(SEED).uniform(low, high, (others if (high > low).any() else 0, len(NAMES)))
    settings: list[Setting] = []
    truths: list[Reference] = []
    for setting in (first_rad, *drawn):
        progress(f"reference of setting {len(settings) + 1}")
        truth = reference(loaded, problem, setting)
        if np.isfinite(truth.J):
            settings.append(setting)
            truths.append(truth)
    return settings, truths


def _trial(
    problem: Problem,
    settings: list[Setting],
    truths: list[Reference],
    name: str,
    method: methods.Method,
    parameter: str,
    value: int,
) -> Trial:
    off = np.abs([method(problem, angles, value) - truth.J for angles, truth in zip(settings, truths, strict=True)])
    tracemalloc.start()  # the calls above have compiled and warmed up
    method(problem, settings[0], value)
    peak_mb = tracemalloc.get_traced_memory()[1] / 1e6
    tracemalloc.stop()
    seconds: list[float] = []
    while len(seconds) < REPEATS and (not seconds or seconds[0] < SLOW_S):
        start = time.perf_counter()
        method(problem, settings[0], value)
        seconds.append(time.perf_counter() - start)
    worst, floor = float(off.max()), max(truth.J_error for truth in truths)
    return Trial(
        choice="method of J",
        method=name,
        setting=f"{value} {parameter}",
        error=worst if worst > floor else 0.0,
        unit="of J",
        seconds=tuple(sorted(seconds)),
        size=f"median error {np.median(off):.0e}, {peak_mb:.0f} MB",
        chosen=name in ("segments", "directions") and value == problem.nodes,
    )
