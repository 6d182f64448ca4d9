"""PLY, binary little endian: one `vertex` element of scalar columns; shape, pose and start of a cloud as comments.

Format: G. Turk, "The PLY polygon file format" (1994). Written by ourselves, because the usual library is GPL. It holds
everything but integers of 64 bits.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import numpy as np
from jaxtyping import Float64
from numpy import ndarray
from numpy.typing import NDArray

from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import atomic_write, check_place
from scanwright.firmware_io.clouds.cloud import Cloud, cloud_from_rows, cloud_rows, headlines
from scanwright.firmware_io.foreign import foreign

_WORDS = {
    "|i1": "char",
    "|u1": "uchar",
    "<i2": "short",
    "<u2": "ushort",
    "<i4": "int",
    "<u4": "uint",
    "<f4": "float",
    "<f8": "double",
}
_TYPES = {word: code for code, word in _WORDS.items()}
_DIGITS = 20
_LONGEST_HEADER = 1 << 20


class PlyWriter:
    """Writes rows as they come; use it in a `with` statement. The file appears only when that ends well.

    The header's number of rows is filled in at the end: nothing has to be known before, nothing is kept.

    Attributes:
        rows: written so far.

    Raises:
        RecordingError: the file cannot be written.
    """

    def __init__(self, path: Path, fields: np.dtype[np.void], comments: Iterable[str]) -> None:
        """`fields` is a structured type of little-endian scalars."""
        self._path = path
        self._fields = fields
        self._comments = [line for comment in comments for line in comment.splitlines()]
        self.rows = 0
        self._stack = ExitStack()

    def __enter__(self) -> PlyWriter:
        with ExitStack() as stack:
            part = stack.enter_context(atomic_write(self._path, RecordingError))
            self._stream = stack.enter_context(foreign(f"{self._path}: cannot write", part.open, "wb"))
            self._stream.write(self._header())
            stack.push(self._finish)
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.__exit__(kind, error, trace)

    def write(self, rows: NDArray[np.void]) -> None:
        """Append rows of the writer's fields, any shape."""
        if rows.dtype != self._fields:
            raise ValueError(f"rows of {rows.dtype}, the file holds {self._fields}")
        self._stream.write(np.ascontiguousarray(rows).data)
        self.rows += rows.size

    def _finish(
        self, kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        if kind is None:
            self._stream.seek(0)
            self._stream.write(self._header())

    def _header(self) -> bytes:
        # A last comment gives back what the number takes, so that the header's length never changes.
        filler = "-" * (_DIGITS - len(str(self.rows)))
        columns = [f"property {_WORDS[self._fields[name].str]} {name}" for name in self._fields.names or ()]
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


def write_points(path: Path, points_m: Float64[ndarray, "n 3"], comments: Iterable[str] = ()) -> None:
    """Write bare points (n, 3) as a cloud of x y z.

    Raises:
        RecordingError: the file cannot be written, or is no .ply.
    """
    check_place(path, RecordingError)
    if path.suffix != ".ply":
        raise RecordingError(f"{path}: clouds are written as PLY; name it {path.with_suffix('.ply').name}")
    fields = np.dtype([(axis, "<f4") for axis in "xyz"])
    rows = np.empty(len(points_m), fields)
    for column, axis in enumerate("xyz"):
        rows[axis] = points_m[:, column]
    with PlyWriter(path, fields, comments) as cloud:
        cloud.write(rows)


@dataclass(frozen=True, slots=True)
class PlyHeader:
    """What the header of a cloud says, checked against the file.

    Attributes:
        fields: of a row; x y z among them, all floats.
        rows: at least 1, and all there.
        comments: without the filler.
        start: where the rows begin.
    """

    fields: np.dtype[np.void]
    rows: int
    comments: tuple[str, ...]
    start: int

    @property
    def width(self) -> int:
        """Rows of a scan of an organised cloud, 0 of a flat one."""
        sizes = dict(words for line in self.comments if len(words := line.split()) == 2 and words[1].isdigit())
        width, height = int(sizes.get("width", 0)), int(sizes.get("height", 0))
        return width if height > 1 and width * height == self.rows else 0


def read_header(path: Path) -> PlyHeader:
    """The header of a cloud such as `PlyWriter` writes.

    Raises:
        RecordingError: the file is missing, cut off, or another kind of PLY.
    """
    with foreign(f"{path}: cannot read", path.open, "rb") as stream:
        text = foreign(f"{path}: cannot read", stream.read, _LONGEST_HEADER)
    end = re.search(rb"^end_header\r?\n", text, re.MULTILINE)
    lines = text[: end.start() if end else len(text)].decode("ascii", "replace").splitlines()
    if not lines or lines[0].strip() != "ply":
        raise RecordingError(f"{path}: not a PLY file")
    fields: list[tuple[str, str]] = []
    rows = -1
    for line in lines[1:]:
        match line.split():
            case ["format", kind, *_] if kind != "binary_little_endian":
                raise RecordingError(f"{path}: PLY format {kind}; only binary_little_endian is read")
            case ["element", "vertex", number] if rows < 0 and number.isdecimal() and len(number) <= _DIGITS:
                rows = int(number)
            case ["property", word, name] if word in _TYPES and rows >= 0:
                fields.append((name, _TYPES[word]))
            case ["format" | "comment" | "obj_info", *_]:
                pass
            case _:
                raise RecordingError(f"{path}: not a cloud of scalar columns: '{line.strip()[:80]}' in the header")
    if not end:
        raise RecordingError(f"{path}: no 'end_header' in the first {len(text):,} bytes")
    names = [name for name, _ in fields]
    if twice := [name for k, name in enumerate(names) if name in names[:k]]:
        raise RecordingError(f"{path}: property {twice[0]} stands twice in the header")
    kinds = dict(fields)
    if not all(kinds.get(axis, "") in ("<f4", "<f8") for axis in "xyz"):
        raise RecordingError(f"{path}: the columns are {' '.join(names)[:200]}; a cloud has x y z, float or double")
    layout = np.dtype(fields)
    start, size = end.end(), path.stat().st_size
    if rows < 1 or size < start + rows * layout.itemsize:
        raise RecordingError(
            f"{path}: {max(rows, 0)} rows of {layout.itemsize} bytes announced, {size - start} bytes there"
        )
    comments = [line.removeprefix("comment ") for line in lines if line.startswith("comment ")]
    return PlyHeader(layout, rows, tuple(comment for comment in comments if comment.strip("-")), start)


def read_ply(path: Path) -> NDArray[np.void]:
    """Rows of a cloud such as `PlyWriter` writes, shape (n,), read only and mapped: columns are loaded when touched.

    Raises:
        RecordingError: as for `read_header`.
    """
    header = read_header(path)
    return np.memmap(path, header.fields, "r", header.start, (header.rows,))


def read(path: Path) -> tuple[list[Cloud], list[str]]:
    """The cloud of a file."""
    return [cloud_from_rows(read_ply(path), read_header(path).comments)], []


def write(path: Path, cloud: Cloud) -> list[str]:
    """Write a cloud; lines about what the file does not hold."""
    rows = cloud_rows(cloud)
    wide = [name for name in rows.dtype.names or () if rows.dtype[name].kind in "iu" and rows.dtype[name].itemsize == 8]
    kinds = [(name, "<f8" if name in wide else rows.dtype[name].str) for name in rows.dtype.names or ()]
    with PlyWriter(path, np.dtype(kinds), [*headlines(cloud), "x y z in m"]) as stream:
        stream.write(rows.astype(kinds))
    return [f"PLY has no 64-bit integers: {name} is written as double" for name in wide]
