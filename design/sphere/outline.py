"""The outline of what a task cares about, and how far from an axis it begins and ends."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from design.concurrency.parallel import in_chunks
from design.sphere.painting import MAP
from design.sphere.polar_rule import around, edge_corners
from design.sphere.regions import Field, frames_about

AROUND = 3600  # points of each edge: what an arc reaches further between two of them is below 4e-7 rad
BETWEEN = 9  # points of each edge of a cell of a map


def reach_about(field: Field, axes: Float[ndarray, "axes 3"]) -> Float[ndarray, "axes 2"]:
    """Lowest and highest polar angle about unit axes (n, 3) at which there is weight, shape (n, 2).

    The way from an axis to a region ends at its outline, but for a region that the axis itself lies in.
    """
    points = _outline(field)
    if not len(points):  # all of the sphere
        return np.tile([0.0, np.pi], (len(axes), 1))
    parts = in_chunks(lambda chunk: _reach(points, axes[chunk]), len(axes), smallest=16)
    reach = np.concatenate(parts)
    reach[field.weight_at(axes) > 0, 0] = 0.0
    reach[field.weight_at(-axes) > 0, 1] = np.pi
    return reach


def _reach(points: Float[ndarray, "n 3"], axes: Float[ndarray, "axes 3"]) -> Float[ndarray, "axes 2"]:
    cosine = np.clip(axes @ points.T, -1, 1)
    return np.arccos(np.stack([cosine.max(axis=1), cosine.min(axis=1)], axis=1))


@lru_cache(maxsize=64)
def _outline(field: Field) -> Float[ndarray, "n 3"]:
    """Points where the weight begins, along every edge, and all corners, shape (n, 3)."""
    circles = [_on_circle(plane) for plane in field.planes]
    cells = [
        _on_cells(layers.tables[int(row[1])], row)
        for layers in (field.weight, field.mask)
        for row in layers.rows[layers.rows[:, 0] == MAP]
    ]
    points = np.concatenate([np.empty((0, 3)), *circles, *cells, edge_corners(field)])
    return points[_begins(field, points)]


def _begins(field: Field, points: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
    """Whether there is weight on one side of points and none on another."""
    if not len(points):
        return np.zeros(0, dtype=bool)
    weighted = field.weight_at(around(points).reshape(-1, 3)).reshape(len(points), -1) > 0
    return np.asarray(weighted.any(axis=1) & ~weighted.all(axis=1))


def _on_circle(plane: Float[ndarray, " 4"]) -> Float[ndarray, "n 3"]:
    """Points all along the circle that a plane (m, c) cuts from the sphere."""
    e1, e2, normal = frames_about(plane[None, :3])[0]
    turn = 2 * np.pi * np.arange(AROUND)[:, None] / AROUND
    return plane[3] * normal + np.sqrt(max(0.0, 1 - plane[3] ** 2)) * (np.cos(turn) * e1 + np.sin(turn) * e2)


def _on_cells(table: Float[ndarray, "rows columns"], row: Float[ndarray, " 14"]) -> Float[ndarray, "n 3"]:
    """Points along those edges of a map's cells at which it begins to hold something."""
    height, width = int(row[2]), int(row[3])
    holds = table[:height, :width] > 0
    along = np.linspace(0, 1, BETWEEN)
    r, c = np.nonzero(holds[:-1] != holds[1:])  # across the parallel below a cell
    theta = [np.repeat(np.pi * (r + 1) / height, BETWEEN)]
    phi = [(2 * np.pi * (c[:, None] + along) / width).ravel()]
    r, c = np.nonzero(holds != np.roll(holds, 1, axis=1))  # across the meridian in front of a cell
    theta.append((np.pi * (r[:, None] + along) / height).ravel())
    phi.append(np.repeat(2 * np.pi * c / width, BETWEEN))
    t, p = np.concatenate(theta), np.concatenate(phi)
    return np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=1)
