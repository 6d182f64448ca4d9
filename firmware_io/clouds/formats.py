"""Formats of clouds; unusable input raises RecordingError.

An installed package adds one by an entry point of the group "scanwright.cloud_formats" that names a `CloudFormat`; its
module has `read(path) -> (clouds, notes)` and, if it can write, `write(path, cloud) -> notes`.
"""

from __future__ import annotations

import platform
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

from scanwright.design.errors import RecordingError, require, suggest
from scanwright.design.files.atomic_file import check_place
from scanwright.firmware_io.clouds.cloud import Cloud
from scanwright.firmware_io.clouds.parts import Again, Parts, survey
from scanwright.firmware_io.foreign import foreign, foreign_items, of_file
from scanwright.firmware_io.installed import with_installed

GROUP = "scanwright.cloud_formats"
_CLOUDS = "scanwright.firmware_io.clouds"


@dataclass(frozen=True, slots=True)
class CloudFormat:
    """A format of clouds."""

    name: str  # suffix of its files in lower case, without the dot
    module: str  # dotted name of the module that reads and writes it; imported when it is used
    packages: tuple[str, ...] = ()  # top-level names of required packages of the extra `clouds`
    rows: Literal["fields", "comments", "none"] = "none"  # how it stores rows and columns of an organised cloud
    several: bool = False  # whether a file can contain several clouds, and `write` has a list of them


FORMATS = (
    CloudFormat("ply", f"{_CLOUDS}.ply", rows="comments"),
    CloudFormat("pcd", f"{_CLOUDS}.pcd", ("pypcd4",), rows="fields"),
    CloudFormat("las", f"{_CLOUDS}.las", ("laspy",)),
    CloudFormat("laz", f"{_CLOUDS}.las", ("laspy", "lazrs")),
    CloudFormat("e57", f"{_CLOUDS}.e57", ("pye57",), rows="fields", several=True),
    CloudFormat("npz", f"{_CLOUDS}.npz", rows="fields"),
    CloudFormat("npy", f"{_CLOUDS}.structured_array"),
    CloudFormat("ptx", f"{_CLOUDS}.ptx"),
    *(CloudFormat(name, f"{_CLOUDS}.text", rows="comments") for name in ("xyz", "txt", "asc", "csv", "pts")),
)


@cache
def all_formats() -> dict[str, CloudFormat]:
    """Return the shipped formats and those of installed packages, by name."""
    return with_installed(GROUP, CloudFormat, FORMATS, RecordingError)


def read_clouds(path: Path) -> tuple[list[Cloud], list[str]]:
    """Read all clouds of a file (E57 and PTX can have several), with notes about dropped data.

    Raises:
        InstallError: the format requires a package that is not installed.
        RecordingError: the format is unknown, or the file does not have it.
    """
    if path.is_dir():
        raise RecordingError(f"{path}: is a folder; name a file of a cloud")
    if path.suffix in (".mcap", ".bag", ".db3"):
        raise RecordingError(f"{path}: a recording, not a cloud: `scanwright assemble` makes a cloud of a recording")
    module = cloud_module(path)
    with of_file(path):
        clouds: tuple[list[Cloud], list[str]] = foreign(f"{path}: damaged", module.read, path)
    return clouds


def check_target(path: Path) -> None:
    """Check that a file can be written; raises as `write_clouds`."""
    _writer(path)
    check_place(path, RecordingError)


@dataclass(frozen=True, slots=True)
class Written:
    """Result of writing clouds."""

    paths: tuple[Path, ...]
    rows: int  # of all files
    notes: tuple[str, ...]  # dropped data, one sentence each


def write_clouds(path: Path, clouds: Sequence[Cloud], *, organised: bool = False) -> Written:
    """Write clouds, to one file if the format supports several.

    Rows without a point are dropped, unless the cloud is organised and the format has fields for rows and columns
    (PCD, E57, NPZ): many readers of the others read NaN as a point at 0.

    Args:
        path: the file, or the name after which several are numbered.
        clouds: with a point in each.
        organised: keep the rows and columns of organised clouds in PLY and XYZ too, in comments.

    Raises:
        InstallError: the format requires a package that is not installed.
        RecordingError: the format is unknown, read-only or cannot store this, or the file cannot be written.
    """
    form, module = _format(path), _writer(path)
    if organised:
        _check_organised(path, form, clouds)
    notes: list[str] = []
    for number, cloud in enumerate(clouds):
        if not cloud.valid.any():
            raise RecordingError(f"{path}: none of the {len(cloud.points_m)} rows of cloud {number + 1} is a point")
    formed = [cloud if cloud.organised and (organised or form.rows == "fields") else cloud.flat() for cloud in clouds]
    rows = sum(len(cloud.points_m) for cloud in formed)
    if lost := sum(len(cloud.points_m) for cloud in clouds) - rows:
        notes.append(f"dropped {lost:,} rows without a point")
    if form.rows != "fields" and not organised and any(cloud.organised for cloud in clouds):
        shapes = ", ".join(f"{cloud.shape[0]} x {cloud.shape[1]}" for cloud in clouds if cloud.organised)
        notes.append(f"the shape {shapes} is lost ({_listed('fields')} keep it)")
    if form.several:
        return Written((path,), rows, (*notes, *module.write(path, formed)))
    paths = [path] if len(clouds) == 1 else [path.with_stem(f"{path.stem}_{k}") for k in range(1, len(clouds) + 1)]
    for file, cloud in zip(paths, formed, strict=True):
        notes += module.write(file, cloud)
    return Written(tuple(paths), rows, tuple(dict.fromkeys(notes)))


def _check_organised(path: Path, form: CloudFormat, clouds: Sequence[Cloud]) -> None:
    if form.rows == "none":
        keep = f"{_listed('fields')}, {_listed('comments')}"
        raise RecordingError(f"{path}: organised: {form.name} holds points, no rows and columns; {keep} keep them")
    if not all(cloud.organised for cloud in clouds):
        raise RecordingError(f"{path}: organised: the cloud is flat, its rows and columns are unknown")


def _listed(rows: str) -> str:
    return ", ".join(form.name for form in all_formats().values() if form.rows == rows)


def _format(path: Path) -> CloudFormat:
    name = path.suffix.lower().removeprefix(".")
    if name not in all_formats():
        raise RecordingError(f"{path}: '{path.suffix}' is not a format of clouds{suggest(name, all_formats())}")
    return all_formats()[name]


def cloud_module(path: Path) -> Any:
    """Return the module of the format of a file; InstallError without a package that it needs."""
    form = _format(path)
    need = f"{path}: {form.name} needs {' and '.join(form.packages)}"
    if "pye57" in form.packages and platform.machine() == "aarch64":
        need += ", which has no wheel for Linux on aarch64: choose another format, or use another computer"
    require("clouds", need, *form.packages)
    return import_module(form.module)


def _writer(path: Path) -> Any:
    module = cloud_module(path)
    if not hasattr(module, "write"):
        raise RecordingError(f"{path}: {_format(path).name} is only read: write ply, or another format")
    return module


STREAM_BYTES = 250_000_000  # smallest file that is streamed
ROWS = 500_000  # in memory


def stream(source: Path, target: Path, *, least_bytes: int = STREAM_BYTES, rows: int = ROWS) -> Written | None:
    """Convert a large cloud in bounded memory; None if it is small, organised, or of a format that is not streamed.

    Files from `least_bytes` on are streamed, `rows` points at a time.
    """
    reader, writer = cloud_module(source), cloud_module(target)
    if not (hasattr(reader, "parts") and hasattr(writer, "write_parts")) or not source.is_file():
        return None
    if source.stat().st_size < least_bytes:
        return None
    with of_file(source):
        parts: Parts | None = reader.parts(source, rows)
    if parts is None:
        return None
    several = len(parts.clouds) > 1
    paths = [target.with_stem(f"{target.stem}_{k}") if several else target for k in range(1, len(parts.clouds) + 1)]
    total, notes = 0, list(parts.notes)
    for number, (path, again) in enumerate(zip(paths, parts.clouds, strict=True), 1):
        flat = _flat(source, again)
        known = survey(flat())
        if known is None:
            raise RecordingError(f"{target}: none of the rows of cloud {number} is a point")
        notes += writer.write_parts(path, known, flat())
        total += known.rows
    return Written(tuple(paths), total, tuple(dict.fromkeys(notes)))


def _flat(source: Path, again: Again) -> Again:
    return lambda: (part.flat() for part in foreign_items(f"{source}: damaged", again()))
