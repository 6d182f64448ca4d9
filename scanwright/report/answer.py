"""The result of a build, computed from its files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scanwright.design.angles import AngleSet
from scanwright.design.arrays import Array
from scanwright.design.evaluation.as_built import AsBuilt, as_built
from scanwright.design.evaluation.coverage import coverage
from scanwright.design.evaluation.expected_cloud import ExpectedCloud, expected_cloud
from scanwright.design.findings import Finding
from scanwright.design.objective.problem import Problem, problem_of
from scanwright.design.search.with_parts import checked_score
from scanwright.design.self_occlusion import SelfOcclusion
from scanwright.design.task.angle_ranges import NAMES
from scanwright.design.task.task import LoadedTask


@dataclass(frozen=True, slots=True)
class BuildAnswer:
    """The result of a build, from its files."""

    as_built: AsBuilt  # what it sees with its parts, and the reference mounts
    ball_deg: float  # within which a beam counts for a direction
    cloud: ExpectedCloud  # error, gaps and points to expect
    masked_fraction: float  # share of the sphere that the robot hides
    lines: int  # of one full scan
    beams: int  # of one line


def answer(
    loaded: LoadedTask, angles: AngleSet, shadow: SelfOcclusion | None = None, checks: Sequence[Finding] = ()
) -> BuildAnswer:
    """Judge an angle set on its task, without the beams that `shadow` blocks; `checks` are of its parts.

    Raises:
        BuildError: the shadow is of another number of beams.
        TaskError: no direction has a weight.
        NumericalError: J differs from a count over simulated beams.
    """
    built = task_as_built(loaded, angles)
    problem, setting = problem_of(built), mounting_rad(angles)
    own = checked_score(built, problem, setting, shadow)
    return BuildAnswer(
        as_built=as_built(problem, built.task, setting, shadow, own),
        ball_deg=float(np.degrees(problem.ball_rad)),
        cloud=expected_cloud(built, problem, setting, own, shadow, checks),
        masked_fraction=coverage(problem, setting).masked_fraction,
        lines=problem.lines.count * problem.lines.repeats,
        beams=len(problem.bearings_rad),
    )


def task_as_built(loaded: LoadedTask, angles: AngleSet) -> LoadedTask:
    """Return the task with the motion that was built: `period_s = "shortest"` does not state the result."""
    if angles.motion is None:
        return loaded
    return replace(loaded, task=loaded.task.model_copy(update={"motion": angles.motion}))


def problem_as_built(loaded: LoadedTask, angles: AngleSet) -> Problem:
    """Return the numbers of the task as built."""
    return problem_of(task_as_built(loaded, angles))


def mounting_rad(angles: AngleSet) -> Array:
    """Return (alpha_rot, beta_rot, alpha_laser, beta_laser) [rad]."""
    return np.radians([getattr(angles.angles_deg, name) for name in NAMES])
