"""Rows of a `sensor_msgs/PointCloud2`: one per beam, NaN without a point.

Fields are named as by drivers of 3D lidars: x y z [m], intensity, ring (index of the beam), and the time after the
stamp of the message, which is that of its first beam: `t` in nanoseconds of a scan, `time` in seconds of a turn, which
lasts longer than 32 bits of nanoseconds.
"""

from __future__ import annotations

import math
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


BACK_RAD = math.radians(1.0)  # smaller reversals are noise or backlash
MOST_BEAMS = 10_000_000  # of a turn, which ends earlier if the axis is at rest


class Turns:
    """Groups placed scans to turns of the axis, as by `assemble --per turn`; each is returned once.

    A turn ends after a further 360 deg, or at a reversal; a scan belongs to the turn of its first beam. A reversal is
    detected a degree later, and the scans of that degree begin the next turn.
    """

    def __init__(self) -> None:
        self._lines: list[ScanPoints] = []
        self._beams = 0
        self._sense = 0
        self._begin_rad = self._extreme_rad = math.nan
        self._extreme = 0  # index of the scan at the extreme angle

    def push(self, line: ScanPoints) -> list[list[ScanPoints]]:
        """Add a scan, and return the turns that it ends."""
        done = []
        joint_rad = float(line.joint_rad[0]) if line.joint_rad.size else math.nan
        if not math.isnan(joint_rad):
            if self._sense and (self._extreme_rad - joint_rad) * self._sense > BACK_RAD:
                done.append(self._cut(self._extreme + 1, self._extreme_rad))
                self._sense = -self._sense
            if math.isnan(self._begin_rad):
                self._begin_rad = self._extreme_rad = joint_rad
            turn_rad, turned_rad = 2 * math.pi, abs(joint_rad - self._begin_rad)
            if turned_rad >= turn_rad:
                turns = math.copysign(turn_rad * (turned_rad // turn_rad), joint_rad - self._begin_rad)
                done.append(self._cut(len(self._lines), self._begin_rad + turns))
            ahead_rad = joint_rad - self._extreme_rad
            if not self._sense and abs(ahead_rad) > BACK_RAD:
                self._sense = 1 if ahead_rad > 0 else -1
            if self._sense and ahead_rad * self._sense >= 0:
                self._extreme, self._extreme_rad = len(self._lines), joint_rad
        if self._lines and self._beams + line.scan.range_m.size > MOST_BEAMS:
            done.append(self._cut(len(self._lines), self._begin_rad))
        self._lines.append(line)
        self._beams += line.scan.range_m.size
        return [turn for turn in done if turn]

    def finish(self) -> list[list[ScanPoints]]:
        """Return the incomplete turn."""
        turn = self._cut(len(self._lines), math.nan)
        return [turn] if turn else []

    def _cut(self, count: int, begin_rad: float) -> list[ScanPoints]:
        """Return the first `count` scans; the others begin a turn at an angle."""
        turn, self._lines = self._lines[:count], self._lines[count:]
        self._beams = sum(line.scan.range_m.size for line in self._lines)
        self._begin_rad, self._extreme = begin_rad, len(self._lines) - 1
        return turn
