"""The answer of a build, from its files: what the angles buy, what stays blind, what the parts hide, what it costs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from design.angles import AngleSet, standard_settings
from design.arrays import Array
from design.evaluation.coverage import coverage
from design.evaluation.gaps import gaps
from design.objective.holes import holes
from design.objective.problem import Problem, problem_of
from design.objective.score import Score, score
from design.objective.stated_error import rounded_to_error
from design.objective.tolerance import sensitivity
from design.shadow import Shadow
from design.task.angle_ranges import NAMES
from design.task.task import LoadedTask

OFF_DEG = 1.0  # what a printed and screwed mount may be off by


@dataclass(frozen=True, slots=True)
class Seen:
    """What one setting sees, without parts.

    Attributes:
        blind_fraction: of the sphere outside the masks.
        blind_weight: of the weight of the task, never seen.
        least: lowest count of beams per ball in the weighted region, at any start phase.
        line_gap_deg: widest distance between neighbouring scan lines.
    """

    blind_fraction: float
    blind_weight: float
    least: int
    line_gap_deg: float


@dataclass(frozen=True, slots=True)
class Standard:
    """A standard alignment on the same task, without parts.

    Attributes:
        J: rounded to its error.
        factor: of the beams per ball of the scanner over its own, on the geometric mean; None where J is no logarithm.
        seen: what it sees.
    """

    name: str
    J: float
    J_error: float
    factor: float | None
    seen: Seen


@dataclass(frozen=True, slots=True)
class ConeOnMap:
    """A blind cone, its axis as the density map has it: theta from up, phi from ahead to the left."""

    half_angle_deg: float
    theta_deg: float
    phi_deg: float


@dataclass(frozen=True, slots=True)
class BuildAnswer:
    """What a setting sees, computed from `task.toml` and `angles.json`, as `scanwright evaluate` does, without parts.

    Attributes:
        own: of the setting itself.
        holes: where the region is blind, in words.
        ball_deg: within which a beam counts for a direction.
        rises: by mounting angle, how much J rises when it alone is 1 deg off, the worse of the two ways.
        worst: the largest of `rises` as the share of beams per direction that it costs; None where J is no logarithm.
    """

    own: Seen
    holes: tuple[str, ...]
    ball_deg: float
    standard: tuple[Standard, ...]
    cones: tuple[ConeOnMap, ...]
    masked_fraction: float
    lines: int
    beams: int
    nodes: int
    rises: dict[str, float]
    worst: float | None


@dataclass(frozen=True, slots=True)
class Hidden:
    """What the parts hide, as counts of beams and as the share of all beams over one turn of the axis."""

    beams: int
    always: int
    sometimes: int
    share: float


def answer(problem: Problem, angles: AngleSet) -> BuildAnswer:
    """What the angle set sees on its task (`problem_as_built`), and the standard alignments beside it."""
    setting = mounting_rad(angles)
    logarithmic = problem.objective.name == "log"
    standard = []
    for name, other in standard_settings().items():
        found = score(problem, other)
        factor = float(np.exp(found.J - angles.J)) if logarithmic and angles.J is not None else None
        J, J_error = rounded_to_error(found.J, found.J_error)
        standard.append(Standard(name, J, J_error, factor, _seen(problem, other, found)))
    rises = sensitivity(problem, setting, np.radians(OFF_DEG))
    return BuildAnswer(
        own=_seen(problem, setting, score(problem, setting)),
        holes=tuple(hole.words() for hole in holes(problem, setting)),
        ball_deg=float(np.degrees(problem.ball_rad)),
        standard=tuple(standard),
        cones=tuple(
            _on_map(np.array(cone.axis_world), cone.half_angle_deg) for cone in gaps(problem, setting).blind_cones
        ),
        masked_fraction=coverage(problem, setting).masked_fraction,
        lines=problem.lines.count * problem.lines.repeats,
        beams=len(problem.bearings_rad),
        nodes=problem.nodes,
        rises=rises,
        worst=float(-np.expm1(-max(0.0, *rises.values()))) if logarithmic else None,
    )


def problem_as_built(loaded: LoadedTask, angles: AngleSet) -> Problem:
    """The task as numbers, with the motion that was built: `period_s = "shortest"` does not say what was found.

    Raises:
        TaskError: no direction of the task has a weight.
    """
    if angles.motion is not None:
        loaded = replace(loaded, task=loaded.task.model_copy(update={"motion": angles.motion}))
    return problem_of(loaded)


def mounting_rad(angles: AngleSet) -> Array:
    """(alpha_rot, beta_rot, alpha_laser, beta_laser) [rad]."""
    return np.radians([getattr(angles.angles_deg, name) for name in NAMES])


def _seen(problem: Problem, setting: Array, found: Score) -> Seen:
    return Seen(
        blind_fraction=coverage(problem, setting).blind_fraction,
        blind_weight=found.blind_weight,
        least=found.least,
        line_gap_deg=gaps(problem, setting).line_gap_deg,
    )


def hidden_by(shadow: Shadow) -> Hidden:
    """The counts of a shadow."""
    share = shadow.hidden()
    return Hidden(len(share), int((share == 1).sum()), int(((share > 0) & (share < 1)).sum()), float(share.mean()))


def _on_map(axis: Array, half_angle_deg: float) -> ConeOnMap:
    x, y, z = np.round(axis, 9) + 0.0  # straight up and straight back have one name each
    return ConeOnMap(
        half_angle_deg,
        float(np.degrees(np.arccos(np.clip(z, -1, 1)))),
        float(np.degrees(np.arctan2(y, x)).round(1) + 0.0),  # straight ahead is 0.0, never -0.0
    )
