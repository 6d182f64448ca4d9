"""The objective `J = int w <g(d)> dO / int w dO` of one setting, with the error of its own quadrature.

In coordinates about the axis the integral is one-dimensional: the zonal `<g(d)>` (`design.density`) times the mean
weight of each circle (`design.regions`), both exact at every polar angle. What is left is the quadrature over that
angle. Its segments end where a circle touches an edge of the region or passes a corner of it; the rule with a third
of the nodes is inside the full one, and their difference measures the error.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from design.beams import Lines, beam_directions_rot, polar_and_azimuth, scan_lines
from design.density import mean_count, zones
from design.errors import TaskError
from design.frames import Array, R_world_rot
from design.regions import Field, field_of, frames_about
from design.sphere import EMPTY, equal_angle_grid, weighted_samples
from design.task import LoadedTask

FRONT = Path(__file__).parent / "front.csv"
NODES = 6561  # per setting, spread over the segments
MOST_NODES = 200_000
A_FEW = 100  # directions that show that a region is not empty
ROUNDING = 1e-6  # floor of the stated error
LOOKS_AROUND, LOOK_RAD = 12, 1e-5  # at what lies around a point of an edge
MANY_EDGES = 64  # above this (maps) corners are not looked for: the nodes are then spread evenly


@dataclass(frozen=True, slots=True)
class Problem:
    """A task as numbers: beams, lines, ball, weights, and g of every possible count."""

    bearings_rad: Array
    lines: Lines
    ball_rad: float
    field: Field
    g: Array
    grid_step_deg: float | None
    """Step of the paper's equal-angle sum, or None for solid angles."""
    nodes: int = NODES
    """Quadrature nodes that a score starts with, from the task's `tolerance` or `budget_s`."""
    tolerance: float = 1e-3
    """A score takes more nodes as long as it states a larger error."""


@dataclass(frozen=True, slots=True)
class Score:
    """J of one setting.

    Attributes:
        J: the objective.
        J_error: estimate of its numerical error, on the safe side; see `score_on`.
        J_lower: with g of the mean count, a lower bound of J as g is convex.
        least: lowest count in the weighted region at any start phase, beams per ball.
        blind_weight: share of the weight that is never seen, at no phase.
    """

    J: float
    J_error: float
    J_lower: float
    least: int
    blind_weight: float


@dataclass(frozen=True, slots=True)
class PolarRule:
    """Quadrature over the polar angle about an axis.

    Attributes:
        polar_rad: nodes, shape (n,).
        fine: what each node adds to `int w dO`, shape (n,).
        coarse: the same for the rule with a third of the nodes: zero on two of three, shape (n,).
        segment: the segment that each node belongs to, shape (n,).
    """

    polar_rad: Array
    fine: Array
    coarse: Array
    segment: NDArray[np.intp]


def log_density(counts: Array) -> Array:
    """`g(d) = -ln(1 + d)`: rewards every direction's first beams most (the paper's logarithm, with its sign)."""
    return -np.log1p(counts)


def problem_of(loaded: LoadedTask) -> Problem:
    """The numbers that decide J.

    Raises:
        TaskError: no direction has a weight, or the tolerance or the budget cannot be kept.
    """
    density = loaded.task.density
    field = field_of(loaded)
    step_deg = density.grid_step_deg if density.quadrature == "equal_angle" else None
    try:
        nodes = nodes_for(density.tolerance, density.budget_s)
        if step_deg is None:
            weighted_samples(field, A_FEW)
        elif not field.weight_at(equal_angle_grid(step_deg)).any():
            raise TaskError(EMPTY)
    except TaskError as error:
        raise TaskError(f"{loaded.source}: {error}") from error
    lidar = loaded.lidar
    bearings = lidar.bearings_rad()
    lines = scan_lines(loaded.task.motion.period_s, lidar.scan_rate_hz)
    return Problem(
        bearings_rad=bearings,
        lines=lines,
        ball_rad=float(np.radians(density.ball_radius_deg)),
        field=field,
        g=log_density(np.arange(lines.count * len(bearings) + 1.0)),
        grid_step_deg=step_deg,
        nodes=nodes,
        tolerance=density.tolerance or (np.inf if density.budget_s else 1e-3),
    )


def nodes_for(tolerance: float | None, budget_s: float | None) -> int:
    """The cheapest nodes that keep a tolerance of J, or the most that a budget pays for, from the measured front.

    `design/front.csv` is the front; `benchmarks/front.py` measures it.

    Raises:
        TaskError: nothing on the front is that near, or that fast.
    """
    if tolerance is None and budget_s is None:
        return NODES
    front = np.loadtxt(FRONT, delimiter=",", skiprows=1)
    paid = front[front[:, 2] <= (np.inf if budget_s is None else budget_s)]
    if not len(paid):
        raise TaskError(f"density.budget_s = {budget_s:g}: the fastest score takes {front[:, 2].min():g} s")
    near = paid[paid[:, 1] <= (np.inf if tolerance is None else tolerance)]
    if not len(near):
        raise TaskError(f"density.tolerance = {tolerance:g}: the nearest that can be had is {paid[:, 1].min():g}")
    return int(near[-1, 0] if tolerance is None else near[0, 0])


def score(problem: Problem, angles_rad: Array) -> Score:
    """J of the setting (alpha_rot, beta_rot, alpha_laser, beta_laser) [rad], on as many nodes as its tolerance needs.

    Raises:
        TaskError: no direction has a weight.
    """
    nodes = problem.nodes
    while True:
        found = score_on(problem, angles_rad, nodes)
        if found.J_error <= problem.tolerance or nodes >= MOST_NODES or problem.grid_step_deg:
            return found
        nodes *= 3


def score_on(problem: Problem, angles_rad: Array, nodes: int) -> Score:
    """J of a setting on a number of nodes.

    The rule with a third of the nodes is inside the full one. Their differences on the segments have no common sign,
    so their root sum of squares stands for the error: 2 to 1000 times the true one in tests/test_objective.py.

    Raises:
        TaskError: no direction has a weight.
    """
    rule, polar, azimuth = rule_of(problem, angles_rad, nodes)
    total = rule.fine.sum()
    z = zones(rule.polar_rad, polar, azimuth, problem.lines, problem.ball_rad, problem.g)
    by_segment = np.bincount(rule.segment, (rule.fine - rule.coarse) * z.mean_g)
    lower = log_density(mean_count(rule.polar_rad, polar, problem.lines, problem.ball_rad))
    return Score(
        J=float(rule.fine @ z.mean_g / total),
        J_error=float(np.linalg.norm(by_segment) / total) + ROUNDING,
        J_lower=float(rule.fine @ lower / total),
        least=int(z.least[rule.fine > 0].min()),
        blind_weight=float(rule.fine @ (z.most == 0) / total),
    )


def quick_J(problem: Problem, angles_rad: Array, nodes: int) -> float:
    """J alone, as `score` computes it: for searches that call it often."""
    rule, polar, azimuth = rule_of(problem, angles_rad, nodes)
    z = zones(rule.polar_rad, polar, azimuth, problem.lines, problem.ball_rad, problem.g)
    return float(rule.fine @ z.mean_g / rule.fine.sum())


def rule_of(problem: Problem, angles_rad: Array, nodes: int) -> tuple[PolarRule, Array, Array]:
    """Quadrature for one setting, and the polar angles and azimuths of its beams.

    Raises:
        TaskError: no direction has a weight.
    """
    axis = R_world_rot(angles_rad[0], angles_rad[1])[:, 2]
    polar, azimuth = polar_and_azimuth(beam_directions_rot(problem.bearings_rad, angles_rad[2], angles_rad[3]))
    rule = _grid_rule(problem, axis) if problem.grid_step_deg else _circle_rule(problem, axis, polar, nodes)
    if not rule.fine.sum() > 0:
        raise TaskError(EMPTY)
    return rule, polar, azimuth


def _grid_rule(problem: Problem, axis: Array) -> PolarRule:
    """The paper's sum: every grid node counts the same, poles and all."""
    assert problem.grid_step_deg is not None
    grid = equal_angle_grid(problem.grid_step_deg)
    weights = problem.field.weight_at(grid)
    hit = weights > 0
    polar = np.arccos(np.clip(grid[hit] @ axis, -1, 1))
    unique, index = np.unique(np.round(polar, 12), return_inverse=True)
    summed = np.bincount(index, weights[hit], len(unique))
    return PolarRule(unique, summed, summed, np.zeros(len(unique), dtype=np.intp))


def _circle_rule(problem: Problem, axis: Array, beam_polar_rad: Array, nodes: int) -> PolarRule:
    """Midpoint rule on each segment, nodes gathered at its ends: there the integrand starts like a square root."""
    field = problem.field
    segments = _weighted_segments(field, axis, _density_breaks(beam_polar_rad, problem.ball_rad))
    length = sum(b - a for a, b in segments)
    polar, fine, coarse = [], [], []
    for a, b in segments:
        thirds = max(3, round(nodes / 3 * (b - a) / length))
        s = np.pi * (np.arange(3 * thirds) + 0.5) / (3 * thirds)
        width = (b - a) / 2 * np.sin(s) * np.pi / (3 * thirds)
        polar.append(a + (b - a) * np.sin(s / 2) ** 2)
        fine.append(width)
        coarse.append(np.where(np.arange(3 * thirds) % 3 == 1, 3 * width, 0.0))
    if not segments:
        raise TaskError(EMPTY)
    t = np.concatenate(polar)
    means, _ = field.on_circles(axis, t)
    around = 2 * np.pi * np.sin(t) * means
    segment = np.repeat(np.arange(len(polar)), [len(p) for p in polar])
    return PolarRule(t, np.concatenate(fine) * around, np.concatenate(coarse) * around, segment)


def _density_breaks(beam_polar_rad: Array, ball_rad: float) -> Array:
    """Polar angles where a density starts, ends or peaks: a ball radius from the fan's extremes and its two ends."""
    marks = np.array([beam_polar_rad.min(), beam_polar_rad.max(), beam_polar_rad[0], beam_polar_rad[-1]])
    return np.concatenate([marks - ball_rad, marks, marks + ball_rad])


def _fold(polar_rad: Array) -> Array:
    """Bring polar angles past a pole back to 0 .. pi."""
    beyond = np.abs(polar_rad) % (2 * np.pi)
    return np.where(beyond > np.pi, 2 * np.pi - beyond, beyond)


def breaks_of(field: Field, axis: Array, more_rad: Array) -> Array:
    """Polar angles about an axis where the circle mean of the weight breaks, with some more, sorted, 0 to pi."""
    of_field = _breaks(field, axis)
    return np.unique(np.round(np.concatenate([of_field, _fold(more_rad)]), 12))


def _weighted_segments(field: Field, axis: Array, more_rad: Array) -> list[tuple[float, float]]:
    """Ranges of the polar angle between breaks, those of weight zero left out."""
    breaks = breaks_of(field, axis, more_rad)
    middles = (breaks[:-1] + breaks[1:]) / 2
    means, _ = field.on_circles(axis, middles)
    return [(a, b) for a, b, m in zip(breaks[:-1], breaks[1:], means, strict=True) if m > 0 and b - a > 1e-12]


def _breaks(field: Field, axis: Array) -> Array:
    """Polar angles at which a circle about `axis` touches an edge or passes a corner; 0 and pi too."""
    planes = np.concatenate([field.weight.planes, field.mask.planes])
    if len(planes) > MANY_EDGES:
        return np.radians(np.arange(0, 181.0))
    points = np.concatenate([_touched(planes, axis), _corners(planes)])
    points = points[_is_edge(field, points)]
    passing = np.arctan2(np.linalg.norm(np.cross(points, axis), axis=1), points @ axis)
    return np.concatenate([[0.0, np.pi], passing])


def _is_edge(field: Field, points: Array) -> NDArray[np.bool_]:
    """Whether the weight changes around points of edge planes: most crossings lie within a region, or outside all."""
    if not len(points):
        return np.zeros(0, dtype=bool)
    frames = frames_about(points)
    around = 2 * np.pi * np.arange(LOOKS_AROUND) / LOOKS_AROUND + 0.1
    e1, e2, centre = (frames[:, None, i] for i in range(3))
    ring = centre + LOOK_RAD * (np.cos(around)[None, :, None] * e1 + np.sin(around)[None, :, None] * e2)
    ring /= np.linalg.norm(ring, axis=2, keepdims=True)
    values = field.weight_at(ring.reshape(-1, 3)).reshape(len(points), -1)
    return np.ptp(values, axis=1) > 0


def _touched(planes: Array, axis: Array) -> Array:
    """Points of each edge circle nearest to the axis and farthest from it, shape (n, 3)."""
    normals, offsets = planes[:, :3], planes[:, 3:]
    across = axis - normals * (normals @ axis)[:, None]
    length = np.linalg.norm(across, axis=1, keepdims=True)
    tilted = length[:, 0] > 1e-12  # a circle about the axis itself is at one polar angle: any point of it will do
    side = np.where(tilted[:, None], across / np.maximum(length, 1e-300), frames_about(normals)[:, 0])
    radius = np.sqrt(np.maximum(1 - offsets**2, 0))
    return np.concatenate([normals * offsets + side * radius, normals * offsets - side * radius])


def _corners(planes: Array) -> Array:
    """Points of the sphere where two edge planes meet, shape (n, 3)."""
    i, j = np.triu_indices(len(planes), 1)
    m, n = planes[i, :3], planes[j, :3]
    along = np.cross(m, n)
    square = (along**2).sum(axis=1)
    meet = square > 1e-18
    m, n, along, square = m[meet], n[meet], along[meet], square[meet]
    c, d = planes[i, 3][meet], planes[j, 3][meet]
    # the point of the common line next to the centre, then along the line to the sphere
    foot = (np.cross(n, along) * c[:, None] + np.cross(along, m) * d[:, None]) / square[:, None]
    rest = 1 - (foot**2).sum(axis=1)
    on = rest > 0
    reach = (along * np.sqrt(np.maximum(rest, 0) / square)[:, None])[on]
    return np.concatenate([foot[on] + reach, foot[on] - reach])
