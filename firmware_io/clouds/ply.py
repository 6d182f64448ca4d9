"""PLY: holds everything, shape, pose and start as comments. It has no integers of 64 bits."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from firmware_io.clouds.point_file import PlyWriter, ply_comments, read_ply
from firmware_io.clouds.record import Cloud, cloud_of, headlines, rows_of


def read(path: Path) -> tuple[list[Cloud], list[str]]:
    """The cloud of a file."""
    return [cloud_of(read_ply(path), ply_comments(path))], []


def write(path: Path, cloud: Cloud) -> list[str]:
    """Write a cloud; lines about what the file does not hold."""
    rows = rows_of(cloud)
    wide = [name for name in rows.dtype.names or () if rows.dtype[name].kind in "iu" and rows.dtype[name].itemsize == 8]
    kinds = [(name, "<f8" if name in wide else rows.dtype[name].str) for name in rows.dtype.names or ()]
    with PlyWriter(path, np.dtype(kinds), [*headlines(cloud), "x y z in m"]) as stream:
        stream.write(rows.astype(kinds))
    return [f"PLY has no 64-bit integers: {name} is written as double" for name in wide]
