"""The estimated cost of a study, from the unit costs that `benchmarks/scanwright/study` measures."""

from __future__ import annotations

import csv
from collections import Counter
from pathlib import Path

from scanwright.design.progress import Progress
from scanwright.study.candidate import addresses
from scanwright.study.crossing import Crossing
from scanwright.study.results import Results
from scanwright.study.study import load_study

COSTS = Path(__file__).parent / "costs.csv"


def plan_study(study: Path, out: Path | None, results: Path | None, progress: Progress) -> list[str]:
    """Return the size and the remaining cost of a study as lines; computes and writes nothing.

    Arguments as for `scanwright.study.run.run_study`; the folder of results need not exist.

    Raises:
        TaskError: the study is malformed.
    """
    crossing = Crossing(load_study(study))
    stored = Results(results or (out or Path("out") / crossing.loaded.study.name) / "results", "")
    refused: Counter[str] = Counter()
    searches: set[str] = set()
    judged = 0
    for combination in crossing:
        if combination.number % 10_000 == 9_999:
            progress(f"counting {len(crossing):,} candidates", combination.number / len(crossing))
        if combination.loaded is None:
            refused[combination.refused] += 1
            continue
        search, at = addresses(combination.loaded)
        searches.add(search)
        judged += stored.has(at)
    searched = sum(map(stored.has, searches))
    left = {"search": len(searches) - searched, "candidate": len(crossing) - refused.total() - judged}
    cost = _unit_costs()
    mean_h, most_h = (sum(left[unit] * cost[unit][field] for unit in left) / 3600 for field in ("mean_s", "most_s"))
    return [
        f"{len(crossing):,} candidates, {refused.total():,} of them refused by their products",
        *(f"refused {count:,}: {reason}" for reason, count in sorted(refused.items())),
        f"{len(searches):,} different searches, {searched:,} in the results folder",
        f"at most {left['candidate'] + judged:,} candidates to make, {judged:,} in the results folder",
        f"at most {mean_h:.2f} core-hours, {most_h:.2f} if each needs the longest time measured",
        f"{max(of['memory_mb'] for of in cost.values()) / 1000:.1f} GB of memory per worker",
        *(
            f"measured: {unit} {of['mean_s']:.1f} core-seconds, {of['most_s']:.1f} the longest"
            for unit, of in cost.items()
        ),
    ]


def _unit_costs() -> dict[str, dict[str, float]]:
    """Return the committed costs of a search and of a candidate."""
    with COSTS.open(encoding="utf-8", newline="") as file:
        return {row.pop("unit"): {name: float(value) for name, value in row.items()} for row in csv.DictReader(file)}
