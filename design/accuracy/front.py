"""Pareto dominance: a row is dominated if another one is worse in no column and better in at least one."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Num
from numpy import ndarray


def dominators(costs: Num[ndarray, "n columns"], cost: Num[ndarray, " columns"]) -> Bool[ndarray, " n"]:
    """Return which rows (n, columns) dominate one of shape (columns,); lower is better. Shape (n,)."""
    return np.asarray((costs <= cost).all(axis=1) & (costs < cost).any(axis=1))
