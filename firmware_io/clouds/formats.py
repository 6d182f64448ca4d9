"""Clouds in the formats that others read: one record, a format by its suffix, and a word on what it cannot hold."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from design.atomic_file import check_place
from design.errors import RecordingError, require, suggest
from firmware_io.clouds.cloud import Cloud

_FORMATS = {  # suffix: module of this folder, and the packages of the extra `clouds` that it needs
    ".ply": ("ply",),
    ".pcd": ("pcd", "pypcd4"),
    ".las": ("las", "laspy"),
    ".laz": ("las", "laspy", "lazrs"),
    ".e57": ("e57", "pye57"),
    ".npz": ("npz",),
    ".xyz": ("xyz",),
}


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
    clouds: tuple[list[Cloud], list[str]] = _format(path).read(path)
    return clouds


def check_target(path: Path) -> None:
    """Refuse what cannot be written, before the work that it is to hold.

    Raises:
        InstallError: the format needs a package that is not installed.
        RecordingError: the format is not known, or no file can be there.
    """
    _format(path)
    check_place(path, RecordingError)


def write_clouds(path: Path, clouds: Sequence[Cloud]) -> tuple[list[Path], list[str]]:
    """Write clouds, each to a file of its own where the format holds one; the files, and what they do not hold.

    Raises:
        InstallError: the format needs a package that is not installed.
        RecordingError: the format is not known, or the file cannot be written.
    """
    module = _format(path)
    if path.suffix.lower() == ".e57":
        return [path], module.write(path, clouds)
    paths = [path] if len(clouds) == 1 else [path.with_stem(f"{path.stem}_{k}") for k in range(1, len(clouds) + 1)]
    said = [module.write(one, cloud) for one, cloud in zip(paths, clouds, strict=True)]
    return paths, list(dict.fromkeys(line for lines in said for line in lines))


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
    return import_module(f"firmware_io.clouds.{module}")
