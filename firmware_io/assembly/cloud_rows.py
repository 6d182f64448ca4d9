"""The rows of our clouds: x y z of each beam, and what else is known of it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from scanwright.firmware_io.assembly.deskew_kernel import PlacedBlock
from scanwright.firmware_io.assembly.options import COLUMNS
from scanwright.firmware_io.clouds.cloud import COLUMN_TYPES
from scanwright.firmware_io.samples import Block

"""What a cloud can tell of each point beside x y z."""


def cloud_fields(has_intensity: bool, columns: Iterable[str] = COLUMNS) -> np.dtype[np.void]:
    """Columns of our clouds. A recording without intensities has no such column."""
    # joint_rad counts turns: after ten minutes float32 would be a hundredth of a degree coarse
    wanted = [name for name in COLUMNS if name in columns and (has_intensity or name != "intensity")]
    return np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), *((name, COLUMN_TYPES[name]) for name in wanted)])


def cloud_rows(
    block: Block, placed: PlacedBlock, fields: np.dtype[np.void], start_ns: int, width: int
) -> NDArray[np.void]:
    """Rows of a cloud, shape (scans, width); those behind the last beam are NaN.

    Args:
        block: scans with as many beams each.
        placed: their beams in the world.
        fields: as `cloud_fields` has them.
        start_ns: from which time_s counts.
        width: at least the beams of a scan.
    """
    scans, beams = block.range_m.shape
    rows = np.empty((scans, width), fields)
    point = rows.getfield("V12")  # x y z as one: three columns would take three passes
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
