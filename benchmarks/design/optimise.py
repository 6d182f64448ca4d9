"""Processor seconds of `optimise` for the shipped tasks: of this checkout, and of others by their Python interpreters.

    uv run python -m benchmarks.design.optimise [TASK ...] [--other PYTHON ...]

Each task runs in a separate process, checkout by checkout, twice: the first run loads what is compiled and is not
counted.
"""

from __future__ import annotations

import argparse
import subprocess
import sys

import numpy as np

from scanwright.design.task.task import shipped_tasks

PROGRAM = """
import sys, time
import scanwright
for _ in range(2):
    start = time.process_time()
    scanwright.optimise(sys.argv[1])
    seconds = time.process_time() - start
print(seconds)
"""


def processor_seconds(python: str, task: str) -> float:
    """Run `optimise` of a task with the interpreter of a checkout."""
    return float(subprocess.run([python, "-P", "-c", PROGRAM, task], check=True, capture_output=True, text=True).stdout)


def main() -> None:
    """Print a row per task, and the sums."""
    parser = argparse.ArgumentParser()
    parser.add_argument("tasks", nargs="*", default=shipped_tasks())
    parser.add_argument("--other", action="append", default=[])
    asked = parser.parse_args()
    pythons = [sys.executable, *asked.other]
    rows = []
    for task in asked.tasks:
        rows.append([processor_seconds(python, task) for python in pythons])
        print(f"{task:20}", *(f"{seconds:8.2f} s" for seconds in rows[-1]), flush=True)
    print(f"{'all':20}", *(f"{seconds:8.2f} s" for seconds in np.sum(rows, axis=0)))


if __name__ == "__main__":
    main()
