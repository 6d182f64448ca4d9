"""Error against run time of every method to compute J, from which the numerical defaults are chosen.

The time is that of the first setting. The error is the worst of several settings, since at one setting few nodes can
be exact by chance.
"""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scanwright.design.accuracy.front import dominators
from scanwright.design.accuracy.methods import Method, methods_for
from scanwright.design.accuracy.reference import Reference, is_smooth, reference
from scanwright.design.arrays import Array, Setting
from scanwright.design.errors import ScanwrightError
from scanwright.design.objective.problem import Problem
from scanwright.design.progress import Progress
from scanwright.design.task.angle_ranges import NAMES
from scanwright.design.task.task import LoadedTask

REPEATS = 5  # timed runs
SLOW_S = 2.0  # slower methods are timed once
NEARBY_DEG = 2.0  # range about the setting in which the minimum of a method is searched
NEARBY_POINTS = 9  # samples of that range
OTHERS, OTHERS_DRAWN = 7, 2  # further settings; fewer if each reference is drawn at random
SEED = 0


@dataclass(frozen=True, slots=True)
class Point:
    """One method with one value of its parameter; NaN and a reason in `failed` if it gave no result.

    Attributes:
        method: its name.
        setting: the parameter and its value.
        J: at the first setting.
        J_error: distance from the reference, the worst of all settings.
        J_error_median: the median of all settings.
        argmin_error_deg: distance of its minimum over beta_laser from that of the reference; NaN if not searched.
        seconds: of the repeats, shortest to longest.
        peak_mb: peak memory of Python and NumPy.
        chosen: whether the program starts with it.
        failed: why there is no result.
    """

    method: str
    setting: str
    J: float
    J_error: float
    J_error_median: float
    argmin_error_deg: float
    seconds: tuple[float, ...]
    peak_mb: float
    chosen: bool = False
    failed: str = ""

    @property
    def median_s(self) -> float:
        """Median of the repeats [s]; infinite without a result."""
        return float(np.median(self.seconds)) if self.seconds else np.inf


@dataclass(frozen=True, slots=True)
class MethodsMeasured:
    """Results of all methods.

    Attributes:
        truths: the reference at each setting, in order.
        points: one for each method and value of its parameter.
    """

    truths: tuple[Reference, ...]
    points: tuple[Point, ...]

    @property
    def floor(self) -> float:
        """Largest error of the references: smaller errors of methods cannot be distinguished."""
        return max(truth.J_error for truth in self.truths)


def measure_methods(loaded: LoadedTask, problem: Problem, first_rad: Setting, progress: Progress) -> MethodsMeasured:
    """Measure all methods with all values at one setting, and their errors at some others of the task.

    Minima are compared only if the reference is smooth: the noise of a drawn one exceeds their distance.
    """
    settings, truths = _settings(loaded, problem, first_rad, progress)
    nearby = None
    if is_smooth(problem):
        steps = NEARBY_DEG * np.linspace(-1, 1, NEARBY_POINTS)
        J = [reference(loaded, problem, _turned(first_rad, d)).J for d in steps]
        nearby = steps, _minimum(steps, J)
    points: list[Point] = []
    methods = methods_for(problem)
    total = sum(len(values) for _, _, values in methods.values())
    for name, (method, parameter, values) in methods.items():
        for value in values:
            progress(f"{name}, {value} {parameter}", len(points) / total)
            points.append(_point(problem, settings, truths, nearby, name, method, parameter, value))
    return MethodsMeasured(tuple(truths), tuple(points))


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


def best_points(points: Sequence[Point], reference_error: float) -> list[bool]:
    """Return whether no other point dominates it; errors below that of the reference count as equal."""
    costs = np.array([[p.median_s, max(p.J_error, reference_error)] for p in points])
    return [bool(np.isfinite(cost[1]) and not dominators(costs, cost).any()) for cost in costs]


def _point(
    problem: Problem,
    settings: list[Setting],
    truths: list[Reference],
    nearby: tuple[Array, float] | None,  # steps of beta_laser, and the minimum of the reference, from the setting [deg]
    name: str,
    method: Method,
    parameter: str,
    value: int,
) -> Point:
    setting, first_rad = f"{value} {parameter}", settings[0]
    chosen = name in ("segments", "directions") and value == problem.nodes
    try:
        J = [method(problem, angles, value) for angles in settings]  # and warms up
        tracemalloc.start()
        method(problem, first_rad, value)
        peak = tracemalloc.get_traced_memory()[1] / 1e6
        tracemalloc.stop()
    except (ScanwrightError, MemoryError, np.linalg.LinAlgError) as error:
        return Point(name, setting, np.nan, np.nan, np.nan, np.nan, (), np.nan, failed=str(error))
    seconds: list[float] = []
    while len(seconds) < REPEATS and (not seconds or seconds[0] < SLOW_S):
        start = time.perf_counter()
        method(problem, first_rad, value)
        seconds.append(time.perf_counter() - start)
    moved = np.nan
    if nearby is not None and seconds[0] < SLOW_S:
        steps_deg, minimum_deg = nearby
        moved = abs(
            _minimum(steps_deg, [method(problem, _turned(first_rad, d), value) for d in steps_deg]) - minimum_deg
        )
    off = np.abs(np.array(J) - [truth.J for truth in truths])
    times = tuple(sorted(seconds))
    return Point(name, setting, J[0], float(off.max()), float(np.median(off)), moved, times, peak, chosen)


def _turned(angles_rad: Setting, degrees: float) -> Setting:
    return angles_rad + np.array([0.0, 0.0, 0.0, np.radians(degrees)])


def _minimum(x: Array, y: list[float]) -> float:
    """Return the minimum of the parabola through the lowest sample and its neighbours."""
    i = int(np.clip(np.argmin(y), 1, len(y) - 2))
    a, b, c = y[i - 1], y[i], y[i + 1]
    bend = a - 2 * b + c
    return float(x[i] + (0 if bend <= 0 else np.clip((a - c) / (2 * bend), -1, 1)) * (x[1] - x[0]))
