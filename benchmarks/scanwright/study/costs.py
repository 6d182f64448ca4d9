"""What a search and a candidate cost: the table that `scanwright study --plan` reads."""

from __future__ import annotations

import csv
import resource
import time
from pathlib import Path

from scanwright.study.bench import judge_candidate
from scanwright.study.candidate import record_digest, search_candidate, search_record
from scanwright.study.crossing import Crossing
from scanwright.study.plan import COSTS
from scanwright.study.results import Result
from scanwright.study.study import load_study


def measure_costs(folder: Path, every: int) -> None:
    """Do searches and candidates of the shipped study in one process, and write the table that `--plan` reads."""
    crossing = Crossing(load_study(Path("fleet")))
    found: dict[str, Result] = {}
    seconds: dict[str, list[float]] = {"search": [], "candidate": []}
    memory_mb = {"search": 0.0, "candidate": 0.0}
    possible = [loaded for combination in crossing if (loaded := combination.loaded) is not None]
    for loaded in possible[::every]:
        record = search_record(loaded)
        key = record_digest(record)
        if key not in found:
            start = time.process_time()  # of all threads: core-seconds, whoever else is on the machine
            found[key] = search_candidate(record)
            seconds["search"].append(time.process_time() - start)
            memory_mb["search"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        if found[key]["status"] == "found":
            start = time.process_time()
            judge_candidate(loaded, found[key])
            seconds["candidate"].append(time.process_time() - start)
            memory_mb["candidate"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print({name: round(times[-1], 1) for name, times in seconds.items() if times}, loaded.task.name, flush=True)
    with (folder / COSTS.name).open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["unit", "measured", "mean_s", "most_s", "memory_mb"])
        for name, times in seconds.items():
            writer.writerow(
                [name, len(times), f"{sum(times) / len(times):.2f}", f"{max(times):.2f}", f"{memory_mb[name]:.0f}"]
            )
