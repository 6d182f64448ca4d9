"""Columns of candidates, and the Pareto front."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from scanwright.design.accuracy.front import dominators
from scanwright.design.arrays import Array


@dataclass(frozen=True, slots=True)
class Column:
    """One number of a row; `better` is the better direction."""

    name: str
    better: Literal["low", "high"]
    what: str


COLUMNS = {
    column.name: column
    for column in (
        Column("J", "low", "the objective of the task, with what the parts hide"),
        Column("density_gain", "high", "times the beams per ball of the best reference mount (objective log)"),
        Column("beams_per_ball", "high", "exp(-J) - 1, the geometric mean (objective log)"),
        Column("beams_per_ball_per_usd", "high", "the same over cost_usd: what a dollar sees"),
        Column("range_m", "high", "farthest that the lidar measures, as its maker states it"),
        Column("range_sigma_mm", "low", "noise of one range, one standard deviation"),
        Column("blind_fraction", "low", "of the unmasked sphere, with what turns in front of the laser"),
        Column("line_gap_deg", "low", "widest between neighbouring scan lines"),
        Column("period_s", "low", "time of one full scan"),
        Column("shortest_period_s", "low", "of a turn that still brings min_density (or 1 beam) to every ball"),
        Column("hidden_fraction", "low", "share of all beams that the parts hide"),
        Column("mass_g", "low", "of all of it, without screws and cables"),
        Column("load_margin", "high", "rating over load, of the load that comes nearest to its rating"),
        Column("deflection_deg", "low", "tilt of the scan plane by gravity, by finite elements"),
        Column("cost_usd", "low", "of what is bought, where every price is known; screws and wiring are not"),
    )
}


def six_digits(value: float | None) -> float | None:
    """Round to six digits: the last bits depend on the machine."""
    return None if value is None else float(f"{value:.6g}") + 0.0


def costs(values: dict[str, float | None], names: Iterable[str]) -> Array:
    """Return values of columns, negated if higher is better; unknown ones are infinite, shape (columns,)."""
    return np.array([_cost(values.get(name), name) for name in names])


def _cost(value: float | None, name: str) -> float:
    if value is None:
        return np.inf
    return value if COLUMNS[name].better == "low" else -value


@dataclass(slots=True)
class Front:
    """Rows that no other row beats, independent of their order."""

    columns: int
    costs: Array = field(init=False)  # lower is better, shape (rows, columns)
    numbers: Array = field(init=False)  # identifier of each row, shape (rows,)

    def __post_init__(self) -> None:
        self.costs, self.numbers = np.empty((0, self.columns)), np.empty(0, np.intp)

    def add(self, number: int, cost: Array) -> bool:
        """Add a row, and return whether it is on the front. Equal rows are kept, the same row once."""
        if number in self.numbers or self.beater(cost) is not None:
            return False
        stays = ~dominators(-self.costs, -cost)
        self.costs = np.vstack([self.costs[stays], cost])
        self.numbers = np.append(self.numbers[stays], number)
        return True

    def beater(self, cost: Array) -> int | None:
        """Return the lowest number of a row that beats a cost; None if none does."""
        beats = dominators(self.costs, cost)
        return int(self.numbers[beats].min()) if beats.any() else None
