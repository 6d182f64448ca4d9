"""Error against run time of numerical choices: one record, its table and its picture."""

from __future__ import annotations

import csv
import math
import platform
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from matplotlib.figure import Figure

from scanwright.design.accuracy.front import dominators
from scanwright.design.concurrency.processes import cores
from scanwright.design.errors import BuildError
from scanwright.design.files.atomic_file import atomic_write
from scanwright.design.files.picture_files import save_picture

T = TypeVar("T")
CPUINFO = Path("/proc/cpuinfo")
REPEATS = 3  # timed runs after a warm-up
ROW = 3  # diagrams in one row; more form a square
MARKS = "osD^vP*X"
RING: dict[str, Any] = {"markersize": 15, "markerfacecolor": "none", "markeredgecolor": "black"}
GREYS = ("#000000", "#1f77b4", "#8a8a8a", "#d95f02", "#1b9e77", "#7570b3", "#a6761d", "#e7298a")


@dataclass(frozen=True, slots=True)
class Trial:
    """One method with one value of its parameter."""

    choice: str  # the choice, such as "mesh of a part"
    method: str  # its name
    setting: str  # the parameter and its value
    error: float  # against a separate reference; 0 if below the error of that
    unit: str  # of the error
    seconds: tuple[float, ...]  # of the repeats, shortest to longest
    size: str = ""  # other costs, as text
    chosen: bool = False  # whether the program uses it

    @property
    def median_s(self) -> float:
        """Median of the repeats [s]."""
        return float(np.median(self.seconds))


def this_machine() -> str:
    """Return processor, usable cores, system and Python."""
    lines = CPUINFO.read_text().splitlines() if CPUINFO.exists() else []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    processor = named[0] if named else platform.processor() or "unnamed processor"
    system = f"{platform.system()} {platform.machine()}, Python {platform.python_version()}"
    return f"{processor}, {cores()} cores, {system}"


def timed(work: Callable[[], T]) -> tuple[T, tuple[float, ...]]:
    """Return the result of `work` and the seconds of its repeats, shortest first, after a warm-up."""
    result = work()
    seconds = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - start)
    return result, tuple(sorted(seconds))


def best_trials(trials: Sequence[Trial]) -> list[bool]:
    """Return whether no other trial of the same choice dominates it in time and error."""
    costs = np.array([(trial.median_s, trial.error) for trial in trials])
    choices = np.array([trial.choice for trial in trials])
    return [not dominators(costs[choices == choice], cost).any() for choice, cost in zip(choices, costs, strict=True)]


def write_trials(path: Path, trials: Sequence[Trial]) -> None:
    """Write one row per trial."""
    header = "choice method setting error unit seconds_median seconds_min seconds_max size on_front chosen"
    rows = []
    for t, best in zip(trials, best_trials(trials), strict=True):
        seconds = [f"{s:.4g}" for s in (t.median_s, t.seconds[0], t.seconds[-1])]
        marks = [str(best).lower(), str(t.chosen).lower()]
        rows.append([t.choice, t.method, t.setting, f"{t.error:.4g}", t.unit, *seconds, t.size, *marks])
    write_table(path, header.split(), rows)


def write_table(path: Path, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Write a CSV file."""
    with atomic_write(path, BuildError) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)


def trials_picture(path: Path, trials: Sequence[Trial]) -> None:
    """Draw a diagram for each choice: error against median seconds, with a ring about the chosen one."""
    choices = list(dict.fromkeys(trial.choice for trial in trials))
    columns = len(choices) if len(choices) <= ROW else math.ceil(math.sqrt(len(choices)))
    rows = -(-len(choices) // columns)
    figure = Figure(figsize=(5.4 * columns, 5 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for empty in axes[len(choices) :]:
        empty.remove()
    for axis, choice in zip(axes, choices, strict=False):
        here = [trial for trial in trials if trial.choice == choice]
        floor = min((t.error for t in here if t.error > 0), default=1e-16) / 3
        for i, method in enumerate(dict.fromkeys(trial.method for trial in here)):
            of_method = [trial for trial in here if trial.method == method]
            x, y = [t.median_s for t in of_method], [max(t.error, floor) for t in of_method]
            axis.plot(x, y, marker=MARKS[i % 8], color=GREYS[i % 8], label=method, linewidth=1.2, markersize=6)
            for trial, at in zip(of_method, zip(x, y, strict=True), strict=True):
                axis.annotate(trial.setting, at, textcoords="offset points", xytext=(5, 4), fontsize=6.5)
        for trial in here:
            if trial.chosen:
                axis.plot([trial.median_s], [max(trial.error, floor)], "o", label="chosen", **RING)
        axis.set(xscale="log", yscale="log", xlabel="run time, median [s]", ylabel=f"error [{here[0].unit}]")
        axis.set_title(choice, fontsize=11)
        axis.grid(which="major", color="#dddddd", linewidth=0.6)
        axis.margins(0.15)
        axis.legend(fontsize=8)
    figure.suptitle(this_machine(), fontsize=9)
    save_picture(figure, path)


def report_trials(trials: Sequence[Trial], folder: Path, name: str) -> list[str]:
    """Write their table and picture under a name; return lines."""
    folder.mkdir(parents=True, exist_ok=True)
    write_trials(folder / f"{name}.csv", trials)
    trials_picture(folder / f"{name}.png", trials)
    lines = [this_machine()]
    for trial, best in zip(trials, best_trials(trials), strict=True):
        mark = "=" if trial.chosen else "*" if best else " "
        method = f"{trial.method}, {trial.setting}"
        price = f"{trial.error:.1e} {trial.unit:11} {trial.median_s:.4f} s {trial.size}"
        lines.append(f"{mark} {trial.choice:26} {method:50} {price}")
    return [*lines, f"= chosen, * nothing is both faster and nearer; wrote {name}.csv and .png to {folder}"]
