"""Four usual mounts, each tuned to a task, with which a result is compared.

- rolling and pitching, the standard alignments (Schubert 2016, section 4), have no free angle;
- upright, one tilt: vertical axis, and a lidar that is pitched (as in Malaga: Mandow; Morales 2018) or rolled by the
  best angle;
- Bonn, 45 deg: axis 45 deg down ahead, scan plane along the axis, heading twisted away from it "slightly" (the
  UTM-30LX-EW on an MX-28 of their MAV). The angle is unknown: the best twist up to 45 deg.

They must meet the limits of the task, but not its ranges of angles. Angles are tuned in steps down to `STEPS_DEG[-1]`.
For a sweep the first steps compare mean counts.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from scanwright.design.angles import STANDARD_DEG
from scanwright.design.arrays import Setting
from scanwright.design.objective.problem import Problem
from scanwright.design.objective.score import Score, bound_J, score, score_on
from scanwright.design.search.grid_classes import mirrors_of
from scanwright.design.search.space import SearchSpace
from scanwright.design.search.with_parts import equivalents
from scanwright.design.task.angle_ranges import AngleRanges
from scanwright.design.task.task import Task

STEPS_DEG = (5.0, 1.0, 0.2)  # of an angle: over its range, then about the best value
AROUND = 4  # steps to either side of the best value
QUICK_NODES = 243  # of the scores that tune an angle
SWEEP_SCORED = 12  # angles of a sweep that are scored, the best by their mean counts
SWEEP_NODES = 2187  # initial nodes of a score of a sweep
SWEEP_TOLERANCE = 5e-3  # of J of a sweep: half a percent of its beams
EXACT = 5  # angles that are scored exactly to find one that meets the limits

Four = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class OneFreeAngle:
    """Mounts with one free angle."""

    angles_deg: Four  # (alpha_rot, beta_rot, alpha_laser, beta_laser)
    free: int  # index of the free angle
    low_deg: float  # its lower limit
    high_deg: float  # its upper limit

    def at(self, angle_deg: float) -> Four:
        """Return the angles with the free angle at a value."""
        angles = list(self.angles_deg)
        angles[self.free] = angle_deg
        return angles[0], angles[1], angles[2], angles[3]


PITCHED = OneFreeAngle((0.0, 0.0, 0.0, 0.0), 3, -90.0, 90.0)
ROLLED = OneFreeAngle((0.0, 0.0, 0.0, 0.0), 2, -90.0, 90.0)
TWISTED = OneFreeAngle((180.0, 45.0, 90.0, -90.0), 3, -90.0, -45.0)
TUNED = {"upright, one tilt": (PITCHED, ROLLED), "Bonn, 45 deg": (TWISTED,)}


@dataclass(frozen=True, slots=True)
class TunedMount:
    """A reference mount, tuned to a task."""

    name: str  # of the mount
    angles_deg: Four  # (alpha_rot, beta_rot, alpha_laser, beta_laser)
    score: Score  # its exact score
    keeps_limits: bool  # whether it meets the limits of the task; blind spots do not matter
    in_ranges: bool  # whether `angles_deg`, chosen among mounts of the same J, are in the ranges of the task

    @property
    def angles_rad(self) -> Setting:
        """The four angles in radians, shape (4,)."""
        return np.radians(self.angles_deg)


def angles_used(angles_deg: Iterable[float]) -> int:
    """Return the number of mounting angles that are not 0: the fewer, the simpler the mount."""
    return sum(abs(angle) > 1e-9 for angle in angles_deg)


def reference_mounts(problem: Problem, task: Task) -> tuple[TunedMount, ...]:
    """Return the four reference mounts, tuned to a task.

    Each has the lowest J within the limits and, if the task avoids them, without blind spots; or else the lowest J.
    """
    if problem.sweep is not None:
        tolerance = max(problem.tolerance, SWEEP_TOLERANCE)
        problem = replace(problem, tolerance=tolerance, nodes=min(problem.nodes, SWEEP_NODES))
    space = SearchSpace(problem, task.angles, task.limits, task.angles.holes == "avoid")
    limits = replace(space, avoid_holes=False)
    result = [(name, angles_deg, score(problem, np.radians(angles_deg))) for name, angles_deg in STANDARD_DEG.items()]
    result += [(name, *_tuned(space, lines)) for name, lines in TUNED.items()]
    out = []
    for name, angles_deg, judged in result:
        keeps_limits = limits.keeps(judged, np.array(angles_deg))
        allowed = [same for same in _same(problem, angles_deg) if task.angles.hold(same)]
        out.append(TunedMount(name, (allowed or [angles_deg])[0], judged, keeps_limits, bool(allowed)))
    return tuple(out)


def _tuned(space: SearchSpace, lines: tuple[OneFreeAngle, ...]) -> tuple[Four, Score]:
    """Return the best mount of some lines by quick scores, and its exact score."""
    problem = space.problem
    known: dict[Four, tuple[bool, float]] = {}
    places: list[tuple[OneFreeAngle, float]] = []

    def try_angles(line: OneFreeAngle, angles_deg: Setting) -> None:
        for angle_deg in np.unique(np.clip(angles_deg, line.low_deg, line.high_deg).round(6) + 0.0).tolist():
            setting = line.at(angle_deg)
            if setting not in known:
                quick = score_on(problem, np.radians(setting), QUICK_NODES, stated=False)
                known[setting] = (not space.keeps(quick, np.array(setting)), quick.J)
                places.append((line, angle_deg))

    first: list[tuple[OneFreeAngle, Setting]] = []
    # a lidar rolled to the left can have the same view as one rolled to the right
    rolls_alike = problem.sweep is None and len(mirrors_of(problem.bearings_rad)) > 1
    for line in lines:
        low_deg = 0.0 if line is ROLLED and rolls_alike else line.low_deg
        first.append((line, np.arange(low_deg, line.high_deg + STEPS_DEG[0] / 2, STEPS_DEG[0])))
    if problem.sweep is not None:
        bounds = [
            (bound_J(problem, np.radians(line.at(angle_deg)), QUICK_NODES), k, angle_deg)
            for k, (line, angles_deg) in enumerate(first)
            for angle_deg in angles_deg.tolist()
        ]
        first = [(first[k][0], np.array([angle_deg])) for _, k, angle_deg in sorted(bounds)[:SWEEP_SCORED]]
    for line, angles_deg in first:
        try_angles(line, angles_deg)
    for step_deg in STEPS_DEG[1:]:
        line, angle_deg = min(places, key=lambda place: known[place[0].at(place[1])])
        try_angles(line, angle_deg + step_deg * np.arange(-AROUND, AROUND + 1))
    ordered = sorted(known, key=known.__getitem__)
    for setting in [each for each in ordered if not known[each][0]][:EXACT]:
        if (result := space.score(np.array(setting))) is not None:
            return setting, result
    return ordered[0], score(space.problem, np.radians(ordered[0]))


def _same(problem: Problem, angles_deg: Four) -> list[Four]:
    """Return mounts of the same J, itself first, with alpha_rot = -180 also as 180."""
    result = equivalents(problem, angles_deg, AngleRanges())
    return [*result, *((180.0, b, c, d) for a, b, c, d in result if a == -180)]
