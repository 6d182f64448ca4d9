"""The view of a scanner without the beams that its own parts block, compared with the reference mounts.

Console, report, studio, `evaluate` and `compare` print the numbers of this record.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from scanwright.design.arrays import Setting
from scanwright.design.evaluation.coverage import coverage
from scanwright.design.evaluation.gaps import gaps
from scanwright.design.objective.holes import NO_BLIND_WEIGHT, holes, percent
from scanwright.design.objective.problem import Problem
from scanwright.design.objective.score import Score, score
from scanwright.design.objective.stated_error import rounded_to_error
from scanwright.design.search.mounts.gain import Gain, gain_lines, gains, verdict
from scanwright.design.search.mounts.reference import TunedMount, reference_mounts
from scanwright.design.search.with_parts import score_with
from scanwright.design.self_occlusion import SelfOcclusion
from scanwright.design.task.task import Task


@dataclass(frozen=True, slots=True)
class Seen:
    """View of one mount."""

    J: float  # the objective, rounded to its error
    J_error: float  # its error
    blind: tuple[str, ...]  # descriptions of the blind spots
    blind_weight: float  # blind share of the weight of the task
    blind_fraction: float  # blind share of the sphere outside the masks
    least: int  # lowest number of beams per ball in the weighted region at any start phase
    line_gap_deg: float  # widest distance between neighbouring scan lines


@dataclass(frozen=True, slots=True)
class ReferenceMount:
    """A reference mount on the same task, without parts: the gain of the scanner over it, and its view."""

    gain: Gain
    seen: Seen

    @property
    def name(self) -> str:
        """Name of the mount."""
        return self.gain.mount.name

    @property
    def factor(self) -> float | None:
        """Ratio of the beams per direction (geometric mean) to those of the mount; None for objectives but `log`."""
        return self.gain.factor


@dataclass(frozen=True, slots=True)
class AsBuilt:
    """A scanner and the reference mounts."""

    blocked: float | None  # share of the beams that its parts block; None without known parts
    own: Seen  # its view
    mounts: tuple[ReferenceMount, ...]  # the reference mounts, the best one, with the smallest factor, first

    @property
    def parts(self) -> str:
        """Whether the numbers are with the parts, as text."""
        return "without parts" if self.blocked is None else "with parts"

    def verdict(self) -> list[str]:
        """Return a sentence about a reference mount that is as good, if there is one."""
        return verdict(tuple(mount.gain for mount in self.mounts))

    def lines(self) -> list[str]:
        """Return the numbers as lines of text."""
        own = self.own
        blocked = "" if self.blocked is None else f", which block {percent(self.blocked)} of the beams"
        return [
            f"{self.parts}{blocked}: J = {own.J:g} +- {own.J_error:g}",
            *(f"{self.parts}: {words}" for words in own.blind),
            f"{self.parts}: never seen: {percent(own.blind_weight)} of the weight, "
            f"{percent(own.blind_fraction)} of the unmasked sphere",
            *(f"{self.parts}: {line.strip()}" for line in gain_lines(tuple(mount.gain for mount in self.mounts))),
        ]

    def facts(self) -> dict[str, Any]:
        """Return the numbers by name, for JSON."""
        mounts = [{**mount.gain.facts(), "seen": asdict(mount.seen)} for mount in self.mounts]
        return {
            "with_parts": self.blocked is not None,
            "blocked": self.blocked,
            "own": asdict(self.own),
            "mounts": mounts,
        }


def as_built(
    problem: Problem,
    task: Task,
    angles_rad: Setting,
    shadow: SelfOcclusion | None,
    own: Score | None = None,
    mounts: tuple[TunedMount, ...] | None = None,
) -> AsBuilt:
    """Evaluate (alpha_rot, beta_rot, alpha_laser, beta_laser) [rad] without the beams that `shadow` blocks, if known.

    `own`, the score with the parts, and the reference mounts are computed if they are not given.
    """
    if own is None:
        own = score(problem, angles_rad) if shadow is None else score_with(problem, angles_rad, shadow)
    if mounts is None:
        mounts = reference_mounts(problem, task)
    result = gains(problem, np.degrees(angles_rad).round(6).tolist(), own.J, mounts)
    return AsBuilt(
        None if shadow is None else shadow.share(),
        seen_of(problem, angles_rad, own, shadow),
        tuple(ReferenceMount(gain, seen_of(problem, gain.mount.angles_rad, gain.mount.score)) for gain in result),
    )


def seen_of(problem: Problem, angles_rad: Setting, result: Score, shadow: SelfOcclusion | None = None) -> Seen:
    """Return the view of a mount with a known score, without the beams that `shadow` blocks."""
    moving = problem if shadow is None else problem.behind(shadow)
    spots = holes(moving, angles_rad)
    blind = [spot.words() for spot in spots]
    behind = result.blind_weight - sum(spot.weight for spot in spots)
    if shadow is not None and shadow.partly().any() and behind > NO_BLIND_WEIGHT:
        blind.append(f"blind behind fixed parts: about {percent(behind)} of the weight")
    J, J_error = rounded_to_error(result.J, result.J_error)
    return Seen(
        J=J,
        J_error=J_error,
        blind=tuple(blind),
        blind_weight=result.blind_weight,
        blind_fraction=coverage(problem, angles_rad, shadow).blind_fraction,
        least=result.least,
        line_gap_deg=gaps(moving, angles_rad).line_gap_deg,
    )
