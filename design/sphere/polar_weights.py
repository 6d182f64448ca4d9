"""Distribution of the weight over the polar angle, about many axes at once."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numba import njit
from numpy import ndarray

from scanwright.design.arrays import Array
from scanwright.design.concurrency.parallel import in_chunks
from scanwright.design.errors import TaskError
from scanwright.design.sphere.directions import EMPTY, Samples, equal_angle_grid, weighted_samples
from scanwright.design.sphere.outline import reach_about
from scanwright.design.sphere.regions import Field

FEW_EDGES = 16  # with more edges (maps) sample directions are faster than circles
DIRECTIONS = 20_000  # sample directions
MISSED = 0.05  # largest relative error of the sum over circles


def weights_over_polar(
    field: Field, axes: Float[ndarray, "axes 3"], nodes: int, grid_step_deg: float | None
) -> Float[ndarray, "axes nodes"]:
    """Return the share of the weight near each of `nodes` equally spaced polar angles about each axis; rows sum to 1.

    With `grid_step_deg` only the directions of the paper's grid have weight.

    Raises:
        TaskError: no direction has a weight.
    """
    if grid_step_deg:
        grid = equal_angle_grid(grid_step_deg)
        rows = _histogram(Samples(grid, field.weight_at(grid)), axes, nodes)
    elif field.edges > FEW_EDGES:
        rows = _histogram(weighted_samples(field, DIRECTIONS), axes, nodes)
    else:
        step = np.pi / (nodes - 1)
        polar = (np.arange(nodes - 1) + 0.5) * step  # circles halfway between the nodes, which share their weight
        halves = field.on_circles_about(axes, polar, reach_about(field, axes)) * np.sin(polar) / 2
        rows = np.zeros((len(axes), nodes))
        rows[:, :-1] += halves
        rows[:, 1:] += halves
        around = rows.sum(axis=1) * (2 * np.pi * step)
        samples = weighted_samples(field, DIRECTIONS // 10)
        # circles miss or overrate regions that are narrower than the step between them
        if np.abs(around / samples.weights.sum() - 1).max() > MISSED:
            rows = _histogram(samples, axes, nodes)
    total = rows.sum(axis=1, keepdims=True)
    if not (total > 0).all():
        raise TaskError(EMPTY)
    return rows / total


def _histogram(samples: Samples, axes: Float[ndarray, "axes 3"], nodes: int) -> Array:
    """Return the weight of the samples near each polar angle about each axis, shape (axes, nodes)."""
    parts = in_chunks(
        lambda chunk: _polar_histogram(samples.directions, samples.weights, axes[chunk], nodes), len(axes), 4
    )
    return np.concatenate(parts)


@njit(cache=True, nogil=True, error_model="numpy")
def _polar_histogram(directions: Array, weights: Array, axes: Array, nodes: int) -> Array:
    """Return the weight by polar angle; each direction is shared linearly between the two nearest nodes."""
    out = np.zeros((len(axes), nodes))
    for a in range(len(axes)):
        for i in range(len(directions)):
            c = directions[i, 0] * axes[a, 0] + directions[i, 1] * axes[a, 1] + directions[i, 2] * axes[a, 2]
            at = np.arccos(min(1.0, max(-1.0, c))) * ((nodes - 1) / np.pi)
            k = min(int(at), nodes - 2)
            out[a, k] += weights[i] * (k + 1 - at)
            out[a, k + 1] += weights[i] * (at - k)
    return out
