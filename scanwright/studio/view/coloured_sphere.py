"""The sphere about the scanner: tiles coloured by density, and the edges of what matters and of what is hidden."""

from __future__ import annotations

from dataclasses import dataclass

import contourpy
import numpy as np
from numpy.typing import NDArray

from scanwright.design.arrays import Array
from scanwright.design.evaluation.coverage import mean_density_at
from scanwright.design.objective.problem import Problem
from scanwright.design.sphere.directions import spiral
from scanwright.design.sphere.regions import Field
from scanwright.report.density_sphere import DENSEST

TILES = 5_000  # 2.9 deg each; of more, a browser without a graphics card draws less than ten pictures a second
RADIUS_M = 0.5  # of the sphere of densities about the scanner
OVERLAP = 1.25  # of the hexagons, so that no seam shows
EDGE_STEP_DEG = 1.0  # between the corners of a drawn outline


@dataclass(frozen=True, slots=True)
class Hexagons:
    """Hexagons of equal area.

    Attributes:
        directions: their middles, shape (n, 3).
        corners_m: of the one at +z, about its middle, shape (6, 3).
        faces: its triangles, shape (4, 3).
        wxyz: what turns +z to each direction, shape (n, 4).
    """

    directions: Array
    corners_m: Array
    faces: NDArray[np.uint32]
    wxyz: Array


def hexagons() -> Hexagons:
    """The sphere of `RADIUS_M` in tiles."""
    directions = spiral(TILES)
    side = OVERLAP * RADIUS_M * np.sqrt(4 * np.pi / TILES / (1.5 * 3**0.5))
    around = np.arange(6) * np.pi / 3
    rim = side * np.stack([np.cos(around), np.sin(around), np.zeros(6)], axis=1)
    faces = [[0, i, i + 1] for i in range(1, 5)]
    x, y, z = directions.T  # the spiral never reaches -z, where this has no value
    w = np.sqrt((1 + z) / 2)
    wxyz = np.stack([w, -y / (2 * w), x / (2 * w), np.zeros(TILES)], axis=1)
    return Hexagons(directions, rim, np.array(faces, np.uint32), wxyz)


def highest_density(problem: Problem, angles_rad: Array) -> float:
    """Return the mean beams per ball that all but the densest directions keep to: the top of a colour scale."""
    return float(np.quantile(mean_density_at(problem, angles_rad, spiral(TILES)), DENSEST))


def edges(field: Field) -> tuple[Array, Array]:
    """Edges of the weighted regions and of the masks as line segments on the unit sphere, (n, 2, 3) each."""
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
    for level in (levels[:-1] + levels[1:])[:8] / 2:  # a map has many: a few tell its shape
        for line in generator.lines(float(level)):
            p, t = np.asarray(line).T
            points = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=1)
            hit.append(np.stack([points[:-1], points[1:]], axis=1))
    return np.concatenate(hit)


def direction_hit(origin_m: Array, direction: Array) -> Array | None:
    """Return where a ray from the camera meets the far wall of the sphere, as a unit vector; None if it passes by."""
    origin, along = np.asarray(origin_m, float), np.asarray(direction, float)
    length = float(np.linalg.norm(along))
    if not (np.isfinite(origin).all() and np.isfinite(length)) or length == 0:
        return None
    along = along / length
    middle = -float(origin @ along)
    square = RADIUS_M**2 - float(origin @ origin) + middle**2
    if square < 0:
        return None
    distance = middle + np.sqrt(square)
    point = origin + distance * along
    return None if distance <= 0 else point / RADIUS_M
