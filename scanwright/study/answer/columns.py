"""What a candidate is judged by: every column of a study's table that its Pareto front may name."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from design.frames import Array


@dataclass(frozen=True, slots=True)
class Column:
    """One number of a row. `better` tells which end wins; empty where it is not known, and then nothing is worse."""

    name: str
    better: Literal["low", "high"]
    what: str


COLUMNS = {
    column.name: column
    for column in (
        Column("J", "low", "the objective of the task, with what the parts hide"),
        Column("density_gain", "high", "times the beams per ball of the better standard alignment (objective log)"),
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


def tidy(value: float | None) -> float | None:
    """Six digits: the last bits depend on the machine and are no measurement."""
    return None if value is None else float(f"{value:.6g}") + 0.0


def costs(values: dict[str, float | None], names: Iterable[str]) -> Array:
    """Values of columns turned so that lower is better; what is not known is worst, shape (columns,)."""
    return np.array([_cost(values.get(name), name) for name in names])


def _cost(value: float | None, name: str) -> float:
    if value is None:
        return np.inf
    return value if COLUMNS[name].better == "low" else -value
