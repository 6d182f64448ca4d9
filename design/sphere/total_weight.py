"""The integral of a weight over the sphere by a separate rule, with which the sum of every quadrature is compared.

It uses circles about the world's z axis, the axis of bands and maps. Their mean weight is smooth between the polar
angles at which a circle touches an edge or passes a corner. All panels between these are halved until their Gauss sums
agree.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from scanwright.design.errors import NumericalError, TaskError
from scanwright.design.sphere.corners import PROBE_RAD, edge_corners, polar_about, touched_points
from scanwright.design.sphere.painting import VALUE
from scanwright.design.sphere.regions import Field

UP = np.array([0.0, 0.0, 1.0])
WEIGHT_OFF = 1e-3  # largest relative error of the sum of the weights of a quadrature
SURE = 5.0  # largest error of a sum over drawn directions, in standard errors
RELATIVE_ERROR = 1e-5  # of the integral: a hundredth of `WEIGHT_OFF`
MOST_HALVINGS = 40
NODES, NODE_WEIGHTS = np.polynomial.legendre.leggauss(3)


@lru_cache(maxsize=64)
def total_weight(field: Field) -> float:
    """Return the integral of the weight outside the masks [sr], with a relative error of 1e-5.

    Raises:
        NumericalError: the sum does not converge.
    """
    planes = np.concatenate([field.planes, field.map_planes])
    points = np.concatenate([touched_points(planes, UP), edge_corners(field).points])
    breaks = np.unique(np.concatenate([[0.0, np.pi], polar_about(UP, points)]))
    ends = np.stack([breaks[:-1], breaks[1:]], axis=1)
    sums = _panel_sums(field, ends)
    converged = 0.0
    for _ in range(MOST_HALVINGS):
        middle = ends.mean(axis=1)
        ends = np.stack([ends[:, 0], middle, middle, ends[:, 1]], axis=1).reshape(-1, 2)
        halves = _panel_sums(field, ends).reshape(-1, 2)
        change = np.abs(halves.sum(axis=1) - sums)
        if change.sum() <= RELATIVE_ERROR * (converged + halves.sum()):
            return float(converged + halves.sum())
        again = change > RELATIVE_ERROR / 2 * (converged + halves.sum()) / len(change)
        converged += float(halves[~again].sum())
        ends, sums = ends[np.repeat(again, 2)], halves[again].ravel()
    raise NumericalError("weight: its integral over the sphere does not converge")


def is_total(field: Field, got: float, own_error: float) -> bool:
    """Return whether the sum `got` of a quadrature with the error `own_error` is the integral of the weight."""
    expected = total_weight(field)
    return abs(got - expected) <= WEIGHT_OFF * expected + own_error


def weight_error(field: Field, got: float, where: str) -> NumericalError | TaskError:
    """Return the error for a quadrature with a wrong sum `got`, or for a region that is too thin."""
    if total_weight(field) < 2 * np.pi * field.edges * 2 * PROBE_RAD * field.patches[:, VALUE].max():
        return TaskError(
            f"weight: outside the masks the regions are thinner than {np.degrees(2 * PROBE_RAD):.0e} deg: "
            "widen the regions, or narrow the masks"
        )
    return NumericalError(f"weight: {where} it sums to {got:.6g}, and not to {total_weight(field):.6g}")


def require_drawn(field: Field, weights: Float[ndarray, " n"]) -> None:
    """Require the weights of drawn directions to sum to the integral of the weight.

    Raises:
        NumericalError: the difference is larger than the error of the draw.
        TaskError: the same, and the region is thinner than the resolution.
    """
    got = float(weights.sum())
    if not is_total(field, got, SURE * float(np.linalg.norm(weights / weights.max()) * weights.max())):
        raise weight_error(field, got, f"over {len(weights)} directions")


def _panel_sums(field: Field, ends: Float[ndarray, "panels 2"]) -> Float[ndarray, " panels"]:
    """Return the Gauss sums of the weight over ranges of the polar angle about z."""
    half = np.diff(ends, axis=1) / 2
    polar = ends.mean(axis=1, keepdims=True) + half * NODES
    means, _ = field.on_circles(UP, polar.ravel())
    return np.asarray((2 * np.pi * half * NODE_WEIGHTS * np.sin(polar) * means.reshape(polar.shape)).sum(axis=1))
