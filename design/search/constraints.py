"""What pairs of scan plane and axis must keep whatever their J, asked of the whole grid at once.

A setting is free of holes where its fan, a ball radius wider, reaches from the lowest polar angle of the region about
the axis to the highest: two numbers of the plane, two of the axis, two comparisons a pair. A lowest density, a share
that may be blind, and all that a sweep must not miss are sums over nodes: one more product each.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from scanwright.design.arrays import Array, Ints, Mask, Setting
from scanwright.design.concurrency.blocked_product import product
from scanwright.design.concurrency.parallel import in_chunks
from scanwright.design.frames import R_rot_laser, R_world_rot
from scanwright.design.objective.holes import NO_BLIND_WEIGHT
from scanwright.design.objective.problem import Problem
from scanwright.design.objective.score import Score, score, score_on
from scanwright.design.search.limits import planes_keep
from scanwright.design.sphere.outline import reach_about
from scanwright.design.sphere.polar_rule import has_all_breaks
from scanwright.design.task.task import Limits

TOUCHING_RAD = 1e-6  # rounding of what a fan and a region reach
PIECE = 512  # planes, at least, whose beams are looked at together


class Constraint(Protocol):
    """What pairs of planes and axes must keep."""

    def broken(self, planes: slice, axes: slice) -> tuple[Mask, Mask]:
        """Pairs of some planes with some axes that break it, straight and with the planes turned round."""
        ...

    def of(self, planes: slice | Ints, axes: slice) -> Constraint:
        """The same of some planes and some axes."""
        ...


@dataclass(frozen=True, slots=True)
class NoHole:
    """Lowest and highest polar angle about the axis: of the fan and a ball, (planes, 2); of weight, (axes, 2)."""

    fan_rad: Float[ndarray, "planes 2"]
    region_rad: Float[ndarray, "axes 2"]

    def broken(self, planes: slice, axes: slice) -> tuple[Mask, Mask]:
        """See `Constraint`."""
        low, high = self.fan_rad[planes, 0, None], self.fan_rad[planes, 1, None]
        first, last = self.region_rad[axes, 0] + TOUCHING_RAD, self.region_rad[axes, 1] - TOUCHING_RAD
        return (low > first) | (high < last), (np.pi - high > first) | (np.pi - low < last)

    def of(self, planes: slice | Ints, axes: slice) -> NoHole:
        """See `Constraint`."""
        return NoHole(self.fan_rad[planes], self.region_rad[axes])


@dataclass(frozen=True, slots=True)
class AtMost:
    """A sum over nodes that may not be more than `most`: of planes (planes, nodes) times axes (axes, nodes).

    Turned round, a plane has its nodes in the opposite order; where nothing turns round both ways are the same.
    """

    of_planes: Array
    of_axes: Array
    most: float
    turns: bool

    def broken(self, planes: slice, axes: slice) -> tuple[Mask, Mask]:
        """See `Constraint`."""
        rows = self.of_planes[planes].astype(np.float32)
        columns = self.of_axes[axes].T
        straight = product(rows, columns) > self.most
        return straight, product(np.ascontiguousarray(rows[:, ::-1]), columns) > self.most if self.turns else straight

    def of(self, planes: slice | Ints, axes: slice) -> AtMost:
        """See `Constraint`."""
        return AtMost(self.of_planes[planes], self.of_axes[axes], self.most, self.turns)


def fan_reach(problem: Problem, planes_rad: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
    """Lowest and highest polar angle that the fans of scan planes (n, 2) and a ball reach, shape (n, 2)."""
    reach = in_chunks(lambda chunk: _extremes(problem.bearings_rad, planes_rad[chunk]), len(planes_rad), PIECE)
    return np.concatenate(reach) + np.array([-problem.ball_rad, problem.ball_rad])


def _extremes(bearings_rad: Float[ndarray, " beams"], planes_rad: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
    """Lowest and highest polar angle of the beams: the cosine tells whose they are, and costs a tenth of the angle."""
    R = R_rot_laser(*planes_rad.T)[:, :, :2]
    along = product(R[:, 2], np.stack([np.cos(bearings_rad), np.sin(bearings_rad)]))
    ends = bearings_rad[np.stack([along.argmax(axis=1), along.argmin(axis=1)])]
    x, y, z = np.einsum("nij,jkn->ikn", R, np.stack([np.cos(ends), np.sin(ends)]))
    return np.asarray(np.arctan2(np.hypot(x, y), z).T)


@dataclass(frozen=True, slots=True)
class Requirements:
    """Scores settings in degrees, and refuses those that break what a search may not break."""

    problem: Problem
    limits: Limits
    avoid_holes: bool
    _known: dict[tuple[float, ...], Score] = field(default_factory=dict, init=False, repr=False, compare=False)

    def score(self, angles_deg: Setting) -> Score | None:
        """The exact score of (alpha_rot, beta_rot, alpha_laser, beta_laser) [deg]; None where it is refused.

        Kept, as the steps of a search ask for the same: that of a sweep takes seconds where its J is to be exact.
        """
        named = tuple(np.asarray(angles_deg).tolist())
        if named not in self._known:
            self._known[named] = score(self.problem, np.radians(angles_deg))
        result = self._known[named]
        return result if self.keeps(result, angles_deg) and self._reaches_all(np.radians(angles_deg)) else None

    def J(self, angles_deg: Setting, nodes: int) -> float:
        """J on a number of nodes; inf where the setting is refused."""
        result = score_on(self.problem, np.radians(angles_deg), nodes, stated=False)
        return result.J if self.keeps(result, angles_deg) else np.inf

    def _reaches_all(self, angles_rad: Setting) -> bool:
        """Whether a fan reaches all of a region of many edges: between directions that stand for it is some of it."""
        problem = self.problem
        if not self.avoid_holes or problem.sweep is not None or has_all_breaks(problem.field):
            return True
        axis = R_world_rot(angles_rad[0], angles_rad[1])[None, :, 2]
        both = NoHole(fan_reach(problem, angles_rad[None, 2:]), reach_about(problem.field, axis))
        return not both.broken(slice(None), slice(None))[0].any()

    def keeps(self, result: Score, angles_deg: Setting) -> bool:
        """Whether a scored setting keeps the limits and, where they are to be avoided, has no hole."""
        blind = 0.0 if self.avoid_holes else self.limits.max_blind_weight
        if blind is not None and result.blind_weight > blind + NO_BLIND_WEIGHT:
            return False
        if result.least < (self.limits.min_density or 0):
            return False
        return bool(planes_keep(self.problem, np.radians(angles_deg[None, 2:]), self.limits)[0])
