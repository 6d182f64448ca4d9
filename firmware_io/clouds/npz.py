"""NumPy's own archive: holds everything exactly."""

from __future__ import annotations

from pathlib import Path
from zipfile import is_zipfile

import numpy as np

from design.atomic_file import whole_file
from design.errors import RecordingError
from firmware_io.clouds.cloud import Cloud
from firmware_io.foreign import foreign

_COLUMN = "column."


def read(path: Path) -> tuple[list[Cloud], list[str]]:
    """The cloud of a file such as `write` makes."""
    with foreign(f"{path}: cannot read", path.open, "rb") as stream:
        if not is_zipfile(stream):
            raise RecordingError(f"{path}: not an archive of NumPy, or cut off")
    with foreign(f"{path}: cannot read", np.load, path, allow_pickle=False) as archive:
        missing = {"points_m", "shape", "T_world_cloud"} - set(archive)
        if missing:
            raise RecordingError(f"{path}: no array {', '.join(sorted(missing))}: not a cloud of ours")
        held = {name: foreign(f"{path}: cannot read {name}", archive.__getitem__, name) for name in archive}
    columns = {name.removeprefix(_COLUMN): array for name, array in held.items() if name.startswith(_COLUMN)}
    height, width = (int(count) for count in held["shape"])
    start_ns = int(held["start_ns"]) if "start_ns" in held else None
    return [Cloud(held["points_m"], columns, (height, width), held["T_world_cloud"], start_ns)], []


def write(path: Path, cloud: Cloud) -> list[str]:
    """Write a cloud."""
    start = {} if cloud.start_ns is None else {"start_ns": np.int64(cloud.start_ns)}
    columns = {_COLUMN + name: column for name, column in cloud.columns.items()}
    with whole_file(path, RecordingError) as part, part.open("wb") as stream:
        np.savez(
            stream,
            allow_pickle=False,
            points_m=cloud.points_m,
            shape=np.array(cloud.shape),
            T_world_cloud=cloud.T_world_cloud,
            **start,
            **columns,
        )
    return []
