"""Error against run time of every way to compute J: what the numerical defaults are chosen from.

The time is that of the first setting. The error is the worst of several: at one setting a few nodes are often lucky.
"""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scanwright.design.accuracy.front import undominated
from scanwright.design.accuracy.methods import Method, methods_for
from scanwright.design.accuracy.reference import Reference, is_smooth, reference
from scanwright.design.arrays import Array, Setting
from scanwright.design.errors import ScanwrightError
from scanwright.design.objective.problem import Problem
from scanwright.design.progress import Progress
from scanwright.design.task.angle_ranges import NAMES
from scanwright.design.task.task import LoadedTask

REPEATS = 5
SLOW_S = 2.0  # a point slower than this is timed once
LOOK_DEG = 2.0  # how far around the setting a method's own minimum is looked for
LOOKS = 9
OTHERS, OTHERS_DRAWN = 7, 2  # settings beside the first; fewer where each reference is drawn at random
SEED = 0


@dataclass(frozen=True, slots=True)
class Point:
    """One method at one setting of its knob; NaN and a word in `failed` where it gave no answer.

    Attributes:
        method: its name.
        setting: the knob and its value.
        J: its answer at the first setting.
        J_error: distance from the reference, the worst of all settings.
        J_error_median: the median of all settings.
        argmin_error_deg: distance of its minimum over beta_laser from that of the reference; NaN where not looked for.
        seconds: of the repeats, shortest to longest.
        peak_mb: highest memory that Python and NumPy asked for.
        chosen: whether the program begins with it.
        failed: why there is no answer.
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
        """Median of the repeats [s]; infinite where there is no answer."""
        return float(np.median(self.seconds)) if self.seconds else np.inf


@dataclass(frozen=True, slots=True)
class _Nearby:
    """Where the minimum over beta_laser is looked for, and where the reference has it [deg from the setting]."""

    steps_deg: Array
    minimum_deg: float


@dataclass(frozen=True, slots=True)
class MethodsMeasured:
    """What all methods gave.

    Attributes:
        truths: the reference at each setting, the first one's first.
        points: one of each method and value of its knob.
    """

    truths: tuple[Reference, ...]
    points: tuple[Point, ...]

    @property
    def floor(self) -> float:
        """What the references may be off by, the worst of them: errors below it are not told apart."""
        return max(truth.J_error for truth in self.truths)


def measure_methods(loaded: LoadedTask, problem: Problem, first_rad: Setting, progress: Progress) -> MethodsMeasured:
    """All methods at all their knobs on one setting, and their errors on some others of the task as well.

    The minima of methods are compared where the reference is smooth: a drawn one jumps more than they are apart.
    """
    settings, truths = _settings(loaded, problem, first_rad, progress)
    nearby = None
    if is_smooth(problem):
        steps = LOOK_DEG * np.linspace(-1, 1, LOOKS)
        J = [reference(loaded, problem, _turned(first_rad, d)).J for d in steps]
        nearby = _Nearby(steps, _minimum(steps, J))
    points = []
    for name, (method, knob, values) in methods_for(problem).items():
        for value in values:
            progress(f"{name}, {value} {knob}")
            points.append(_point(problem, settings, truths, nearby, name, method, knob, value))
    return MethodsMeasured(tuple(truths), tuple(points))


def _settings(
    loaded: LoadedTask, problem: Problem, first_rad: Setting, progress: Progress
) -> tuple[list[Setting], list[Reference]]:
    """The first setting and some drawn from the ranges of the task, with their references; blind ones have none."""
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
    """Whether no other point is both faster and nearer; errors below the reference's own count as equal."""
    costs = np.array([[p.median_s, max(p.J_error, reference_error)] for p in points])
    answered = np.isfinite(costs[:, 1])
    return (undominated(np.where(answered[:, None], costs, np.inf)) & answered).tolist()


def _point(
    problem: Problem,
    settings: list[Setting],
    truths: list[Reference],
    nearby: _Nearby | None,
    name: str,
    method: Method,
    knob: str,
    value: int,
) -> Point:
    setting, first_rad = f"{value} {knob}", settings[0]
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
        around = [method(problem, _turned(first_rad, d), value) for d in nearby.steps_deg]
        moved = abs(_minimum(nearby.steps_deg, around) - nearby.minimum_deg)
    off = np.abs(np.array(J) - [truth.J for truth in truths])
    times = tuple(sorted(seconds))
    return Point(name, setting, J[0], float(off.max()), float(np.median(off)), moved, times, peak, chosen)


def _turned(angles_rad: Setting, degrees: float) -> Setting:
    return angles_rad + np.array([0.0, 0.0, 0.0, np.radians(degrees)])


def _minimum(x: Array, y: list[float]) -> float:
    """Where the parabola through the lowest sample and its neighbours is lowest."""
    i = int(np.clip(np.argmin(y), 1, len(y) - 2))
    a, b, c = y[i - 1], y[i], y[i + 1]
    bend = a - 2 * b + c
    return float(x[i] + (0 if bend <= 0 else np.clip((a - c) / (2 * bend), -1, 1)) * (x[1] - x[0]))
