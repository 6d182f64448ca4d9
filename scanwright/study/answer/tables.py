"""The table of a study, `study.csv` and `study.parquet`: a row for every candidate, written as they come."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from design.atomic_file import whole_file
from design.errors import BuildError
from design.task.task import NAMES
from scanwright.study.answer.columns import COLUMNS
from scanwright.study.crossing import AXES

WORDS = ("name", *AXES, "status", "reason")
NUMBERS = tuple(f"{name}_deg" for name in NAMES) + tuple(COLUMNS) + ("J_error",)
FIELDS = (*WORDS, *NUMBERS, "weakest")
STATUSES = ("front", "built", "dominated", "refused", "failed")
"""On the front; made and beaten; left out, its bound is beaten; cannot be built, and why; could not be finished."""

GROUP = 10_000  # rows of a Parquet group, which is what is held in memory


def write_tables(folder: Path, rows: Iterable[dict[str, Any]]) -> Counter[str]:
    """Write both tables, whole or not at all; how many rows have each status.

    Raises:
        BuildError: they cannot be written.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    schema = pa.schema([(name, pa.float64() if name in NUMBERS else pa.string()) for name in FIELDS])
    statuses: Counter[str] = Counter()
    with (
        whole_file(folder / "study.csv", BuildError) as text,
        whole_file(folder / "study.parquet", BuildError) as table,
        text.open("w", encoding="utf-8", newline="") as file,
        pq.ParquetWriter(table, schema) as parquet,
    ):
        writer = csv.DictWriter(file, FIELDS, lineterminator="\n")
        writer.writeheader()
        for group in _groups(rows, GROUP):
            writer.writerows(group)
            statuses.update(row["status"] for row in group)
            whole = [{name: row.get(name) for name in FIELDS} for row in group]
            parquet.write_table(pa.Table.from_pylist(whole, schema))
    return statuses


def _groups(rows: Iterable[dict[str, Any]], size: int) -> Iterator[list[dict[str, Any]]]:
    """Rows in lists of a size, the last one shorter."""
    group: list[dict[str, Any]] = []
    for row in rows:
        group.append(row)
        if len(group) == size:
            yield group
            group = []
    if group:
        yield group
