"""Refinement of a mount of the grid to the nearest local minimum of J, by the simplex method of Nelder and Mead.

At a pole (beta = 90) alpha has no effect, and near it hardly any, so a simplex over the angles would stop there. For
full turns with both angles of a pair free, the coordinates are degrees along two tangents of the unit sphere of the
axis direction, or of the axis in the laser frame.

The simplex method of scipy is not used since its import takes longer than the refinement.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, product

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from scanwright.design.arrays import Array, Rotation, Setting, Vector
from scanwright.design.concurrency.parallel import in_chunks
from scanwright.design.frames import R_rot_laser, R_world_rot
from scanwright.design.objective.score import Score
from scanwright.design.objective.tolerance import worst_off
from scanwright.design.progress import Progress
from scanwright.design.search.space import SearchSpace
from scanwright.design.sphere.regions import frames_about
from scanwright.design.task.angle_ranges import NAMES, AngleRanges

STEP = 2  # values that one step needs
FINEST_DEG = 0.01
STEPS_BACK = (0.0, 0.05, 0.15, 0.35, 0.7)  # from a rejected minimum back to its candidate, as shares of the distance
LITTLE, LUCK = 1e-3, 0.25  # smallest expected gain of J for a run; share of it that is still expected after the run
NEARLY_DEG, INDIFFERENT = 0.25, 1e-4  # tolerances for rounding to the grid: angle, and J (0.01 % of the beams)
PAIRS = slice(0, 2), slice(2, 4)  # of the axis, and of the scan plane


@dataclass(frozen=True, slots=True)
class SimplexRun:
    """Parameters of one run of the simplex method."""

    reach: float  # first step along each coordinate, in steps of the grid
    nodes: int  # of the quadrature of J
    size_deg: float  # largest size in each coordinate at the end
    spread: float  # largest difference of values at the end
    values: int  # largest number of values for each coordinate
    blind_cost: float  # of `SearchSpace.J`


WIDE = SimplexRun(0.5, 243, 0.1, 1e-4, 60, 10.0)
SHRUNK = 1.0, 0.3, 0.1  # factor of the reach of successive runs
NARROW = SimplexRun(0.1, 1215, 0.005, 1e-7, 30, 1000.0)


@dataclass(frozen=True, slots=True)
class Descent:
    """State of the refinement of one mount of the grid."""

    start: int  # index of the mount
    any_axis: bool  # whether J does not depend on its axis, which then stays
    angles_deg: Setting  # the refined angles
    J: float = np.inf  # of these, on the nodes of the runs; with a tolerance of the mounting the highest within it
    gain: float = np.inf  # expected gain of the next run


def descended(space: SearchSpace, starts: list[tuple[Setting, bool]], most: int, progress: Progress) -> list[Descent]:
    """Return mounts refined by at most `most` simplex runs each, the lowest J first.

    `starts` are angles [deg], and whether J does not depend on the axis. In a valley that is long and narrower than the
    grid a simplex ends far from the minimum, and another one with rotated sides continues. A run is expected to gain as
    much as the last one; only those that could give the best result continue.
    """
    descents = [Descent(k, any_axis, angles_deg) for k, (angles_deg, any_axis) in enumerate(starts)]
    for number in range(most):
        lowest = min(descent.J for descent in descents)
        open_ = [d for d in descents if not number or (d.gain > LITTLE and d.J - d.gain < lowest)]
        if not open_:
            break
        runs = in_chunks(partial(_descend_some, space, open_, number), len(open_), smallest=1)
        further = {descent.start: descent for descent in chain.from_iterable(runs)}
        descents = [further.get(descent.start, descent) for descent in descents]
        progress("refining the minima", (number + 1) / most)
    return sorted(descents, key=lambda descent: descent.J)


def descend(space: SearchSpace, descent: Descent, run: SimplexRun, number: int = 0) -> Descent:
    """Return the lowest mount of one simplex run; run 0 has its sides along the coordinates, others are rotated."""
    free, limits = _free(space.ranges, descent.any_axis)
    # a non-integer number of lines needs ten times the time and matters for the lowest count only
    exact_count = space.limits.min_density is not None
    easier = space if exact_count else replace(space, problem=space.problem.without_seam())
    chart = _Chart(descent.angles_deg, free, limits, on_spheres=space.problem.sweep is None)

    def J(moved: Array) -> float:
        return _J_of(easier, chart.setting(moved), run.nodes, run.blind_cost)

    if not free.any():
        return replace(descent, J=J(chart.origin), gain=0.0)
    sides = np.eye(free.sum())
    if number:
        sides = np.linalg.qr(np.random.default_rng(number).normal(size=sides.shape))[0]
    sides *= run.reach * space.ranges.step_deg * SHRUNK[number % len(SHRUNK)]
    corners, values = _first_simplex(J, chart, sides)
    lowest, value = lowest_by_simplex(J, corners, values, chart.bounds, run)
    # after a run without gain the next one can still gain
    gain = max(float(values[0]) - value, descent.gain * LUCK if number else 0.0)
    return replace(descent, angles_deg=chart.setting(lowest), J=value, gain=gain)


def _descend_some(space: SearchSpace, descents: list[Descent], number: int, some: slice) -> list[Descent]:
    return [descend(space, descent, WIDE, number) for descent in descents[some]]


def buildable_setting(space: SearchSpace, descent: Descent, nodes: int, otherwise: Setting) -> Setting:
    """Return a refined mount, rounded to the grid if J is as low there, or to 0.01 deg, within the constraints."""
    free, limits = _free(space.ranges, descent.any_axis)
    if not free.any():
        return descent.angles_deg
    step_deg = space.ranges.step_deg
    angles = _on_the_grid(descent.angles_deg, free, limits, step_deg, lambda setting: _J_of(space, setting, nodes))
    below = np.floor(angles[free] / FINEST_DEG) * FINEST_DEG
    corners = below + FINEST_DEG * np.array(list(product((0, 1), repeat=int(free.sum()))))
    corners = np.clip(corners, limits[free, 0], limits[free, 1]).round(2)
    # the nearest one can break the constraints
    for corner in corners[np.argsort(np.linalg.norm(corners - angles[free], axis=1), kind="stable")]:
        setting = angles.copy()
        setting[free] = corner
        if np.isfinite(space.J(setting, nodes)):
            return setting + 0.0  # -0.0 is 0.0
    return otherwise


def _free(ranges: AngleRanges, any_axis: bool) -> tuple[Bool[ndarray, " 4"], Float[ndarray, "4 2"]]:
    """Return whether each angle is free, and its limits."""
    limits = np.array([ranges.limits(name) for name in NAMES])
    free = limits[:, 1] > limits[:, 0]
    free[:2] &= not any_axis
    return free, limits


def _J_of(space: SearchSpace, angles_deg: Setting, nodes: int, blind_cost: float = np.inf) -> float:
    """Return `SearchSpace.J` of a mount, or the highest within the tolerance of the mounting."""
    designed, off_deg = space.J(angles_deg, nodes, blind_cost), space.ranges.tolerance_deg
    if not off_deg or not np.isfinite(designed):
        return designed
    return max(designed, worst_off(space.problem, np.radians(angles_deg), np.radians(off_deg), nodes))


def allowed_setting(space: SearchSpace, refined: Setting, candidate: Setting) -> tuple[Setting, Score | None]:
    """Return a refined mount and its exact score; if it is rejected, the next one on the line to its candidate."""
    for share in STEPS_BACK:
        setting = ((1 - share) * refined + share * candidate).round(2) + 0.0
        result = space.score(setting)
        if result is not None:
            return setting, result
    return candidate, None


def lowest_by_simplex(
    value: Callable[[Array], float],
    corners: Float[ndarray, "corners n"],
    values: Float[ndarray, " corners"],
    bounds: Float[ndarray, "n 2"],
    run: SimplexRun,
) -> tuple[Float[ndarray, " n"], float]:
    """Return the lowest corner of a simplex that reflects, expands and contracts (Nelder and Mead 1965), and its value.

    `value` is inf for rejected points, and points are clipped to `bounds`. The values of the first simplex, with one
    corner more than coordinates, count as values of the run.
    """
    corners, values = corners.copy(), values.copy()
    left = run.values * corners.shape[1] - len(values)

    def tried(point: Array) -> tuple[Array, float]:
        nonlocal left
        left -= 1
        inside = np.clip(point, *bounds.T)
        return inside, value(inside)

    while True:
        order = np.argsort(values, kind="stable")
        corners, values = corners[order], values[order]
        small = np.abs(corners[1:] - corners[0]).max(initial=0.0) <= run.size_deg  # one corner: no angle is free
        if left < STEP or (small and not values[-1] > values[0] + run.spread):  # all of them can be inf
            return corners[0], float(values[0])
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
    """Coordinates [deg] about a mount, one for each free angle; `bounds` are their limits, (free, 2).

    With `on_spheres` the coordinates of a pair of free angles are tangential on its sphere; else they are the angles.
    """

    def __init__(
        self, angles_deg: Setting, free: Bool[ndarray, " 4"], limits_deg: Float[ndarray, "4 2"], *, on_spheres: bool
    ) -> None:
        self._angles, self._free, self._limits = angles_deg, free, limits_deg
        self._on_sphere = [on_spheres and bool(free[pair].all()) for pair in PAIRS]
        axis, plane = (np.radians(angles_deg[pair]) for pair in PAIRS)
        self._frames = frames_about(np.stack([R_world_rot(*axis)[:, 2], R_rot_laser(*plane)[2]]))
        spherical = np.repeat(self._on_sphere, 2)
        self.origin = np.where(spherical, 0.0, angles_deg)[free]
        self.bounds = np.where(spherical[:, None], [[-np.inf, np.inf]], limits_deg)[free]

    def setting(self, moved: Array) -> Setting:
        """Return the mounting angles of coordinates, within the limits."""
        result = self._angles.copy()
        full = np.zeros(4)
        full[self._free] = moved
        for k, pair in enumerate(PAIRS):
            if self._on_sphere[k]:
                result[pair] = (_axis_of, _plane_of)[k](_along_sphere(self._frames[k], np.radians(full[pair])))
            else:
                result[pair] = np.where(self._free[pair], full[pair], result[pair])
        return np.clip(result, *self._limits.T)


def _axis_of(u: Vector) -> Array:
    return np.degrees([np.arctan2(-u[1], u[2]), np.arcsin(np.clip(u[0], -1, 1))])


def _plane_of(q: Vector) -> Array:
    """Return scan-plane angles from the third row q of `R_rot_laser`; the sign of q[2] has no effect on J."""
    return np.degrees([np.arctan2(q[1], abs(q[2])), -np.arcsin(np.clip(q[0], -1, 1))])


def _along_sphere(frame: Rotation, moved_rad: Array) -> Vector:
    """Return the point at a distance from the third row of `frame`, along a great circle in a tangent direction."""
    across, up, start = frame
    away = float(np.hypot(*moved_rad))
    if away == 0.0:
        return start
    along = (moved_rad[0] * across + moved_rad[1] * up) / away
    return np.cos(away) * start + np.sin(away) * along


def _first_simplex(J: Callable[[Array], float], chart: _Chart, sides: Float[ndarray, "n n"]) -> tuple[Array, Array]:
    """Return the origin and a step along each side, in the direction of the lower J, (n + 1, n); and their J."""
    low, high = chart.bounds.T
    corners = [(chart.origin, J(chart.origin))]
    for side in sides:
        ends = [chart.origin + side, chart.origin - side]
        allowed = [end for end in ends if (low <= end).all() and (end <= high).all()] or [np.clip(ends[0], low, high)]
        corners.append(min(((end, J(end)) for end in allowed), key=lambda pair: pair[1]))
    return np.array([point for point, _ in corners]), np.array([value for _, value in corners])


def _on_the_grid(
    angles: Setting, free: Bool[ndarray, " 4"], limits: Array, step: float, J: Callable[[Setting], float]
) -> Setting:
    """Return angles with those near a value of the grid moved there, if J does not rise by more than `INDIFFERENT`."""
    most = J(angles) + INDIFFERENT
    for i in np.flatnonzero(free):
        rounder = angles.copy()
        rounder[i] = np.clip(step * np.round(angles[i] / step), *limits[i])
        if abs(rounder[i] - angles[i]) <= NEARLY_DEG and J(rounder) <= most:
            angles = rounder
    return angles
