"""Sets of directions that represent the sphere, or the weighted region of a task."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from scanwright.design.errors import TaskError
from scanwright.design.sphere.painting import ALL, BAND, CONE, POLYGON, VALUE
from scanwright.design.sphere.rectangle import seen_rectangle
from scanwright.design.sphere.regions import Field, frames_about

GOLDEN = (1 + 5**0.5) / 2
MOST_PER_PATCH = 1_000_000  # directions
A_FEW = 100  # directions that show that a region is not empty
EMPTY = "weight: the region is empty: no direction has a weight above 0 outside the masks"
NO_WEIGHT = f"{EMPTY}; widen theta_deg, phi_deg or half_angle_deg, give it a value above 0, or set density.background"


@dataclass(frozen=True, slots=True)
class Samples:
    """Directions, and the contribution of each to the integral of the weight over the sphere."""

    directions: Float[ndarray, "n 3"]
    weights: Float[ndarray, " n"]


def spiral(
    count: int, turn_rad: float = 0.0, lowest_z: float = -1.0, shift: float = 0.5
) -> Float[ndarray, "{count} 3"]:
    """Return a Fibonacci spiral of directions of equal solid angle in the cap about z above `lowest_z`.

    Each direction represents a slice of the cap; `shift` is its place in the slice, 0 to 1.
    """
    k = np.arange(count) + shift
    return _on_sphere(1 - (1 - lowest_z) * k / count, turn_rad + 2 * np.pi * k / GOLDEN)


def _on_sphere(z: Float[ndarray, " n"], phi: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
    r = np.sqrt(np.maximum((1 - z) * (1 + z), 0.0))
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=1)


def equal_angle_grid(step_deg: float) -> Float[ndarray, "n 3"]:
    """Return the paper's grid: theta 0 .. 180, phi 0 .. 360 (excluded) in equal steps, row after row, shape (n, 3)."""
    theta = np.radians(np.arange(0, 180 + step_deg / 2, step_deg))
    phi = np.radians(np.arange(0, 360 - step_deg / 2, step_deg))
    t, p = np.meshgrid(theta, phi, indexing="ij")
    grid = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)
    return grid.reshape(-1, 3)


def weighted_samples(field: Field, wanted: int, turn_rad: float = 0.0, shift: float = 0.5) -> Samples:
    """Return `wanted` or more directions that cover the weighted region, without directions of weight zero.

    Each region of the task gets the same number, however small it is. In the overlap of several regions the directions
    of all of them share the solid angle.

    Raises:
        TaskError: no direction has a weight.
    """
    each = wanted // max(1, len(field.patches)) + 1
    result = [_in_patch(field, k, each, turn_rad, shift) for k in range(len(field.patches))]
    if not any(len(samples.weights) for samples, _ in result):
        raise TaskError(NO_WEIGHT)
    directions = np.concatenate([samples.directions for samples, _ in result])
    weights = np.concatenate([samples.weights for samples, _ in result])
    return Samples(directions, weights / field.summed_at(directions, np.array([per_sr for _, per_sr in result])))


def require_weight(field: Field) -> None:
    """Require a direction with a weight; stop at the first region that has one.

    Raises:
        TaskError: no direction has a weight.
    """
    patches = len(field.patches)
    if not any(len(_in_patch(field, k, A_FEW // patches + 1, 0.0, 0.5)[0].weights) for k in range(patches)):
        raise TaskError(NO_WEIGHT)


@lru_cache(maxsize=8)
def sample_sets(field: Field, grid_step_deg: float | None, wanted: int, count: int) -> tuple[Samples, ...]:
    """Return `sample_set` 0 .. count - 1, or the paper's grid once; cached, since all mounts use the same sets.

    Raises:
        TaskError: no direction has a weight.
    """
    return tuple(sample_set(field, grid_step_deg, wanted, index) for index in range(1 if grid_step_deg else count))


def sample_set(field: Field, grid_step_deg: float | None, wanted: int, index: int) -> Samples:
    """Return set number `index` of directions that cover the weighted region; with a grid step, the paper's grid.

    The spirals of the sets differ in number, rotation and `shift`, so that the spread of their means contains the error
    of one set. With equal shifts the error for a density that is symmetric about a cap would be common to all.

    Raises:
        TaskError: no direction has a weight.
    """
    if grid_step_deg:
        grid = equal_angle_grid(grid_step_deg)
        weights = field.weight_at(grid)
        return Samples(grid[weights > 0], weights[weights > 0])
    return weighted_samples(field, wanted + 17 * index, turn_rad=float(index), shift=(0.5 + index / GOLDEN) % 1)


def _in_patch(field: Field, index: int, wanted: int, turn_rad: float, shift: float) -> tuple[Samples, float]:
    """Return at least `wanted` weighted directions of one patch, and all directions of the patch per steradian.

    Fewer are returned if `MOST_PER_PATCH` directions do not contain as many.
    """
    count = wanted
    while True:
        directions, solid_angle = _spread(field, index, count, turn_rad, shift)
        if not solid_angle > 0:
            return Samples(np.empty((0, 3)), np.empty(0)), 0.0
        weights = field.weight_at(directions)
        hits = int((weights > 0).sum())
        if hits >= wanted or count >= MOST_PER_PATCH:
            return Samples(directions[weights > 0], weights[weights > 0]), count / solid_angle
        count = min(MOST_PER_PATCH, int(count * min(100.0, 1.2 * wanted / max(hits, 1))) + 1)


def _spread(field: Field, index: int, count: int, turn_rad: float, shift: float) -> tuple[Float[ndarray, "n 3"], float]:
    """Return directions of equal solid angle that cover one patch, and its solid angle."""
    row = field.patches[index]
    if row[0] == ALL:
        return spiral(count, turn_rad, -1.0, shift), 4 * np.pi
    if row[0] == CONE:
        return spiral(count, turn_rad, row[4], shift) @ frames_about(row[None, 1:4])[0], 2 * np.pi * (1 - row[4])
    k = np.arange(count) + shift
    share = (k / GOLDEN + turn_rad / (2 * np.pi)) % 1
    if row[0] == POLYGON:
        return seen_rectangle(row[1:VALUE].reshape(4, 3)).spread(k / count, share)
    if row[0] == BAND:
        half = np.arccos(row[5])
        phi = np.arctan2(row[4], row[3]) + half * (2 * share - 1)
        return _on_sphere(row[2] - (row[2] - row[1]) * k / count, phi), 2 * half * (row[2] - row[1])
    height, width = int(row[2]), int(row[3])
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    r, c = np.nonzero(field.weight.tables[int(row[1]), :height, :width])
    ends = np.cumsum(edges[r] - edges[r + 1])
    if not len(ends):
        return np.empty((0, 3)), 0.0
    at = k / count * ends[-1]  # as if the cells lay one below the other
    cell = np.minimum(np.searchsorted(ends, at, side="right"), len(ends) - 1)
    z = np.clip(edges[r[cell] + 1] + ends[cell] - at, edges[r[cell] + 1], edges[r[cell]])
    return _on_sphere(z, 2 * np.pi * (c[cell] + share) / width), float(2 * np.pi / width * ends[-1])
