"""Text clouds (xyz, txt, asc, csv, pts), one point per line; names, types, shape, pose and start are comments.

A first line of words names the columns; without it the first three are x y z. Separators are spaces, tabs, commas or
semicolons. Decimal commas are read only on request, since `1,5,2,5` may be two numbers or four. Unusable input raises
RecordingError.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import count, islice
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from scanwright.design.arrays import Floats
from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import atomic_write
from scanwright.design.files.text_files import read_text
from scanwright.firmware_io.clouds.cloud import Cloud, Column, as_type, cloud_rows, headlines, with_header
from scanwright.firmware_io.clouds.parts import CloudSurvey, Parts
from scanwright.firmware_io.foreign import foreign, of_file

_DIGITS = {"<f4": "%.9g", "<f8": "%.17g"}  # the fewest for an exact round trip
_TYPES = {"|i1", "|u1", *(f"<{kind}{size}" for kind in "iu" for size in (2, 4, 8)), *_DIGITS}
_COMMENTS = ("#", "//", "!")
_ALIASES = {"r": "red", "g": "green", "b": "blue", "a": "alpha", "i": "intensity"} | {
    f"points{mark}{k}": axis
    for k, axis in enumerate("xyz")
    for mark in ":_"  # ParaView
}
_UNIT = re.compile(r"([xyz])[ _]?[\[(]?(mm|cm|m|meters?|metres?|ft|feet)[\])]?$")
_PTS = {4: ("intensity",), 6: ("red", "green", "blue"), 7: ("intensity", "red", "green", "blue")}  # Leica, after x y z
_AXES = ("x", "y", "z")
_HEAD = 1000  # lines that show the columns of a large file
_AMBIGUOUS = 6  # numbers without a point, separated by commas: three with a decimal comma, or as many integers
_DECIMAL_COMMA = "a decimal comma, or a comma between numbers? For the first, convert it with decimal_comma = true"
_COMMA_INSIDE = re.compile(rb"(?<=\d),(?=\d)")


@dataclass(frozen=True, slots=True)
class _Layout:
    """How the numbers of a file are separated and named."""

    first: int  # index of the first line of numbers
    separator: str | None
    count: int  # of the columns
    names: tuple[str, ...]
    announced: int | None  # number of points by the first line
    comments: tuple[str, ...] = ()
    numeric: tuple[int, ...] = ()  # columns that are numbers
    every: bool = False  # whether all columns are, also for the reader

    @property
    def used(self) -> tuple[int, ...] | None:
        """The columns to read; None for all."""
        return None if self.every else self.numeric


def read(path: Path) -> tuple[list[Cloud], list[str]]:
    """Read the cloud of a file of three or more numbers a line."""
    lines = foreign(f"{path}: cannot read", read_text, path).splitlines()
    layout = _survey_lines(path, lines)
    values = read_numbers(path, islice(lines, layout.first, None), layout.first + 1, layout.separator, layout.used)
    if layout.announced is not None and layout.announced != len(values):
        raise RecordingError(f"{path}: line 1 announces {layout.announced} points, {len(values)} are there")
    cloud = _cloud(path, layout, values)
    if not cloud.valid.any():
        raise RecordingError(f"{path}: none of the {len(values)} lines is a point")
    return [cloud], _notes(path, layout)


def parts(path: Path, rows: int) -> Parts | None:
    """Return the cloud of a file in parts of `rows` lines; None if it is organised. The first lines define columns."""
    with foreign(f"{path}: cannot read", path.open, encoding="utf-8-sig") as stream:
        lines = [line.rstrip("\n") for line in islice(stream, _HEAD)]
    layout = _survey_lines(path, lines)
    if any(line.split()[:1] == ["height"] for line in layout.comments):
        return None

    def again() -> Iterator[Cloud]:
        read = 0
        with foreign(f"{path}: cannot read", path.open, encoding="utf-8-sig") as stream:
            body = islice(stream, layout.first, None)
            first: Cloud | None = None
            for begin in count(layout.first + 1, rows):
                some = list(islice(body, rows))
                if not any(line.strip() and not line.startswith(_COMMENTS) for line in some):
                    break
                values = read_numbers(path, some, begin, layout.separator, layout.used)
                read += len(values)
                cloud = _cloud(path, layout, values)
                first = first or cloud
                yield _like(path, cloud, first)
        if layout.announced is not None and layout.announced != read:
            raise RecordingError(f"{path}: line 1 announces {layout.announced} points, {read} are there")

    return Parts((again,), tuple(_notes(path, layout)))


def _like(path: Path, cloud: Cloud, first: Cloud) -> Cloud:
    """Return a part with its columns as in the first one."""
    with of_file(path):
        columns = {name: as_type(values, first.columns[name].dtype) for name, values in cloud.columns.items()}
    return Cloud(cloud.points_m, columns, cloud.shape, cloud.T_world_cloud, cloud.start_ns)


def _survey_lines(path: Path, lines: Sequence[str]) -> _Layout:
    """Return the layout of a file that begins with these lines."""
    comments = tuple(line.lstrip("#/! ") for line in lines if line.startswith(_COMMENTS))
    layout = _layout(path, lines, comments)
    words = split(lines[layout.first], layout.separator)
    numeric = tuple(k for k in range(layout.count) if _is_number(words[k]))
    for axis in _AXES:
        if axis not in layout.names:
            raise RecordingError(f"{path}: the columns are {' '.join(layout.names)[:200]}; a cloud has x y z")
        if (k := layout.names.index(axis)) not in numeric:
            raise RecordingError(f"{path}: line {layout.first + 1}: {words[k][:40]!a} is not a number")
    every = len(numeric) == layout.count == len(lines[layout.first].strip().split(layout.separator))
    return replace(layout, comments=comments, numeric=numeric, every=every)


def _cloud(path: Path, layout: _Layout, values: Floats) -> Cloud:
    comments = layout.comments
    typed = [words[1:] for line in comments if len(words := line.split()) == layout.count + 1 and words[0] == "types"]
    types = typed[0] if typed else ["<f8"] * layout.count
    columns = {
        layout.names[k]: _typed(path, layout.names[k], values[:, j], types[k]) for j, k in enumerate(layout.numeric)
    }
    points = [columns.pop(axis) for axis in _AXES]
    if any(column.dtype.kind != "f" for column in points):
        raise RecordingError(f"{path}: types: x y z must be floats")
    points_m: NDArray[np.floating] = np.stack(points, axis=1)
    return with_header(Cloud(points_m, columns if typed else columns | _colours(columns)), comments)


def _notes(path: Path, layout: _Layout) -> list[str]:
    dropped = [name for k, name in enumerate(layout.names) if k not in layout.numeric]
    notes = [f"dropped of {path}, as they are no numbers: {', '.join(dropped)}"] if dropped else []
    if any(name.startswith("column_") for name in layout.names):
        notes.append(f"columns 4 to {layout.count} have no name in {path}")
    return notes


def _layout(path: Path, lines: Sequence[str], comments: Sequence[str]) -> _Layout:
    """Find the first line of numbers, how they are separated, and what names the columns."""
    rows = [k for k, line in enumerate(lines) if line.strip() and not line.startswith(_COMMENTS)]
    announced = None
    if len(rows) > 1 and lines[rows[0]].strip().isdecimal():
        announced = int(lines[rows.pop(0)][:20])
    titles = [k for k in rows[:1] if not any(map(_is_number, re.split(r"[\s,;]+", lines[k].strip())))]
    rows = rows[len(titles) :]
    if not rows:
        raise RecordingError(f"{path}: no line of numbers")
    line = lines[rows[0]]
    separator = _separator(f"{path}: line {rows[0] + 1}", line)
    count = len(split(line, separator))
    if count < len(_AXES):
        raise RecordingError(f"{path}: line {rows[0] + 1}: {count} numbers; a cloud has x y z at least")
    titled = [split(lines[k], separator) for k in titles]
    titled = [words if len(words) == count else re.split(r"[\s,;]+", " ".join(words)) for words in titled]
    named = [_named(path, [word.strip("\"'") for word in words]) for words in titled]
    if named and len(named[0]) != count:
        hint = f": {_DECIMAL_COMMA}" if separator == "," else ""
        raise RecordingError(f"{path}: line {titles[0] + 1} names {len(named[0])} columns, the next has {count}{hint}")
    named += [words for line in comments if len(words := _words(line)) == count and set(_AXES) <= set(words)]
    if not named and separator == "," and count >= _AMBIGUOUS and "." not in line:
        raise RecordingError(f"{path}: line {rows[0] + 1}: {line.strip()[:60]!a}: {_DECIMAL_COMMA}")
    further = [f"column_{k}" for k in range(4, count + 1)]
    if announced is not None or path.suffix.lower() == ".pts":
        further = list(_PTS.get(count, further))
    names = named[0] if named else [*_AXES, *further]
    if twice := [name for k, name in enumerate(names) if name in names[:k]]:
        raise RecordingError(f"{path}: column {twice[0]} is named twice")
    return _Layout(rows[0], separator, count, tuple(names), announced)


def _separator(place: str, line: str) -> str | None:
    """Return the separator of a line of numbers, None for spaces; RecordingError for a decimal comma."""
    words = line.split(";") if ";" in line else line.split()
    if "," in line and len(words) > 2 and not line.split(",")[1][:1].isspace():
        raise RecordingError(f"{place}: {line.strip()[:60]!a}: {_DECIMAL_COMMA}")
    return ";" if ";" in line else "," if "," in line else None


def split(line: str, separator: str | None) -> list[str]:
    """Return the words of a line without the quotes around them and without an empty last one."""
    words = [word.strip().strip("\"'") for word in line.strip().split(separator)]
    return words[:-1] if words and not words[-1] else words


def _words(line: str) -> list[str]:
    """Return the names in a comment."""
    return [_ALIASES.get(word, word) for word in re.split(r"[\s,;]+", line.strip().lower())]


def _named(path: Path, words: Sequence[str]) -> list[str]:
    names = []
    for word in map(str.lower, words):
        unit = _UNIT.match(word)
        if (unit and not unit[2].startswith("m")) or (unit and unit[2] == "mm"):
            raise RecordingError(f"{path}: column '{word}': coordinates must be in m")
        names.append(unit[1] if unit else _ALIASES.get(word, word.replace(" ", "_") or "column"))
    return names


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _typed(path: Path, name: str, values: Floats, kind: str) -> Column:
    if kind not in _TYPES:
        raise RecordingError(f"{path}: types: {name} is {kind[:40]}: {', '.join(sorted(_TYPES))}")
    try:
        return as_type(values, kind)
    except RecordingError as error:
        raise RecordingError(f"{path}: column {name}: {error}") from error


def _colours(columns: dict[str, Column]) -> dict[str, Column]:
    """Return the colours as bytes if all are integers up to 255."""
    names = [name for name in ("red", "green", "blue", "alpha") if name in columns]
    values = [columns[name] for name in names]
    if any(((value < 0) | (value > 255) | (value % 1 != 0)).any() for value in values):
        return {}
    return {name: value.astype(np.uint8) for name, value in zip(names, values, strict=True)}


def read_numbers(
    path: Path, lines: Iterable[str], place: int, separator: str | None = None, columns: Sequence[int] | None = None
) -> Floats:
    """Read the numbers of lines but comments and empty ones, shape (rows, columns).

    `place`: number of the first line in the file, for errors; `columns`: indices of the words to read, None for all,
    whose number must be constant.
    """
    last = [place - 1, ""]

    def rows() -> Iterator[str]:
        for last[0], last[1] in enumerate(lines, place):
            if str(last[1]).strip() and not str(last[1]).startswith(_COMMENTS):
                yield str(last[1]).replace('"', "")

    try:
        return np.loadtxt(rows(), delimiter=separator, usecols=columns, ndmin=2, comments=None)
    except ValueError as error:
        changed = str(error).startswith("the number of columns")
        why = str(error).split(" at row ")[0].split(";")[0] if changed else "not numbers"
        if separator != "," and _COMMA_INSIDE.search(str(last[1]).encode()):
            why += f": {_DECIMAL_COMMA}"
        raise RecordingError(f"{path}: line {last[0]}: {str(last[1]).strip()[:60]!a}: {why}") from error


@contextmanager
def decimal_points(path: Path) -> Iterator[Path]:
    """Yield a copy of a text file that has points for its decimal commas; errors name the file itself."""
    with TemporaryDirectory() as folder:
        copy = Path(folder, path.name)
        with foreign(f"{path}: cannot read", path.open, "rb") as source, copy.open("wb") as out:
            for line in source:
                if b"\0" in line:
                    raise RecordingError(f"{path}: decimal_comma: not a text file")
                out.write(_COMMA_INSIDE.sub(b".", line))
        try:
            yield copy
        except RecordingError as error:
            raise RecordingError(str(error).replace(str(copy), str(path))) from error


def write(path: Path, cloud: Cloud) -> list[str]:
    """Write a cloud."""
    return _write(path, cloud, [cloud])


def write_parts(path: Path, known: CloudSurvey, parts: Iterable[Cloud]) -> list[str]:
    """Write a flat cloud part by part."""
    return _write(path, known.head, parts)


def _write(path: Path, head: Cloud, parts: Iterable[Cloud]) -> list[str]:
    fields = cloud_rows(head.select(np.empty(0, np.int64))).dtype
    names = fields.names or ()
    kinds = [fields[name].str for name in names]
    header = [" ".join(names), "types " + " ".join(kinds), *headlines(head)]
    with atomic_write(path, RecordingError) as place, foreign(f"{path}: cannot write", place.open, "w") as stream:
        stream.writelines(f"# {line}\n" for line in header)
        for part in parts:
            np.savetxt(stream, cloud_rows(part), [_DIGITS.get(kind, "%d") for kind in kinds])
    return []
