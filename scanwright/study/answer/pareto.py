"""Who is beaten by whom: a row is dominated where another one is nowhere worse and somewhere better."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from design.frames import Array


@dataclass(slots=True)
class Front:
    """Rows that nothing beats, of those shown so far; the same ones whatever the order they come in.

    Attributes:
        costs: lower is better, shape (rows, columns).
        numbers: what each row is called, shape (rows,).
    """

    columns: int
    costs: Array = field(init=False)
    numbers: Array = field(init=False)

    def __post_init__(self) -> None:
        self.costs, self.numbers = np.empty((0, self.columns)), np.empty(0, np.intp)

    def add(self, number: int, cost: Array) -> bool:
        """Show a row; whether it is on the front. Equal rows stand side by side, the same row but once."""
        if number in self.numbers or dominators(self.costs, cost).any():
            return False
        stays = ~_beats(cost, self.costs)
        self.costs = np.vstack([self.costs[stays], cost])
        self.numbers = np.append(self.numbers[stays], number)
        return True

    def beater(self, cost: Array) -> int | None:
        """The lowest number of a row that beats a cost, or the bound of one; None where none does."""
        beaten = dominators(self.costs, cost)
        return int(self.numbers[beaten].min()) if beaten.any() else None


def dominators(costs: Array, cost: Array) -> Array:
    """Which rows (n, columns) dominate one of shape (columns,): bool (n,)."""
    return np.asarray((costs <= cost).all(axis=1) & (costs < cost).any(axis=1))


def _beats(cost: Array, costs: Array) -> Array:
    """Which rows one row dominates."""
    return np.asarray((cost <= costs).all(axis=1) & (cost < costs).any(axis=1))
