"""The files of the accuracy report: work-precision diagram, its table, and the stress table."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from scanwright.design.accuracy.machine import this_machine
from scanwright.design.accuracy.search_trials import search_trials
from scanwright.design.accuracy.stress import StressRow, as_turning, stress_rows
from scanwright.design.accuracy.trials import GREYS, MARKS, RING, report_trials, write_table
from scanwright.design.accuracy.work_precision import MethodsMeasured, best_points, measure_methods
from scanwright.design.evaluation.picture_files import save_picture
from scanwright.design.motion import Shortest
from scanwright.design.objective.problem import problem_of
from scanwright.design.objective.stated_error import error_words
from scanwright.design.progress import Progress
from scanwright.design.search.optimum import find_optimum
from scanwright.design.task.task import LoadedTask


def write_method_points(path: Path, measured: MethodsMeasured) -> None:
    """Write one row per method and parameter; cells are empty if it failed, with the reason in `failed`."""
    header = "method setting J J_error J_error_median argmin_error_deg seconds_median seconds_min seconds_max peak_MB"
    rows = []
    for point, front in zip(measured.points, best_points(measured.points, measured.floor), strict=True):
        seconds = point.seconds or (np.nan,)
        numbers = [point.J, point.J_error, point.J_error_median, point.argmin_error_deg]
        numbers += [point.median_s if point.seconds else np.nan, min(seconds), max(seconds), point.peak_mb]
        cells = ["" if np.isnan(n) else f"{n:.6g}" for n in numbers]
        marks = [str(front).lower(), str(point.chosen).lower()]
        rows.append([point.method, point.setting, *cells, *marks, point.failed])
    write_table(path, [*header.split(), "on_front", "chosen", "failed"], rows)


def work_precision_picture(path: Path, measured: MethodsMeasured, title: str) -> None:
    """Draw the worst error against median seconds, one curve per method; a thin line goes down to the median."""
    figure = Figure(figsize=(9, 6), layout="constrained")
    axis = figure.subplots()
    floor, points = max(measured.floor, 1e-16), measured.points
    methods = list(dict.fromkeys(point.method for point in points))
    for i, method in enumerate(methods):
        mine = [p for p in points if p.method == method and p.seconds]
        seconds = [p.median_s for p in mine]
        error = [max(p.J_error, floor) for p in mine]
        axis.vlines(seconds, [max(p.J_error_median, floor) for p in mine], error, color=GREYS[i % 8], linewidth=0.5)
        axis.plot(seconds, error, marker=MARKS[i % 8], color=GREYS[i % 8], label=method, linewidth=1.2, markersize=6)
        for s, e, p in zip(seconds, error, mine, strict=True):
            axis.annotate(p.setting.split()[0], (s, e), textcoords="offset points", xytext=(4, 4), fontsize=6.5)
    for p in points:
        if p.chosen:
            axis.plot([p.median_s], [max(p.J_error, floor)], "o", label="chosen", **RING)
    for method in methods:
        if failed := next((p.failed for p in points if p.method == method and p.failed), ""):
            axis.plot([], [], " ", label=f"{method}: {failed}")
    count = len(measured.truths)
    label = "error of J" if count == 1 else f"error of J, the worst of {count} settings (thin: to the median)"
    axis.axhline(floor, color="#888888", linestyle=":", linewidth=1)
    axis.annotate("error of the reference", (1, floor), xycoords=("axes fraction", "data"), ha="right", va="bottom")
    axis.set(xscale="log", yscale="log", xlabel="run time, median [s]", ylabel=label)
    axis.grid(which="major", color="#dddddd", linewidth=0.6)
    axis.legend(fontsize=8)
    axis.set_title(f"{title}\n{this_machine()}", fontsize=10)
    save_picture(figure, path)


@dataclass(frozen=True, slots=True)
class StressReport:
    """Results of the stiff and extreme cases as lines, and whether all passed."""

    lines: tuple[str, ...]
    passed: bool


def report_stress(loaded: LoadedTask, folder: Path, progress: Progress, more: Iterable[StressRow] = ()) -> StressReport:
    """Run the stiff and extreme cases on a task, add the rows `more`, and write `stress.csv`.

    Raises:
        TaskError: no direction has a weight.
    """
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
    return StressReport((*lines, end), failed == 0)


def report_precision(loaded: LoadedTask, folder: Path, progress: Progress) -> list[str]:
    """Measure every method to compute J at the optimum of a task; write `work_precision.csv` and `.png`; return lines.

    Raises:
        TaskError: no direction has a weight, or no setting meets the limits.
    """
    optimum = find_optimum(loaded, progress)
    measured = measure_methods(loaded, optimum.problem, optimum.search.best[0].angles_rad, progress)
    points, truth = measured.points, measured.truths[0]
    folder.mkdir(parents=True, exist_ok=True)
    write_method_points(folder / "work_precision.csv", measured)
    work_precision_picture(folder / "work_precision.png", measured, f"{loaded.task.name}: {optimum.title}")
    lines = [
        this_machine(),
        f"reference J = {truth.J:.9f} +- {error_words(truth.J, truth.J_error)}; the worst and the median error of "
        f"{len(measured.truths)} settings, this one and others of its ranges; times of this one",
    ]
    for point, front in zip(points, best_points(points, measured.floor), strict=True):
        seconds = f"{point.median_s:.4f} s" if point.seconds else point.failed
        mark = "=" if point.chosen else "*" if front else " "
        error = f"{point.J_error:.1e} {point.J_error_median:.1e}"
        lines.append(f"{mark} {point.method:24} {point.setting:16} error {error}  {seconds}")
    return [*lines, f"= chosen, * nothing is both faster and nearer; wrote work_precision.csv and .png to {folder}"]


def report_search(loaded: LoadedTask, folder: Path, progress: Progress) -> list[str]:
    """Measure cost and result of a search; write `search.csv` and `search.png`; return lines.

    Raises:
        TaskError: the period is to be found, and no setting meets the limits.
    """
    fixed = find_optimum(loaded, progress).loaded if isinstance(loaded.task.motion, Shortest) else loaded
    return report_trials(list(search_trials(fixed, progress)), folder, "search")
