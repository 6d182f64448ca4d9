"""LAS and LAZ 1.4: points in the world, integers of a tenth of a millimetre (more beyond 200 km).

Pose and start of the times are in a separate record (VLR), which other software ignores.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import laspy
import numpy as np

from scanwright.design import frames
from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import atomic_write
from scanwright.firmware_io.clouds.cloud import COLUMN_TYPES, Cloud, Column, colour_bytes, headlines, with_header
from scanwright.firmware_io.clouds.parts import CloudSurvey, Parts, survey
from scanwright.firmware_io.foreign import foreign

_HEADER = struct.Struct("<94xHII")  # size of the header, byte of the first point, number of records before it
_RECORD_BYTES = 54  # head of a record
_STEPS_M = (1e-4, 1e-3, 1e-2)
_MOST_STEPS = 2**31 - 1  # LAS stores coordinates as int32
_PACKED = 1000  # above the compression ratio of LAZ
_OURS = "scanwright"
_EXACT = "intensity_exact"
_OWN_FIELD = {"intensity": "intensity", "time_s": "gps_time"}
_COLOURS = ("red", "green", "blue")  # 16 bits; in `Cloud` bytes
_STANDARD = {"X", "Y", "Z", "intensity", "gps_time", *_COLOURS}


def read(path: Path) -> tuple[list[Cloud], list[str]]:
    """Read the cloud of a file, in the frame of its scanner if the file has a pose, or in the world."""
    _check_header(path)
    las = foreign(f"{path}: not a LAS file", laspy.read, path)
    return [_cloud(las.header, las.points)], _notes(path, las.points)


def parts(path: Path, rows: int) -> Parts:
    """Return the cloud of a file in parts of so many points."""
    _check_header(path)

    def again() -> Iterator[Cloud]:
        with foreign(f"{path}: not a LAS file", laspy.open, path) as reader:
            for points in reader.chunk_iterator(rows):
                yield _cloud(reader.header, points, measured=True)

    with foreign(f"{path}: not a LAS file", laspy.open, path) as reader:
        notes = _notes(path, foreign(f"{path}: damaged", next, reader.chunk_iterator(rows)))
    return Parts((again,), tuple(notes))


def _notes(path: Path, points: Any) -> list[str]:
    """Return a note of the dimensions that are not read."""
    unread = [
        name
        for name in points.point_format.standard_dimension_names
        if name not in _STANDARD and np.ptp(np.asarray(points[name]).astype(float)) > 0
    ]
    return [f"left out of {path}: {', '.join(unread)}"] if unread else []


def _cloud(header: laspy.LasHeader, las: Any, *, measured: bool = False) -> Cloud:
    """Return points as a cloud; `measured`: intensity and time are columns even if all are 0."""
    lines = [
        line
        for vlr in header.vlrs
        if vlr.user_id == _OURS
        for line in vlr.record_data_bytes().decode("utf-8", "replace").splitlines()
    ]
    extra = list(las.point_format.extra_dimension_names)
    columns: dict[str, Column] = {}
    for name in extra:
        values = np.array(las[name]).reshape(len(las), -1)
        names = [name] if values.shape[1] == 1 else [f"{name}_{k}" for k in range(values.shape[1])]
        columns |= dict(zip(names, np.ascontiguousarray(values.T), strict=True))
    columns.pop(_EXACT, None)
    intensity = np.array(las[_EXACT] if _EXACT in extra else las["intensity"])
    if _EXACT in extra or measured or intensity.any():
        columns["intensity"] = intensity.astype(COLUMN_TYPES["intensity"])
    if "gps_time" in las.point_format.dimension_names and (measured or np.any(las["gps_time"])):
        columns["time_s"] = np.array(las["gps_time"], float)
    for name in _COLOURS if "red" in las.point_format.dimension_names else ():
        columns[name] = colour_bytes(np.array(las[name]))
    world = np.stack([las.x, las.y, las.z], axis=1).astype(float)
    cloud = with_header(Cloud(world, columns), lines)
    points_m = frames.apply(np.linalg.inv(cloud.T_world_cloud), world) if cloud.placed else world
    return Cloud(points_m, columns, (1, len(world)), cloud.T_world_cloud, cloud.start_ns)


def write(path: Path, cloud: Cloud) -> list[str]:
    """Write a flat cloud; return notes of dropped data."""
    known = survey([cloud])
    if known is None:
        raise RecordingError(f"{path}: no row is a point")
    return write_parts(path, known, [cloud])


def write_parts(path: Path, known: CloudSurvey, parts: Iterable[Cloud]) -> list[str]:
    """Write a flat cloud part by part."""
    names = known.head.columns
    header = laspy.LasHeader(version="1.4", point_format=7 if "red" in names else 6)
    step_m = _step_m(path, known)
    header.scales = np.full(3, step_m)
    header.offsets = np.floor(known.low_m)
    if lines := headlines(known.head):
        header.vlrs.append(laspy.VLR(_OURS, 1, "pose and start of times", "\n".join(lines).encode()))
    notes = [f"LAS rounds coordinates to {1000 * step_m:g} mm"]
    if known.head.placed:
        notes.append("LAS has no scan pose: the points are moved into the world, a Scanwright record keeps the pose")
    exact = "intensity" in names and "intensity" not in known.integers
    if exact:
        notes.append(f"LAS intensities are whole numbers to 65535: the exact ones are the extra dimension {_EXACT}")
    if "time_s" in names:
        notes.append("gps_time is seconds since the first beam, not the time of GPS")
    types = {name: column.dtype for name, column in names.items() if name not in _STANDARD | set(_OWN_FIELD)}
    if exact:
        types[_EXACT] = names["intensity"].dtype
    header.add_extra_dims([laspy.ExtraBytesParams(name, kind) for name, kind in types.items()])
    packed = path.suffix.lower() == ".laz"
    with atomic_write(path, RecordingError) as place, place.open("wb") as stream:
        what = f"{path}: cannot write"
        writer = foreign(what, laspy.open, stream, mode="w", header=header, do_compress=packed, closefd=False)
        for part in parts:
            foreign(what, writer.write_points, _points(header, part, exact=exact))
        foreign(what, writer.close)
    return notes


def _points(header: laspy.LasHeader, cloud: Cloud, *, exact: bool) -> laspy.ScaleAwarePointRecord:
    world = frames.apply(cloud.T_world_cloud, cloud.points_m.astype(float))
    columns = dict(cloud.columns)
    columns |= {name: columns[name].astype(np.uint16) * 257 for name in _COLOURS if name in columns}
    if exact:
        columns[_EXACT] = columns["intensity"]
        columns["intensity"] = np.clip(np.nan_to_num(columns["intensity"]).round(), 0, 65535)
    points = laspy.ScaleAwarePointRecord.zeros(len(world), header=header)
    points.x, points.y, points.z = world.T
    for name, column in columns.items():
        points[_OWN_FIELD.get(name, name)] = column
    return points


def _check_header(path: Path) -> None:
    """Raise RecordingError if the header announces more than the file has, or invalid coordinates."""
    _check_records(path)
    with foreign(f"{path}: not a LAS file", laspy.open, path) as reader:
        header = reader.header
        room = path.stat().st_size * (_PACKED if header.are_points_compressed else 1)
        if not 0 < header.point_count * header.point_format.size <= room:
            raise RecordingError(
                f"{path}: {header.point_count:,} points announced, {path.stat().st_size:,} bytes there"
            )
        numbers = np.array([header.scales, header.offsets])
        if not np.isfinite(numbers).all() or (header.scales <= 0).any():
            raise RecordingError(f"{path}: scales {header.scales}, offsets {header.offsets}: finite, scales above 0")
        if header.are_points_compressed:
            _check_chunks(path, header.offset_to_point_data, header.point_count)


def _check_records(path: Path) -> None:
    """Raise RecordingError for more variable length records than fit, which laspy would read for minutes."""
    size = path.stat().st_size if path.is_file() else 0
    with foreign(f"{path}: cannot read", path.open, "rb") as stream:
        head = stream.read(_HEADER.size)
    if len(head) < _HEADER.size or head[:4] != b"LASF":
        raise RecordingError(f"{path}: not a LAS file")
    header_size, points, records = _HEADER.unpack(head)
    if not header_size + _RECORD_BYTES * records <= points <= size:
        raise RecordingError(
            f"{path}: byte 96: {records:,} records announced before the points at byte {points:,} of {size:,}"
        )


def _check_chunks(path: Path, at: int, points: int) -> None:
    """Raise RecordingError for a table of chunks longer than the points, which crashes the decoder.

    Its place is before the points, or at the end of a streamed file; it begins with a version and the number of chunks
    (LASzip, chunk table).
    """
    size = path.stat().st_size
    with path.open("rb") as stream:
        stream.seek(at)
        place = int.from_bytes(stream.read(8), "little", signed=True)
        if place == -1:
            stream.seek(max(0, size - 8))
            place = int.from_bytes(stream.read(8), "little", signed=True)
        if not at < place <= size - 8:
            raise RecordingError(f"{path}: the table of its chunks would begin at byte {place:,} of {size:,}")
        stream.seek(place + 4)
        chunks = int.from_bytes(stream.read(4), "little")
    if chunks > points + 1:
        raise RecordingError(f"{path}: {chunks:,} chunks announced for {points:,} points")


def _step_m(path: Path, known: CloudSurvey) -> float:
    """Return the smallest step with which 32 bits cover all points."""
    across_m = float((known.high_m - known.low_m).max()) + 1
    for step_m in _STEPS_M:
        if across_m < step_m * _MOST_STEPS:
            return step_m
    most_km = _STEPS_M[-1] * _MOST_STEPS / 1000
    raise RecordingError(f"{path}: the points are {across_m / 1000:.3g} km apart: LAS holds {most_km:,.0f} km")
