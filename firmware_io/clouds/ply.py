"""PLY, binary little endian: one `vertex` element of scalar columns; shape, pose and start of a cloud as comments.

Format: G. Turk, "The PLY polygon file format" (1994). Written by ourselves, because the usual library is GPL. It holds
everything but integers of 64 bits.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack
from itertools import takewhile
from pathlib import Path
from types import TracebackType

import numpy as np
from jaxtyping import Float64
from numpy import ndarray
from numpy.typing import NDArray

from design.atomic_file import whole_file
from design.errors import RecordingError
from firmware_io.clouds.cloud import Cloud, cloud_from_rows, cloud_rows, headlines
from firmware_io.foreign import foreign

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


class PlyWriter:
    """Writes rows as they come; use it in a `with` statement. The file appears only when that ends well.

    The header's number of rows is filled in at the end: nothing has to be known before, nothing is kept.

    Raises:
        RecordingError: the file cannot be written.
    """

    def __init__(self, path: Path, fields: np.dtype[np.void], comments: Iterable[str]) -> None:
        """`fields` is a structured type of little-endian scalars."""
        self._path = path
        self._fields = fields
        self._comments = [line for comment in comments for line in comment.splitlines()]
        self._rows = 0
        self._stack = ExitStack()

    def __enter__(self) -> PlyWriter:
        with ExitStack() as stack:
            part = stack.enter_context(whole_file(self._path, RecordingError))
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
        self._rows += rows.size

    def _finish(
        self, kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        if kind is None:
            self._stream.seek(0)
            self._stream.write(self._header())

    def _header(self) -> bytes:
        # A last comment gives back what the number takes, so that the header's length never changes.
        filler = "-" * (_DIGITS - len(str(self._rows)))
        columns = [f"property {_WORDS[self._fields[name].str]} {name}" for name in self._fields.names or ()]
        lines = [
            "ply",
            "format binary_little_endian 1.0",
            *(f"comment {comment}" for comment in self._comments),
            f"comment {filler}",
            f"element vertex {self._rows}",
            *columns,
            "end_header",
        ]
        return ("\n".join(lines) + "\n").encode("ascii", "replace")


def write_points(path: Path, points_m: Float64[ndarray, "n 3"], comments: Iterable[str] = ()) -> None:
    """Write bare points (n, 3) as a cloud of x y z.

    Raises:
        RecordingError: the file cannot be written, or is no .ply.
    """
    if path.suffix != ".ply":
        raise RecordingError(f"{path}: clouds are written as PLY; name it {path.with_suffix('.ply').name}")
    fields = np.dtype([(axis, "<f4") for axis in "xyz"])
    rows = np.empty(len(points_m), fields)
    for column, axis in enumerate("xyz"):
        rows[axis] = points_m[:, column]
    with PlyWriter(path, fields, comments) as cloud:
        cloud.write(rows)


def ply_comments(path: Path) -> list[str]:
    """The comments in the header of a cloud that `read_ply` reads, without the filler."""
    with foreign(f"{path}: cannot read", path.open, "rb") as stream:
        lines = iter(stream.readline, b"")
        words = [line.decode("ascii", "replace").strip() for line in takewhile(_in_header, lines)]
    comments = [line.removeprefix("comment ") for line in words if line.startswith("comment ")]
    return [comment for comment in comments if comment.strip("-")]


def _in_header(line: bytes) -> bool:
    return line.strip() != b"end_header"


def read_ply(path: Path) -> NDArray[np.void]:
    """Rows of a cloud such as `PlyWriter` writes, shape (n,), read only and mapped: columns are loaded when touched.

    Raises:
        RecordingError: the file is missing, cut off, or another kind of PLY.
    """
    with foreign(f"{path}: cannot read", path.open, "rb") as stream:
        if stream.readline().strip() != b"ply":
            raise RecordingError(f"{path}: not a PLY file")
        fields: list[tuple[str, str]] = []
        rows = -1
        while (line := stream.readline()).strip() != b"end_header":
            match line.decode("ascii", "replace").split():
                case ["format", kind, *_] if kind != "binary_little_endian":
                    raise RecordingError(f"{path}: PLY format {kind}; only binary_little_endian is read")
                case ["element", "vertex", number] if rows < 0 and number.isdigit():
                    rows = int(number)
                case ["property", word, name] if word in _TYPES and rows >= 0:
                    fields.append((name, _TYPES[word]))
                case ["format" | "comment" | "obj_info", *_]:
                    pass
                case _:
                    shown = line.decode("ascii", "replace").strip() or "end of file"
                    raise RecordingError(f"{path}: not a cloud of scalar columns: '{shown}' in the header")
        start = stream.tell()
    layout = np.dtype(fields)
    size = path.stat().st_size
    if rows < 1 or size < start + rows * layout.itemsize:
        raise RecordingError(
            f"{path}: {max(rows, 0)} rows of {layout.itemsize} bytes announced, {size - start} bytes there"
        )
    return np.memmap(path, layout, "r", start, (rows,))


def read(path: Path) -> tuple[list[Cloud], list[str]]:
    """The cloud of a file."""
    return [cloud_from_rows(read_ply(path), ply_comments(path))], []


def write(path: Path, cloud: Cloud) -> list[str]:
    """Write a cloud; lines about what the file does not hold."""
    rows = cloud_rows(cloud)
    wide = [name for name in rows.dtype.names or () if rows.dtype[name].kind in "iu" and rows.dtype[name].itemsize == 8]
    kinds = [(name, "<f8" if name in wide else rows.dtype[name].str) for name in rows.dtype.names or ()]
    with PlyWriter(path, np.dtype(kinds), [*headlines(cloud), "x y z in m"]) as stream:
        stream.write(rows.astype(kinds))
    return [f"PLY has no 64-bit integers: {name} is written as double" for name in wide]
