"""The files of the accuracy report: errors against run times of methods and of searches, and the stress table."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import astuple
from pathlib import Path

from scanwright.design.accuracy.search_trials import search_trials
from scanwright.design.accuracy.stress import StressRow, as_turning, stress_rows
from scanwright.design.accuracy.trials import report_trials, write_table
from scanwright.design.accuracy.work_precision import measure_methods
from scanwright.design.motion import Shortest
from scanwright.design.objective.problem import problem_of
from scanwright.design.objective.stated_error import error_words
from scanwright.design.progress import Progress
from scanwright.design.search.optimum import find_optimum
from scanwright.design.task.task import LoadedTask


def report_stress(
    loaded: LoadedTask, folder: Path, progress: Progress, more: Iterable[StressRow] = ()
) -> tuple[list[str], bool]:
    """Run the stiff cases on a task, add `more`, and write `stress.csv`; return lines, and whether all passed."""
    progress("stiff and extreme cases")
    loaded = as_turning(loaded)
    rows = [*stress_rows(loaded, problem_of(loaded)), *more]
    folder.mkdir(parents=True, exist_ok=True)
    header = ["case", "quantity", "expected", "got", "error", "allowed", "passed"]
    write_table(folder / "stress.csv", header, [[*astuple(row), row.passed] for row in rows])
    failed = sum(not row.passed for row in rows)
    lines = [
        f"{'ok  ' if row.passed else 'FAIL'} {row.case:58} {row.quantity:15} expected {row.expected:.8g}, "
        f"off by {row.error:.1e}"
        for row in rows
    ]
    end = f"{len(rows) - failed} of {len(rows)} passed; wrote {folder / 'stress.csv'}"
    return [*lines, end], failed == 0


def report_precision(loaded: LoadedTask, folder: Path, progress: Progress) -> list[str]:
    """Measure every method to compute J at the optimum of a task; write `work_precision.csv` and `.png`; return lines.

    Raises:
        TaskError: no direction has a weight, or no setting meets the limits.
    """
    optimum = find_optimum(loaded, progress)
    measured = measure_methods(loaded, optimum.problem, optimum.search.best[0].angles_rad, progress)
    truth = measured.truths[0]
    return [
        f"reference J = {truth.J:.9f} +- {error_words(truth.J, truth.J_error)}; errors: the worst of "
        f"{len(measured.truths)} settings, this one and others of its ranges; times of this one",
        *report_trials(measured.trials, folder, "work_precision"),
        *measured.failed,
    ]


def report_search(loaded: LoadedTask, folder: Path, progress: Progress) -> list[str]:
    """Measure cost and result of a search; write `search.csv` and `search.png`; return lines.

    Raises:
        TaskError: the period is to be found, and no setting meets the limits.
    """
    fixed = find_optimum(loaded, progress).loaded if isinstance(loaded.task.motion, Shortest) else loaded
    return report_trials(list(search_trials(fixed, progress)), folder, "search")
