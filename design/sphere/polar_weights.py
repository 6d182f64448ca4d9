"""The weight about an axis over the polar angle: what each polar node gets of a field, about many axes at once."""

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

FEW_EDGES = 16  # above this (maps) directions represent the field: circles would be slower
DIRECTIONS = 20_000  # that do so
MISSED = 0.05  # share of the weight that circles may miss or count twice


def weights_over_polar(
    field: Field, axes: Float[ndarray, "axes 3"], nodes: int, circles: int, grid_step_deg: float | None
) -> Float[ndarray, "axes nodes"]:
    """Share of a weight near each polar node about each axis, shape (axes, nodes); rows sum to 1.

    Args:
        field: the weights.
        axes: unit vectors, shape (axes, 3).
        nodes: of the polar angle, from 0 to pi.
        circles: about each axis along which the weight is looked at, a multiple of `nodes - 1`.
        grid_step_deg: of the paper's grid, whose nodes are all that counts then.

    Raises:
        TaskError: no direction has a weight.
    """
    if grid_step_deg:
        grid = equal_angle_grid(grid_step_deg)
        rows = _histogram(Samples(grid, field.weight_at(grid)), axes, nodes)
    elif field.edges > FEW_EDGES:
        rows = _histogram(weighted_samples(field, DIRECTIONS), axes, nodes)
    else:
        polar = (np.arange(circles) + 0.5) * (np.pi / circles)
        rows = _share_between_nodes(
            field.on_circles_about(axes, polar, reach_about(field, axes)) * np.sin(polar), nodes
        )
        around = rows.sum(axis=1) * (2 * np.pi * np.pi / circles)
        samples = weighted_samples(field, DIRECTIONS // 10)
        # what is narrower than the step between circles they meet about some axes and miss about others
        if np.abs(around / samples.weights.sum() - 1).max() > MISSED:
            rows = _histogram(samples, axes, nodes)
    total = rows.sum(axis=1, keepdims=True)
    if not (total > 0).all():
        raise TaskError(EMPTY)
    return rows / total


def _histogram(samples: Samples, axes: Float[ndarray, "axes 3"], nodes: int) -> Array:
    """Weight of samples near each polar node about each axis, shape (axes, nodes)."""
    parts = in_chunks(
        lambda chunk: _polar_histogram(samples.directions, samples.weights, axes[chunk], nodes), len(axes), 4
    )
    return np.concatenate(parts)


def _share_between_nodes(circles: Array, nodes: int) -> Array:
    """Weights at circle middles, shape (axes, circles), shared linearly between the nodes on both sides."""
    cells = circles.reshape(len(circles), nodes - 1, -1)
    upper = (np.arange(cells.shape[2]) + 0.5) / cells.shape[2]
    shared = np.zeros((len(circles), nodes))
    shared[:, :-1] += cells @ (1 - upper)
    shared[:, 1:] += cells @ upper
    return shared


@njit(cache=True, nogil=True, error_model="numpy")
def _polar_histogram(directions: Array, weights: Array, axes: Array, nodes: int) -> Array:
    """Weight by polar angle, each direction shared linearly between its two nodes."""
    out = np.zeros((len(axes), nodes))
    for a in range(len(axes)):
        for i in range(len(directions)):
            c = directions[i, 0] * axes[a, 0] + directions[i, 1] * axes[a, 1] + directions[i, 2] * axes[a, 2]
            at = np.arccos(min(1.0, max(-1.0, c))) * ((nodes - 1) / np.pi)
            k = min(int(at), nodes - 2)
            out[a, k] += weights[i] * (k + 1 - at)
            out[a, k + 1] += weights[i] * (at - k)
    return out
