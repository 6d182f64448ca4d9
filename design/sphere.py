"""Sets of directions that stand for the sphere, or for the part of it that a task cares about."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from design.errors import TaskError
from design.frames import Array
from design.regions import Field

GOLDEN = (1 + 5**0.5) / 2
FIRST_LOOK = 1_000_000  # directions looked at to find the region; a region of one degree still catches 19 of them


@dataclass(frozen=True, slots=True)
class Samples:
    """Directions (n, 3) and what each adds to `int w dO`, shape (n,)."""

    directions: Array
    weights: Array


def spiral(count: int, turn_rad: float = 0.0, cap_rad: float = np.pi) -> Array:
    """Fibonacci spiral: `count` directions of equal solid angle within `cap_rad` of z, shape (count, 3)."""
    k = np.arange(count) + 0.5
    z = 1 - (1 - np.cos(cap_rad)) * k / count
    r = np.sqrt(np.maximum(1 - z * z, 0.0))
    phi = turn_rad + 2 * np.pi * k / GOLDEN
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=1)


def equal_angle_grid(step_deg: float) -> Array:
    """The paper's grid: theta 0 .. 180, phi 0 .. 360 (excluded) in equal steps, row after row, shape (n, 3)."""
    theta = np.radians(np.arange(0, 180 + step_deg / 2, step_deg))
    phi = np.radians(np.arange(0, 360 - step_deg / 2, step_deg))
    t, p = np.meshgrid(theta, phi, indexing="ij")
    grid = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)
    return grid.reshape(-1, 3)


def weighted_samples(field: Field, wanted: int, turn_rad: float = 0.0) -> Samples:
    """At least about `wanted` directions of equal solid angle that cover the weighted region.

    Directions of weight zero are left out; a small region is covered by a spiral of its own.

    Raises:
        TaskError: no direction has a weight.
    """
    count = wanted
    for count in (4 * wanted, FIRST_LOOK):
        found = _hits(field, spiral(count, turn_rad))
        share = len(found.weights) / count
        if len(found.weights) >= wanted:
            return found
        if share > 1e-2:
            return _hits(field, spiral(int(wanted / share), turn_rad))
    if not len(found.weights):
        raise TaskError(
            "weight: the region is empty: no direction has a weight above 0 outside the masks; "
            "widen theta_deg, phi_deg or half_angle_deg, or set density.background"
        )
    centre = found.directions.mean(axis=0)
    centre /= np.linalg.norm(centre)
    spacing = 2 * np.sqrt(np.pi / count)
    reach = min(np.pi, float(np.arccos(np.clip(found.directions @ centre, -1, 1)).max()) + 2 * spacing)
    share = len(found.weights) / count * 2 / (1 - np.cos(reach))
    return _hits(field, spiral(int(wanted / share), turn_rad, reach) @ _z_to(centre).T, (1 - np.cos(reach)) / 2)


def _hits(field: Field, directions: Array, share: float = 1.0) -> Samples:
    weights = field.weight_at(directions)
    hit = weights > 0
    return Samples(directions[hit], weights[hit] * (4 * np.pi * share / len(directions)))


def _z_to(axis: Array) -> Array:
    """A rotation that takes z to `axis`, shape (3, 3)."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    e1 = np.cross(helper, axis)
    e1 /= np.linalg.norm(e1)
    return np.stack([e1, np.cross(axis, e1), axis], axis=1)
