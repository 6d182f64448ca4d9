"""`front.png`: trade-offs between columns, a row of panels for each task."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from scanwright.study.front import COLUMNS

DPI = 110  # readable on a screen at 100 %
MOST = 20_000  # rows that a picture shows
NAMED = 12  # members of a front that are labelled


def front_picture(path: Path, table: Path, title: str, front: tuple[str, ...]) -> int:
    """Draw the first column of the front against each other one from a CSV; return the number of rows not drawn."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from scanwright.design.files.picture_files import save_picture

    by_task: dict[str, list[dict[str, str]]] = {}
    shown = omitted = 0
    with table.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            rows = by_task.setdefault(row["task"], [])
            if row["status"] in ("front", "built"):
                shown += 1
                if shown <= MOST or row["status"] == "front":
                    rows.append(row)
                else:
                    omitted += 1
    others = front[1:] or ("period_s",)
    figure = Figure(figsize=(5.2 * len(others), 3.9 * max(1, len(by_task))), layout="constrained", dpi=DPI)
    FigureCanvasAgg(figure)
    axes = figure.subplots(max(1, len(by_task)), len(others), squeeze=False)
    for line, (task, rows) in zip(axes, by_task.items(), strict=False):
        for ax, other in zip(line, others, strict=True):
            _panel(ax, rows, front[0], other)
            ax.set_title(task, fontsize=10)
    figure.suptitle(title, fontsize=11)
    save_picture(figure, path, DPI)
    return omitted


def _panel(ax: Any, rows: list[dict[str, str]], across: str, up: str) -> None:
    """Draw one panel; its corner shows the number of rows without a value."""
    known = [row for row in rows if row[across] and row[up]]
    for status, colour, size, label in (("built", "#9aa5b1", 22, "built"), ("front", "#c8102e", 46, "front")):
        chosen = [row for row in known if row["status"] == status]
        if chosen:
            points = sorted(((float(row[across]), float(row[up])) for row in chosen), key=lambda point: point)
            ax.scatter(*zip(*points, strict=True), s=size, color=colour, label=label, zorder=2 + (status == "front"))
    values = [float(row[across]) for row in known]
    middle = (min(values) + max(values)) / 2 if known else 0.0
    for (x, y), names in list(_by_place(known, across, up).items())[:NAMED]:
        side = "right" if x > middle else "left"
        ax.annotate(names, (x, y), textcoords="offset points", xytext=(0, 6), fontsize=6.5, ha=side)
    ax.set_xlabel(_title(across))
    ax.set_ylabel(_title(up))
    ax.margins(0.18)
    ax.grid(alpha=0.3)
    if known:
        ax.legend(fontsize=7, loc="best")
    if len(known) < len(rows):
        text = f"{len(rows) - len(known)} of {len(rows)} without a known value"
        ax.text(0.02, 0.02, text, transform=ax.transAxes, fontsize=6.5, color="#555555")


def _by_place(rows: Iterable[dict[str, str]], across: str, up: str) -> dict[tuple[float, float], str]:
    """Return the names of the rows on the front by position."""
    places: dict[tuple[float, float], list[str]] = {}
    for row in rows:
        if row["status"] == "front":
            label = " ".join(filter(None, (row["sensor"], row["servo"], row["mounting"], row["period"])))
            labels = places.setdefault((float(row[across]), float(row[up])), [])
            if label not in labels:
                labels.append(label)
    return {place: " / ".join(labels) for place, labels in places.items()}


def _title(column: str) -> str:
    return f"{column} ({COLUMNS[column].better} is better)"
