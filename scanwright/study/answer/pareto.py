"""The front of a study: the rows that nothing beats, as they come."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from design.accuracy.front import dominators
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
        stays = ~dominators(-self.costs, -cost)
        self.costs = np.vstack([self.costs[stays], cost])
        self.numbers = np.append(self.numbers[stays], number)
        return True

    def beater(self, cost: Array) -> int | None:
        """The lowest number of a row that beats a cost, or the bound of one; None where none does."""
        beaten = dominators(self.costs, cost)
        return int(self.numbers[beaten].min()) if beaten.any() else None
