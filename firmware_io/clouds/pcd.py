"""PCD 0.5 to 0.7 of the Point Cloud Library; the start of the times is a comment.

Format: https://pointclouds.org/documentation/tutorials/pcd_file_format.html. Read here, since pypcd4 fails on older
versions and on padding.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import lzf
import numpy as np
from numpy.lib import recfunctions
from numpy.typing import NDArray
from pypcd4.pypcd4 import Encoding, PointCloud

from scanwright.design.arrays import Pose
from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import atomic_write
from scanwright.firmware_io.clouds.cloud import (
    Cloud,
    as_type,
    cloud_from_rows,
    cloud_rows,
    headlines,
    pose_matrix,
    pose_numbers,
)
from scanwright.firmware_io.clouds.parts import CloudSurvey, Parts
from scanwright.firmware_io.clouds.text import read_numbers
from scanwright.firmware_io.foreign import foreign, of_file

_LONGEST_HEADER = 1 << 16  # bytes: hundreds of fields
_DIGITS = 16  # of a count
_MOST_PACKED = 100  # above the compression ratio of LZF, 264 bytes in 3
_KINDS = {"<f4", "<f8", *(f"<{kind}{size}" for kind in "iu" for size in (1, 2, 4, 8))}
_PADDING = "_ "  # begin of the names of columns without a meaning; those of fields have no spaces
_AT_ORIGIN = ("0", "0", "0", "1", "0", "0", "0")


def read(path: Path) -> tuple[list[Cloud], list[str]]:
    """Read the cloud of a file, whether ascii, binary or binary_compressed; padding (fields named `_`) is skipped."""
    header = _header(path)
    if header.encoding == "binary_compressed":
        body = foreign(f"{path}: cannot read", path.read_bytes)[header.start :]
        rows = _from_columns(path, _unpacked_bytes(path, body), header)
    else:
        rows = next(_chunks(path, header, header.rows))
    return [_cloud(rows, header, header.shape)], []


def parts(path: Path, rows: int) -> Parts | None:
    """Return the cloud of a file in parts of so many rows; None if it has rows and columns, or is compressed as one."""
    header = _header(path)
    if header.encoding == "binary_compressed" or header.shape[0] > 1:
        return None
    return Parts((lambda: (_cloud(some, header, (1, some.size)) for some in _chunks(path, header, rows)),))


def _cloud(rows: NDArray[np.void], header: PcdHeader, shape: tuple[int, int]) -> Cloud:
    named = rows[[name for name, _ in header.columns if not name.startswith(_PADDING)]]
    cloud = cloud_from_rows(_unpacked(named), header.comments)
    return Cloud(cloud.points_m, cloud.columns, shape, header.T_world_cloud, cloud.start_ns)


def _chunks(path: Path, header: PcdHeader, rows: int) -> Iterator[NDArray[np.void]]:
    """Read the rows of an ascii or binary cloud, so many at a time."""
    with foreign(f"{path}: cannot read", path.open, "rb") as stream:
        place = stream.read(header.start).count(b"\n") + 1
        for begin in range(0, header.rows, rows):
            count = min(rows, header.rows - begin)
            if header.encoding == "binary":
                yield np.fromfile(stream, header.layout, count)
                continue
            last = None if begin + count == header.rows else count  # what follows the last row is a fault
            lines = [line.decode("ascii", "replace") for line in islice(stream, last)]
            yield _from_text(path, lines, place, count, header)
            place += len(lines)


@dataclass(frozen=True, slots=True, eq=False)
class PcdHeader:
    """The header of a cloud, checked against the file."""

    columns: tuple[tuple[str, str], ...]  # unique name and type of each number of a row, padding included
    counts: tuple[int, ...]  # numbers in each field: `fpfh_0`, `fpfh_1` and so on of several
    shape: tuple[int, int]  # HEIGHT and WIDTH
    encoding: str  # ascii, binary or binary_compressed
    start: int  # byte after the header
    T_world_cloud: Pose  # VIEWPOINT
    comments: tuple[str, ...]  # lines that begin with #

    @property
    def rows(self) -> int:
        """Number of points."""
        return self.shape[0] * self.shape[1]

    @property
    def layout(self) -> np.dtype[np.void]:
        """Type of a row."""
        return np.dtype(list(self.columns))


def _header(path: Path) -> PcdHeader:
    """Read the header; RecordingError if it announces more rows than the file has."""
    with foreign(f"{path}: cannot read", path.open, "rb") as stream:
        data = foreign(f"{path}: cannot read", stream.read, _LONGEST_HEADER)
    size = path.stat().st_size
    end = re.search(rb"^DATA[ \t]+(ascii|binary_compressed|binary)[ \t]*\r?\n", data, re.MULTILINE)
    if end is None:
        raise RecordingError(f"{path}: not a PCD file: no line DATA ascii, binary or binary_compressed")
    lines = data[: end.start()].decode("ascii", "replace").splitlines()
    entries = {words[0]: words[1:] for line in lines if (words := line.split()) and not line.startswith("#")}
    names = entries.get("FIELDS", entries.get("COLUMNS", []))  # COLUMNS: version 0.5
    names = [name.lower() if name in ("X", "Y", "Z") else name for name in names]  # PDAL
    entries.setdefault("COUNT", ["1"] * len(names))
    for key in ("SIZE", "TYPE", "COUNT"):
        if len(entries.get(key, [])) != len(names):
            entry = " ".join(entries.get(key, []))[:80]
            raise RecordingError(f"{path}: {key} {entry}: must be one for each of {len(names)} fields")
    columns: list[tuple[str, str]] = []
    counts = tuple(_integer(path, entries, "COUNT", k) for k in range(len(names)))
    if sum(counts) > size:
        raise RecordingError(f"{path}: COUNT {max(counts)}: more than the bytes of the file")
    for k, (name, count) in enumerate(zip(names, counts, strict=True)):
        kind = f"<{entries['TYPE'][k].lower()}{entries['SIZE'][k]}"
        if kind not in _KINDS:
            raise RecordingError(
                f"{path}: field {name}: TYPE {entries['TYPE'][k]} of SIZE {entries['SIZE'][k]}: unknown"
            )
        name = f"{_PADDING}{k}" if name == "_" else name
        columns += [(name, kind)] if count == 1 else [(f"{name}_{i}", kind) for i in range(count)]
    used = [name for name, _ in columns if not name.startswith(_PADDING)]
    if len(set(used)) != len(used) or not {*"xyz"} <= set(used):
        raise RecordingError(f"{path}: the fields are {' '.join(used)[:200]}; a cloud has x y z, each field once")
    if "WIDTH" in entries:
        width = _integer(path, entries, "WIDTH", 0)
        height = _integer(path, entries, "HEIGHT", 0) if "HEIGHT" in entries else 1
    else:
        width, height = _integer(path, entries, "POINTS", 0), 1
    rows = _integer(path, entries, "POINTS", 0) if "POINTS" in entries else height * width
    viewpoint = foreign(f"{path}: VIEWPOINT", lambda: [float(word) for word in entries.get("VIEWPOINT", _AT_ORIGIN)])
    if len(viewpoint) != 7:
        raise RecordingError(f"{path}: VIEWPOINT of {len(viewpoint)} numbers: x y z qw qx qy qz")
    x, y, z, w, *axis = viewpoint
    comments = tuple(line[1:].strip() for line in lines if line.startswith("#"))
    T = pose_matrix([x, y, z, *axis, w])
    header = PcdHeader(
        tuple(columns), tuple(filter(None, counts)), (height, width), end[1].decode(), end.end(), T, comments
    )
    least = 2 * len(columns) if header.encoding == "ascii" else header.layout.itemsize
    room = (size - header.start) * (_MOST_PACKED if header.encoding == "binary_compressed" else 1)
    if not 0 < rows == header.rows or rows * least > room + (header.encoding == "ascii"):
        raise RecordingError(
            f"{path}: POINTS {rows}, HEIGHT {height}, WIDTH {width} of {header.layout.itemsize} bytes each announced, "
            f"{size - header.start} bytes there"
        )
    return header


def _from_text(path: Path, lines: Sequence[str], place: int, count: int, header: PcdHeader) -> NDArray[np.void]:
    """Read rows of an ascii cloud; `place` is the number of the first line."""
    values = read_numbers(path, lines, place)
    if values.shape != (count, len(header.columns)):
        raise RecordingError(f"{path}: {values.shape[0]} rows of {values.shape[1]} numbers, {count} announced")
    rows = np.empty(count, header.layout)
    for (name, kind), column in zip(header.columns, values.T, strict=True):
        if not name.startswith(_PADDING):
            with of_file(path):
                rows[name] = as_type(column, kind)
    return rows


def _from_columns(path: Path, body: bytes, header: PcdHeader) -> NDArray[np.void]:
    if len(body) < header.rows * header.layout.itemsize:
        raise RecordingError(f"{path}: {len(body)} bytes unpacked, {header.rows} rows announced")
    rows, columns, begin = np.empty(header.rows, header.layout), iter(header.columns), 0
    for count in header.counts:  # field by field
        names, kinds = zip(*islice(columns, count), strict=True)
        values = np.frombuffer(body, kinds[0], header.rows * count, begin)
        for name, column in zip(names, values.reshape(-1, count).T, strict=True):
            rows[name] = column
        begin += values.nbytes
    return rows


def _unpacked_bytes(path: Path, body: bytes) -> bytes:
    """Undo LZF: the bytes begin with their packed and their unpacked size, of four bytes each."""
    packed, size = int.from_bytes(body[:4], "little"), int.from_bytes(body[4:8], "little")
    if packed > len(body) - 8 or size > _MOST_PACKED * packed:
        raise RecordingError(f"{path}: {packed:,} packed bytes announced, {max(len(body) - 8, 0):,} there")
    unpacked = foreign(f"{path}: damaged", lzf.decompress, body[8 : 8 + packed], size)
    if unpacked is None:
        raise RecordingError(f"{path}: damaged: not {size:,} bytes of LZF")
    return unpacked


def _integer(path: Path, entries: dict[str, list[str]], key: str, place: int) -> int:
    words = entries.get(key, [])
    if place >= len(words) or not words[place].isdecimal() or not 0 < len(words[place]) < _DIGITS:
        raise RecordingError(f"{path}: {key} {' '.join(words)[:80]}: a whole number")
    return int(words[place])


def write(path: Path, cloud: Cloud) -> list[str]:
    """Write a cloud, binary."""
    return _write(path, cloud, cloud.shape, [cloud])


def write_parts(path: Path, known: CloudSurvey, parts: Iterable[Cloud]) -> list[str]:
    """Write a flat cloud part by part."""
    return _write(path, known.head, (1, known.rows), parts)


def _write(path: Path, head: Cloud, shape: tuple[int, int], parts: Iterable[Cloud]) -> list[str]:
    rows = _packed(cloud_rows(head.select(np.empty(0, np.int64))))
    names = list(rows.dtype.names or ())
    pcd = PointCloud.from_points([rows[name] for name in names], names, [rows.dtype[name].type for name in names])
    x, y, z, i, j, k, w = (float(value) for value in pose_numbers(head.T_world_cloud))
    height, width = shape
    sizes = {"height": height, "width": width, "points": height * width}
    pcd.metadata = pcd.metadata.derive(viewpoint=(x, y, z, w, i, j, k), data=Encoding.BINARY, **sizes)
    comments = [f"# {line}\n" for line in headlines(head) if line.startswith("time_s")]
    with atomic_write(path, RecordingError) as place, foreign(f"{path}: cannot write", place.open, "wb") as stream:
        stream.write("".join([*comments, pcd.metadata.compose_header()]).encode())
        for part in parts:
            stream.write(np.ascontiguousarray(_packed(cloud_rows(part))).data)
    return []


_PACKED = ("blue", "green", "red", "alpha")  # the bytes of PCL's rgba, lowest first


def _packed(rows: NDArray[np.void]) -> NDArray[np.void]:
    """Combine the colours in one column, as in PCL."""
    if not set(_PACKED) <= set(rows.dtype.names or ()):
        return rows
    rgba = np.zeros(rows.size, np.uint32)
    for place, name in enumerate(_PACKED):
        rgba |= rows[name].astype(np.uint32) << np.uint32(8 * place)
    bare = recfunctions.drop_fields(rows, _PACKED, usemask=False)
    return recfunctions.append_fields(bare, "rgba", rgba, usemask=False)


def _unpacked(rows: NDArray[np.void]) -> NDArray[np.void]:
    """Split the colours into columns; PCL's older rgb is a float of the same bits, without alpha."""
    packed = next((name for name in ("rgba", "rgb") if name in (rows.dtype.names or ())), None)
    if packed is None or rows.dtype[packed].itemsize != 4:
        return rows
    bits = np.ascontiguousarray(rows[packed]).view(np.uint32)
    names = _PACKED if packed == "rgba" else _PACKED[:3]
    colours = [((bits >> np.uint32(8 * place)) & np.uint32(255)).astype(np.uint8) for place in range(len(names))]
    bare = recfunctions.drop_fields(rows, packed, usemask=False)
    return recfunctions.append_fields(bare, list(names), colours, usemask=False)
