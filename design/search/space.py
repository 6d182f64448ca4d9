"""The mounts of one search: the task as numbers, the grid in classes of equal J, the limits, and exact scores."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from scanwright.design.arrays import Setting
from scanwright.design.frames import R_world_rot
from scanwright.design.objective.holes import NO_BLIND_WEIGHT
from scanwright.design.objective.problem import Problem
from scanwright.design.objective.score import Score, blind_to_sweep, score, score_on
from scanwright.design.search.constraints import NoHole, allowed_planes, fan_reach, planes_keep
from scanwright.design.search.grid_classes import Folded, fold_axes, fold_planes, mirrors_of, unfolded
from scanwright.design.sphere.outline import just_inside, reach_about
from scanwright.design.sphere.polar_rule import has_all_breaks
from scanwright.design.task.angle_ranges import AngleRanges
from scanwright.design.task.task import Limits


@dataclass(frozen=True)
class SearchSpace:
    """The mounts of a search and their limits."""

    problem: Problem  # the task as numbers
    ranges: AngleRanges  # of the angles
    limits: Limits  # of the task
    avoid_holes: bool  # whether a mount with a blind spot is rejected
    # whether a sweep with a blind spot that lies between the directions of a score, and reaches the outline of the
    # region, is rejected too
    to_the_outline: bool = True
    _scores: dict[tuple[float, ...], Score] = field(default_factory=dict, init=False, repr=False, compare=False)

    @cached_property
    def mirrors(self) -> Float[ndarray, "mirrors 2 2"]:
        """Mirrors of the scan plane that do not change J; for a sweep only the identity."""
        return mirrors_of(self.problem.bearings_rad)[: None if self.problem.sweep is None else 1]

    @cached_property
    def planes(self) -> Folded:
        """Scan planes of the grid that meet the limits.

        Raises:
            TaskError: there are none.
        """
        sweep = self.problem.sweep is not None
        every = unfolded(self.ranges)[1] if sweep else fold_planes(self.ranges, self.mirrors)
        return allowed_planes(self.problem, every, self.limits)

    @cached_property
    def axes(self) -> Folded:
        """Axes of the grid."""
        return fold_axes(self.ranges) if self.problem.sweep is None else unfolded(self.ranges)[0]

    @property
    def covered(self) -> int:
        """Number of mounts of the grid."""
        return len(self.planes.settings_deg) * len(self.axes.settings_deg)

    @property
    def different(self) -> int:
        """Number of different J: pairs of classes in both orientations, if the grid has both of one of them."""
        planes, axes = self.planes, self.axes
        one_way = int((~(planes.has | planes.own).all(axis=0)).sum()) * int((~axes.has.all(axis=0)).sum())
        return 2 * len(planes.first) * len(axes.first) - one_way

    def score(self, angles_deg: Setting) -> Score | None:
        """Return the exact score of (alpha_rot, beta_rot, alpha_laser, beta_laser) [deg]; None if it is rejected.

        Scores are cached: for a sweep one takes seconds.
        """
        if not self._reaches_all(angles_deg):
            return None
        key = tuple(np.asarray(angles_deg).tolist())
        if key not in self._scores:
            self._scores[key] = score(self.problem, np.radians(angles_deg))
        result = self._scores[key]
        return result if self.keeps(result, angles_deg) else None

    def J(self, angles_deg: Setting, nodes: int, blind_cost: float = np.inf) -> float:
        """Return J on a number of nodes; inf if the mount is rejected.

        With a finite `blind_cost` a sweep with blind spots is not rejected: their share times this cost is added, so
        that a simplex can move along the limit of the mounts that see all.
        """
        result = score_on(self.problem, np.radians(angles_deg), nodes, stated=False)
        penalised = self.avoid_holes and self.to_the_outline and self.problem.sweep is not None
        if not penalised or np.isinf(blind_cost):
            return result.J if self.keeps(result, angles_deg) and self._reaches_all(angles_deg) else np.inf
        if not replace(self, avoid_holes=False).keeps(result, angles_deg):
            return np.inf
        return result.J + blind_cost * (result.blind_weight + self._blind_outline(angles_deg))

    def keeps(self, result: Score, angles_deg: Setting) -> bool:
        """Return whether a scored mount meets the limits and, if they are to be avoided, has no blind spot."""
        blind = 0.0 if self.avoid_holes else self.limits.max_blind_weight
        if blind is not None and result.blind_weight > blind + NO_BLIND_WEIGHT:
            return False
        if result.least < (self.limits.min_density or 0):
            return False
        return bool(planes_keep(self.problem, np.radians(angles_deg[None, 2:]), self.limits)[0])

    def _reaches_all(self, angles_deg: Setting) -> bool:
        """Return whether a mount sees all of a region, also between the directions that represent it."""
        problem, angles_rad = self.problem, np.radians(angles_deg)
        if not self.avoid_holes:
            return True
        if problem.sweep is not None:
            return self._blind_outline(angles_deg) == 0
        if has_all_breaks(problem.field):
            return True
        axis = R_world_rot(angles_rad[0], angles_rad[1])[None, :, 2]
        both = NoHole(fan_reach(problem, angles_rad[None, 2:]), reach_about(problem.field, axis))
        return not both.broken(slice(None), slice(None))[0].any()

    def _blind_outline(self, angles_deg: Setting) -> float:
        """Return the share of the outline of the region that a sweep never sees; 0 if it does not matter."""
        directions = just_inside(self.problem.field)
        if self.problem.grid_step_deg or not self.to_the_outline or not len(directions):
            return 0.0
        alpha_rot, beta_rot, *plane = np.radians(angles_deg)
        beams = self.problem.beams_rot(np.array(plane))
        return float(blind_to_sweep(self.problem, directions @ R_world_rot(alpha_rot, beta_rot), beams).mean())
