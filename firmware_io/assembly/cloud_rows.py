"""Rows of assembled clouds: x y z of each beam, and further columns."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from scanwright.firmware_io.assembly.deskew_kernel import PlacedBlock
from scanwright.firmware_io.assembly.options import COLUMNS
from scanwright.firmware_io.clouds.cloud import COLUMN_TYPES
from scanwright.firmware_io.samples import Block


def cloud_fields(has_intensity: bool, columns: Iterable[str] = COLUMNS) -> np.dtype[np.void]:
    """Return the fields of a row, without intensity if the recording has none."""
    # joint_rad counts turns: after ten minutes the resolution of float32 would be 0.01 deg
    names = [name for name in COLUMNS if name in columns and (has_intensity or name != "intensity")]
    return np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), *((name, COLUMN_TYPES[name]) for name in names)])


def cloud_rows(
    block: Block, placed: PlacedBlock, fields: np.dtype[np.void], start_ns: int, width: int
) -> NDArray[np.void]:
    """Return rows of a cloud, shape (scans, width); those after the last beam are NaN. `start_ns`: time_s is 0."""
    scans, beams = block.range_m.shape
    rows = np.empty((scans, width), fields)
    point = rows.getfield("V12")  # x y z together, three times faster than three columns
    point[:, :beams] = placed.points_m.view("V12")[:, :, 0]
    point[:, beams:] = np.full(3, np.nan, np.float32).view("V12")
    names = fields.names or ()
    if "intensity" in names:
        lit = block.intensity.shape[1]
        rows["intensity"][:, :lit] = block.intensity
        rows["intensity"][:, lit:] = np.nan
    if "time_s" in names:
        after_ns = block.first.time_ns - block.first.stamp_ns
        rows["time_s"][:, :beams] = (np.add.outer(block.stamp_ns - start_ns, after_ns)) / 1e9
        rows["time_s"][:, beams:] = np.nan
    if "joint_rad" in names:
        rows["joint_rad"][:, :beams] = placed.joint_rad
        rows["joint_rad"][:, beams:] = np.nan
    if "ring" in names:
        rows["ring"] = np.arange(width)
    return rows
