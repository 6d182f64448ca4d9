"""Sets of directions that stand for the sphere, or for the part of it that a task cares about."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from design.errors import TaskError
from design.sphere.regions import SPHERE, Field, frames_about

GOLDEN = (1 + 5**0.5) / 2
MOST_LOOKS = 1_000_000  # directions looked at in one cap
EMPTY = "weight: the region is empty: no direction has a weight above 0 outside the masks"


@dataclass(frozen=True, slots=True)
class Samples:
    """Directions (n, 3) and what each adds to `int w dO`, shape (n,)."""

    directions: Float[ndarray, "n 3"]
    weights: Float[ndarray, " n"]


def spiral(
    count: int, turn_rad: float = 0.0, cap_rad: float = np.pi, shift: float = 0.5
) -> Float[ndarray, "{count} 3"]:
    """Fibonacci spiral: `count` directions of equal solid angle within `cap_rad` of z, shape (count, 3).

    Each stands for a slice of the cap; `shift` is where in it, 0 to 1.
    """
    k = np.arange(count) + shift
    z = 1 - (1 - np.cos(cap_rad)) * k / count
    r = np.sqrt(np.maximum(1 - z * z, 0.0))
    phi = turn_rad + 2 * np.pi * k / GOLDEN
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=1)


def equal_angle_grid(step_deg: float) -> Float[ndarray, "n 3"]:
    """The paper's grid: theta 0 .. 180, phi 0 .. 360 (excluded) in equal steps, row after row, shape (n, 3)."""
    theta = np.radians(np.arange(0, 180 + step_deg / 2, step_deg))
    phi = np.radians(np.arange(0, 360 - step_deg / 2, step_deg))
    t, p = np.meshgrid(theta, phi, indexing="ij")
    grid = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)
    return grid.reshape(-1, 3)


def weighted_samples(field: Field, wanted: int, turn_rad: float = 0.0, shift: float = 0.5) -> Samples:
    """About `wanted` directions or more that cover the weighted region; directions of weight zero are left out.

    Every painted region has a cap that holds it, and gets a spiral of its own in what the caps before it leave.

    Raises:
        TaskError: no direction has a weight.
    """
    caps = field.weight.caps if field.background == 0 else np.vstack([field.weight.caps, SPHERE])
    found = [_in_cap(field, caps, i, wanted // len(caps) + 1, turn_rad, shift) for i in range(len(caps))]
    if not any(len(samples.weights) for samples in found):
        raise TaskError(
            f"{EMPTY}; widen theta_deg, phi_deg or half_angle_deg, give it a value above 0, or set density.background"
        )
    return Samples(
        np.concatenate([samples.directions for samples in found]),
        np.concatenate([samples.weights for samples in found]),
    )


def sample_set(field: Field, grid_step_deg: float | None, wanted: int, index: int) -> Samples:
    """The set of that number: sets share no ring of the spiral, so no two cut a region's edges alike.

    Nor do they stand at the same place in the slices of a cap: what the middle of each misses of a density that is
    zonal about the cap would be common to all, and their spread would not tell of it.

    With a grid step it is the paper's grid, the same for every number.

    Raises:
        TaskError: no direction has a weight.
    """
    if grid_step_deg:
        grid = equal_angle_grid(grid_step_deg)
        weights = field.weight_at(grid)
        return Samples(grid[weights > 0], weights[weights > 0])
    return weighted_samples(field, wanted + 17 * index, turn_rad=float(index), shift=(0.5 + index / GOLDEN) % 1)


def _in_cap(
    field: Field, caps: Float[ndarray, "caps 4"], index: int, wanted: int, turn_rad: float, shift: float
) -> Samples:
    """Weighted directions in one cap and in none before it; denser until there are enough, or it is given up."""
    centre, reach = caps[index, :3], float(caps[index, 3])
    to_centre = frames_about(centre[None])[0]
    count = wanted
    while True:
        directions = spiral(count, turn_rad, reach, shift) @ to_centre
        new = np.ones(count, dtype=bool)
        for before in caps[:index]:
            new &= directions @ before[:3] < np.cos(before[3])
        weights = np.where(new, field.weight_at(directions), 0.0)
        hits = int((weights > 0).sum())
        if hits >= wanted or count >= MOST_LOOKS:
            solid_angle = 2 * np.pi * (1 - np.cos(reach)) / count
            return Samples(directions[weights > 0], weights[weights > 0] * solid_angle)
        count = min(MOST_LOOKS, int(count * min(100.0, 1.2 * wanted / max(hits, 1))) + 1)
