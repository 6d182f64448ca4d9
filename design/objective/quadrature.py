"""Quadrature of one setting: the polar rule of its weights, broken at the breaks of its density too."""

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
    """Quadrature for one setting over the weights of the task, or another field, and the beams' polar angles, azimuths.

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
    """The paper's sum: every grid node counts the same, poles and all."""
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
    """Polar angles where a density starts, ends or peaks: a ball radius from the fan's extremes and its two ends.

    A fan all around has no ends: between its last beam and its first it goes on as between any two.
    """
    marks = np.array([beam_polar_rad.min(), beam_polar_rad.max()])
    if not is_closed(bearings_rad):
        marks = np.append(marks, beam_polar_rad[[0, -1]])
    return np.concatenate([marks - ball_rad, marks, marks + ball_rad])
