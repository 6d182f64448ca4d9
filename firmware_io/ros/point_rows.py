"""Rows of a `sensor_msgs/PointCloud2`: one per beam, NaN without a point.

Fields are named as by drivers of 3D lidars: x y z [m], intensity, ring (index of the beam), and the time after the
stamp of the message, which is that of its first beam: `t` in nanoseconds of a scan, `time` in seconds of a turn, which
lasts longer than 32 bits of nanoseconds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scanwright.design.angles import AngleSet
from scanwright.firmware_io.assembly.streaming import ScanPoints

POINT = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("t", "<u4"), ("ring", "<u2")],
)
TURN_POINT = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("time", "<f8"), ("ring", "<u2")],
)


def point_rows(line: ScanPoints) -> NDArray[np.void]:
    """Return the rows of one scan, shape (beams,), of `POINT`; intensity is NaN if the sensor measures none."""
    rows = np.empty(line.scan.range_m.size, POINT)
    _fill(rows, line)
    rows["t"] = line.scan.time_ns - line.scan.stamp_ns
    return rows


def turn_rows(lines: Sequence[ScanPoints]) -> NDArray[np.void]:
    """Return the rows of the scans of a turn, shape (scans, beams), of `TURN_POINT`; NaN after the last beam."""
    rows = np.empty((len(lines), max(line.scan.range_m.size for line in lines)), TURN_POINT)
    for name in ("x", "y", "z", "intensity", "time"):
        rows[name] = np.nan
    rows["ring"] = np.arange(rows.shape[1])
    for row, line in zip(rows, lines, strict=True):
        beams = row[: line.scan.range_m.size]
        _fill(beams, line)
        beams["time"] = (line.scan.time_ns - lines[0].scan.stamp_ns) / 1e9
    return rows


def in_rot(line: ScanPoints, angles: AngleSet) -> ScanPoints:
    """Return the scan in the frame `rot` at the time of the first beam, the stamp."""
    T_rot_world = np.linalg.inv(angles.T_world_rot(float(line.joint_rad[0])))
    points_m = line.points_m.astype(np.float64) @ T_rot_world[:3, :3].T + T_rot_world[:3, 3]
    return replace(line, points_m=points_m.astype(np.float32))


def _fill(rows: NDArray[np.void], line: ScanPoints) -> None:
    for column, name in enumerate("xyz"):
        rows[name] = line.points_m[:, column]
    rows["intensity"] = line.scan.intensity if line.scan.intensity.size else np.nan
    rows["ring"] = np.arange(rows.size)
