"""Outlines of the region of interest and of what the robot hides, and the top of the colour scale."""

from __future__ import annotations

import contourpy
import numpy as np

from scanwright.design.arrays import Array
from scanwright.design.evaluation.coverage import mean_density_at
from scanwright.design.objective.problem import Problem
from scanwright.design.sphere.directions import spiral
from scanwright.design.sphere.regions import Field
from scanwright.report.density_sphere import DENSEST

SAMPLES = 5_000  # directions, evenly distributed
EDGE_STEP_DEG = 1.0  # between the corners of a drawn outline
MOST_LEVELS = 8  # of a weight with an outline each: a map has many


def highest_density(problem: Problem, angles_rad: Array) -> float:
    """Return the beam density that all but the densest directions have at most: the top of a colour scale."""
    return float(np.quantile(mean_density_at(problem, angles_rad, spiral(SAMPLES)), DENSEST))


def edges(field: Field) -> tuple[Array, Array]:
    """Return edges of the weighted regions and of the masks as line segments on the unit sphere, (n, 2, 3) each."""
    theta = np.radians(np.arange(0, 180 + EDGE_STEP_DEG / 2, EDGE_STEP_DEG))
    phi = np.radians(np.arange(-180, 180 + EDGE_STEP_DEG / 2, EDGE_STEP_DEG))
    t, p = np.meshgrid(theta, phi, indexing="ij")
    grid = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1).reshape(-1, 3)
    weight = field.weight_at(grid).reshape(t.shape)
    masked = field.masked_at(grid).reshape(t.shape).astype(float)
    return _segments(weight, theta, phi), _segments(masked, theta, phi)


def _segments(table: Array, theta: Array, phi: Array) -> Array:
    levels = np.unique(table)
    generator = contourpy.contour_generator(phi, theta, table, line_type=contourpy.LineType.Separate)
    hit = [np.empty((0, 2, 3))]
    for level in (levels[:-1] + levels[1:])[:MOST_LEVELS] / 2:
        for line in generator.lines(float(level)):
            p, t = np.asarray(line).T
            points = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=1)
            hit.append(np.stack([points[:-1], points[1:]], axis=1))
    return np.concatenate(hit)
