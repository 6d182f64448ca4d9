"""PCD of the Point Cloud Library: holds everything, the start of the times as a comment."""

from __future__ import annotations

import io
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.lib import recfunctions
from numpy.typing import NDArray
from pypcd4.pypcd4 import Encoding, PointCloud

from scanwright.design.arrays import Pose
from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import atomic_write
from scanwright.firmware_io.clouds.cloud import Cloud, cloud_from_rows, cloud_rows, headlines, pose_matrix, pose_numbers
from scanwright.firmware_io.foreign import foreign

_LONGEST_HEADER = 1 << 16
_DIGITS = 16
_MOST_PACKED = 100  # times smaller LZF never gets: 264 bytes in 3
_AT_ORIGIN = ("0", "0", "0", "1", "0", "0", "0")


def read(path: Path) -> tuple[list[Cloud], list[str]]:
    """The cloud of a file, whether ascii, binary or binary_compressed."""
    data = foreign(f"{path}: cannot read", path.read_bytes)
    header = _header(path, data)
    pcd = foreign(f"{path}: not a PCD file", PointCloud.from_fileobj, io.BufferedReader(io.BytesIO(data)))
    rows = pcd.pc_data
    if rows.shape != (header.shape[0] * header.shape[1],):
        raise RecordingError(
            f"{path}: {rows.size} rows, HEIGHT x WIDTH {header.shape[0]} x {header.shape[1]} announced"
        )
    cloud = cloud_from_rows(_unpacked(rows), header.comments)
    return [Cloud(cloud.points_m, cloud.columns, header.shape, header.T_world_cloud, cloud.start_ns)], []


@dataclass(frozen=True, slots=True, eq=False)
class PcdHeader:
    """What the header of a cloud says, checked against the file.

    Attributes:
        shape: HEIGHT and WIDTH.
        T_world_cloud: VIEWPOINT.
        comments: lines that begin with #.
    """

    shape: tuple[int, int]
    T_world_cloud: Pose
    comments: tuple[str, ...]


def _header(path: Path, data: bytes) -> PcdHeader:
    """Refuse a header that is none, or that promises more rows than the file has bytes for."""
    end = re.search(rb"^DATA (ascii|binary|binary_compressed)\r?\n", data[:_LONGEST_HEADER], re.MULTILINE)
    if end is None:
        raise RecordingError(f"{path}: not a PCD file: no line DATA ascii, binary or binary_compressed")
    lines = data[: end.start()].decode("ascii", "replace").splitlines()
    entries = {words[0]: words[1:] for line in lines if (words := line.split()) and not line.startswith("#")}
    fields = entries.get("FIELDS", [])
    if len(set(fields)) != len(fields) or not {*"xyz"} <= set(fields):
        raise RecordingError(f"{path}: the fields are {' '.join(fields)[:200]}; a cloud has x y z, each field once")
    counts = entries.setdefault("COUNT", ["1"] * len(fields))
    for key in ("SIZE", "TYPE", "COUNT"):
        if len(entries.get(key, [])) != len(fields):
            raise RecordingError(
                f"{path}: {key} {' '.join(entries.get(key, []))[:80]}: one for each of {len(fields)} fields"
            )
    size = sum(_integer(path, entries, "SIZE", k) * _integer(path, entries, "COUNT", k) for k in range(len(fields)))
    rows, height, width = (_integer(path, entries, key, 0) for key in ("POINTS", "HEIGHT", "WIDTH"))
    room = (len(data) - end.end()) * (_MOST_PACKED if end[1] == b"binary_compressed" else 1)
    if not 0 < rows == height * width or rows * (2 * sum(map(int, counts)) if end[1] == b"ascii" else size) > room + 1:
        raise RecordingError(
            f"{path}: POINTS {rows}, HEIGHT {height}, WIDTH {width} of {size} bytes each announced, "
            f"{len(data) - end.end()} bytes there"
        )
    viewpoint = foreign(f"{path}: VIEWPOINT", lambda: [float(word) for word in entries.get("VIEWPOINT", _AT_ORIGIN)])
    if len(viewpoint) != 7:
        raise RecordingError(f"{path}: VIEWPOINT of {len(viewpoint)} numbers: x y z qw qx qy qz")
    x, y, z, w, i, j, k = viewpoint
    comments = tuple(line[1:].strip() for line in lines if line.startswith("#"))
    return PcdHeader((height, width), pose_matrix([x, y, z, i, j, k, w]), comments)


def _integer(path: Path, entries: dict[str, list[str]], key: str, place: int) -> int:
    words = entries.get(key, [])
    if place >= len(words) or not words[place].isdecimal() or not 0 < len(words[place]) < _DIGITS:
        raise RecordingError(f"{path}: {key} {' '.join(words)[:80]}: a whole number")
    return int(words[place])


def write(path: Path, cloud: Cloud) -> list[str]:
    """Write a cloud, binary."""
    rows = _packed(cloud_rows(cloud))
    names = list(rows.dtype.names or ())
    pcd = PointCloud.from_points([rows[name] for name in names], names, [rows.dtype[name].type for name in names])
    x, y, z, i, j, k, w = (float(value) for value in pose_numbers(cloud.T_world_cloud))
    height, width = cloud.shape
    pcd.metadata = pcd.metadata.derive(viewpoint=(x, y, z, w, i, j, k), height=height, width=width)
    data = io.BytesIO()
    pcd.save(data, Encoding.BINARY)
    comments = [f"# {line}\n" for line in headlines(cloud) if line.startswith("time_s")]
    with atomic_write(path, RecordingError) as part:
        part.write_bytes("".join(comments).encode() + data.getvalue())
    return []


_PACKED = ("blue", "green", "red", "alpha")  # the bytes of PCL's rgba, lowest first


def _packed(rows: NDArray[np.void]) -> NDArray[np.void]:
    """Rows with their colours in one column, as PCL has them."""
    if not set(_PACKED) <= set(rows.dtype.names or ()):
        return rows
    rgba = np.zeros(rows.size, np.uint32)
    for place, name in enumerate(_PACKED):
        rgba |= rows[name].astype(np.uint32) << np.uint32(8 * place)
    bare = recfunctions.drop_fields(rows, _PACKED, usemask=False)
    return recfunctions.append_fields(bare, "rgba", rgba, usemask=False)


def _unpacked(rows: NDArray[np.void]) -> NDArray[np.void]:
    """Rows with a column for each colour; PCL's older rgb is a float of the same bits, without alpha."""
    packed = next((name for name in ("rgba", "rgb") if name in (rows.dtype.names or ())), None)
    if packed is None or rows.dtype[packed].itemsize != 4:
        return rows
    bits = np.ascontiguousarray(rows[packed]).view(np.uint32)
    names = _PACKED if packed == "rgba" else _PACKED[:3]
    colours = [((bits >> np.uint32(8 * place)) & np.uint32(255)).astype(np.uint8) for place in range(len(names))]
    bare = recfunctions.drop_fields(rows, packed, usemask=False)
    return recfunctions.append_fields(bare, list(names), colours, usemask=False)
