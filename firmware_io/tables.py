"""CSV tables with a time and numbers in each line, by the names of their columns; errors raise RecordingError."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal, InvalidOperation
from pathlib import Path

from scanwright.design.errors import RecordingError, suggest
from scanwright.design.files.text_files import read_text
from scanwright.firmware_io.foreign import foreign

Row = tuple[int, Sequence[float]]
"""Time [ns], and the numbers of its line."""
_UNITS = re.compile(r"\s*\[.*?\]\s*$")
_EVER_NS = 2**63  # an int64 ends there, in 2262
_TIME_DIGITS = 20  # bound before the conversion of a decimal to an integer
_SECONDS = {"t", "time", "time_s", "timestamp", "timestamp_s", "stamp"}
_NANOSECONDS = {"time_ns", "timestamp_ns", "stamp_ns"}


def csv_rows(path: Path, columns: Mapping[str, set[str]]) -> Iterator[Row]:
    """Yield times and numbers of a CSV file whose first line names its columns.

    Args:
        path: of the file. Its time is in seconds, or in nanoseconds by the column's name or unit.
        columns: possible names of each column, in the order of the numbers.
    """
    lines = csv.reader(lines_of(path))
    header = [word.strip().lstrip("#").strip().lower() for word in next(lines, [])]
    names = [_UNITS.sub("", word) for word in header]
    places = [_column(path, names, name, known) for name, known in columns.items()]
    when = _column(path, names, "time", _SECONDS | _NANOSECONDS)
    digits = 0 if names[when] in _NANOSECONDS or "[ns]" in header[when] else 9
    for number, words in enumerate(lines, 2):
        if words:
            if len(words) < len(names):
                raise RecordingError(f"{path}:{number}: {len(words)} values, the header names {len(names)}")
            yield row_of(path, number, words[when], digits, [words[place] for place in places])


def row_of(path: Path, number: int, time: str, digits: int, values: list[str]) -> Row:
    """Convert the words of line `number`; the time is exact, with `digits` decimal places for nanoseconds."""
    try:
        # float64 rounds seconds since 1970 to 256 ns
        when = Decimal(time)
        if not when.is_finite():
            raise ValueError
        if when.adjusted() > _TIME_DIGITS or abs(when.scaleb(digits)) >= _EVER_NS:
            raise RecordingError(f"{path}:{number}: time {time[:40]}: a number of nanoseconds below 2^63")
        return int(when.scaleb(digits).to_integral_value()), [float(value) for value in values]
    except RecordingError:
        raise
    except (InvalidOperation, ValueError, OverflowError) as error:
        raise RecordingError(f"{path}:{number}: not a line of numbers: {time}, {', '.join(values)}") from error


def lines_of(path: Path) -> list[str]:
    """Return the lines of a text file."""
    return foreign(f"{path}: cannot read", read_text, path).splitlines()


def _column(path: Path, names: list[str], name: str, known: set[str]) -> int:
    columns = [column for column, heading in enumerate(names) if heading in known]
    if len(columns) != 1:
        hint = suggest(min(known), names) if len(known) == 1 else ""
        expected = f"the first line names {'one of ' if len(known) > 1 else ''}{', '.join(sorted(known))}{hint}"
        raise RecordingError(f"{path}: {len(columns)} columns for {name}: {expected}")
    return columns[0]
