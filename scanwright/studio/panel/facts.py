"""The figures that the studio shows of a setting, without parts.

While an angle is dragged, J is from fewer nodes, with a larger error; at rest it is that of `scanwright evaluate`.
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
    """The figures of a setting without parts."""

    setting: Setting
    J: float
    J_error: float
    exact: bool  # the J that `evaluate` prints; otherwise from fewer nodes
    blind_cone_deg: float  # half angle of the wider one about the axis
    gap_deg: float  # widest distance between neighbouring scan lines
    blind_weight: float  # share of the weight that is never seen
    period_s: float | None  # shortest turn with `density` beams everywhere; NaN if there is none, None if unknown
    density: int  # beams per ball that the period is for
    mounts: dict[str, float]  # J of the reference mounts for the same task, the best one first
    planes: tuple[tuple[str, PlaneFigures | None], ...]  # of the task in words, and a full scan on each if known
    least: int  # fewest beams per ball in the region of interest
    limits: Limits
    log: bool  # J is the mean of -ln(1 + d), so that differences of J are ratios of beams

    @property
    def ratio(self) -> float:
        """Beams per direction against the best usual mount, geometric mean; NaN if J gives no ratio."""
        best = min(self.mounts.values(), default=math.nan)
        return math.exp(min(best - self.J, 50.0)) if self.log and math.isfinite(best - self.J) else math.nan

    def requirements(self) -> list[tuple[str, bool, str]]:
        """Return the limits of the task in words, whether they are met without parts, and the values."""
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
    """A task, its numbers, and its reference mounts, the best one first."""

    loaded: LoadedTask
    problem: Problem
    mounts: tuple[TunedMount, ...]

    @classmethod
    def for_task(cls, loaded: LoadedTask) -> Judge:
        """Return the judge of a task, with its reference mounts tuned."""
        problem = problem_of(loaded)
        mounts = sorted(reference_mounts(problem, loaded.task), key=lambda mount: mount.score.J)
        return cls(loaded, problem, tuple(mounts))

    def references(self) -> dict[str, Setting]:
        """Return the reference mounts, the best one first."""
        return {mount.name: Setting.within_bounds(np.degrees(mount.angles_rad)) for mount in self.mounts}

    def quick(self, setting: Setting) -> Facts:
        """Return the figures from fewer nodes, for a slider that moves."""
        return self._facts(setting, score_on(self.problem, setting.angles_rad, DRAG_NODES), exact=False)

    def exact(self, setting: Setting) -> Facts:
        """Return the figures with the J of `evaluate`."""
        return self._facts(setting, score(self.problem, setting.angles_rad), exact=True)

    def settled(self, facts: Facts) -> Facts:
        """Add what takes longest: the shortest period, and the figures of planes."""
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
