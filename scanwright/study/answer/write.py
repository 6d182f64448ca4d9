"""What a study came to: its files, and the lines for a person."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from design.errors import BuildError
from scanwright.study.answer.columns import COLUMNS
from scanwright.study.answer.pictures import front_picture
from scanwright.study.answer.tables import STATUSES, write_tables
from scanwright.study.session import Counts, Row, Session

MOST_REASONS = 5
MEANS = {
    "front": "on the front of their task",
    "built": "made and beaten",
    "dominated": "their bound is beaten",
    "refused": "cannot be built",
    "failed": "could not be finished",
}


def write_answer(session: Session, folder: Path) -> list[str]:
    """Write `study.csv`, `study.parquet` and `front.png`; what they say in short.

    Raises:
        BuildError: they cannot be written.
    """
    study = session.crossing.loaded.study
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BuildError(f"{folder}: cannot write the study: {error.strerror}") from error
    front: list[Row] = []
    reasons: Counter[tuple[str, str]] = Counter()

    def noted() -> Iterator[Row]:
        for row in session.rows():
            if row["status"] == "front":
                front.append(row)
            elif row["status"] in ("refused", "failed"):
                reasons[row["status"], row["reason"]] += 1
            yield row

    statuses = write_tables(folder, noted())
    candidates = f"{len(session.crossing):,} candidates"
    title = f"{study.name}: {statuses['front']:,} of {candidates} on the front of their task"
    left = front_picture(folder / "front.png", folder / "study.csv", title, study.front)
    told = [*_front_lines(front, study.front), f"{candidates}: " + ", ".join(_shares(statuses))]
    for (status, reason), count in reasons.most_common(MOST_REASONS):
        told.append(f"{status} {count:,}: {reason}")
    if len(reasons) > MOST_REASONS:
        told.append(f"{len(reasons) - MOST_REASONS} more reasons in the table")
    if left:
        told.append(f"front.png leaves out {left:,} rows that are not on a front: too many to see")
    return [*told, _run_line(session.counts)]


def _shares(statuses: Counter[str]) -> list[str]:
    return [f"{statuses[status]:,} {status} ({MEANS[status]})" for status in STATUSES if statuses[status]]


def _run_line(counts: Counts) -> str:
    worked = f", {counts.seconds:,.0f} s of work, {counts.memory_mb:,.0f} MB the most of a worker"
    return (
        f"this run: {counts.searches:,} searches, {counts.judged:,} candidates made, {counts.looked_up:,} looked up, "
        f"{counts.beaten:,} beaten before they were made{worked if counts.seconds else ''}"
    )


def _front_lines(rows: list[Row], columns: tuple[str, ...]) -> list[str]:
    """The front as a table for a terminal, candidates of equal numbers one after the other."""
    if not rows:
        return ["no candidate could be built"]
    shown = list(dict.fromkeys([*columns, "period_s", "hidden_fraction", "load_margin"]))
    width = max(len(row["name"]) for row in rows)
    lines = [" " * width + "".join(f"  {name:>15}" for name in shown)]
    best = COLUMNS[columns[0]].better == "high"
    order = sorted(rows, key=lambda row: (row["task"], _rank(row, columns[0], best), row["name"]))
    for row in order:
        lines.append(f"{row['name']:{width}}" + "".join(f"  {_number(row.get(name)):>15}" for name in shown))
    return lines


def _rank(row: Row, column: str, high: bool) -> float:
    value: Any = row.get(column)
    return float("inf") if value is None else -value if high else value


def _number(value: float | None) -> str:
    return "?" if value is None else f"{value:,.6g}"
