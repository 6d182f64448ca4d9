"""PLY: written binary little endian, with shape, pose and start of a cloud as comments; read in all encodings.

Format: G. Turk, "The PLY polygon file format" (1994), without integers of 64 bits. Unusable input raises
RecordingError.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import atomic_write
from scanwright.firmware_io.clouds.cloud import Cloud, as_type, cloud_from_rows, cloud_rows, headlines
from scanwright.firmware_io.clouds.parts import CloudSurvey, Parts
from scanwright.firmware_io.clouds.text import read_numbers
from scanwright.firmware_io.foreign import foreign, of_file

_WORDS = {
    "i1": "char",
    "u1": "uchar",
    "i2": "short",
    "u2": "ushort",
    "i4": "int",
    "u4": "uint",
    "f4": "float",
    "f8": "double",
}
_SIZED = {"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"}
_TYPES = {word: code for code, word in _WORDS.items()} | _SIZED | {"float32": "f4", "float64": "f8"}
_DIGITS = 20  # of a count: an int64 has 19
_LONGEST_HEADER = 1 << 20  # bytes: thousands of comments


@contextmanager
def ply_writer(path: Path, fields: np.dtype[np.void], comments: Iterable[str]) -> Iterator[PlyRows]:
    """Write rows of a structured type of little-endian scalars; the file gets its name after the body ends well.

    The number of rows in the header is written at the end.
    """
    with atomic_write(path, RecordingError) as part, foreign(f"{path}: cannot write", part.open, "wb") as stream:
        rows = PlyRows(stream, fields, [line for comment in comments for line in comment.splitlines()])
        yield rows
        stream.seek(0)
        stream.write(rows.header())


class PlyRows:
    """Writer of rows to a stream, with their number in the header."""

    def __init__(self, stream: IO[bytes], fields: np.dtype[np.void], comments: Sequence[str]) -> None:
        self._stream, self._fields, self._comments = stream, fields, comments
        self.rows = 0  # written so far
        stream.write(self.header())

    def write(self, rows: NDArray[np.void]) -> None:
        """Append rows of the writer's fields, any shape."""
        if rows.dtype != self._fields:
            raise ValueError(f"rows of {rows.dtype}, the file holds {self._fields}")
        self._stream.write(np.ascontiguousarray(rows).data)
        self.rows += rows.size

    def header(self) -> bytes:
        """Return the header, whose length is constant."""
        # The last comment compensates the length of the number.
        filler = "-" * (_DIGITS - len(str(self.rows)))
        columns = [f"property {_WORDS[self._fields[name].str[1:]]} {name}" for name in self._fields.names or ()]
        lines = [
            "ply",
            "format binary_little_endian 1.0",
            *(f"comment {comment}" for comment in self._comments),
            f"comment {filler}",
            f"element vertex {self.rows}",
            *columns,
            "end_header",
        ]
        return ("\n".join(lines) + "\n").encode("ascii", "replace")


@dataclass(frozen=True, slots=True)
class PlyElement:
    """One element of a header: name, number of rows, and type of each property; of a list those of length and item."""

    name: str
    rows: int
    properties: dict[str, str | tuple[str, str]]

    @property
    def lists(self) -> bool:
        """Whether a property is a list, so that rows differ in length."""
        return any(isinstance(kind, tuple) for kind in self.properties.values())

    def fields(self, order: str) -> np.dtype[np.void]:
        """Return the type of a row without lists in a byte order, `<` or `>`."""
        return np.dtype([(name, order + str(kind)) for name, kind in self.properties.items()])


@dataclass(frozen=True, slots=True)
class PlyHeader:
    """The header of a PLY file."""

    form: str  # ascii, binary_little_endian or binary_big_endian
    elements: tuple[PlyElement, ...]  # in the order of the file; one is `vertex`, with x y z
    comments: tuple[str, ...]  # without the filler
    start: int  # byte after the header
    lines: int  # of the header

    @property
    def vertex(self) -> PlyElement:
        """The points."""
        return next(element for element in self.elements if element.name == "vertex")

    @property
    def width(self) -> int:
        """Rows of a scan of an organised cloud, 0 of a flat one."""
        sizes = dict(words for line in self.comments if len(words := line.split()) == 2 and words[1].isdigit())
        width, height = int(sizes.get("width", 0)), int(sizes.get("height", 0))
        return width if height > 1 and width * height == self.vertex.rows else 0


def read_header(path: Path) -> PlyHeader:
    """Read the header of any PLY file with a cloud."""
    with foreign(f"{path}: cannot read", path.open, "rb") as stream:
        text = foreign(f"{path}: cannot read", stream.read, _LONGEST_HEADER)
    end = re.search(rb"^end_header[ \t]*(\r\n|\n|\r)", text, re.MULTILINE) or re.search(rb"\rend_header(\r)", text)
    lines = text[: end.start() if end else len(text)].decode("ascii", "replace").splitlines()
    if not lines or lines[0].strip() != "ply":
        raise RecordingError(f"{path}: not a PLY file")
    form, elements = "", list[PlyElement]()
    for number, line in enumerate(lines[1:], 2):
        match line.split():
            case ["format", ("ascii" | "binary_little_endian" | "binary_big_endian") as form, *_]:
                pass
            case ["element", name, count] if count.isdecimal() and len(count) <= _DIGITS:
                elements.append(PlyElement(name, int(count), {}))
            case ["property", kind, name] if kind in _TYPES and elements and _key(name) not in elements[-1].properties:
                elements[-1].properties[_key(name)] = _TYPES[kind]
            case ["property", "list", length, kind, name] if (
                _TYPES.get(length, "f")[0] in "iu" and kind in _TYPES and elements
            ):
                elements[-1].properties[name] = _TYPES[length], _TYPES[kind]
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise RecordingError(
                    f"{path}: line {number}: '{line.strip()[:80]}': unknown type, or a name given twice"
                )
    if not end or not form:
        raise RecordingError(f"{path}: no '{'format' if end else 'end_header'}' in the first {len(text):,} bytes")
    comments = [line.strip().removeprefix("comment ") for line in lines if line.startswith("comment ")]
    shown = tuple(comment for comment in comments if comment.strip("-"))
    header = PlyHeader(form, tuple(elements), shown, end.end(), len(lines) + 1)
    if not any(element.name == "vertex" for element in elements):
        raise RecordingError(f"{path}: no element vertex: {', '.join(element.name for element in elements)[:200]}")
    if header.vertex.lists or not {*"xyz"} <= set(header.vertex.properties):
        names = " ".join(header.vertex.properties)[:200]
        raise RecordingError(f"{path}: the properties of vertex are {names}; a cloud has x y z and no lists")
    if not header.vertex.rows:
        raise RecordingError(f"{path}: element vertex has 0 rows")
    return header


def _key(name: str) -> str:
    return name.lower() if name in ("X", "Y", "Z") else name


def parts(path: Path, rows: int) -> Parts | None:
    """Return the cloud of a file in parts of so many rows; None if it has rows and columns."""
    header = read_header(path)
    if header.width:
        return None

    def again() -> Iterator[Cloud]:
        return (cloud_from_rows(some, header.comments) for some in _chunks(path, header, rows))

    return Parts((again,), tuple(_notes(path, header)))


def _chunks(path: Path, header: PlyHeader, rows: int) -> Iterator[NDArray[np.void]]:
    """Read the rows of a cloud, so many at a time, without mapping the file: mapped pages count as memory."""
    vertex = header.vertex
    first = header.lines + sum(element.rows for element in header.elements[: header.elements.index(vertex)])
    if header.form == "ascii":
        with path.open(encoding="ascii", errors="replace") as stream:
            lines = islice(stream, first, first + vertex.rows)
            for begin in range(0, vertex.rows, rows):
                count = min(rows, vertex.rows - begin)
                yield _typed_rows(path, header, islice(lines, count), first + begin + 1, count)
        return
    start, fields = _body(path, header)
    with path.open("rb") as stream:
        stream.seek(start)
        for begin in range(0, vertex.rows, rows):
            yield np.fromfile(stream, fields, min(rows, vertex.rows - begin))


def read_ply(path: Path) -> NDArray[np.void]:
    """Read the rows of a cloud, shape (n,); binary ones are mapped: columns are loaded when touched."""
    header = read_header(path)
    if header.form == "ascii":
        return next(_chunks(path, header, header.vertex.rows))
    start, fields = _body(path, header)
    return np.memmap(path, fields, "r", start, (header.vertex.rows,))


def _body(path: Path, header: PlyHeader) -> tuple[int, np.dtype[np.void]]:
    """Return the byte where the rows of a binary cloud begin, and their type."""
    vertex = header.vertex
    order = "<" if header.form == "binary_little_endian" else ">"
    fields = vertex.fields(order)
    start, size = header.start, path.stat().st_size
    for element in header.elements[: header.elements.index(vertex)]:
        start = _end_of(path, element, start, order)
    if size < start + vertex.rows * fields.itemsize:
        raise RecordingError(
            f"{path}: {vertex.rows} rows of {fields.itemsize} bytes announced, {size - start} bytes there"
        )
    return start, fields


def _end_of(path: Path, element: PlyElement, start: int, order: str) -> int:
    """Return the byte after an element of a binary file that begins at `start`."""
    if not element.lists:
        return start + element.rows * element.fields(order).itemsize
    with path.open("rb") as stream:
        stream.seek(start)
        for row in range(element.rows):
            for kind in element.properties.values():
                if isinstance(kind, str):
                    stream.seek(np.dtype(kind).itemsize, 1)
                    continue
                data = stream.read(np.dtype(kind[0]).itemsize)
                if len(data) < np.dtype(kind[0]).itemsize:
                    raise RecordingError(f"{path}: cut off in row {row} of {element.name}")
                count = int(np.frombuffer(data, order + kind[0])[0])
                if count < 0:
                    raise RecordingError(f"{path}: row {row} of {element.name}: a list of {count}")
                stream.seek(count * np.dtype(kind[1]).itemsize, 1)
        return stream.tell()


def _typed_rows(path: Path, header: PlyHeader, lines: Iterable[str], place: int, count: int) -> NDArray[np.void]:
    """Read rows of a text file, each as its header types it; `place` is the number of the first line."""
    properties, fields = header.vertex.properties, header.vertex.fields("<")
    values = read_numbers(path, lines, place)
    if values.shape != (count, len(properties)):
        raise RecordingError(
            f"{path}: {header.vertex.rows} rows of {len(properties)} numbers announced, "
            f"{values.shape[0]} of {values.shape[1]} there"
        )
    rows = np.empty(count, fields)
    for k, name in enumerate(properties):
        with of_file(path):
            rows[name] = as_type(values[:, k], fields[name])
    return rows


def read(path: Path) -> tuple[list[Cloud], list[str]]:
    """Read the cloud of a file; other elements than `vertex` are skipped and named."""
    header = read_header(path)
    return [cloud_from_rows(read_ply(path), header.comments)], _notes(path, header)


def _notes(path: Path, header: PlyHeader) -> list[str]:
    skipped = [
        f"{element.rows:,} of {element.name}"
        for element in header.elements
        if element.rows and element.name != "vertex"
    ]
    return [f"dropped of {path}: {', '.join(skipped)}"] if skipped else []


def write(path: Path, cloud: Cloud) -> list[str]:
    """Write a cloud; return notes of dropped data."""
    return _write(path, cloud, [cloud])


def write_parts(path: Path, known: CloudSurvey, parts: Iterable[Cloud]) -> list[str]:
    """Write a flat cloud part by part."""
    return _write(path, known.head, parts)


def _write(path: Path, head: Cloud, parts: Iterable[Cloud]) -> list[str]:
    fields = cloud_rows(head.select(np.empty(0, np.int64))).dtype
    wide = [name for name in fields.names or () if fields[name].kind in "iu" and fields[name].itemsize == 8]
    kinds = [(name, "<f8" if name in wide else fields[name].str) for name in fields.names or ()]
    with ply_writer(path, np.dtype(kinds), [*headlines(head), "x y z in m"]) as stream:
        for part in parts:
            stream.write(cloud_rows(part).astype(kinds))
    return [f"PLY has no 64-bit integers: {name} is written as double" for name in wide]
