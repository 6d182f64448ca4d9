"""The results of a study: `study.csv`, `study.parquet` and a summary."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import islice
from pathlib import Path
from typing import Any

from scanwright.design.errors import BuildError
from scanwright.design.files.atomic_file import atomic_write, place_in
from scanwright.design.task.angle_ranges import NAMES
from scanwright.study.crossing import AXES
from scanwright.study.front import COLUMNS, costs
from scanwright.study.front_picture import front_picture
from scanwright.study.study import Study

Row = dict[str, Any]
"""Values of one candidate by the names of `FIELDS`; unknown values are missing."""

NUMBERS = (*(f"{name}_deg" for name in NAMES), *COLUMNS, "J_error")
FIELDS = ("name", *AXES, "status", "reason", *NUMBERS, "weakest")
STATUSES = {
    "front": "on the front of their task",
    "built": "made and beaten",
    "dominated": "their bound is beaten",
    "refused": "cannot be built",
    "failed": "could not be finished",
}
GROUP = 10_000  # rows of a Parquet group, which are in memory at once
MOST_REASONS = 5  # reasons in the summary


def write_answer(study: Study, rows: Iterable[Row], folder: Path) -> list[str]:
    """Write the tables and `front.png`, and return a summary as lines.

    Raises:
        BuildError: they cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BuildError(f"{folder}: cannot write the study: {error.strerror}") from error
    front: list[Row] = []
    reasons: Counter[tuple[str, str]] = Counter()

    def noted() -> Iterator[Row]:
        for row in rows:
            if row["status"] == "front":
                front.append(row)
            elif row["status"] in ("refused", "failed"):
                reasons[row["status"], row["reason"]] += 1
            yield row

    statuses = write_tables(folder, noted())
    candidates = f"{statuses.total():,} candidates"
    title = f"{study.name}: {statuses['front']:,} of {candidates} on the front of their task"
    omitted = front_picture(place_in(folder, "front.png", BuildError), folder / "study.csv", title, study.front)
    shares = [f"{statuses[status]:,} {status} ({means})" for status, means in STATUSES.items() if statuses[status]]
    lines = [*_front_lines(front, study.front), f"{candidates}: {', '.join(shares)}"]
    lines += [f"{status} {count:,}: {reason}" for (status, reason), count in reasons.most_common(MOST_REASONS)]
    if len(reasons) > MOST_REASONS:
        lines.append(f"{len(reasons) - MOST_REASONS} more reasons in the table")
    if omitted:
        lines.append(f"front.png leaves out {omitted:,} rows that are not on a front: too many to see")
    return lines


def write_tables(folder: Path, rows: Iterable[Row]) -> Counter[str]:
    """Write both tables atomically, and return the number of rows of each status. No Parquet without pyarrow.

    Raises:
        BuildError: they cannot be written.
    """
    statuses: Counter[str] = Counter()
    with ExitStack() as open_files:
        text = open_files.enter_context(atomic_write(folder / "study.csv", BuildError))
        file = open_files.enter_context(text.open("w", encoding="utf-8", newline=""))
        add_group = open_files.enter_context(_parquet(folder / "study.parquet"))
        writer = csv.DictWriter(file, FIELDS, lineterminator="\n")
        writer.writeheader()
        for group in _groups(rows):
            writer.writerows(group)
            statuses.update(row["status"] for row in group)
            add_group(group)
    return statuses


@contextmanager
def _parquet(path: Path) -> Iterator[Callable[[list[Row]], None]]:
    """Yield a function that adds rows to a table; without pyarrow it does nothing, and an older table is removed."""
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        path.unlink(missing_ok=True)
        yield lambda _: None
        return
    schema = pa.schema([(name, pa.float64() if name in NUMBERS else pa.string()) for name in FIELDS])
    with atomic_write(path, BuildError) as part, pq.ParquetWriter(part, schema) as parquet:
        yield lambda rows: parquet.write_table(
            pa.Table.from_pylist([{name: row.get(name) for name in FIELDS} for row in rows], schema)
        )


def _groups(rows: Iterable[Row]) -> Iterator[list[Row]]:
    rows = iter(rows)
    while group := list(islice(rows, GROUP)):
        yield group


def _front_lines(rows: list[Row], columns: tuple[str, ...]) -> list[str]:
    """Return the front as lines of a table, sorted by task and first column."""
    if not rows:
        return ["no candidate could be built"]
    shown = list(dict.fromkeys([*columns, "period_s", "hidden_fraction", "load_margin"]))
    width = max(len(row["name"]) for row in rows)
    lines = [" " * width + "".join(f"  {name:>15}" for name in shown)]
    for row in sorted(rows, key=lambda row: (row["task"], float(costs(row, columns[:1])[0]), row["name"])):
        numbers = ("?" if row.get(name) is None else f"{row[name]:,.6g}" for name in shown)
        lines.append(f"{row['name']:{width}}" + "".join(f"  {number:>15}" for number in numbers))
    return lines
