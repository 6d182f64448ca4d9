"""The integral of a weight over the sphere, by a separate rule: every quadrature of that weight must sum to it.

Circles about the world's z axis, the axis of bands and maps: between the polar angles at which a circle touches an
edge or passes a corner the mean along it is smooth. Panels between all of these, of weight zero or not, are halved
until their Gauss sums agree.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from scanwright.design.errors import NumericalError, TaskError
from scanwright.design.sphere.corners import LOOK_RAD, edge_corners, polar_about, touched_points
from scanwright.design.sphere.painting import VALUE
from scanwright.design.sphere.regions import Field

UP = np.array([0.0, 0.0, 1.0])
WEIGHT_OFF = 1e-3  # share of the integral of the weight that the sum of a quadrature may be off by
SURE = 5.0  # standard errors of a sum of weights that are drawn
RELATIVE_ERROR = 1e-5  # a hundredth of what a quadrature may be off by
MOST_HALVINGS = 40
NODES, NODE_WEIGHTS = np.polynomial.legendre.leggauss(3)


@lru_cache(maxsize=64)
def total_weight(field: Field) -> float:
    """`int w dO` outside the masks [sr], to a relative error of 1e-5; 0.0 if no direction has a weight.

    Raises:
        NumericalError: the sum does not settle.
    """
    planes = np.concatenate([field.planes, field.map_planes])
    points = np.concatenate([touched_points(planes, UP), edge_corners(field).points])
    breaks = np.unique(np.concatenate([[0.0, np.pi], polar_about(UP, points)]))
    ends = np.stack([breaks[:-1], breaks[1:]], axis=1)
    sums = _panel_sums(field, ends)
    settled = 0.0
    for _ in range(MOST_HALVINGS):
        middle = ends.mean(axis=1)
        ends = np.stack([ends[:, 0], middle, middle, ends[:, 1]], axis=1).reshape(-1, 2)
        halves = _panel_sums(field, ends).reshape(-1, 2)
        change = np.abs(halves.sum(axis=1) - sums)
        if change.sum() <= RELATIVE_ERROR * (settled + halves.sum()):
            return float(settled + halves.sum())
        # what changes by less than its share of the allowance is good enough, however many others there are
        again = change > RELATIVE_ERROR / 2 * (settled + halves.sum()) / len(change)
        settled += float(halves[~again].sum())
        ends, sums = ends[np.repeat(again, 2)], halves[again].ravel()
    raise NumericalError("weight: its integral over the sphere does not settle")


def is_total(field: Field, got: float, own_error: float) -> bool:
    """Whether the sum of the weights of a quadrature is the integral of the weight.

    Args:
        field: the weights.
        got: their sum.
        own_error: what the sum is off by as its nodes are few.
    """
    expected = total_weight(field)
    return abs(got - expected) <= WEIGHT_OFF * expected + own_error


def weight_error(field: Field, got: float, where: str) -> NumericalError | TaskError:
    """Return the error of a quadrature that loses weight, or has some of it twice; or of a region that is too thin."""
    if total_weight(field) < 2 * np.pi * field.edges * 2 * LOOK_RAD * field.patches[:, VALUE].max():
        return TaskError(
            f"weight: what the masks leave of the regions is thinner than {np.degrees(2 * LOOK_RAD):.0e} deg: "
            "widen the regions, or narrow the masks"
        )
    return NumericalError(f"weight: {where} it sums to {got:.6g}, and not to {total_weight(field):.6g}")


def require_drawn(field: Field, weights: Float[ndarray, " n"]) -> None:
    """Compare the sum of the weights of directions that are drawn with the integral of the weight.

    Raises:
        NumericalError: they differ by more than a draw of so many explains.
        TaskError: the same, and the region is thinner than what is resolved.
    """
    got = float(weights.sum())
    if not is_total(field, got, SURE * float(np.linalg.norm(weights / weights.max()) * weights.max())):
        raise weight_error(field, got, f"over {len(weights)} directions")


def _panel_sums(field: Field, ends: Float[ndarray, "panels 2"]) -> Float[ndarray, " panels"]:
    """Gauss sums of the weight over ranges of the polar angle about z."""
    half = np.diff(ends, axis=1) / 2
    polar = ends.mean(axis=1, keepdims=True) + half * NODES
    means, _ = field.on_circles(UP, polar.ravel())
    return np.asarray((2 * np.pi * half * NODE_WEIGHTS * np.sin(polar) * means.reshape(polar.shape)).sum(axis=1))
