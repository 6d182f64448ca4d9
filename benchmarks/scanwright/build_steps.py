"""When the steps of a build begin, for its progress bar, and how the time left behaves.

    uv run python -m benchmarks.scanwright.build_steps           # prints
    uv run python -m benchmarks.scanwright.build_steps --write   # and keeps the times as data of the program
    uv run python -m benchmarks.scanwright.build_steps --kept    # judges the kept times again

Builds `TASKS`, one after the other, and notes when each kind of step is reported first. The time left is the one that
the bar shows; its growth is the largest one between two steps of a build.
"""

from __future__ import annotations

import argparse
import csv
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import scanwright.pipeline
from scanwright.cli.console import ConsoleProgress
from scanwright.pipeline.build_steps import DONE, TABLE, kind_of, measured_builds, measured_shares, share_done

TASKS = ("ground_ahead", "low_cost", "indoor_urg")


def main() -> None:
    """Parse the command line, and measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--kept", action="store_true")
    given = parser.parse_args()
    builds = measured_builds() if given.kept else {task: begins_s(task) for task in TASKS}
    if given.write:
        with (Path(scanwright.pipeline.__file__).parent / TABLE).open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(("task", "step", "seconds"))
            writer.writerows((task, *row) for task, begins in builds.items() for row in begins.items())
        measured_shares.cache_clear()
    for task, begins in builds.items():
        lefts = times_left_s(begins)
        print(
            f"{task}: {begins[DONE]:.0f} s, {len(begins) - 1} kinds of steps; time left grows by at most "
            f"{growth(lefts):.0%} and is off by at most {off(begins, lefts):.0%} of the build"
        )


def begins_s(task: str) -> dict[str, float]:
    """Return kind of step -> seconds until a build first reports it."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "scanwright", "build", task, "--out", folder, "-v"]
        began, begins = time.monotonic(), dict[str, float]()
        with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as process:
            assert process.stderr is not None
            for line in process.stderr:
                if line.startswith("  .. "):
                    begins.setdefault(kind_of(line.removeprefix("  .. ")), round(time.monotonic() - began, 2))
        if process.returncode:
            raise SystemExit(f"{task}: the build ended with {process.returncode}")
        return begins | {DONE: round(time.monotonic() - began, 2)}


def times_left_s(begins: dict[str, float]) -> list[tuple[float, float]]:
    """Return when the bar is drawn in a build, and the time left that it shows then [s]."""
    now_s, shown = 0.0, []
    progress = ConsoleProgress(lambda: now_s)
    for step, begin_s in sorted(begins.items(), key=lambda pair: pair[1]):
        now_s = begin_s
        share = share_done(measured_shares(), step)
        left_s = None if share is None else progress.left_s(share)
        if left_s is not None and step != DONE:
            shown.append((begin_s, left_s))
    return shown


def growth(lefts: list[tuple[float, float]]) -> float:
    """Return the largest growth of the time left over an earlier one, as a share of it."""
    lowest, grown = float("inf"), 0.0
    for _, left_s in lefts:
        grown = max(grown, left_s / lowest - 1)
        lowest = min(lowest, left_s)
    return grown


def off(begins: dict[str, float], lefts: list[tuple[float, float]]) -> float:
    """Return the largest error of the time left, as a share of the build."""
    return max(abs(begins[DONE] - now_s - left_s) for now_s, left_s in lefts) / begins[DONE]


if __name__ == "__main__":
    main()
