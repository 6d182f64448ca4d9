"""A recording as arrays, for notebooks: each scan a row, each beam a column."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanwright.design.arrays import Floats, Times
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.samples import JointLog, Scan


@dataclass(frozen=True, slots=True, eq=False)
class RecordingArrays:
    """All scans and angles; beam i of scan k is at [k, i].

    Attributes:
        time_ns: of each beam, shape (scans, beams).
        bearing_rad: in the scan plane, shape (scans, beams); NaN after the last beam of a short scan.
        range_m: shape (scans, beams); NaN, inf or 0 without a return.
        intensity: shape (scans, beams), or (scans, 0) if the sensor measures none.
        joint_log: angle of the servo.
    """

    time_ns: Times
    bearing_rad: Floats
    range_m: NDArray[np.float32]
    intensity: NDArray[np.float32]
    joint_log: JointLog

    @property
    def joint_rad(self) -> Floats:
        """Servo angle at the time of each beam by linear interpolation, shape (scans, beams); NaN outside the log."""
        return self.joint_log.angle_at(self.time_ns.ravel()).reshape(self.time_ns.shape)


def arrays_of(scans: Sequence[Scan], joint_log: JointLog) -> RecordingArrays:
    """Return all scans, short ones padded; RecordingError without a scan."""
    if not scans:
        raise RecordingError("no scan: there is nothing to put into arrays")
    shape = len(scans), max(scan.range_m.size for scan in scans)
    lit = max(scan.intensity.size for scan in scans)
    time_ns = np.zeros(shape, np.int64)
    bearing_rad = np.full(shape, np.nan)
    range_m = np.full(shape, np.nan, np.float32)
    intensity = np.full((shape[0], lit), np.nan, np.float32)
    for row, scan in enumerate(scans):
        beams = scan.range_m.size
        time_ns[row] = scan.stamp_ns
        time_ns[row, :beams] = scan.time_ns
        bearing_rad[row, :beams] = scan.bearing_rad
        range_m[row, :beams] = scan.range_m
        intensity[row, : scan.intensity.size] = scan.intensity
    return RecordingArrays(time_ns, bearing_rad, range_m, intensity, joint_log)
