"""Nelder and Mead's simplex within bounds: scipy has one too, whose import takes longer than a search's use of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from design.arrays import Array

STEP = 2  # values that one step takes


@dataclass(frozen=True, slots=True)
class Enough:
    """When a simplex is small enough: in every coordinate and in its values; and the most values of its steps."""

    size: float
    spread: float
    values: int


def lowest_by_simplex(
    value: Callable[[Array], float],
    corners: Float[ndarray, "corners n"],
    values: Float[ndarray, " corners"],
    bounds: Float[ndarray, "n 2"],
    enough: Enough,
) -> Float[ndarray, " n"]:
    """The lowest corner of a simplex that reflects, expands and contracts (Nelder and Mead 1965), shape (n,).

    Args:
        value: what is minimised; inf where a point is refused.
        corners: the first simplex, one corner more than coordinates.
        values: of its corners.
        bounds: lowest and highest of each coordinate; points beyond are moved there.
        enough: when it ends.
    """
    corners, values = corners.copy(), values.copy()
    left = enough.values

    def tried(point: Array) -> tuple[Array, float]:
        nonlocal left
        left -= 1
        inside = np.clip(point, *bounds.T)
        return inside, value(inside)

    while True:
        order = np.argsort(values, kind="stable")
        corners, values = corners[order], values[order]
        small = np.abs(corners[1:] - corners[0]).max() <= enough.size
        if left < STEP or (small and not values[-1] - values[0] > enough.spread):
            return corners[0]
        middle = corners[:-1].mean(axis=0)
        away = middle - corners[-1]
        found, low = tried(middle + away)
        if low < values[0]:
            further, lower = tried(middle + 2 * away)
            found, low = (further, lower) if lower < low else (found, low)
        elif low >= values[-2]:
            outside = low < values[-1]
            nearer, lower = tried(middle + (0.5 if outside else -0.5) * away)
            if not (lower <= low if outside else lower < values[-1]):
                corners[1:] = corners[0] + 0.5 * (corners[1:] - corners[0])
                for i in range(1, len(corners)):
                    corners[i], values[i] = tried(corners[i])
                continue
            found, low = nearer, lower
        corners[-1], values[-1] = found, low
