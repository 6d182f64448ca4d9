"""Quadrature of one mount: the polar rule of the weights, with further breaks for the density."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from scanwright.design.arrays import Setting, Vector
from scanwright.design.density.beams import is_closed, polar_and_azimuth
from scanwright.design.errors import TaskError
from scanwright.design.frames import R_world_rot
from scanwright.design.objective.problem import Problem
from scanwright.design.sphere.directions import EMPTY, equal_angle_grid
from scanwright.design.sphere.polar_rule import PolarRule, circle_rule
from scanwright.design.sphere.regions import Field


def polar_rule(
    problem: Problem, angles_rad: Setting, nodes: int, field: Field | None = None
) -> tuple[PolarRule, Float[ndarray, " beams"], Float[ndarray, " beams"]]:
    """Return the quadrature of one mount over the weights of `field` (the task's), and polar and azimuth of its beams.

    Raises:
        TaskError: no direction has a weight.
    """
    field = field or problem.field
    axis = R_world_rot(angles_rad[0], angles_rad[1])[:, 2]
    polar, azimuth = polar_and_azimuth(problem.beams_rot(angles_rad[2:]))
    step = problem.grid_step_deg
    breaks = np.concatenate(
        [_density_breaks(problem.bearings_rad, polar, problem.ball_rad), problem.blind_zones(polar).ravel()]
    )
    rule = _grid_rule(field, step, axis) if step else circle_rule(field, axis, breaks, nodes)
    if not rule.fine.sum() > 0:
        raise TaskError(EMPTY)
    return rule, polar, azimuth


def _grid_rule(field: Field, step_deg: float, axis: Vector) -> PolarRule:
    """Return the sum of the paper as a rule: every grid node has the same area, also at the poles."""
    grid = equal_angle_grid(step_deg)
    weights = field.weight_at(grid)
    hit = weights > 0
    polar = np.arccos(np.clip(grid[hit] @ axis, -1, 1))
    unique, index = np.unique(np.round(polar, 12), return_inverse=True)
    summed = np.bincount(index, weights[hit], len(unique))
    return PolarRule(unique, summed, summed, np.zeros(len(unique), dtype=np.intp))


def _density_breaks(
    bearings_rad: Float[ndarray, " beams"], beam_polar_rad: Float[ndarray, " beams"], ball_rad: float
) -> Float[ndarray, " n"]:
    """Return the polar angles at which a density starts, ends or peaks.

    They are within a ball radius of the extremes of the field of view and of its ends, if it is not a full circle.
    """
    marks = np.array([beam_polar_rad.min(), beam_polar_rad.max()])
    if not is_closed(bearings_rad):
        marks = np.append(marks, beam_polar_rad[[0, -1]])
    return np.concatenate([marks - ball_rad, marks, marks + ball_rad])
