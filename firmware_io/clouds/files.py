"""Clouds in the formats that others read: one record, a format by its suffix, and a word on what it cannot hold."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from design.atomic_file import check_place
from design.errors import RecordingError, suggest
from firmware_io.clouds import e57, las, npz, pcd, ply, xyz
from firmware_io.clouds.record import Cloud

_READERS: dict[str, Callable[[Path], tuple[list[Cloud], list[str]]]] = {
    ".ply": ply.read,
    ".pcd": pcd.read,
    ".las": las.read,
    ".laz": las.read,
    ".e57": e57.read,
    ".npz": npz.read,
    ".xyz": xyz.read,
}
_WRITERS: dict[str, Callable[[Path, Cloud], list[str]]] = {
    ".ply": ply.write,
    ".pcd": pcd.write,
    ".las": las.write,
    ".laz": las.write,
    ".npz": npz.write,
    ".xyz": xyz.write,
}


def read_clouds(path: Path) -> tuple[list[Cloud], list[str]]:
    """All clouds of a file (E57 holds several, the others one), and lines about what was not read.

    Raises:
        RecordingError: the format is not known, or the file is not what its suffix says.
    """
    if path.is_dir():
        raise RecordingError(f"{path}: this is a folder; name a cloud in it, a file")
    if path.suffix in (".mcap", ".bag", ".db3"):
        raise RecordingError(f"{path}: a recording, not a cloud: `scanwright assemble` makes the one of the other")
    return _READERS[_known(path)](path)


def check_target(path: Path) -> None:
    """Refuse what cannot be written, before the work that it is to hold.

    Raises:
        RecordingError: the format is not known, or no file can be there.
    """
    _known(path)
    check_place(path, RecordingError)


def write_clouds(path: Path, clouds: Sequence[Cloud]) -> tuple[list[Path], list[str]]:
    """Write clouds, each to a file of its own where the format holds one; the files, and what they do not hold.

    Raises:
        RecordingError: the format is not known, or the file cannot be written.
    """
    suffix = _known(path)
    if suffix == ".e57":
        return [path], e57.write(path, clouds)
    paths = [path] if len(clouds) == 1 else [path.with_stem(f"{path.stem}_{k}") for k in range(1, len(clouds) + 1)]
    said = [_WRITERS[suffix](one, cloud) for one, cloud in zip(paths, clouds, strict=True)]
    return paths, list(dict.fromkeys(line for lines in said for line in lines))


def _known(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in _READERS:
        raise RecordingError(f"{path}: '{suffix}' is no format of clouds{suggest(suffix, _READERS)}")
    return suffix
