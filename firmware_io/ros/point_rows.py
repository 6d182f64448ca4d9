"""The points of a scan as `sensor_msgs/PointCloud2` holds them: a row for every beam, NaN where it became no point.

Fields are named as drivers of 3D lidars name them, so that what reads those reads this: x y z [m], intensity, t
(nanoseconds after the stamp of the message, which is the time of the first beam) and ring (the beam's index).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from firmware_io.assembly.streaming import ScanPoints

POINT = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("t", "<u4"), ("ring", "<u2")],
)


def point_rows(line: ScanPoints) -> NDArray[np.void]:
    """The rows of one scan, shape (beams,), of `POINT`; intensity is NaN from a sensor that measures none."""
    rows = np.empty(line.scan.range_m.size, POINT)
    for column, name in enumerate("xyz"):
        rows[name] = line.points_m[:, column]
    rows["intensity"] = line.scan.intensity if line.scan.intensity.size else np.nan
    rows["t"] = line.scan.time_ns - line.scan.stamp_ns
    rows["ring"] = np.arange(rows.size)
    return rows
