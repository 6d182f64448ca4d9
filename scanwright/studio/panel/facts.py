"""What the studio tells of a setting, without parts, fast enough to follow a hand.

While an angle is dragged J is the real one, mean of g over true counts, on fewer nodes: it carries a larger error, and
that is shown. When the hand rests it is `design.objective.score.score`, the number that `scanwright evaluate` prints.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from scanwright.design.errors import TaskError
from scanwright.design.evaluation.metres import PlaneFigures, on_planes, planes_of
from scanwright.design.objective.holes import NO_BLIND_WEIGHT, percent
from scanwright.design.objective.problem import NODES, Problem, problem_of
from scanwright.design.objective.score import Score, score, score_on
from scanwright.design.search.constraints import blind_cones_deg, line_gaps_deg
from scanwright.design.search.mounts.reference import TunedMount, reference_mounts
from scanwright.design.search.shortest_period import shortest_period_s
from scanwright.design.task.task import Limits, LoadedTask
from scanwright.studio.state import Setting

DRAG_NODES = 2187  # 3^7, fewer than `NODES`, to follow the hand; the panel shows the larger error
WALL_M = 10.0  # range at which gaps are given in millimetres


@dataclass(frozen=True, slots=True)
class Facts:
    """A setting judged.

    Attributes:
        setting: the angles.
        J: and its error.
        exact: whether J is the one that `evaluate` prints; else it stands on fewer nodes.
        blind_cone_deg: half angle of the wider one about the axis.
        gap_deg: widest distance between neighbouring scan lines.
        blind_weight: share of the weight that is never seen.
        period_s: shortest turn with `density` beams everywhere; NaN if none has or the servo sweeps, None if unknown.
        density: beams per ball that the period is for.
        mounts: J of the reference mounts for the same task, the best one first.
        least: fewest beams per ball where it counts.
        limits: of the task.
        log: whether J is the mean of -ln(1 + d): differences of J are ratios of beams.
        planes: each plane of the task in words, and what a full scan leaves on it in metres; None while not known.
    """

    setting: Setting
    J: float
    J_error: float
    exact: bool
    blind_cone_deg: float
    gap_deg: float
    blind_weight: float
    period_s: float | None
    density: int
    mounts: dict[str, float]
    planes: tuple[tuple[str, PlaneFigures | None], ...]
    least: int
    limits: Limits
    log: bool

    @property
    def ratio(self) -> float:
        """Beams per direction against the best usual mount, geometric mean; NaN if J gives no ratio."""
        best = min(self.mounts.values(), default=math.nan)
        return math.exp(min(best - self.J, 50.0)) if self.log and math.isfinite(best - self.J) else math.nan

    def asked(self) -> list[tuple[str, bool, str]]:
        """What the task asks for: in words, whether it is met without parts, and the value."""
        limits, blind = self.limits, f"{percent(self.blind_weight)} blind"
        rows = [("no blind spot", self.blind_weight <= (limits.max_blind_weight or NO_BLIND_WEIGHT), blind)]
        if (fewest := limits.min_density) is not None:
            rows.append((f"at least {fewest:g} beams per ball", self.least >= fewest, f"{self.least}"))
        if (most := limits.max_line_gap_deg) is not None:
            rows.append((f"scan lines at most {most:g} deg apart", self.gap_deg <= most, f"{self.gap_deg:.3f} deg"))
        if (most := limits.max_blind_cone_deg) is not None:
            rows.append(
                (f"blind cone at most {most:g} deg", self.blind_cone_deg <= most, f"{self.blind_cone_deg:.2f} deg")
            )
        return rows

    @property
    def gap_mm(self) -> float:
        """The widest gap on a wall that faces the scanner at `WALL_M`."""
        return math.radians(self.gap_deg) * WALL_M * 1000


@dataclass(frozen=True, slots=True)
class Judge:
    """A task ready to judge settings: its numbers, and the reference mounts, the best one first."""

    loaded: LoadedTask
    problem: Problem
    mounts: tuple[TunedMount, ...]

    @classmethod
    def for_task(cls, loaded: LoadedTask) -> Judge:
        """Tune the reference mounts once; they stay while the task does.

        Raises:
            TaskError: no direction of the task has a weight.
        """
        problem = problem_of(loaded)
        mounts = sorted(reference_mounts(problem, loaded.task), key=lambda mount: mount.score.J)
        return cls(loaded, problem, tuple(mounts))

    def references(self) -> dict[str, Setting]:
        """Return the reference mounts, the best one first."""
        return {mount.name: Setting.within_bounds(np.degrees(mount.angles_rad)) for mount in self.mounts}

    def quick(self, setting: Setting) -> Facts:
        """While the hand moves."""
        return self._facts(setting, score_on(self.problem, setting.angles_rad, DRAG_NODES), exact=False)

    def exact(self, setting: Setting) -> Facts:
        """When it rests."""
        return self._facts(setting, score(self.problem, setting.angles_rad), exact=True)

    def settled(self, facts: Facts) -> Facts:
        """Add the shortest period, whose search computes J many times, and what planes get in metres."""
        turns = self.loaded.task.motion.mode in ("spin", "shortest")
        period_s = self._period_s(facts.setting) if facts.blind_weight == 0 and turns else math.nan
        planes = on_planes(self.loaded, self.problem, facts.setting.angles_rad)
        return replace(facts, period_s=period_s, planes=tuple((figures.region, figures) for figures in planes))

    def _facts(self, setting: Setting, result: Score, *, exact: bool) -> Facts:
        plane = setting.angles_rad[None, 2:]
        return Facts(
            setting=setting,
            J=result.J,
            J_error=result.J_error,
            exact=exact,
            blind_cone_deg=float(blind_cones_deg(self.problem, plane)[0]),
            gap_deg=float(line_gaps_deg(self.problem, plane)[0]),
            blind_weight=result.blind_weight,
            period_s=None,
            density=self._least,
            mounts={mount.name: mount.score.J for mount in self.mounts},
            planes=tuple((region.words(), None) for region in planes_of(self.loaded)),
            least=result.least,
            limits=self.loaded.task.limits,
            log=self.problem.objective.name == "log",
        )

    @property
    def _least(self) -> int:
        return math.ceil(self.loaded.task.limits.min_density or 1)

    def _period_s(self, setting: Setting) -> float:
        rate_hz = self.loaded.lidar.scan_rate_hz
        try:
            return shortest_period_s(self.problem, setting.angles_rad, rate_hz, self._least, NODES)
        except TaskError:  # part of the region is out of reach at any speed
            return math.nan
