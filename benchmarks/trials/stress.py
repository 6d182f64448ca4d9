"""Run all stiff and extreme cases, and write them to `out/accuracy/<task>/stress.csv`; exit code 1 if a case fails.

uv run python -m benchmarks.trials.stress [TASK]
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import astuple
from pathlib import Path

from benchmarks.trials.density_stress import as_turning, stress_rows
from benchmarks.trials.device_stress import range_rows, servo_rows
from scanwright.design.accuracy.trials import write_table
from scanwright.design.objective.problem import problem_of
from scanwright.design.task.task import load_task
from scanwright.firmware_io.emulators.servo_plant import plant_of


def main(words: list[str] | None = None) -> None:
    """Run all cases, and print and write them."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.trials.stress")
    parser.add_argument("task", nargs="?", type=Path, default=Path("uniform"))
    parser.add_argument("--out", type=Path, default=Path("out/accuracy"))
    asked = parser.parse_args(words)
    loaded = as_turning(load_task(asked.task))
    cases = stress_rows(loaded, problem_of(loaded)), servo_rows(plant_of(loaded.task.servo)), range_rows()
    rows = [row for some in cases for row in some]
    table = asked.out / loaded.task.name / "stress.csv"
    table.parent.mkdir(parents=True, exist_ok=True)
    header = ["case", "quantity", "expected", "got", "error", "allowed", "passed"]
    write_table(table, header, [[*astuple(row), row.passed] for row in rows])
    for row in rows:
        verdict = "ok  " if row.passed else "FAIL"
        print(f"{verdict} {row.case:58} {row.quantity:15} expected {row.expected:.8g}, off by {row.error:.1e}")
    passed = sum(row.passed for row in rows)
    print(f"{passed} of {len(rows)} passed; wrote {table}")
    sys.exit(passed < len(rows))


if __name__ == "__main__":
    main()
