"""The shortest period that meets the limits of a task, and the mounts that allow it (`period_s = "shortest"`)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from scanwright.design.arrays import Setting
from scanwright.design.density.beams import ScanLines
from scanwright.design.density.spin import phase_statistics
from scanwright.design.errors import TaskError
from scanwright.design.motion import Shortest, Spin
from scanwright.design.objective.problem import NODES, Problem, problem_of
from scanwright.design.objective.quadrature import polar_rule
from scanwright.design.objective.score import score
from scanwright.design.progress import Progress
from scanwright.design.search.constraints import line_gaps_deg
from scanwright.design.search.families import Family
from scanwright.design.search.mounts.simplest import simplest_first
from scanwright.design.search.search import SearchResult, search
from scanwright.design.search.space import SearchSpace
from scanwright.design.task.named_products import fastest_rpm
from scanwright.design.task.task import LoadedTask

MOST_LINES = 200_000
ROUNDS = 6  # of searches, since the best mounts of a slow turn are seldom those of a fast one


def fastest(loaded: LoadedTask, progress: Progress) -> tuple[LoadedTask, Problem, SearchResult]:
    """Return the task with the shortest period found, its numbers, and its search.

    The search is repeated at the shortest period of any of its families until that does not become shorter. The result
    meets the limits; a shorter period of a mount that is not among the families is possible.

    Raises:
        TaskError: the limits are not met even at `longest_s`.
    """
    motion, limits, ranges = loaded.task.motion, loaded.task.limits, loaded.task.angles
    assert isinstance(motion, Shortest)
    now = _at(loaded, motion.longest_s)
    problem = problem_of(now)
    try:
        result = search(problem, ranges, progress, limits)
    except TaskError as error:
        raise TaskError(f"{loaded.source}: even with motion.longest_s = {motion.longest_s:g}: {error}") from error
    for _ in range(ROUNDS):
        periods = [_shortest(loaded, problem, family.angles_rad) for family in result.best]
        period = min(periods)
        if period >= now.task.motion.duration_s * (1 - 1e-9):
            break
        progress(f"{period:g} s keep the limits: searching again")
        now = _at(loaded, period)
        problem = problem_of(now)
        able = _rescored(problem, result.best, periods, period)
        if ranges.prefer == "simple":
            avoid = ranges.holes == "avoid" and result.least_blind is None
            space = SearchSpace(problem, ranges, limits, avoid)
            result = replace(result, best=simplest_first(space, able), lowest=able[0])
        else:
            result = replace(result, best=able)
        try:
            result = search(problem, ranges, progress, limits)
        except TaskError:  # the families of this search do not include the one that allows the period: keep that
            break
    return now, problem, result


def with_period(loaded: LoadedTask, angles_rad: Setting, progress: Progress) -> LoadedTask:
    """Return a task with the shortest period of one mount, at most `longest_s`; the task itself if it has a period."""
    motion = loaded.task.motion
    if not isinstance(motion, Shortest):
        return loaded
    slowest = _at(loaded, motion.longest_s)
    try:
        period_s = _shortest(loaded, problem_of(slowest), angles_rad)
    except TaskError:
        period_s = math.inf
    if period_s > motion.longest_s:
        progress(f"this mount breaks the limits of the task even at longest_s = {motion.longest_s:g} s")
        return slowest
    progress(f"one turn in {period_s:g} s: the shortest of this mount that keeps the limits")
    return _at(loaded, period_s)


def shortest_period_s(
    problem: Problem, angles_rad: Setting, scan_rate_hz: float, least: int, nodes: int = NODES
) -> float:
    """Return the shortest full turn [s] with at least `least` beams per ball in all directions of the region.

    It has an integer number of lines, so that all gaps are equal. The density is evaluated on `nodes` circles about the
    axis.

    Raises:
        TaskError: some directions do not get that many beams at any period.
    """
    if least < 1:
        raise TaskError(f"density {least}: at least 1 beam per ball is required")
    rule, beam_polar, beam_azimuth = polar_rule(problem, angles_rad, nodes)
    polar_rad = rule.polar_rad[rule.fine > 0]

    def enough(count: int) -> bool:
        lines = ScanLines(count, 2 * np.pi / count)
        results = phase_statistics(polar_rad, beam_polar, beam_azimuth, lines, problem.ball_rad, np.zeros_like)
        return bool(results.least.min() >= least)

    upper = 1
    while not enough(upper):
        upper *= 2
        if upper > MOST_LINES:
            raise TaskError(
                f"density {least} per ball: not reached with {MOST_LINES} lines; part of the region is blind: "
                "make it smaller, mask it, or use other angles"
            )
    lower = upper // 2
    while upper - lower > 1:
        middle = (upper + lower) // 2
        lower, upper = (lower, middle) if enough(middle) else (middle, upper)
    return upper / scan_rate_hz


def _at(loaded: LoadedTask, period_s: float) -> LoadedTask:
    return replace(loaded, task=loaded.task.model_copy(update={"motion": Spin(period_s=period_s)}))


def _shortest(loaded: LoadedTask, problem: Problem, angles_rad: Setting) -> float:
    """Return the shortest period of one mount: the longest of those that servo, density and gaps require."""
    limits, rate = loaded.task.limits, loaded.lidar.scan_rate_hz
    periods = [
        np.ceil(60 / fastest_rpm(loaded.task.product_names(), loaded.task.motion, loaded.products)[0] * rate - 1e-9)
        / rate
    ]
    if limits.max_line_gap_deg is not None:
        gap = float(line_gaps_deg(problem, angles_rad[None, 2:])[0]) / np.degrees(problem.lines.step_rad)
        periods.append(np.ceil(360 * gap / limits.max_line_gap_deg - 1e-9) / rate)
    if limits.min_density is not None:
        least = int(np.ceil(limits.min_density))
        periods.append(shortest_period_s(problem, angles_rad, rate, least))
    return float(max(periods))


def _rescored(
    problem: Problem, families: tuple[Family, ...], periods: list[float], period_s: float
) -> tuple[Family, ...]:
    """Return the families that allow a period, with their scores at it."""
    able = [family for family, p in zip(families, periods, strict=True) if p <= period_s * (1 + 1e-9)]
    return tuple(
        sorted((replace(f, score=score(problem, f.angles_rad)) for f in able), key=lambda family: family.score.J)
    )
