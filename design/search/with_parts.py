"""The best mount with the beams that its parts block; solids are made for few mounts only.

J without parts is a lower bound of J with parts, and so is J without the beams that parts block according to a closed
form. Families are examined in the order of the first bound, their equivalent mounts in that of the second, until no
bound is below the best J.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Protocol

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from scanwright.design.angles import angles_words
from scanwright.design.arrays import Setting
from scanwright.design.density.ball_count import ball_count
from scanwright.design.density.beams import scan_at
from scanwright.design.errors import BuildError
from scanwright.design.left_out import LeftOut
from scanwright.design.objective.ball_search import start_phases
from scanwright.design.objective.holes import NO_BLIND_WEIGHT
from scanwright.design.objective.problem import Problem
from scanwright.design.objective.score import Score, score
from scanwright.design.objective.self_check import require_counted
from scanwright.design.progress import Progress
from scanwright.design.search.families import Family
from scanwright.design.search.grid_classes import mirrors_of
from scanwright.design.self_occlusion import SelfOcclusion
from scanwright.design.sphere.directions import sample_set
from scanwright.design.task.angle_ranges import AngleRanges
from scanwright.design.task.task import Limits, LoadedTask

SETS, DIRECTIONS = 4, 3000  # of samples with and without fixed parts, at the same directions and phases
MOST_BUILT = 6  # mounts whose solids are made


@dataclass(frozen=True, slots=True)
class Refused:
    """A mount that cannot be built, and the reason."""

    reason: str


class Workshop(Protocol):
    """Maker of the parts of a mount (alpha_rot, beta_rot, alpha_laser, beta_laser) [rad]: `cad.assembly.shadow`."""

    def bound(self, setting_rad: Setting) -> SelfOcclusion | Refused:
        """Return beams that the parts block at every axis angle according to a closed form; `stator` is None."""
        ...

    def shadow(self, setting_rad: Setting) -> SelfOcclusion | Refused:
        """Return the beams that the parts block."""
        ...


@dataclass(frozen=True, slots=True)
class Chosen:
    """The best mount with its parts."""

    family: Family  # its angles, and its J with the parts
    bare: Score  # its J without parts
    shadow: SelfOcclusion  # the beams that the parts block
    bounded: int  # number of mounts with a bound
    built: int  # number of mounts whose solids were made
    refused: tuple[tuple[float, str], ...]  # J without parts and the reason, for each rejected mount
    open: int  # families with a bound below the best J that were not built because of `MOST_BUILT`
    worse: int = 0  # families with a lower J without parts that are worse with them

    def lines(self) -> list[str]:
        """Return the chosen mount, and the rejected ones with reasons."""
        lines = [
            f"built {angles_words(self.family.angles_deg)}: J = {self.bare.J:.4f} without parts; "
            f"considered {self.bounded} mount{'s' * (self.bounded != 1)}, built {self.built}, "
            f"rejected {len(self.refused)}",
            *(f"{each.what} rejected: {each.why}" for each in self.left_out()),
        ]
        if self.worse:
            lines.append(f"mounts with a lower J without parts that lose more beams to their parts: {self.worse}")
        if self.open:
            lines.append(f"{self.open} more mounts can be better with their parts, but were not built")
        return lines

    def left_out(self) -> list[LeftOut]:
        """Return the number of rejected mounts with a lower J, and each reason once; empty if there are none."""
        reasons = [reason for J, reason in sorted(self.refused) if self.bare.J > J]
        if not reasons:
            return []
        mounts = "mount" if len(reasons) == 1 else "mounts"
        return [LeftOut(f"{len(reasons)} {mounts} with a lower J", "; ".join(dict.fromkeys(reasons)), 0, mounts)]


def choose_with_parts(
    problem: Problem,
    families: tuple[Family, ...],
    ranges: AngleRanges,
    limits: Limits,
    workshop: Workshop,
    progress: Progress,
    failed: Mapping[tuple[float, ...], str] = MappingProxyType({}),
) -> Chosen:
    """Return the family that is best with its parts; with `prefer = "simple"` the first one that can be built.

    `failed` maps angles [deg] of mounts whose parts failed a check to its message: they are not chosen.

    Raises:
        BuildError: none can be built within the limits of the task.
    """
    best: Chosen | None = None
    lowest: tuple[bool, int, float] | None = None  # rank of the best one
    avoid, simple = ranges.holes == "avoid", ranges.prefer == "simple"
    refused: list[tuple[float, str]] = []
    considered: list[float] = []
    bounded = built = 0
    queue = families if simple else sorted(families, key=lambda family: family.score.J)
    for place, family in enumerate(queue):
        first = place if simple else 0
        if lowest is not None and lowest <= (False, first, family.score.J):
            break
        if built == MOST_BUILT and best is not None:
            left = sum(other.score.J < best.family.score.J for other in queue[place:])
            best = replace(best, open=left)
            break
        considered.append(family.score.J)
        bounds = []
        for angles_deg in equivalents(problem, family.angles_deg, ranges):
            if angles_deg in failed:
                refused.append((family.score.J, f"its parts fail a check: {failed[angles_deg]}"))
                continue
            bound = workshop.bound(np.radians(angles_deg))
            bounded += 1
            if isinstance(bound, Refused):
                refused.append((family.score.J, bound.reason))
                continue
            bare = score(problem.behind(bound), np.radians(angles_deg))
            turned = simple and angles_deg != family.angles_deg
            bounds.append((_blind(bare, avoid), turned, bare.J, angles_deg))
        # the first mount of a family is the easiest to build: another one must be better by more than 0.001
        for blind, _, J, angles_deg in sorted(bounds, key=lambda bound: (*bound[:2], round(bound[2], 3)))[:1]:
            if lowest is not None and lowest <= (blind, first, J):
                continue
            progress(f"beams blocked by the parts of {angles_words(angles_deg)}")
            built += 1
            shadow = workshop.shadow(np.radians(angles_deg))
            if isinstance(shadow, Refused):
                refused.append((family.score.J, shadow.reason))
                continue
            hidden = shadow.share()
            if limits.max_blocked is not None and hidden > limits.max_blocked:
                why = f"the parts block {hidden:.1%} of the beams (limits.max_blocked)"
                refused.append((family.score.J, why))
                continue
            result = score_with(problem, np.radians(angles_deg), shadow)
            rank = _blind(result, avoid), first, result.J
            if lowest is None or rank < lowest:
                lowest = rank
                chosen = replace(family, angles_deg=angles_deg, score=result)
                best = Chosen(chosen, family.score, shadow, 0, 0, (), 0)
    if best is None:
        raise BuildError(f"none of the {len(families)} best families can be built: {refused[0][1]}")
    rejected = {J for J, _ in refused}
    worse = sum(J < best.bare.J and J not in rejected for J in considered)
    return replace(best, bounded=bounded, built=built, refused=tuple(refused), worse=worse)


def score_with(problem: Problem, angles_rad: Setting, shadow: SelfOcclusion) -> Score:
    """Return the score of a mount without the beams that its parts block.

    Beams blocked by parts that turn with the laser are removed, which is exact. The effect of fixed parts on J and on
    the blind weight is the difference of two samplings on the same directions and phases; `least` is the lowest count
    of these samples, if that is lower.
    """
    seen = problem.behind(shadow)
    plain = score(seen, angles_rad)
    if not shadow.partly().any() or not np.isfinite(plain.J):  # J is infinite without beams
        return plain
    at_times = shadow.of(~shadow.beams)
    sampled = [_sampled(seen, angles_rad, at_times, index) for index in range(SETS)]
    behind, free = np.array([[float(problem.objective.join(one)) for one in both] for both, _, _ in sampled]).T
    change = np.where(np.isfinite(free), behind, 0.0) - np.where(np.isfinite(free), free, 0.0)
    spread = float(4 * np.std(change, ddof=1) / SETS**0.5) if np.isfinite(change).all() else 0.0
    return replace(
        plain,
        J=plain.J + float(change.mean()),
        J_error=float(np.hypot(plain.J_error, spread)),
        least=min(plain.least, *(least for _, _, least in sampled)),
        blind_weight=plain.blind_weight + float(np.mean([blinded for _, blinded, _ in sampled])),
    )


def checked_score(loaded: LoadedTask, problem: Problem, angles_rad: Setting, shadow: SelfOcclusion | None) -> Score:
    """Return the score of a mount, with its parts if known, after comparing J with a count over simulated beams.

    Raises:
        NumericalError: they differ by more than their errors.
    """
    result = score(problem, angles_rad) if shadow is None else score_with(problem, angles_rad, shadow)
    require_counted(loaded, angles_rad, result, shadow, problem.lever)
    return result


def equivalents(
    problem: Problem, angles_deg: tuple[float, float, float, float], ranges: AngleRanges
) -> list[tuple[float, float, float, float]]:
    """Return the mount and those of equal J within the ranges, itself first (docs/definitions.md, Motion)."""
    a, b, c, d = angles_deg
    if problem.sweep is not None:
        return [angles_deg]
    turned = round((a + 360.0) % 360.0 - 180.0, 9)  # with -b the axis has the opposite direction
    result: list[tuple[float, float, float, float]] = []
    for beta, alpha in np.diagonal(mirrors_of(problem.bearings_rad), axis1=1, axis2=2).tolist():
        plane = 0.0 + alpha * c, 0.0 + beta * d  # q0 has the sign of beta_laser, q1 that of alpha_laser
        result += [(a, b, *plane), (turned, 0.0 - b, 0.0 - plane[0], 0.0 - plane[1])]
    return list(dict.fromkeys([result[0], *filter(ranges.hold, result[1:])]))


def _blind(result: Score, avoid_holes: bool) -> bool:
    """Return whether a mount has blind spots that are to be avoided."""
    return avoid_holes and result.blind_weight > NO_BLIND_WEIGHT


def _sampled(
    problem: Problem, angles_rad: Setting, shadow: SelfOcclusion, index: int
) -> tuple[Float[ndarray, "2 moments"], float, int]:
    """Return moments with and without fixed parts over one set of directions at one start phase, (2, moments).

    Also the share of the weight that these parts make blind, and the lowest count.
    """
    if problem.sweep is None:
        joint = problem.lines.angles_rad + start_phases(problem.lines.count, problem.lines.step_rad)[2 * index]
    else:
        joint = problem.sweep.angles_rad((index + 0.5) / SETS)
    scan = scan_at(problem.bearings_rad, joint, angles_rad)
    free = shadow.free(joint).ravel()  # line after line, as the scan
    out, lowest = [], []
    blinded = 0.0
    for moment in problem.objective.moments:
        samples = sample_set(moment.field, problem.grid_step_deg, DIRECTIONS, index)
        counts = [ball_count(beams, samples.directions, problem.ball_rad) for beams in (scan[free], scan)]
        share = samples.weights / samples.weights.sum()
        blinded += moment.share * float(share @ ((counts[0] == 0) & (counts[1] > 0)))
        if moment.share > 0:
            lowest.append(problem.lines.repeats * int(counts[0][share > 0].min()))
        g = [moment.g(problem.lines.repeats * count) for count in counts]
        out.append([each.max() if moment.gathered == "highest" else share @ each for each in g])
    return np.array(out).T, blinded, min(lowest)
