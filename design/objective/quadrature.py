"""Quadrature over the polar angle about an axis: where a region and a density break, and the nodes between.

In coordinates about the axis an integral over the sphere is one-dimensional. Its segments end where a circle touches
an edge of the region or passes a corner of it, and where a density starts, ends or peaks.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float, Int64
from numpy import ndarray

from design.arrays import Setting, Vector
from design.density.beams import polar_and_azimuth
from design.errors import TaskError
from design.frames import R_world_rot
from design.objective.problem import Problem
from design.sphere.directions import EMPTY, equal_angle_grid
from design.sphere.regions import Field, frames_about

LOOKS_AROUND, LOOK_RAD = 12, 1e-5  # at what lies around a point of an edge
MANY_EDGES = 64  # above this (maps) corners are not looked for: the nodes are then spread evenly


@dataclass(frozen=True, slots=True)
class PolarRule:
    """Quadrature over the polar angle about an axis.

    Attributes:
        polar_rad: nodes, shape (n,).
        fine: what each node adds to `int w dO`, shape (n,).
        coarse: the same for the rule with a third of the nodes: zero on two of three, shape (n,).
        segment: the segment that each node belongs to, shape (n,).
    """

    polar_rad: Float[ndarray, " n"]
    fine: Float[ndarray, " n"]
    coarse: Float[ndarray, " n"]
    segment: Int64[ndarray, " n"]


def polar_rule(
    problem: Problem, angles_rad: Setting, nodes: int, field: Field | None = None
) -> tuple[PolarRule, Float[ndarray, " beams"], Float[ndarray, " beams"]]:
    """Quadrature for one setting over the weights of the task, or another field, and the beams' polar angles, azimuths.

    Raises:
        TaskError: no direction has a weight.
    """
    field = field or problem.field
    axis = R_world_rot(angles_rad[0], angles_rad[1])[:, 2]
    polar, azimuth = polar_and_azimuth(problem.beams_rot(angles_rad[2:]))
    step = problem.grid_step_deg
    rule = _grid_rule(field, step, axis) if step else _circle_rule(field, problem.ball_rad, axis, polar, nodes)
    if not rule.fine.sum() > 0:
        raise TaskError(EMPTY)
    return rule, polar, azimuth


def _grid_rule(field: Field, step_deg: float, axis: Vector) -> PolarRule:
    """The paper's sum: every grid node counts the same, poles and all."""
    grid = equal_angle_grid(step_deg)
    weights = field.weight_at(grid)
    hit = weights > 0
    polar = np.arccos(np.clip(grid[hit] @ axis, -1, 1))
    unique, index = np.unique(np.round(polar, 12), return_inverse=True)
    summed = np.bincount(index, weights[hit], len(unique))
    return PolarRule(unique, summed, summed, np.zeros(len(unique), dtype=np.intp))


def _circle_rule(
    field: Field, ball_rad: float, axis: Vector, beam_polar_rad: Float[ndarray, " beams"], nodes: int
) -> PolarRule:
    """Midpoint rule on each segment, nodes gathered at its ends: there the integrand starts like a square root."""
    segments = _weighted_segments(field, axis, _density_breaks(beam_polar_rad, ball_rad))
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


def _density_breaks(beam_polar_rad: Float[ndarray, " beams"], ball_rad: float) -> Float[ndarray, " n"]:
    """Polar angles where a density starts, ends or peaks: a ball radius from the fan's extremes and its two ends."""
    marks = np.array([beam_polar_rad.min(), beam_polar_rad.max(), beam_polar_rad[0], beam_polar_rad[-1]])
    return np.concatenate([marks - ball_rad, marks, marks + ball_rad])


def _fold(polar_rad: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
    """Bring polar angles past a pole back to 0 .. pi."""
    beyond = np.abs(polar_rad) % (2 * np.pi)
    return np.where(beyond > np.pi, 2 * np.pi - beyond, beyond)


def breaks_of(field: Field, axis: Vector, more_rad: Float[ndarray, " more"]) -> Float[ndarray, " n"]:
    """Polar angles about an axis where the circle mean of the weight breaks, with some more, sorted, 0 to pi."""
    of_field = _breaks(field, axis)
    return np.unique(np.round(np.concatenate([of_field, _fold(more_rad)]), 12))


def _weighted_segments(field: Field, axis: Vector, more_rad: Float[ndarray, " n"]) -> list[tuple[float, float]]:
    """Ranges of the polar angle between breaks, those of weight zero left out."""
    breaks = breaks_of(field, axis, more_rad)
    middles = (breaks[:-1] + breaks[1:]) / 2
    means, _ = field.on_circles(axis, middles)
    return [(a, b) for a, b, m in zip(breaks[:-1], breaks[1:], means, strict=True) if m > 0 and b - a > 1e-12]


def _breaks(field: Field, axis: Vector) -> Float[ndarray, " n"]:
    """Polar angles at which a circle about `axis` touches an edge or passes a corner; 0 and pi too."""
    planes = np.concatenate([field.weight.planes, field.mask.planes])
    if len(planes) > MANY_EDGES:
        return np.radians(np.arange(0, 181.0))
    touched = _touched(planes, axis)
    points = np.concatenate([touched[_is_edge(field, touched)], _edge_corners(field)])
    passing = np.arctan2(np.linalg.norm(np.cross(points, axis), axis=1), points @ axis)
    return np.concatenate([[0.0, np.pi], passing])


@lru_cache(maxsize=64)
def _edge_corners(field: Field) -> Float[ndarray, "n 3"]:
    """Corners of the region, the same about every axis."""
    corners = _corners(np.concatenate([field.weight.planes, field.mask.planes]))
    return corners[_is_edge(field, corners)]


def _is_edge(field: Field, points: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
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


def _touched(planes: Float[ndarray, "edges 4"], axis: Vector) -> Float[ndarray, "n 3"]:
    """Points of each edge circle nearest to the axis and farthest from it, shape (n, 3)."""
    normals, offsets = planes[:, :3], planes[:, 3:]
    across = axis - normals * (normals @ axis)[:, None]
    length = np.linalg.norm(across, axis=1, keepdims=True)
    tilted = length[:, 0] > 1e-12  # a circle about the axis itself is at one polar angle: any point of it will do
    side = np.where(tilted[:, None], across / np.maximum(length, 1e-300), frames_about(normals)[:, 0])
    radius = np.sqrt(np.maximum(1 - offsets**2, 0))
    return np.concatenate([normals * offsets + side * radius, normals * offsets - side * radius])


def _corners(planes: Float[ndarray, "edges 4"]) -> Float[ndarray, "n 3"]:
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
