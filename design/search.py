"""Exhaustive search over the four mounting angles, then refinement of the winner.

The four angles act through two things only (design.md, Definitions): which polar angles the beams sweep, decided by
the third row q of `R_rot_laser`, and where the axis u points. So every J is one entry of a matrix product, density
over polar angle times weight over polar angle. Equivalent settings are folded first:

    (q0, q1) about u is (-q0, -q1) about -u       for any fan
    (q0, q1) about u is (q0, -q1) about u         for a symmetric fan

g of the mean count bounds J from below (g is convex): planes are taken in the order of that bound, and the exact
`<g(d)>` is computed until no bound can beat the best.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.optimize import minimize

from design.beams import beam_directions_rot, polar_and_azimuth
from design.density import mean_count, zones
from design.errors import TaskError
from design.frames import Array, R_world_rot
from design.left_out import LeftOut
from design.objective import EMPTY, MANY_EDGES, Problem, Score, log_density, quick_J, score
from design.parallel import in_chunks
from design.sphere import Samples, equal_angle_grid, weighted_samples
from design.task import NAMES, AngleRanges

POLAR_NODES = 361  # every 0.5 deg
PER_NODE = 2  # circles on which the weight is measured per polar node
DIRECTIONS = 100_000  # that stand for a map or a grid, where circles would be slower
MARGIN = 2e-2  # what the coarse J of the search may be off by
EQUAL = 1e-8  # J of settings that are equal by symmetry differ by rounding only
BASIN_STEPS = 2.5  # a leader this many grid steps from a better one is the same answer
FAMILIES = 10
MOST_LOOKS = 150  # for local minima, before the list is left shorter than that
REFINE_ROUNDS = ((0.5, 243), (0.1, 1215))  # reach in grid steps, quadrature nodes
FINEST_DEG = 0.01

Progress = Callable[[str], None]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Family:
    """Settings of equal J, shown by the one that builds best.

    Attributes:
        angles_deg: (alpha_rot, beta_rot, alpha_laser, beta_laser).
        score: its J, rescored exactly.
        members: grid settings of the search that stand behind it.
        word: what the others are, for a person.
    """

    angles_deg: tuple[float, float, float, float]
    score: Score
    members: int
    word: str

    @property
    def angles_rad(self) -> Array:
        """The four angles in radians, shape (4,)."""
        return np.radians(self.angles_deg)


@dataclass(frozen=True, slots=True)
class SearchResult:
    """What the search found.

    Attributes:
        best: families, best first.
        covered: grid settings that the answer stands for.
        evaluated: distinct values of J computed.
        seconds: time of the search and the rescoring.
        left_out: what was skipped.
        planes: one row per scan-plane setting of the grid: alpha_laser, beta_laser [deg], lowest J of the search,
            and the axis alpha_rot, beta_rot [deg] it was found about.
    """

    best: tuple[Family, ...]
    covered: int
    evaluated: int
    seconds: float
    left_out: tuple[LeftOut, ...]
    planes: Array


@dataclass(frozen=True, slots=True)
class _Folded:
    """Settings of one pair of angles, folded: setting i belongs to classes[i], the other way round where flip[i].

    `points` is what decides J: unit axis (n, 3), or (q0, q1) of the scan plane (n, 2). `first` is the first setting of
    each class; it is never flipped.
    """

    settings_deg: Array
    points: Array
    classes: NDArray[np.intp]
    flip: Mask
    first: NDArray[np.intp]


def search(problem: Problem, ranges: AngleRanges, progress: Progress = lambda _: None) -> SearchResult:
    """Find the best families of settings in the ranges of a task.

    Raises:
        TaskError: no direction has a weight.
    """
    start = time.perf_counter()
    mirrors = np.array([np.eye(2), np.diag([1.0, -1.0])])[: 2 if _is_symmetric(problem.bearings_rad) else 1]
    axes = _fold_axes(ranges)
    planes = _fold_planes(ranges, mirrors)
    progress(f"{len(planes.first)} different scan planes x {len(axes.first)} axes, both ways round")
    weights = _weights_over_polar(problem, axes.points[axes.first])
    J, exact = _exhaust(problem, planes, weights, progress)
    leaders = _leaders(axes, planes, mirrors, J, np.radians(ranges.step_deg))
    progress(f"{len(leaders)} leaders: rescoring exactly and refining")
    families = _families(problem, ranges, leaders)
    covered = len(axes.settings_deg) * len(planes.settings_deg)
    return SearchResult(
        best=tuple(families),
        covered=covered,
        evaluated=J.size,
        seconds=time.perf_counter() - start,
        left_out=_left_out(ranges, covered, J.size, len(planes.first) - exact),
        planes=_plane_table(axes, planes, J),
    )


def _grid(ranges: AngleRanges, first: str, second: str) -> Array:
    a, b = np.meshgrid(ranges.grid_deg(first), ranges.grid_deg(second), indexing="ij")
    return np.stack([a.ravel(), b.ravel()], axis=1)


def _fold_axes(ranges: AngleRanges) -> _Folded:
    """Axes up to their sign."""
    settings = _grid(ranges, "alpha_rot", "beta_rot")
    return _fold(settings, R_world_rot(*np.radians(settings.T))[:, :, 2], np.eye(3)[None])


def _fold_planes(ranges: AngleRanges, mirrors: Array) -> _Folded:
    """Scan planes up to the mirrors that keep J."""
    settings = _grid(ranges, "alpha_laser", "beta_laser")
    return _fold(settings, plane_key(np.radians(settings)), mirrors)


def plane_key(plane_rad: Array) -> Array:
    """(q0, q1) of scan planes (alpha_laser, beta_laser) (n, 2): beam polar angles are acos(q0 cos b + q1 sin b)."""
    alpha, beta = plane_rad.T
    return np.stack([-np.sin(beta), np.cos(beta) * np.sin(alpha)], axis=1)


def _fold(settings: Array, points: Array, mirrors: Array) -> _Folded:
    """Group points that are equal up to the mirrors (no flip), or up to the mirrors and the sign (flip)."""
    images = np.concatenate([points @ m for m in mirrors] + [-points @ m for m in mirrors])
    keys = np.round(images, 9) + 0.0  # -0.0 is 0.0
    _, numbers = np.unique(keys, axis=0, return_inverse=True)
    numbers = numbers.reshape(2, len(mirrors), len(points))
    straight, turned = numbers[0].min(axis=0), numbers[1].min(axis=0)
    _, first, classes = np.unique(np.minimum(straight, turned), return_index=True, return_inverse=True)
    flip = (turned < straight) != (turned < straight)[first][classes]
    return _Folded(settings, points, classes, flip, first)


def _is_symmetric(bearings_rad: Array) -> bool:
    return bool(np.allclose(bearings_rad, -bearings_rad[::-1], atol=1e-9))


def _weights_over_polar(problem: Problem, axes: Array) -> Array:
    """Share of the weight near each polar node about each axis, shape (axes, POLAR_NODES); rows sum to 1."""
    field = problem.field
    if problem.grid_step_deg or field.edges > MANY_EDGES:
        if problem.grid_step_deg:
            directions = equal_angle_grid(problem.grid_step_deg)
            samples = Samples(directions, field.weight_at(directions))
        else:
            samples = weighted_samples(field, DIRECTIONS)
        parts = in_chunks(
            lambda chunk: _polar_histogram(samples.directions, samples.weights, axes[chunk], POLAR_NODES), len(axes), 4
        )
        rows = np.concatenate(parts)
    else:
        circles = PER_NODE * (POLAR_NODES - 1)
        polar = (np.arange(circles) + 0.5) * (np.pi / circles)
        rows = _share_between_nodes(field.on_circles_about(axes, polar) * np.sin(polar))
    total = rows.sum(axis=1, keepdims=True)
    if not (total > 0).all():
        raise TaskError(EMPTY)
    return rows / total


def _share_between_nodes(circles: Array) -> Array:
    """Weights at circle middles, shape (axes, circles), shared linearly between the nodes on both sides."""
    cells = circles.reshape(len(circles), POLAR_NODES - 1, PER_NODE)
    upper = (np.arange(PER_NODE) + 0.5) / PER_NODE
    nodes = np.zeros((len(circles), POLAR_NODES))
    nodes[:, :-1] += cells @ (1 - upper)
    nodes[:, 1:] += cells @ upper
    return nodes


@njit(cache=True, nogil=True)
def _polar_histogram(directions: Array, weights: Array, axes: Array, nodes: int) -> Array:
    """Weight by polar angle, each direction shared linearly between its two nodes."""
    out = np.zeros((len(axes), nodes))
    for a in range(len(axes)):
        for i in range(len(directions)):
            c = directions[i, 0] * axes[a, 0] + directions[i, 1] * axes[a, 1] + directions[i, 2] * axes[a, 2]
            at = np.arccos(min(1.0, max(-1.0, c))) * ((nodes - 1) / np.pi)
            k = min(int(at), nodes - 2)
            out[a, k] += weights[i] * (k + 1 - at)
            out[a, k + 1] += weights[i] * (at - k)
    return out


def _exhaust(problem: Problem, planes: _Folded, weights: Array, progress: Progress) -> tuple[Array, int]:
    """J of every plane class about every axis and its opposite, shape (planes, 2, axes), and how many planes are exact.

    The others keep their bound, g of the mean count: it is above the best by more than the search may be off.
    """
    polar = np.linspace(0, np.pi, POLAR_NODES)
    shown = np.radians(planes.settings_deg[planes.first])
    swept = [polar_and_azimuth(beam_directions_rot(problem.bearings_rad, *plane)) for plane in shown]
    lower = np.stack([log_density(mean_count(polar, t, problem.lines, problem.ball_rad)) for t, _ in swept])
    J = np.stack([lower @ weights.T, lower[:, ::-1] @ weights.T], axis=1)
    bounds = J.min(axis=(1, 2))
    best = np.inf
    exact = 0
    for i in np.argsort(bounds, kind="stable"):
        if bounds[i] > best + MARGIN:
            break
        if exact % 100 == 0:
            progress(f"exact densities: {exact} of at most {len(swept)} scan planes")
        beam_polar, beam_azimuth = swept[i]
        g = zones(polar, beam_polar, beam_azimuth, problem.lines, problem.ball_rad, problem.g).mean_g
        J[i] = weights @ g, weights @ g[::-1]
        best = min(best, float(J[i].min()))
        exact += 1
    return J, exact


@dataclass(frozen=True, slots=True)
class _Leader:
    """Settings of equal coarse J that are no neighbours of a better leader."""

    angles_deg: Array
    members: int
    axes: int
    every_axis: bool
    minimum: bool


def _leaders(axes: _Folded, planes: _Folded, mirrors: Array, J: Array, step_rad: float) -> list[_Leader]:
    """Local minima of J over planes and axes, lowest first; what is equal by symmetry is one.

    A minimum takes its valley with it: settings about nearly the same axis with nearly the same J, whatever the plane.
    Where there are fewer minima than families to show, the best settings outside their neighbourhoods follow.
    """
    left = J.copy()
    ways = np.array([0, 1])
    q = planes.points[planes.first]
    u = np.stack([axes.points[axes.first], -axes.points[axes.first]])
    near_q, near_u = BASIN_STEPS * step_rad, np.cos(BASIN_STEPS * step_rad)
    minima: list[_Leader] = []
    shoulders: list[_Leader] = []
    for _ in range(MOST_LOOKS):
        c, way, axis = (int(i) for i in np.unravel_index(np.argmin(left), left.shape))
        lowest = left[c, way, axis]
        if len(minima) == FAMILIES or not np.isfinite(lowest):
            break
        same = left[c] <= lowest + EQUAL
        around = (u @ u[same].T).max(axis=2) >= near_u
        beaten = False
        for mirror in mirrors:
            for sign, there in ((1, around), (-1, around[::-1])):
                planes_there = np.linalg.norm(q - sign * q[c] @ mirror, axis=1) <= near_q
                beaten |= bool((J[planes_there][:, there] < lowest - EQUAL).any())
                left[np.ix_(planes_there, ways, np.arange(left.shape[2]))] += np.where(there, np.inf, 0.0)
        (shoulders if beaten else minima).append(_leader(axes, planes, c, same, not beaten))
        if not beaten:
            valley = around | around[::-1]
            left[:, valley] = np.where(left[:, valley] <= lowest + MARGIN, np.inf, left[:, valley])
    return [*minima, *shoulders[: 2 * FAMILIES]]


def _leader(axes: _Folded, planes: _Folded, c: int, same: Mask, minimum: bool) -> _Leader:
    """All grid settings behind entries (way round, axis) of one plane class, and the one that builds best."""
    p = np.flatnonzero(planes.classes == c)
    way = planes.flip[p][:, None] ^ axes.flip[None, :]
    member = same[way.astype(int), axes.classes[None, :]]
    which_p, which_a = np.nonzero(member)
    angles = np.hstack([axes.settings_deg[which_a], planes.settings_deg[p[which_p]]])
    u = axes.points[which_a]
    distinct = np.unique(np.round(u, 9) + 0.0, axis=0)
    # builds best: stands rather than hangs, blind wedge of the fan to the servo, axis upright, angles small
    preference = (
        angles[:, 3],
        angles[:, 2],
        angles[:, 1],
        angles[:, 0],
        np.abs(angles[:, 2:]).sum(axis=1).round(6),
        np.abs(angles[:, :2]).sum(axis=1).round(6),
        -u[:, 2].round(6),
        angles[:, 3] > 0,
        u[:, 2] < -1e-9,
    )
    every = len(axes.settings_deg) > 1 and len(distinct) == len(np.unique(np.round(axes.points, 9) + 0.0, axis=0))
    return _Leader(angles[np.lexsort(preference)[0]], len(angles), len(distinct), every, minimum)


def _families(problem: Problem, ranges: AngleRanges, leaders: list[_Leader]) -> list[Family]:
    """Score leaders exactly, best first; refine the minima, the winner twice; drop valleys of better ones."""
    scored = [(score(problem, np.radians(leader.angles_deg)), leader) for leader in leaders]
    families: list[Family] = []
    for first, leader in sorted(scored, key=lambda pair: pair[0].J):
        if any(_same_valley(leader.angles_deg, first.J, better, ranges.step_deg) for better in families):
            continue
        angles, final = leader.angles_deg, first
        if leader.minimum:
            refined = _refined(problem, ranges, leader, REFINE_ROUNDS[: 1 if families else 2])
            again = score(problem, np.radians(refined))
            if again.J + again.J_error < first.J:  # else the rounder angles of the grid are as good
                angles, final = refined, again
        a, b, c, d = (float(x) for x in angles)
        word = "any axis" if leader.every_axis else f"{leader.axes} axes" if leader.axes > 1 else ""
        families.append(Family((a, b, c, d), final, leader.members, word))
        if len(families) == FAMILIES:
            break
    return sorted(families, key=lambda family: family.score.J)


def _same_valley(angles_deg: Array, J: float, better: Family, step_deg: float) -> bool:
    """Whether a setting has nearly the axis and nearly the J of a better one: the scan plane is then indifferent."""
    u = R_world_rot(*np.radians(angles_deg[:2]))[:, 2]
    v = R_world_rot(*np.radians(better.angles_deg[:2]))[:, 2]
    return bool(abs(u @ v) >= np.cos(np.radians(BASIN_STEPS * step_deg)) and abs(J - better.score.J) <= MARGIN)


def _refined(problem: Problem, ranges: AngleRanges, leader: _Leader, rounds: tuple[tuple[float, int], ...]) -> Array:
    """The nearest minimum of J, rounded to 0.01 deg; angles that the task fixes stay, and an axis that is any."""
    limits = np.array([ranges.limits(name) for name in NAMES])
    free = limits[:, 1] > limits[:, 0]
    free[:2] &= not leader.every_axis
    angles = leader.angles_deg.copy()
    if not free.any():
        return angles
    for reach, nodes in rounds:  # a second, narrower simplex: the first often stops short in a flat valley

        def J(moved: Array, nodes: int = nodes) -> float:
            setting = angles.copy()
            setting[free] = moved
            return quick_J(problem, np.radians(setting), nodes)

        start, step = angles[free], reach * ranges.step_deg
        shift = np.where(start + step <= limits[free, 1], step, -step)
        found = minimize(
            J,
            start,
            method="Nelder-Mead",
            bounds=limits[free],
            options={
                "initial_simplex": np.vstack([start, start + np.diag(shift)]),
                "xatol": FINEST_DEG / 2,
                "fatol": 1e-7,
                "maxfev": 30 * len(start),
            },
        )
        angles[free] = found.x
    rounded = np.round(angles[free] / FINEST_DEG) * FINEST_DEG
    angles[free] = np.clip(rounded, limits[free, 0], limits[free, 1]).round(2)
    return angles + 0.0  # -0.0 is 0.0


def _plane_table(axes: _Folded, planes: _Folded, J: Array) -> Array:
    """alpha_laser, beta_laser [deg], lowest coarse J, and alpha_rot, beta_rot [deg] it was found about; see above."""
    u = np.stack([axes.points[axes.first], -axes.points[axes.first]])
    table = np.full((len(planes.settings_deg), 5), np.nan)
    table[:, :2] = planes.settings_deg
    flat = J.reshape(len(J), -1)
    best = (flat <= flat.min(axis=1, keepdims=True) + EQUAL).argmax(axis=1)  # the first of equals, on any machine
    for i, (c, flip) in enumerate(zip(planes.classes, planes.flip, strict=True)):
        way, axis = divmod(int(best[c]), J.shape[2])
        nearest = int(np.argmax(axes.points @ u[way ^ int(flip), axis]))
        table[i, 2] = flat[c, best[c]]
        table[i, 3:] = axes.settings_deg[nearest]
    return table


def _left_out(ranges: AngleRanges, covered: int, different: int, bounded: int) -> tuple[LeftOut, ...]:
    out = []
    fixed = [f"{name}_deg" for name in NAMES if len(ranges.grid_deg(name)) == 1]
    if fixed:
        out.append(LeftOut("search over " + ", ".join(fixed), "the task fixes them", len(fixed), "angles"))
    if covered > different:
        why = "same J by symmetry of scan plane and axis"
        out.append(LeftOut("equivalent settings", why, covered - different, "settings"))
    if bounded:
        why = "the bound from their mean density cannot beat the best setting"
        out.append(LeftOut("exact densities", why, bounded, "scan planes"))
    return tuple(out)
