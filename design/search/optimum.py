"""The result of a task: the search, its gain over the reference mounts, and their text."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from importlib.metadata import version
from typing import Any

import numpy as np

from scanwright.design.angles import AngleSet, angles_words
from scanwright.design.arrays import Array
from scanwright.design.left_out import LeftOut
from scanwright.design.motion import Shortest
from scanwright.design.objective.holes import holes, percent
from scanwright.design.objective.problem import Problem, problem_of
from scanwright.design.objective.self_check import require_counted
from scanwright.design.objective.stated_error import error_words, rounded_to_error
from scanwright.design.progress import Progress
from scanwright.design.search.families import Family
from scanwright.design.search.mounts.gain import Gain, gain_lines, gains
from scanwright.design.search.mounts.reference import TunedMount, angles_used, reference_mounts
from scanwright.design.search.search import SearchResult, search, with_starts
from scanwright.design.search.shortest_period import fastest
from scanwright.design.sphere.directions import spiral
from scanwright.design.task.task import LoadedTask

SQUARE_DEGREES = 41_253  # on the sphere


@dataclass(frozen=True)
class Optimum:
    """The result of a task.

    Attributes:
        requested: the task as it was read.
        loaded: the same with the result of a search for the shortest period.
        problem: the same as numbers.
        search: result of the search.
        mounts: the reference mounts, tuned to the task.
    """

    requested: LoadedTask
    loaded: LoadedTask
    problem: Problem
    search: SearchResult
    mounts: tuple[TunedMount, ...]

    @property
    def title(self) -> str:
        """Sensor and duration of one full scan, as text."""
        task = self.loaded.task
        verb = "out and back" if task.motion.mode == "sweep" else "one turn"
        return f"{task.sensor}, {verb} in {task.motion.duration_s:g} s"

    def angle_set(self, rank: int = 0) -> AngleSet:
        """Return the designed angles of a family of the search, 0 is the best."""
        return angle_set(self.loaded, self.search.best[rank])

    @property
    def gains(self) -> tuple[Gain, ...]:
        """Gains over the reference mounts, all without parts; the smallest first."""
        best = self.search.best[0]
        return gains(self.problem, best.angles_deg, best.score.J, self.mounts)

    @property
    def left_out(self) -> list[LeftOut]:
        """Work that the search skipped."""
        return [*directions_left_out(self.problem), *self.search.left_out]

    def facts(self) -> dict[str, Any]:
        """Return the result by name, for JSON."""
        plain = self.search.plain
        return {
            "task": self.loaded.task.name,
            "with_parts": False,
            "duration_s": self.loaded.task.motion.duration_s,
            "best": [family.facts() | {"settings": family.members, "note": family.word} for family in self.search.best],
            "holes": self._hole_facts(self.search.best[0]),
            "plain": None if plain is None else plain.facts() | {"holes": self._hole_facts(plain)},
            "least_blind_weight": self.search.least_blind,
            "preferred": self._preferred_facts(),
            "standard": {mount.name: {"J": mount.score.J, "J_error": mount.score.J_error} for mount in self.mounts},
            "gains": [gain.facts() for gain in self.gains],
            "covered": self.search.covered,
            "evaluated": self.search.evaluated,
            "seconds": round(self.search.seconds, 3),
            "left_out": [asdict(entry) for entry in self.left_out],
        }

    def _hole_facts(self, family: Family) -> list[dict[str, Any]]:
        return [asdict(hole) for hole in holes(self.problem, family.angles_rad)]

    def _preferred_facts(self) -> dict[str, Any] | None:
        if self.search.lowest is None:
            return None
        optimum = self.search.lowest
        return {
            "accepted_loss": self.loaded.task.angles.prefer_loss,
            "J_more": self.search.best[0].score.J - optimum.score.J,
            "lowest_J": optimum.facts(),
        }

    def lines(self, in_full: bool = False) -> list[str]:
        """Return the result as lines; `in_full` with the skipped work."""
        result = self.search
        skipped = self.left_out if in_full else ()
        shortest = isinstance(self.requested.task.motion, Shortest)
        return [
            *self.table(),
            *gain_lines(self.gains),
            f"{self.title}, the shortest found that keeps the limits" if shortest else self.title,
            f"searched {result.covered:,} mounts in {result.seconds:.1f} s ({result.evaluated:,} values of J computed)",
            *(f"skipped {entry.what}: {entry.why} ({entry.saved:,} {entry.unit})" for entry in skipped),
        ]

    def hole_lines(self, tabled: bool = True) -> list[str]:
        """Return the blind spots of the optimum, or the cost of having none; `tabled`: they follow `table`."""
        best, plain, least = self.search.best[0], self.search.plain, self.search.least_blind
        lowest = best if self.search.lowest is None else self.search.lowest
        lines = [hole.words() for hole in holes(self.problem, best.angles_rad)]
        if least is not None:
            lines.insert(
                0, f"no mount of the grid sees all of the region: at least {percent(least)} of the weight is blind"
            )
        if lines or plain is None:
            return lines or ["blind spots: none, without parts"]
        named = "the last row" if tabled else _angles_and_J(plain)
        spots = "; ".join(hole.words() for hole in holes(self.problem, plain.angles_rad))
        return [
            "blind spots: none, without parts",
            f"if blind spots were allowed, {named} would be best; it is {spots}",
            f"cost of no blind spot: {price(self.problem, lowest.score.J, plain.score.J)}",
        ]

    def table(self) -> list[str]:
        """Return the best mounts without parts, one line each, and the blind spots of the best one."""
        lines = [
            "best mounts, without parts:",
            "  alpha_rot  beta_rot  alpha_laser  beta_laser         J   +-       settings",
        ]
        lines += [_row(family) for family in self.search.best]
        if self.search.lowest is not None:
            lines[2] = f"{lines[2].rstrip()} [preferred]"
        if self.search.plain is not None:
            lines.append(f"{_row(self.search.plain).rstrip()} [blind spot]")
        return [*lines, *self.hole_lines(), *self.preferred_lines()]

    def preferred_lines(self) -> list[str]:
        """Return the simple mount that was preferred to the lowest J, and its cost."""
        if self.search.lowest is None:
            return []
        preferred, optimum = self.search.best[0], self.search.lowest
        unit = "of the beams per ball" if self.problem.objective.name == "log" else "of J"
        accepted = f"at most {percent(self.loaded.task.angles.prefer_loss)} {unit}"
        if preferred.angles_deg == optimum.angles_deg:
            return [f"no simpler mount costs {accepted}: the result has the lowest J"]
        used = angles_used(preferred.angles_deg)
        cost = price(self.problem, preferred.score.J, optimum.score.J)
        return [
            f"preferred as the simplest mount that costs {accepted}: {_angles(preferred)}, {used} "
            f"{'angle is' if used == 1 else 'angles are'} not 0",
            f"it costs {cost} against the lowest J, {_angles_and_J(optimum)}",
        ]


def price(problem: Problem, J: float, less: float) -> str:
    """Return the cost of a J relative to a lower one, as text."""
    if problem.objective.name == "log":
        return f"{percent(-math.expm1(less - J))} of the beams per ball"
    return f"{J - less:.2g} in J"


def _angles_and_J(family: Family) -> str:
    return f"{_angles(family)} with J = {family.score.J:.4f}"


def _angles(family: Family) -> str:
    return angles_words(np.round(family.angles_deg, 2) + 0.0)


def _row(family: Family) -> str:
    angles = "".join(f"{a:{width}.2f}" for a, width in zip(family.angles_deg, (11, 10, 13, 12), strict=True))
    J, J_error = family.score.J, error_words(family.score.J, family.score.J_error)
    return f"{angles} {J:9.4f}   {J_error} {family.members:9} {family.word}"


def find_optimum(loaded: LoadedTask, progress: Progress) -> Optimum:
    """Search the best mounts of a task, and the shortest period if the task requests it.

    Raises:
        TaskError: no direction has a weight, or no mount meets the limits.
        NumericalError: the best J differs from a count over simulated beams.
    """
    progress("reading the task (first run: compiling, about 5 s)")
    result_task = loaded
    if isinstance(loaded.task.motion, Shortest):
        result_task, problem, result = fastest(loaded, progress)
        progress(f"one turn in {result_task.task.motion.duration_s:g} s: the shortest found that keeps the limits")
    else:
        problem = problem_of(loaded)
        result = search(problem, loaded.task.angles, progress, loaded.task.limits)
    task = result_task.task
    progress("tuning the reference mounts")
    mounts = reference_mounts(problem, task)
    starts = [mount.angles_deg for mount in mounts if mount.in_ranges]
    result = with_starts(problem, task.angles, task.limits, result, starts, progress)
    best = result.best[0]
    require_counted(result_task, best.angles_rad, best.score)
    return Optimum(loaded, result_task, problem, result, mounts)


def directions_left_out(problem: Problem) -> list[LeftOut]:
    """Return the directions without weight, in square degrees."""
    directions: Array = spiral(SQUARE_DEGREES)
    masked = problem.field.masked_at(directions)
    ignored = (problem.field.weight_at(directions) == 0) & ~masked
    out = []
    if masked.any():
        out.append(LeftOut("masked directions", "the robot hides them", int(masked.sum()), "square degrees"))
    if ignored.any():
        out.append(LeftOut("directions of weight zero", "they add nothing to J", int(ignored.sum()), "square degrees"))
    return out


def angle_set(loaded: LoadedTask, family: Family) -> AngleSet:
    """Return the designed angle set of a family; J is rounded to its error."""
    assert not isinstance(loaded.task.motion, Shortest)  # the search has replaced it
    J, J_error = rounded_to_error(family.score.J, family.score.J_error)
    return loaded.angle_set(family.angles_deg).model_copy(
        update={
            "task_sha256": loaded.sha256(),
            "J": J,
            "J_error": J_error,
            "versions": {"scanwright": version("scanwright")},
        }
    )
