"""Stiff and extreme cases with a known result: expected value, computed value, error.

Most cases test one law: for any beams, the integral of the mean count over the sphere is beams times lines times the
area of a ball on the sphere.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from scanwright.design.accuracy.reference import smooth_pieces
from scanwright.design.arrays import Array
from scanwright.design.density.beams import beam_directions_rot, polar_and_azimuth, scan_lines
from scanwright.design.density.spin import mean_count, phase_statistics
from scanwright.design.errors import TaskError
from scanwright.design.motion import Spin, Sweep
from scanwright.design.objective.named_objectives import log
from scanwright.design.objective.problem import Problem
from scanwright.design.objective.score import quick_J, score
from scanwright.design.sphere.directions import EMPTY
from scanwright.design.sphere.regions import field_of
from scanwright.design.task.shapes import AllRegion
from scanwright.design.task.task import LoadedTask, Task

PIECE_NODES = 8  # Gauss-Legendre nodes of a smooth piece
HALF_TURN_RAD = np.pi


@dataclass(frozen=True, slots=True)
class StressRow:
    """One case; `error` is relative where `expected` is not zero."""

    case: str
    quantity: str
    expected: float
    got: float
    error: float
    allowed: float

    @property
    def passed(self) -> bool:
        """Whether the error is at most `allowed`; never for NaN."""
        return bool(self.error <= self.allowed)


def as_turning(loaded: LoadedTask) -> LoadedTask:
    """Return the task with the objective `log` and full turns of the axis, which the laws below assume."""
    task = loaded.task
    density = task.density.model_copy(update={"objective": "log"})
    motion = Spin(period_s=task.motion.period_s) if isinstance(task.motion, Sweep) else task.motion
    return replace(loaded, task=task.model_copy(update={"density": density, "motion": motion}))


def stress_rows(loaded: LoadedTask, problem: Problem) -> list[StressRow]:
    """Return all cases, with the beams of a task."""
    cases: list[Callable[[LoadedTask, Problem], list[StressRow]]] = [
        _planes,
        _focus,
        _balls,
        _lines,
        _gimbals,
        _weights,
        _regions,
        _refusals,
    ]
    return [row for case in cases for row in case(loaded, problem)]


def row(case: str, quantity: str, expected: float, got: float, allowed: float) -> StressRow:
    """Return a case with its error: relative, unless 0 is expected."""
    error = abs(got - expected) / (abs(expected) if expected else 1.0)
    return StressRow(case, quantity, expected, got, error, allowed)


def _integral(bearings: Array, plane: tuple[float, float], turns: float, ball: float) -> float:
    """Return the integral of the mean count over the sphere, which is smooth between the ends of beams."""
    polar, _ = polar_and_azimuth(beam_directions_rot(bearings, *plane))
    marks = np.concatenate([[0, np.pi], polar - ball, polar + ball])
    breaks = np.unique(np.clip(np.abs(marks), 0, np.pi))
    t, width = smooth_pieces(breaks, PIECE_NODES)
    return float(2 * np.pi * (width * np.sin(t)) @ mean_count(t, polar, scan_lines(turns, 1.0), ball))


def _law(
    name: str, bearings: Array, plane: tuple[float, float], turns: float, ball: float, allowed: float
) -> StressRow:
    lines = scan_lines(turns, 1.0).count
    expected = len(bearings) * lines * 2 * np.pi * (1 - np.cos(ball))
    return row(name, "integral of d", expected, _integral(bearings, plane, turns, ball), allowed)


def _planes(_loaded: LoadedTask, problem: Problem) -> list[StressRow]:
    """Scan planes at and near the perpendicular one, and with the end of the field of view on the axis."""
    b, ball = problem.bearings_rad, problem.ball_rad
    rows = []
    for tilt in (0.0, 1e-12, 1e-9, 1e-6):
        polar, _ = polar_and_azimuth(beam_directions_rot(b, tilt, 0.0))
        got = mean_count(np.array([np.pi / 2]), polar, scan_lines(720, 1.0), ball)[0]
        name = f"scan plane {tilt:g} rad from perpendicular to the axis"
        rows.append(row(name, "d on the equator", len(b) * 720 * ball / np.pi, float(got), 1e-6))
        rows.append(_law(name, b, (tilt, 0.0), 720, ball, 1e-6))
    for tilt_deg in (1e-3, 30.0, 61.98, 89.999):
        plane = (float(np.radians(tilt_deg)), 0.0)
        rows.append(_law(f"caustics at 90 +- {tilt_deg:g} deg", b, plane, 720, ball, 1e-5))
    end = float(b.max())
    plane = (HALF_TURN_RAD / 2, float(np.arcsin(-np.cos(end))))  # q = (cos end, sin end): the last beam is the axis
    plane = (float(np.arcsin(np.sin(end) / np.cos(plane[1]))), plane[1])
    rows.append(_law("end of the field of view exactly on the axis", b, plane, 720, ball, 1e-5))
    return rows


def _focus(_loaded: LoadedTask, problem: Problem) -> list[StressRow]:
    """At a focus point every line of the beams within a ball counts, at every phase."""
    b, ball = problem.bearings_rad, problem.ball_rad
    polar, _ = polar_and_azimuth(beam_directions_rot(b, 0.0, -HALF_TURN_RAD / 2))
    expected = 720.0 * int((np.abs(b) <= ball * (1 + 1e-12)).sum())
    at = np.array([0.0, 1e-15, 1e-9])
    got = mean_count(at, polar, scan_lines(720, 1.0), ball)
    # 1e-9 rad off, the beams on the rim are met by half of their lines, or by none
    rim = 720.0 * int((np.abs(np.abs(b) - ball) < 1e-6).sum()) / max(expected, 1)
    return [
        row(f"focus point, {t:g} rad off", "d", expected, float(d), 1e-9 if t == 0 else rim + 1e-6)
        for t, d in zip(at, got, strict=True)
    ]


def _balls(_loaded: LoadedTask, problem: Problem) -> list[StressRow]:
    plane = (float(np.radians(-50.0)), float(np.radians(35.0)))
    return [
        _law(f"ball of {r:g} deg", problem.bearings_rad, plane, 720, float(np.radians(r)), 1e-5)
        for r in (0.01, 0.1, 1.0, 10.0, 45.0, 90.0)
    ]


def _lines(_loaded: LoadedTask, problem: Problem) -> list[StressRow]:
    """From one line to ten million beams, one beam, and turns with a non-integer number of lines."""
    b, ball = problem.bearings_rad, problem.ball_rad
    plane = (float(np.radians(-50.0)), float(np.radians(35.0)))
    million = round(1e7 / len(b))
    rows = [_law(f"{k:,} lines, {k * len(b):,} beams", b, plane, k, ball, 1e-5) for k in (1, 2, 720, million)]
    rows.append(_law("one beam", b[:1], plane, 720, ball, 1e-5))
    rows += [_law(f"T f = {turns}", b, plane, turns, ball, 1e-5) for turns in (0.5, 80.5, 719.999999, 720.000001)]
    angles = np.radians([0.0, 0.0, -50.0, 35.0])
    expected = quick_J(_with_turns(problem, 720), angles, 2187)
    for turns in (720 - 1e-7, 720 + 1e-12):  # the last gap is nearly full, or empty
        got = quick_J(_with_turns(problem, turns), angles, 2187)
        rows.append(row(f"T f = 720 {turns - 720:+.0e}: the rate beats with the turn", "J", expected, got, 1e-6))
    return rows


def _gimbals(_loaded: LoadedTask, problem: Problem) -> list[StressRow]:
    """Different angles of the same machine give the same J."""
    pairs = [
        ("beta_rot = 90: alpha_rot only rolls the case", (0, 90, 20, -40), (77, 90, 20, -40)),
        ("beta_rot = -90", (0, -90, 20, -40), (-33, -90, 20, -40)),
        ("beta_laser = -90: alpha_laser turns about the axis", (10, 20, 0, -90), (10, 20, 55, -90)),
        ("alpha_rot a full turn on", (10, 20, 30, -40), (370, 20, 30, -40)),
        ("(alpha, beta) about u is (-alpha, -beta) about -u", (0, 0, 30, -40), (180, 0, -30, 40)),
    ]
    return [
        row(name, "J", quick_J(problem, np.radians(a), 6561), quick_J(problem, np.radians(b), 6561), 1e-5)
        for name, a, b in pairs
    ]


def _weights(loaded: LoadedTask, problem: Problem) -> list[StressRow]:
    """J does not depend on the unit of the weights."""
    angles = np.radians([0.0, 0.0, -50.0, 35.0])
    cone = {"shape": "cone", "axis": [1, 0, -1], "half_angle_deg": 40}
    plain = quick_J(_with(loaded, problem, [cone]), angles, 2187)
    return [
        row(f"weights of {w:g}", "J", plain, quick_J(_with(loaded, problem, [cone | {"value": w}]), angles, 2187), 1e-9)
        for w in (1e-300, 1e-30, 1e30, 1e300)
    ]


def _regions(loaded: LoadedTask, problem: Problem) -> list[StressRow]:
    """A region that is nearly a point has the density of that point."""
    angles = np.radians([0.0, 0.0, -50.0, 35.0])
    polar, azimuth = polar_and_azimuth(beam_directions_rot(problem.bearings_rad, angles[2], angles[3]))
    at = np.radians([60.0])
    g = problem.objective.moments[0].g
    expected = float(phase_statistics(at, polar, azimuth, problem.lines, problem.ball_rad, g).mean_g[0])
    axis = [float(np.sin(at[0])), 0.0, float(np.cos(at[0]))]
    return [
        row(f"region of {half:g} deg", "J", expected, score(_with(loaded, problem, [region]), angles).J, allowed)
        for half, allowed in ((1.0, 2e-2), (0.1, 1e-2), (0.01, 1e-3), (0.001, 1e-4))
        for region in ({"shape": "cone", "axis": axis, "half_angle_deg": half},)
    ]


def _refusals(loaded: LoadedTask, problem: Problem) -> list[StressRow]:
    """Cases without a result are rejected: 1 for a rejection."""
    angles = np.radians([0.0, 0.0, -50.0, 35.0])
    hidden = replace(loaded, task=_task(loaded, [{"shape": "all"}], [{"shape": "all"}]))
    rows = [
        row(
            "all weights zero",
            "refused",
            1,
            _refused(lambda: _with(loaded, problem, [{"shape": "all", "value": 0.0}]), angles),
            0,
        )
    ]
    masked = _refused(lambda: problem.with_objective(log(field_of(hidden))), angles)
    rows.append(row("everything masked", "refused", 1, masked, 0))
    try:
        AllRegion.model_validate({"shape": "all", "value": float("nan")})
        refused = 0
    except ValueError:
        refused = 1
    rows.append(row("NaN weight", "refused", 1, refused, 0))
    return rows


def _refused(make: Callable[[], Problem], angles_rad: Array) -> int:
    try:
        quick_J(make(), angles_rad, 243)
    except TaskError as error:
        return int(str(error) == EMPTY)
    return 0


def _task(loaded: LoadedTask, weight: list[dict[str, object]], mask: list[dict[str, object]]) -> Task:
    density = loaded.task.density.model_dump() | {"background": 0.0, "quadrature": "solid_angle"}
    return Task.model_validate(loaded.task.model_dump() | {"weight": weight, "mask": mask, "density": density})


def _with(loaded: LoadedTask, problem: Problem, weight: list[dict[str, object]]) -> Problem:
    changed = replace(loaded, task=_task(loaded, weight, []), maps=())
    return replace(problem.with_objective(log(field_of(changed))), grid_step_deg=None)


def _with_turns(problem: Problem, turns: float) -> Problem:
    return problem.with_beams(problem.bearings_rad, scan_lines(turns, 1.0))
