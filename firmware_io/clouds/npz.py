"""NPZ archive of NumPy, which stores all data exactly."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import atomic_write
from scanwright.design.files.numpy_files import read_npz
from scanwright.firmware_io.clouds.cloud import Cloud

_COLUMN = "column."


def read(path: Path) -> tuple[list[Cloud], list[str]]:
    """Read the cloud of a file of `write`."""
    arrays = read_npz(path, RecordingError)
    if missing := {"points_m", "shape", "T_world_cloud"} - set(arrays):
        raise RecordingError(f"{path}: no array {', '.join(sorted(missing))}: not a cloud of Scanwright")
    columns = {name.removeprefix(_COLUMN): array for name, array in arrays.items() if name.startswith(_COLUMN)}
    points_m, shape, T = arrays["points_m"], arrays["shape"], arrays["T_world_cloud"]
    for name, array, expected in (
        ("points_m", points_m, (len(points_m), 3) if points_m.ndim else ()),
        ("T_world_cloud", T, (4, 4)),
    ):
        if array.shape != expected or not expected or array.dtype not in (np.float32, np.float64):
            raise RecordingError(f"{path}: {name}: shape {array.shape}, {array.dtype}: {expected or '(n, 3)'}, float")
    if shape.shape != (2,) or shape.dtype.kind not in "iu" or int(shape[0]) * int(shape[1]) != len(points_m):
        raise RecordingError(
            f"{path}: shape = {str(shape.tolist())[:80]}: two whole numbers, {len(points_m)} rows in all"
        )
    start = arrays.get("start_ns")
    if start is not None and (start.shape or start.dtype.kind not in "iu"):
        raise RecordingError(f"{path}: start_ns = {str(start.tolist())[:80]}: one whole number")
    height, width = (int(count) for count in shape)
    start_ns = None if start is None else int(start)
    return [Cloud(points_m, columns, (height, width), T, start_ns)], []


def write(path: Path, cloud: Cloud) -> list[str]:
    """Write a cloud."""
    start = {} if cloud.start_ns is None else {"start_ns": np.int64(cloud.start_ns)}
    columns = {_COLUMN + name: column for name, column in cloud.columns.items()}
    with atomic_write(path, RecordingError) as part, part.open("wb") as stream:
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
