"""Evaluation of one mount: its figures, as JSON (`facts`) and as text (`lines`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from scanwright.design.arrays import Setting
from scanwright.design.density.beams import scan_at
from scanwright.design.errors import TaskError
from scanwright.design.evaluation.as_built import AsBuilt, as_built
from scanwright.design.evaluation.coverage import Coverage, coverage, on_surfaces
from scanwright.design.evaluation.expected_cloud import ExpectedCloud, expected_cloud
from scanwright.design.evaluation.gaps import BlindCone, Gaps, empty_cap, gaps, interlaced_period_s
from scanwright.design.evaluation.poles import Pole, PoleChances, pole_chances, require_in_range
from scanwright.design.findings import Finding
from scanwright.design.objective.ball_search import BallScore, ball_score
from scanwright.design.objective.holes import BlindSpot, holes, percent
from scanwright.design.objective.problem import Problem, problem_of
from scanwright.design.objective.score import Score
from scanwright.design.objective.stated_error import error_words, rounded_to_error
from scanwright.design.objective.tolerance import rise_words, sensitivity
from scanwright.design.progress import Progress
from scanwright.design.search.shortest_period import with_period
from scanwright.design.search.with_parts import checked_score
from scanwright.design.self_occlusion import SelfOcclusion
from scanwright.design.task.angle_ranges import NAMES
from scanwright.design.task.task import LoadedTask


@dataclass(frozen=True, slots=True)
class Lever:
    """Lever arm: offset (x, y) of the optical centre from the rotation axis.

    Attributes:
        x_mm: offset along x of the rotation frame.
        y_mm: offset along y of the rotation frame.
        range_m: range at which its effect is computed.

    Raises:
        TaskError: the range is not at least twice the offset.
    """

    x_mm: float
    y_mm: float
    range_m: float

    def __post_init__(self) -> None:
        if not 0 < self.range_m < 1e6 or not max(abs(self.x_mm), abs(self.y_mm)) < 500 * self.range_m:
            raise TaskError(f"lever: range_m = {self.range_m:g}: must be at least twice the offset, below 1e6")

    def shares(self) -> tuple[float, float, float]:
        """Return the offset as a share of the range: `Problem.lever`."""
        return self.x_mm / 1000 / self.range_m, self.y_mm / 1000 / self.range_m, 0.0

    def words(self) -> str:
        """Return the offset, and the range to which all figures refer, as text."""
        return f"optical centre ({self.x_mm:g}, {self.y_mm:g}) mm off the axis: all figures hold at {self.range_m:g} m"


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Figures of one mount for a task.

    Attributes:
        problem: the task as numbers.
        angles_rad: (alpha_rot, beta_rot, alpha_laser, beta_laser).
        lever: lever arm, if the optical centre is off the axis.
        score: J by the closed form.
        ball: J by ball search over simulated scans.
        holes: blind spots of the region.
        coverage: blind and masked shares.
        gaps: blind cones, gaps and crossings of scan lines.
        cap: the largest empty cap of a sweep; None for full turns, which have blind cones.
        shortest_s: period of a full turn that was chosen for this mount; None if the task gives the motion.
        interlaced_s: period at which the lines of the next turn lie between those of this one; None without a spin.
        rises: rise of J if each angle is 1 deg off.
        hit: the probability to hit a pole, if requested.
        surfaces: points per square metre, if the task has a scene.
        cloud: expected error, gaps and points, with the parts if known.
        as_built: figures with the parts of a build; all others are without parts.
    """

    problem: Problem
    angles_rad: Setting
    lever: Lever | None
    score: Score
    ball: BallScore
    holes: tuple[BlindSpot, ...]
    coverage: Coverage
    gaps: Gaps
    cap: BlindCone | None
    shortest_s: float | None
    interlaced_s: float | None
    rises: dict[str, float]
    hit: PoleChances | None
    surfaces: dict[str, float] | None
    cloud: ExpectedCloud
    as_built: AsBuilt | None

    def beam_directions(self) -> Float[ndarray, "n 3"]:
        """Return the directions of the beams of one full scan in the world frame, shape (n, 3)."""
        return simulated_beams(self.problem, self.angles_rad)

    @property
    def agree(self) -> bool:
        """Whether J by closed form and by ball search differ by no more than their errors."""
        off = abs(self.score.J - self.ball.J)
        return bool(off <= self.score.J_error + self.ball.J_error) or not np.isfinite(off)

    def _disagreement(self) -> list[str]:
        if self.agree:
            return []
        off = abs(self.score.J - self.ball.J) / (self.score.J_error + self.ball.J_error)
        return [f"J and J_ball differ by {off:.1f} times their errors: do not trust this J, and please report the task"]

    def facts(self) -> dict[str, Any]:
        """Return the figures by name, for JSON."""
        return {
            **({} if self.lever is None else {"lever": asdict(self.lever)}),
            "with_parts": False,  # except `as_built`
            "J": self.score.J,
            "J_error": self.score.J_error,
            "J_lower": self.score.J_lower,
            "J_agrees_with_J_ball": self.agree,
            "holes": [asdict(hole) for hole in self.holes],
            "J_ball": self.ball.J,
            "J_ball_error": self.ball.J_error,
            "blind_fraction": self.coverage.blind_fraction,
            "blind_weight_fraction": self.score.blind_weight,
            "masked_fraction": self.coverage.masked_fraction,
            "min_density": self.score.least,
            **asdict(self.gaps),
            **({} if self.cap is None else {"empty_cap": asdict(self.cap)}),
            **({} if self.shortest_s is None else {"period_s": self.shortest_s}),
            **({} if self.interlaced_s is None else {"interlaced_period_s": self.interlaced_s}),
            "J_rises_1_deg_off": self.rises,
            **({} if self.hit is None else {"pole": asdict(self.hit)}),
            **(self.surfaces or {}),
            **asdict(self.cloud),
            **({} if self.as_built is None else {"as_built": self.as_built.facts()}),
        }

    def lines(self) -> list[str]:
        """Return the figures as lines of text."""
        J, ball, seen, gap = self.score, self.ball, self.coverage, self.gaps
        ball_deg = np.degrees(self.problem.ball_rad)
        lines = [
            *self._disagreement(),
            *([] if self.as_built is None else self.as_built.lines()),
            *self.cloud.lines(),
            "without parts:",
            *([] if self.lever is None else [f"lever          {self.lever.words()}"]),
            *(
                [f"blind spot     {hole.words().removeprefix('blind ')}" for hole in self.holes]
                or [f"blind spots    none: every direction of the region is within {ball_deg:g} deg of a beam's path"]
            ),
            f"J              {J.J:.5f} +- {error_words(J.J, J.J_error)}   mean over the start phase",
            f"J_lower        {J.J_lower:.5f}           lower bound, from the mean count",
            f"J_ball         {ball.J:.5f} +- {error_words(ball.J, ball.J_error)}   count in 8 simulated scans",
            f"never seen     {percent(seen.blind_fraction)} of the unmasked sphere, {percent(J.blind_weight)} of the "
            "weight",
            f"masked         {seen.masked_fraction:.2%} of the sphere",
            f"min_density    {J.least} beams within {ball_deg:g} deg: the lowest of all directions and start phases",
        ]
        lines += [f"blind cone     {_cap(cone)}" for cone in gap.blind_cones]
        if self.cap is not None:
            lines.append(f"empty cap      {_cap(self.cap)}, the largest without a beam")
        gap_mm = 10_000 * np.radians(gap.line_gap_deg)
        lines.append(f"line gap       {gap.line_gap_deg:.3f} deg at the widest, {gap_mm:.0f} mm at 10 m")
        crossing = "" if gap.crossing_deg is None else f"; scan lines cross at {gap.crossing_deg:.0f} deg (mean)"
        lines.append(f"seen twice     {gap.seen_twice:.1%} of the weight{crossing}")
        if gap.half_turn_misses is not None:
            lines.append(f"half a turn    misses {gap.half_turn_misses:.1%} of the weight that a full turn sees")
        if self.hit is not None:
            for result in self.hit.chances:
                beams = f"{result.beams} beam{'s' if result.beams > 1 else ''}"
                _, error = rounded_to_error(100 * result.chance, 100 * result.error)
                chance = f"{result.chance:.2%} +- {error:g}%"
                lines.append(f"pole           {chance} get at least {beams} ({self.hit.stands} azimuths)")
        if self.surfaces is not None:
            low, middle = self.surfaces["lowest_points_per_m2"], self.surfaces["median_points_per_m2"]
            lines.append(
                f"surfaces       {middle:,.0f} points per m2 in the region (median by area), {low:,.1f} the lowest"
            )
        if self.shortest_s is not None:
            why = "the shortest that keeps the limits, longest_s if none does"
            lines.append(f"period         {self.shortest_s:g} s a turn: {why}")
        if self.interlaced_s is not None:
            lines.append(
                f"interlaced     with {self.interlaced_s:g} s a turn: the next turn's lines fall between these"
            )
        return [*lines, f"1 deg off      {rise_words(self.rises, J.J_error)}"]


def evaluate(
    loaded: LoadedTask,
    angles_rad: Setting,
    pole: Pole | None,
    lever: Lever | None,
    progress: Progress,
    shadow: SelfOcclusion | None = None,
    checks: Sequence[Finding] = (),
) -> Evaluation:
    """Evaluate (alpha_rot, beta_rot, alpha_laser, beta_laser) [rad].

    `shadow` are the beams that the parts of this mount block and `checks` the checks of these parts, if it was built.

    Raises:
        TaskError: no direction has a weight, or the lidar cannot measure the pole.
        NumericalError: J differs from a count over simulated beams.
    """
    if pole is not None:
        require_in_range(pole, loaded.lidar)
    chosen = with_period(loaded, angles_rad, progress)
    shortest_s = None if chosen is loaded else chosen.task.motion.duration_s
    loaded = chosen
    problem = problem_of(loaded)
    if lever is not None:
        problem = replace(problem, lever=lever.shares())
    motion, sweep = loaded.task.motion, problem.sweep
    progress("closed form")
    cap = None if sweep is None else empty_cap(simulated_beams(problem, angles_rad))
    interlaced_s = interlaced_period_s(motion.duration_s, loaded.lidar.scan_rate_hz) if motion.mode == "spin" else None
    result = checked_score(loaded, problem, angles_rad, None)
    built, own = None, result
    if shadow is not None:
        own = checked_score(loaded, problem, angles_rad, shadow)
        built = as_built(problem, loaded.task, angles_rad, shadow, own)
    progress("ball search, 8 start phases")
    return Evaluation(
        problem=problem,
        angles_rad=angles_rad,
        lever=lever,
        score=result,
        ball=ball_score(problem, angles_rad),
        holes=holes(problem, angles_rad),
        coverage=coverage(problem, angles_rad),
        gaps=gaps(problem, angles_rad),
        cap=cap,
        shortest_s=shortest_s,
        interlaced_s=interlaced_s,
        rises=sensitivity(problem, angles_rad, np.radians(1.0)),
        hit=None if pole is None else pole_chances(problem, angles_rad, pole),
        surfaces=None if loaded.surface is None else on_surfaces(problem, angles_rad, loaded.surface),
        cloud=expected_cloud(loaded, problem, angles_rad, own, shadow, checks),
        as_built=built,
    )


def setting_rad(angles_deg: Sequence[float]) -> Setting:
    """Return mounting angles (alpha_rot, beta_rot, alpha_laser, beta_laser) in radians.

    Raises:
        TaskError: these are not four angles from -360 to 360 degrees.
    """
    if len(angles_deg) != len(NAMES):
        raise TaskError(f"angles_deg = {tuple(angles_deg)}: four numbers in degrees, such as (0, 90, 0, -90)")
    for name, angle_deg in zip(NAMES, angles_deg, strict=True):
        if not abs(angle_deg) <= 360:
            raise TaskError(f"{name} = {angle_deg:g} deg: from -360 to 360")
    return np.radians(angles_deg)


def simulated_beams(problem: Problem, angles_rad: Setting) -> Float[ndarray, "n 3"]:
    """Return the directions of the beams of one full scan in the world frame, shape (n, 3)."""
    return scan_at(problem.bearings_rad, problem.joint_rad(), angles_rad, problem.lever)


def _cap(cap: BlindCone) -> str:
    x, y, z = cap.axis_world
    return f"{cap.half_angle_deg:.2f} deg about ({x:z.3f}, {y:z.3f}, {z:z.3f})"
