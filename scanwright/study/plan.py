"""What a study would cost, before it runs: from the unit costs that `benchmarks/scanwright/study` has measured."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from scanwright.study.candidate import digest, search_record
from scanwright.study.crossing import Crossing
from scanwright.study.runner.identity import address
from scanwright.study.runner.store import Store
from scanwright.study.session import addresses

COSTS = Path(__file__).parent / "costs.csv"


@dataclass(frozen=True, slots=True)
class UnitCost:
    """Core-seconds of one unit, mean and longest, and the memory of its worker."""

    mean_s: float
    most_s: float
    memory_mb: float


@dataclass(frozen=True, slots=True)
class Plan:
    """Counts of a study, and what is left to do of it.

    Attributes:
        candidates: all of them.
        refused: of them by their products, with the reasons and how many each.
        searches: different ones.
        searched: of them in the results folder.
        judged: candidates in the results folder.
    """

    candidates: int
    refused: dict[str, int]
    searches: int
    searched: int
    judged: int

    def lines(self) -> list[str]:
        """What a person wants to know."""
        costs = unit_costs()
        left = self.searches - self.searched
        most = self.candidates - sum(self.refused.values()) - self.judged
        hours = [
            (left * getattr(costs["search"], field) + most * getattr(costs["candidate"], field)) / 3600
            for field in ("mean_s", "most_s")
        ]
        memory = max(cost.memory_mb for cost in costs.values()) / 1000
        told = [f"{self.candidates:,} candidates, {sum(self.refused.values()):,} of them refused by their products"]
        told += [f"refused {count:,}: {reason}" for reason, count in sorted(self.refused.items())]
        told += [
            f"{self.searches:,} different searches, {self.searched:,} in the results folder",
            f"at most {most + self.judged:,} candidates to make, {self.judged:,} in the results folder",
            f"at most {hours[0]:.2f} core-hours, {hours[1]:.2f} if each takes as long as the longest ever measured",
            f"{memory:.1f} GB of memory per worker",
            *(
                f"measured: {name} {cost.mean_s:.1f} core-seconds, {cost.most_s:.1f} the longest"
                for name, cost in costs.items()
            ),
        ]
        return told


def plan_of(crossing: Crossing, results: Path, say: Callable[[str], None]) -> Plan:
    """Count a study; nothing is computed, and nothing written: `results` may not even exist."""
    store = Store(results, "")
    refused: dict[str, int] = {}
    searches: set[str] = set()
    judged = 0
    for combination in crossing:
        if combination.number % 10_000 == 9_999:
            say(f"counting: {combination.number + 1:,} of {len(crossing):,} ({combination.number / len(crossing):.0%})")
        loaded = combination.loaded
        if loaded is None:
            refused[combination.refused] = refused.get(combination.refused, 0) + 1
            continue
        searches.add(digest(search_record(loaded)))
        judged += store.has(addresses(loaded)[1])
    searched = sum(store.has(address("search", each)) for each in searches)
    return Plan(len(crossing), refused, len(searches), searched, judged)


def unit_costs() -> dict[str, UnitCost]:
    """The committed table: what a search and a candidate cost on the computer that it was measured on."""
    with COSTS.open(encoding="utf-8", newline="") as file:
        return {
            row["unit"]: UnitCost(float(row["mean_s"]), float(row["most_s"]), float(row["memory_mb"]))
            for row in csv.DictReader(file)
        }
