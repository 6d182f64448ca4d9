"""Processor seconds of `optimise` for the shipped tasks: of this checkout, and of another one.

    uv run python -m benchmarks.design.optimise [TASK ...] [--other CHECKOUT] [--runs 3]

Both run in turn with the packages of this environment, each in a separate process; the first optimisation of a process
loads what is compiled and is not counted. A row has the lowest seconds of each checkout, and their ratio.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from scanwright.design.arrays import Array
from scanwright.design.task.task import shipped_tasks

ROOT = Path(__file__).parents[2]
PROGRAM = """
import sys, time
import scanwright
for _ in range(2):
    start = time.process_time()
    scanwright.optimise(sys.argv[1])
    seconds = time.process_time() - start
print(seconds)
"""


def processor_seconds(checkout: Path, task: str) -> float:
    """Run `optimise` of a task with the code of a checkout."""
    where = os.environ | {"PYTHONPATH": str(checkout)}
    run = [sys.executable, "-P", "-c", PROGRAM, task]
    return float(subprocess.run(run, check=True, capture_output=True, text=True, env=where).stdout)


def main() -> None:
    """Print a row per task, and the sums."""
    parser = argparse.ArgumentParser()
    parser.add_argument("tasks", nargs="*", default=shipped_tasks())
    parser.add_argument("--other", type=Path)
    parser.add_argument("--runs", type=int, default=3)
    asked = parser.parse_args()
    checkouts = [ROOT] if asked.other is None else [ROOT, asked.other]
    rows = []
    for task in asked.tasks:
        seconds = [[processor_seconds(checkout, task) for checkout in checkouts] for _ in range(asked.runs)]
        rows.append(np.min(seconds, axis=0))
        print(words(task, rows[-1]), flush=True)
    print(words("all", np.sum(rows, axis=0)))


def words(name: str, seconds: Array) -> str:
    """A row of the table."""
    ratio = f"{seconds[0] / seconds[1]:8.2f} times" if len(seconds) > 1 else ""
    return f"{name:20} {' '.join(f'{each:8.2f} s' for each in seconds)} {ratio}"


if __name__ == "__main__":
    main()
