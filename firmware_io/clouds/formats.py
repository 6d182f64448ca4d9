"""Clouds in the formats that others read: one record, a format by its suffix, and a word on what it cannot hold."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from scanwright.design.errors import RecordingError, require, suggest
from scanwright.design.files.atomic_file import check_place
from scanwright.firmware_io.clouds.cloud import Cloud
from scanwright.firmware_io.foreign import of_file

_FORMATS = {  # suffix: module of this folder, and the packages of the extra `clouds` that it needs
    ".ply": ("ply",),
    ".pcd": ("pcd", "pypcd4"),
    ".las": ("las", "laspy"),
    ".laz": ("las", "laspy", "lazrs"),
    ".e57": ("e57", "pye57"),
    ".npz": ("npz",),
    ".xyz": ("xyz",),
}
_SHAPED = {".pcd", ".e57", ".npz"}  # their own fields say what rows and columns are, or which rows are no points
_POINTS_ONLY = {".las", ".laz"}


def read_clouds(path: Path) -> tuple[list[Cloud], list[str]]:
    """All clouds of a file (E57 holds several, the others one), and lines about what was not read.

    Raises:
        InstallError: the format needs a package that is not installed.
        RecordingError: the format is not known, or the file is not what its suffix says.
    """
    if path.is_dir():
        raise RecordingError(f"{path}: this is a folder; name a cloud in it, a file")
    if path.suffix in (".mcap", ".bag", ".db3"):
        raise RecordingError(f"{path}: a recording, not a cloud: `scanwright assemble` makes the one of the other")
    module = _format(path)
    with of_file(path):
        clouds: tuple[list[Cloud], list[str]] = module.read(path)
    return clouds


def check_target(path: Path) -> None:
    """Refuse what cannot be written, before the work that it is to hold.

    Raises:
        InstallError: the format needs a package that is not installed.
        RecordingError: the format is not known, or no file can be there.
    """
    _format(path)
    check_place(path, RecordingError)


@dataclass(frozen=True, slots=True)
class Written:
    """What became of clouds that were written.

    Attributes:
        paths: the files.
        rows: in all of them.
        notes: what they do not hold, one sentence each.
    """

    paths: tuple[Path, ...]
    rows: int
    notes: tuple[str, ...]


def write_clouds(path: Path, clouds: Sequence[Cloud], *, organised: bool = False) -> Written:
    """Write clouds, each to a file of its own where the format holds one.

    Rows without a point are left out, unless the cloud is organised and the format says what its rows and columns are
    (PCD, E57, NPZ): many readers of the others take NaN for a point at 0.

    Args:
        path: the file, or what several are numbered after.
        clouds: with a point in each.
        organised: keep the rows and columns of organised clouds in PLY and XYZ too, in comments.

    Raises:
        InstallError: the format needs a package that is not installed.
        RecordingError: the format is not known or cannot hold this, or the file cannot be written.
    """
    module = _format(path)
    suffix = path.suffix.lower()
    if organised:
        _check_organised(path, suffix, clouds)
    notes: list[str] = []
    for number, cloud in enumerate(clouds):
        if not cloud.valid.any():
            raise RecordingError(f"{path}: none of the {len(cloud.points_m)} rows of cloud {number + 1} is a point")
    formed = [cloud if cloud.organised and (organised or suffix in _SHAPED) else cloud.flat() for cloud in clouds]
    rows = sum(len(cloud.points_m) for cloud in formed)
    if lost := sum(len(cloud.points_m) for cloud in clouds) - rows:
        notes.append(f"left out {lost:,} rows without a point")
    if suffix not in _SHAPED and not organised and any(cloud.organised for cloud in clouds):
        shapes = ", ".join(f"{cloud.shape[0]} x {cloud.shape[1]}" for cloud in clouds if cloud.organised)
        notes.append(f"the shape {shapes} is lost (pcd, e57 and npz keep it)")
    if suffix == ".e57":
        return Written((path,), rows, (*notes, *module.write(path, formed)))
    paths = [path] if len(clouds) == 1 else [path.with_stem(f"{path.stem}_{k}") for k in range(1, len(clouds) + 1)]
    for one, cloud in zip(paths, formed, strict=True):
        notes += module.write(one, cloud)
    return Written(tuple(paths), rows, tuple(dict.fromkeys(notes)))


def _check_organised(path: Path, suffix: str, clouds: Sequence[Cloud]) -> None:
    if suffix in _POINTS_ONLY:
        raise RecordingError(f"{path}: LAS holds points, no rows and columns: organised clouds are ply pcd e57 npz xyz")
    if not all(cloud.organised for cloud in clouds):
        raise RecordingError(f"{path}: organised: the cloud is flat, nobody knows its rows and columns")


def _format(path: Path) -> Any:
    """The module of the format that the suffix names; loaded only once its packages are known to be there."""
    suffix = path.suffix.lower()
    if suffix not in _FORMATS:
        raise RecordingError(f"{path}: '{suffix}' is no format of clouds{suggest(suffix, _FORMATS)}")
    module, *packages = _FORMATS[suffix]
    need = f"{path}: {suffix} needs {' and '.join(packages)}"
    if suffix == ".e57" and platform.machine() == "aarch64":
        need += ", which has no wheel for Linux on aarch64: take another format, or on another computer"
    require("clouds", need, *packages)
    return import_module(f"scanwright.firmware_io.clouds.{module}")
