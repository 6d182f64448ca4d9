"""From a setting of the grid to the nearest minimum of J: a simplex that walks on the spheres that decide J.

At a pole (beta = 90) alpha names nothing, and near one a step of it moves hardly anything: a simplex over the angles
stops there. So where the servo goes round, and both angles of a pair are free, its coordinates are degrees along two
lines that touch the sphere of what the pair decides: where the axis points, or how the axis stands in the laser frame.

The simplex is Nelder and Mead's within bounds: scipy has one too, whose import takes longer than a search's use of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from scanwright.design.arrays import Array, Rotation, Setting, Vector
from scanwright.design.objective.score import Score
from scanwright.design.objective.tolerance import worst_off
from scanwright.design.search.constraints import Requirements
from scanwright.design.sphere.regions import frames_about
from scanwright.design.task.angle_ranges import NAMES, AngleRanges

STEP = 2  # values that one step takes
REFINE_ROUNDS = ((0.5, 243), (0.1, 1215))  # reach in grid steps, quadrature nodes
FINEST_DEG = 0.01
STEPS_BACK = (0.0, 0.05, 0.15, 0.35, 0.7)  # from a minimum at the edge of what is allowed, as shares of the way to it
NEARLY_DEG, INDIFFERENT = 0.25, 1e-4  # to an angle of the grid; of J: about its error, 0.01 % of the beams
PAIRS = slice(0, 2), slice(2, 4)  # of the axis, and of the scan plane


@dataclass(frozen=True, slots=True)
class Enough:
    """When a simplex is small enough: in every coordinate and in its values; and the most values of its steps."""

    size: float
    spread: float
    values: int


ROUGH = Enough(0.1, 1e-4, 30)  # deg, J, values an angle: of all that are not built, as far as their errors reach
FINE = Enough(0.005, 1e-7, 30)


def refined_setting(
    ranges: AngleRanges,
    angles_deg: Setting,
    any_axis: bool,
    rounds: tuple[tuple[float, int], ...],
    required: Requirements,
) -> Setting:
    """The nearest minimum of J that keeps the constraints, rounded to 0.01 deg.

    Angles that the task fixes stay, and an axis that is any.
    """
    limits = np.array([ranges.limits(name) for name in NAMES])
    free = limits[:, 1] > limits[:, 0]
    free[:2] &= not any_axis
    angles = angles_deg.copy()
    if not free.any() or not rounds:
        return angles

    def J_of(setting: Setting, nodes: int, required: Requirements = required) -> float:
        designed = required.J(setting, nodes)
        if not ranges.tolerance_deg or not np.isfinite(designed):
            return designed
        off_rad = np.radians(ranges.tolerance_deg)
        return max(designed, worst_off(required.problem, np.radians(setting), off_rad, nodes))

    exact_count = required.limits.min_density is not None
    easier = required if exact_count else replace(required, problem=required.problem.without_seam())
    for reach, nodes in rounds:  # a second, narrower simplex: the first often stops short in a flat valley
        chart = _Chart(angles, free, limits, on_spheres=required.problem.sweep is None)

        def J(moved: Array, chart: _Chart = chart, nodes: int = nodes) -> float:
            return J_of(chart.setting(moved), nodes, easier)

        corners, values = _first_simplex(J, chart, reach * ranges.step_deg)
        enough = FINE if len(rounds) > 1 else ROUGH
        most = replace(enough, values=enough.values * int(free.sum()) - len(values))
        angles = chart.setting(lowest_by_simplex(J, corners, values, chart.bounds, most))
    finest = rounds[-1][1]
    angles = _on_the_grid(angles, free, limits, ranges.step_deg, lambda setting: J_of(setting, finest))
    return _rounded(angles, free, limits, finest, required, angles_deg)


def allowed_setting(refined: Setting, candidate: Setting, required: Requirements) -> tuple[Setting, Score | None]:
    """A refined setting and its score; where all nodes refuse it, the next one on the way back to its candidate."""
    for share in STEPS_BACK:
        setting = ((1 - share) * refined + share * candidate).round(2) + 0.0
        result = required.score(setting)
        if result is not None:
            return setting, result
    return candidate, None


def lowest_by_simplex(
    value: Callable[[Array], float],
    corners: Float[ndarray, "corners n"],
    values: Float[ndarray, " corners"],
    bounds: Float[ndarray, "n 2"],
    enough: Enough,
) -> Float[ndarray, " n"]:
    """The lowest corner of a simplex that reflects, expands and contracts (Nelder and Mead 1965), shape (n,).

    Args:
        value: what is minimised; inf where a point is refused.
        corners: the first simplex, one corner more than coordinates.
        values: of its corners.
        bounds: lowest and highest of each coordinate; points beyond are moved there.
        enough: when it ends.
    """
    corners, values = corners.copy(), values.copy()
    left = enough.values

    def tried(point: Array) -> tuple[Array, float]:
        nonlocal left
        left -= 1
        inside = np.clip(point, *bounds.T)
        return inside, value(inside)

    while True:
        order = np.argsort(values, kind="stable")
        corners, values = corners[order], values[order]
        small = np.abs(corners[1:] - corners[0]).max() <= enough.size
        if left < STEP or (small and not values[-1] - values[0] > enough.spread):
            return corners[0]
        middle = corners[:-1].mean(axis=0)
        away = middle - corners[-1]
        result, low = tried(middle + away)
        if low < values[0]:
            further, lower = tried(middle + 2 * away)
            result, low = (further, lower) if lower < low else (result, low)
        elif low >= values[-2]:
            outside = low < values[-1]
            nearer, lower = tried(middle + (0.5 if outside else -0.5) * away)
            if not (lower <= low if outside else lower < values[-1]):
                corners[1:] = corners[0] + 0.5 * (corners[1:] - corners[0])
                for i in range(1, len(corners)):
                    corners[i], values[i] = tried(corners[i])
                continue
            result, low = nearer, lower
        corners[-1], values[-1] = result, low


class _Chart:
    """Coordinates [deg] about a setting, as many as angles are free; `bounds` are their limits, (free, 2).

    Args:
        angles_deg: the setting.
        free: which of its angles may move.
        limits_deg: lowest and highest of each angle, (4, 2).
        on_spheres: whether a pair that is free moves on its sphere; else each coordinate is an angle.
    """

    def __init__(
        self, angles_deg: Setting, free: Bool[ndarray, " 4"], limits_deg: Float[ndarray, "4 2"], *, on_spheres: bool
    ) -> None:
        self._angles, self._free, self._limits = angles_deg, free, limits_deg
        self._on_sphere = [on_spheres and bool(free[pair].all()) for pair in PAIRS]
        poles = [_pole_of_axis(angles_deg[PAIRS[0]]), _pole_of_plane(angles_deg[PAIRS[1]])]
        self._frames = frames_about(np.stack(poles))
        spherical = np.repeat(self._on_sphere, 2)
        self.origin = np.where(spherical, 0.0, angles_deg)[free]
        self.bounds = np.where(spherical[:, None], [[-np.inf, np.inf]], limits_deg)[free]

    def setting(self, moved: Array) -> Setting:
        """The setting of some coordinates, within the limits."""
        result = self._angles.copy()
        full = np.zeros(4)
        full[self._free] = moved
        for k, pair in enumerate(PAIRS):
            if self._on_sphere[k]:
                result[pair] = (_axis_of, _plane_of)[k](_walked(self._frames[k], np.radians(full[pair])))
            else:
                result[pair] = np.where(self._free[pair], full[pair], result[pair])
        return np.clip(result, *self._limits.T)


def _pole_of_axis(pair_deg: Array) -> Vector:
    """Where the axis of (alpha_rot, beta_rot) points in the world."""
    alpha, beta = np.radians(pair_deg)
    return np.array([np.sin(beta), -np.sin(alpha) * np.cos(beta), np.cos(alpha) * np.cos(beta)])


def _axis_of(u: Vector) -> Array:
    return np.degrees([np.arctan2(-u[1], u[2]), np.arcsin(np.clip(u[0], -1, 1))])


def _pole_of_plane(pair_deg: Array) -> Vector:
    """The axis in the laser frame of (alpha_laser, beta_laser)."""
    alpha, beta = np.radians(pair_deg)
    return np.array([-np.sin(beta), np.cos(beta) * np.sin(alpha), np.cos(beta) * np.cos(alpha)])


def _plane_of(q: Vector) -> Array:
    """Its third coordinate may have either sign: that is a mirror image, of the same J."""
    return np.degrees([np.arctan2(q[1], abs(q[2])), -np.arcsin(np.clip(q[0], -1, 1))])


def _walked(frame: Rotation, moved_rad: Array) -> Vector:
    """From a point of the unit sphere along the great circle that leaves it in a direction of its tangent plane."""
    across, up, start = frame
    away = float(np.hypot(*moved_rad))
    if away == 0.0:
        return start
    along = (moved_rad[0] * across + moved_rad[1] * up) / away
    return np.cos(away) * start + np.sin(away) * along


def _first_simplex(J: Callable[[Array], float], chart: _Chart, step: float) -> tuple[Array, Array]:
    """The origin and a step along each coordinate, (free + 1, free): to the side of the lower J; with their J."""
    start = chart.origin
    corners = [(start, J(start))]
    for i, (low, high) in enumerate(chart.bounds):
        sides = [np.where(np.arange(len(start)) == i, start + sign * step, start) for sign in (1, -1)]
        allowed = [side for side in sides if low <= side[i] <= high] or [np.clip(sides[0], *chart.bounds.T)]
        corners.append(min(((side, J(side)) for side in allowed), key=lambda pair: pair[1]))
    return np.array([point for point, _ in corners]), np.array([value for _, value in corners])


def _on_the_grid(
    angles: Setting, free: Bool[ndarray, " 4"], limits: Array, step: float, J: Callable[[Setting], float]
) -> Setting:
    """An angle that is nearly one of the grid's is that one where J does not mind: 0 is built better than 0.01."""
    most = J(angles) + INDIFFERENT
    for i in np.flatnonzero(free):
        rounder = angles.copy()
        rounder[i] = np.clip(step * np.round(angles[i] / step), *limits[i])
        if abs(rounder[i] - angles[i]) <= NEARLY_DEG and J(rounder) <= most:
            angles = rounder
    return angles


def _rounded(
    angles: Setting, free: Bool[ndarray, " 4"], limits: Array, nodes: int, required: Requirements, otherwise: Setting
) -> Setting:
    """The nearest of the rounded settings around it: rounding may leave the constraints, and then another one is."""
    below = np.floor(angles[free] / FINEST_DEG) * FINEST_DEG
    corners = below + FINEST_DEG * np.array(list(product((0, 1), repeat=int(free.sum()))))
    corners = np.clip(corners, limits[free, 0], limits[free, 1]).round(2)
    for corner in corners[np.argsort(np.linalg.norm(corners - angles[free], axis=1), kind="stable")]:
        setting = angles.copy()
        setting[free] = corner
        if np.isfinite(required.J(setting, nodes)):
            return setting + 0.0  # -0.0 is 0.0
    return otherwise
