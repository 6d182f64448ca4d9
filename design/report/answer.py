"""The answer of a build, from its files: what the angles buy, what stays blind, what the parts hide, what it costs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from design.angles import AngleSet
from design.build import rounded_to_error, standard_settings
from design.coverage import coverage
from design.errors import BuildError
from design.frames import Array
from design.gaps import gaps
from design.objective import score
from design.problem import problem_of
from design.shadow import Shadow
from design.task import NAMES, LoadedTask


@dataclass(frozen=True, slots=True)
class Standard:
    """A standard alignment on the same task, without parts.

    Attributes:
        J: rounded to its error.
        factor: of the beams per ball of the scanner over its own, on the geometric mean; None where J is no logarithm.
    """

    name: str
    J: float
    J_error: float
    factor: float | None


@dataclass(frozen=True, slots=True)
class Cone:
    """A blind cone, its axis as the density map has it: theta from up, phi from ahead to the left."""

    half_angle_deg: float
    theta_deg: float
    phi_deg: float


@dataclass(frozen=True, slots=True)
class Sight:
    """What a setting sees: computed from `task.toml` and `angles.json`, as `scanwright evaluate` does, without parts.

    Attributes:
        blind_fraction: of the sphere outside the masks.
        line_gap_deg: widest distance between neighbouring scan lines.
    """

    standard: tuple[Standard, ...]
    cones: tuple[Cone, ...]
    blind_fraction: float
    masked_fraction: float
    line_gap_deg: float
    lines: int
    beams: int


@dataclass(frozen=True, slots=True)
class Hidden:
    """What the parts hide, as counts of beams and as the share of all beams over one turn of the axis."""

    beams: int
    always: int
    sometimes: int
    share: float


@contextmanager
def as_built(path: Path) -> Iterator[None]:
    """Tell a file that no build wrote from a bug.

    Raises:
        BuildError: reading the file failed inside the block.
    """
    try:
        yield
    except (OSError, EOFError, ValueError, LookupError, TypeError, BadZipFile) as error:
        raise BuildError(f"{path}: not as a build writes it ({error}): build the folder again") from error


def sight_of(loaded: LoadedTask, angles: AngleSet) -> Sight:
    """What the angle set sees on its task, and the standard alignments beside it.

    Raises:
        TaskError: no direction of the task has a weight.
    """
    if angles.motion is not None:  # a task that asks for the shortest period does not hold the one that was found
        loaded = replace(loaded, task=loaded.task.model_copy(update={"motion": angles.motion}))
    problem = problem_of(loaded)
    setting = np.radians([getattr(angles.angles_deg, name) for name in NAMES])
    logarithmic = problem.objective.name == "log" and angles.J is not None
    standard = []
    for name, other in standard_settings().items():
        found = score(problem, other)
        factor = float(np.exp(found.J - angles.J)) if logarithmic and angles.J is not None else None
        standard.append(Standard(name, *rounded_to_error(found.J, found.J_error), factor))
    lines, seen = gaps(problem, setting), coverage(problem, setting)
    return Sight(
        standard=tuple(standard),
        cones=tuple(_cone(np.array(cone.axis_world), cone.half_angle_deg) for cone in lines.blind_cones),
        blind_fraction=seen.blind_fraction,
        masked_fraction=seen.masked_fraction,
        line_gap_deg=lines.line_gap_deg,
        lines=problem.lines.count * problem.lines.repeats,
        beams=len(problem.bearings_rad),
    )


def load_own_body(path: Path) -> tuple[Shadow, Array]:
    """What the parts hide and the bearings of the beams [rad], from `own_body.npz`."""
    with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
        return Shadow(arrays["beams"], arrays["stator"]), arrays["bearing_rad"]


def hidden_by(shadow: Shadow) -> Hidden:
    """The counts of a shadow."""
    share = shadow.hidden()
    return Hidden(len(share), int((share == 1).sum()), int(((share > 0) & (share < 1)).sum()), float(share.mean()))


def _cone(axis: Array, half_angle_deg: float) -> Cone:
    x, y, z = np.round(axis, 9) + 0.0  # straight up and straight back have one name each
    return Cone(half_angle_deg, float(np.degrees(np.arccos(np.clip(z, -1, 1)))), float(np.degrees(np.arctan2(y, x))))
