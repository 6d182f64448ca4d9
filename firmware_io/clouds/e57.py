"""E57 (ASTM E2807): several scans in one file, each with its pose, organised by row and column, invalid points marked.

Written node by node with libe57, as pye57 supports neither times nor columns of other names, and rounds to float32.
Such columns have an extension of the format, prefix `sw`, which other software skips.
"""

from __future__ import annotations

import uuid
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pye57
from pye57 import libe57

from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import atomic_write
from scanwright.firmware_io.clouds.cloud import (
    COLUMN_TYPES,
    Cloud,
    Column,
    as_type,
    colour_bytes,
    headlines,
    pose_matrix,
    pose_numbers,
    with_header,
)
from scanwright.firmware_io.clouds.parts import CloudSurvey, Parts, survey
from scanwright.firmware_io.foreign import foreign, of_file

_PREFIX, _URI = "sw", "urn:scanwright:cloud:1"
_MOST_PACKED = 8  # points per byte: three axes of a bit each
_MOST_EMPTY = 100  # cells per point, above which rows and columns have another meaning
_AT_ONCE = 100_000  # points
_NO_POINT = 2  # cartesianInvalidState: neither a point nor a direction
_COLOURS = {"red": "colorRed", "green": "colorGreen", "blue": "colorBlue"}
_OWN_FIELD = {"intensity": "intensity", "time_s": "timeStamp", **_COLOURS}
_NORMALS = {f"n{axis.lower()}": f"nor:normal{axis}" for axis in "XYZ"}  # extension of libE57Format
_AXES = ("cartesianX", "cartesianY", "cartesianZ")
_SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
_STRUCTURE = {"cartesianInvalidState", "sphericalInvalidState", "rowIndex", "columnIndex"}


def read(path: Path) -> tuple[list[Cloud], list[str]]:
    """Read all scans of a file."""
    with _opened(path) as e57:
        if not e57.scan_count:
            raise RecordingError(f"{path}: no scan in it")
        clouds = []
        for k in range(e57.scan_count):
            with of_file(path):
                clouds.append(foreign(f"scan {k}", _read_scan, e57, k))
        return clouds, []


def _opened(path: Path) -> pye57.E57:
    if not path.is_file():
        raise RecordingError(f"{path}: cannot read: No such file or directory")
    return foreign(f"{path}: not an E57 file", pye57.E57, str(path))


def parts(path: Path, rows: int) -> Parts:
    """Return the clouds of a file in parts of so many points, without their rows and columns."""

    def again(number: int) -> Iterator[Cloud]:
        with _opened(path) as e57:
            header = e57.get_header(number)
            for values_of in _chunks(e57, header, rows):
                yield _flat_cloud(header, values_of)

    with _opened(path) as e57:
        fields = {name for number in range(e57.scan_count) for name in e57.get_header(number).point_fields}
        notes = ("rows and columns of a file of this size are not kept",) if "rowIndex" in fields else ()
        return Parts(tuple(partial(again, number) for number in range(e57.scan_count)), notes)


def write(path: Path, clouds: Sequence[Cloud]) -> list[str]:
    """Write one scan for each cloud."""
    with atomic_write(path, RecordingError) as place:
        scans = ((survey([cloud]), cloud.shape, [cloud]) for cloud in clouds)
        foreign(f"{path}: cannot write", _write_scans, place, scans, path.stem)
    return []


def write_parts(path: Path, known: CloudSurvey, parts: Iterable[Cloud]) -> list[str]:
    """Write a flat cloud part by part."""
    with atomic_write(path, RecordingError) as place:
        foreign(f"{path}: cannot write", _write_scans, place, [(known, (1, known.rows), parts)], path.stem)
    return []


_Scan = tuple[CloudSurvey | None, tuple[int, int], Iterable[Cloud]]


def _write_scans(place: Path, scans: Iterable[_Scan], name: str) -> None:
    e57 = pye57.E57(str(place), mode="w")
    try:
        e57.image_file.extensionsAdd(_PREFIX, _URI)
        for number, scan in enumerate(scans, 1):
            _write_scan(e57, *scan, f"{name} {number}")
        e57.close()
    except BaseException:
        e57.image_file.cancel()
        raise
    finally:
        del e57.image_file  # its destructor would close it again, with an error on a full disk


def _read_scan(e57: pye57.E57, number: int) -> Cloud:
    header = e57.get_header(number)
    values_of = next(_chunks(e57, header, header.point_count))
    row, column = values_of.get("rowIndex"), values_of.get("columnIndex")
    cloud = _flat_cloud(header, values_of)
    return cloud if row is None or column is None else _organised(cloud, row, column)


def _flat_cloud(header: Any, values_of: dict[str, Column]) -> Cloud:
    if all(name in values_of for name in _AXES):
        points = np.stack([values_of.pop(name) for name in _AXES], axis=1)
    else:
        r, azimuth, elevation = (values_of.pop(name) for name in _SPHERICAL)
        flat = r * np.cos(elevation)
        points = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), r * np.sin(elevation)], axis=1)
    for name in ("cartesianInvalidState", "sphericalInvalidState"):
        if name in values_of:
            points[values_of[name] != 0] = np.nan
    back = {own: name for name, own in (_OWN_FIELD | _NORMALS).items()}
    columns = {
        back.get(name) or name.removeprefix(f"{_PREFIX}:").replace(":", "_"): values
        for name, values in values_of.items()
        if name not in _STRUCTURE
    }
    columns |= {name: colour_bytes(columns[name]) for name in _COLOURS if name in columns}
    for name, values in columns.items():
        try:
            columns[name] = as_type(values, COLUMN_TYPES.get(name, values.dtype))
        except RecordingError as error:
            raise RecordingError(f"column {name}: {error}") from error
    T = np.eye(4)
    if header.has_pose():
        w, x, y, z = header.rotation
        T = pose_matrix([*header.translation, x, y, z, w])
    text = header["description"].value() if header.node.isDefined("description") else ""
    start = with_header(Cloud(points), text.splitlines()).start_ns
    return Cloud(points, columns, (1, len(points)), T, start)


def _organised(cloud: Cloud, row: Column, column: Column) -> Cloud:
    """Return the cloud with each point in its cell, and NaN in cells that the file omits."""
    row, column = row - row.min(), column - column.min()
    height, width = int(row.max()) + 1, int(column.max()) + 1
    cell = row * width + column
    if len(np.unique(cell)) != len(cell) or height * width > _MOST_EMPTY * len(cell):  # several returns to a cell
        return cloud
    points = np.full((height * width, 3), np.nan, cloud.points_m.dtype)
    points[cell] = cloud.points_m
    columns = {}
    for name, values in cloud.columns.items():
        columns[name] = np.full(height * width, np.nan if values.dtype.kind == "f" else 0, values.dtype)
        columns[name][cell] = values
    return Cloud(points, columns, (height, width), cloud.T_world_cloud, cloud.start_ns)


def _chunks(e57: pye57.E57, header: Any, rows: int) -> Iterator[dict[str, Column]]:
    """Read the fields of a scan, at most so many points at a time."""
    size = Path(e57.path).stat().st_size
    if not 0 < header.point_count <= _MOST_PACKED * size:
        raise RecordingError(f"{header.point_count:,} points announced, {size:,} bytes there")
    prototype = libe57.StructureNode(header.points.prototype())
    values_of: dict[str, Column] = {}
    integers = set()
    buffers = libe57.VectorSourceDestBuffer()
    for k in range(prototype.childCount()):
        node = prototype.get(k)
        name = node.elementName()
        real = node.type() == libe57.NodeType.E57_FLOAT
        single = real and libe57.FloatNode(node).precision() == libe57.E57_SINGLE
        if node.type() == libe57.NodeType.E57_INTEGER:
            integers.add(name)
        values_of[name] = np.empty(min(rows, header.point_count), np.float32 if single else np.float64)
        buffers.append(libe57.SourceDestBuffer(e57.image_file, name, values_of[name], values_of[name].size, True, True))
    reader = header.points.reader(buffers)
    try:
        while count := reader.read():
            yield {
                name: values[:count].astype(np.int64) if name in integers else values[:count].copy()
                for name, values in values_of.items()
            }
    finally:
        reader.close()


def _write_scan(
    e57: pye57.E57, known: CloudSurvey | None, shape: tuple[int, int], parts: Iterable[Cloud], name: str
) -> None:
    file = e57.image_file
    if known is None:
        raise RecordingError("no row is a point")
    (height, width), organised, head = shape, shape[0] > 1, known.head
    marked = known.rows < height * width
    scan = libe57.StructureNode(file)
    scan.set("guid", libe57.StringNode(file, f"{{{uuid.uuid4()}}}"))
    scan.set("name", libe57.StringNode(file, name))
    start = [line for line in headlines(head) if line.startswith("time_s")]
    scan.set("description", libe57.StringNode(file, "\n".join(start)))
    bounds = {"rowMinimum": 0, "rowMaximum": height - 1, "columnMinimum": 0, "columnMaximum": width - 1}
    _set(file, scan, "indexBounds", bounds if organised else {"rowMaximum": 0, "columnMaximum": width - 1})
    x, y, z, i, j, k, w = (float(value) for value in pose_numbers(head.T_world_cloud))
    pose = libe57.StructureNode(file)
    scan.set("pose", pose)
    _set(file, pose, "rotation", {"w": w, "x": i, "y": j, "z": k})
    _set(file, pose, "translation", {"x": x, "y": y, "z": z})
    if "intensity" in head.columns:
        low, high = map(float, known.limits["intensity"])
        _set(file, scan, "intensityLimits", {"intensityMinimum": low, "intensityMaximum": high})
    if set(_COLOURS) <= set(head.columns):
        limits = {
            f"{name}{end}": value for name in _COLOURS.values() for end, value in (("Minimum", 0), ("Maximum", 255))
        }
        _set(file, scan, "colorLimits", limits)
    prototype = libe57.StructureNode(file)
    ranges = {_field(column): known.limits[column] for column in head.columns}
    ranges |= {"cartesianInvalidState": (0, _NO_POINT), "rowIndex": (0, height - 1), "columnIndex": (0, width - 1)}
    for field, values in _fields(head, marked=marked, width=width if organised else 0).items():
        prototype.set(field, _node(file, values, ranges.get(field, (0, 0))))
    points = libe57.CompressedVectorNode(file, prototype, libe57.VectorNode(file, True))
    scan.set("points", points)
    e57.data3d.append(scan)
    _write_points(file, points, (_fields(part, marked=marked, width=width if organised else 0) for part in parts))


def _fields(cloud: Cloud, *, marked: bool, width: int) -> dict[str, Column]:
    """Return the values of a scan by field; `width` is 0 without rows and columns."""
    valid = cloud.valid
    fields: dict[str, Column] = {
        axis: np.where(valid, cloud.points_m[:, k], 0).astype(cloud.points_m.dtype) for k, axis in enumerate(_AXES)
    }
    if marked:
        fields["cartesianInvalidState"] = np.where(valid, 0, _NO_POINT).astype(np.int64)
    if width:
        fields["rowIndex"], fields["columnIndex"] = np.divmod(np.arange(len(valid)), width)
    return fields | {_field(column): values for column, values in cloud.columns.items()}


def _field(column: str) -> str:
    return _OWN_FIELD.get(column, f"{_PREFIX}:{column}")


def _write_points(file: Any, points: Any, parts: Iterable[dict[str, Column]]) -> None:
    """Write the points through buffers that stay: libe57 refuses others for the same points."""
    writer = None
    arrays: dict[str, Column] = {}
    try:
        for fields in parts:
            if writer is None:
                buffers = libe57.VectorSourceDestBuffer()
                for name, values in fields.items():
                    # The bindings take int64 for int32, and libe57 refuses to convert an infinity to single
                    arrays[name] = np.empty(_AT_ONCE, np.float32 if values.dtype == np.float32 else np.float64)
                    buffers.append(libe57.SourceDestBuffer(file, name, arrays[name], _AT_ONCE, True, True))
                writer = points.writer(buffers)
            for begin in range(0, fields[_AXES[0]].size, _AT_ONCE):
                count = fields[_AXES[0]][begin : begin + _AT_ONCE].size
                for name, values in fields.items():
                    arrays[name][:count] = values[begin : begin + _AT_ONCE]
                writer.write(count)
    finally:
        if writer is not None:
            writer.close()  # an open writer without its file crashes the process


def _node(file: Any, values: Column, limits: tuple[float, float]) -> Any:
    """Return the node of the type of one field; `limits` are those of its integers."""
    if values.dtype.kind == "f":
        precision = libe57.E57_SINGLE if values.dtype.itemsize == 4 else libe57.E57_DOUBLE
        return libe57.FloatNode(file, 0.0, precision)
    low, high = min(int(limits[0]), 0), max(int(limits[1]), 0)
    return libe57.IntegerNode(file, low, low, high)


def _set(file: Any, parent: Any, name: str, values: dict[str, int] | dict[str, float]) -> None:
    node = libe57.StructureNode(file)
    for key, value in values.items():
        kind = libe57.IntegerNode if isinstance(value, int) else libe57.FloatNode
        node.set(key, kind(file, value))
    parent.set(name, node)
