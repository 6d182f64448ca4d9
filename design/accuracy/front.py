"""Who is beaten by whom: a row is dominated where another one is nowhere worse and somewhere better."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Num
from numpy import ndarray


def dominators(costs: Num[ndarray, "n columns"], cost: Num[ndarray, " columns"]) -> Bool[ndarray, " n"]:
    """Which rows (n, columns) dominate one of shape (columns,), lower being better: bool (n,)."""
    return np.asarray((costs <= cost).all(axis=1) & (costs < cost).any(axis=1))


def undominated(costs: Num[ndarray, "n columns"]) -> Bool[ndarray, " n"]:
    """Which of the rows (n, columns) are dominated by none: bool (n,)."""
    return np.array([not dominators(costs, cost).any() for cost in costs], dtype=bool)
