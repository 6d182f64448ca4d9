"""Turns of sensors that see all around, cut from a stream of points whose bearings and times wander."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64
from numpy import ndarray

from design.catalogue.products import Lidar
from firmware_io.lidar.arrival_line import ArrivalLine
from firmware_io.lidar.lidar import TimedScan
from firmware_io.samples import Scan


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Consecutive points of a sensor that turns clockwise, as seen from above.

    Attributes:
        angle_deg: clockwise from its front, 0 to 360, shape (n,).
        range_m: NaN where nothing came back, shape (n,).
        intensity: as it tells them, shape (n,).
        sensor_ns: when each was measured, on a clock that runs evenly, shape (n,).
    """

    angle_deg: Float64[ndarray, " n"]
    range_m: Float32[ndarray, " n"]
    intensity: Float32[ndarray, " n"]
    sensor_ns: Float64[ndarray, " n"]

    def part(self, where: slice) -> Points:
        """Some of them."""
        return Points(self.angle_deg[where], self.range_m[where], self.intensity[where], self.sensor_ns[where])


class TurnCutter:
    """Cuts a stream of points where it passes the front; the turn in which it begins is not whole, and left out."""

    def __init__(self) -> None:
        self._parts: list[Points] | None = None
        self._last_deg: float | None = None

    def add(self, points: Points) -> list[Points]:
        """The turns that these points end."""
        before_deg = points.angle_deg[0] if self._last_deg is None else self._last_deg
        behind = np.diff(points.angle_deg, prepend=before_deg) < -180
        self._last_deg = float(points.angle_deg[-1])
        turns = []
        begin = 0
        for end in np.flatnonzero(behind):
            if self._parts is not None:
                turns.append(_joined([*self._parts, points.part(slice(begin, end))]))
            self._parts, begin = [], int(end)
        if self._parts is not None:
            self._parts.append(points.part(slice(begin, None)))
        return turns


def timed_scan(turn: Points, line: ArrivalLine, lidar: Lidar, arrival_ns: int, *, intensity: bool) -> TimedScan:
    """A turn on the host's clock; its even grid is the one from its first to its last beam."""
    offset_ns = np.maximum.accumulate(np.rint(turn.sensor_ns - turn.sensor_ns[0])).astype(np.int64)
    bearing_rad = -np.radians(turn.angle_deg)
    between = max(turn.angle_deg.size - 1, 1)
    scan = Scan(
        stamp_ns=line.host_ns(float(turn.sensor_ns[0])),
        angle_min_rad=float(bearing_rad[0]),
        angle_increment_rad=float(bearing_rad[-1] - bearing_rad[0]) / between,
        time_increment_s=float(offset_ns[-1]) / 1e9 / between,
        scan_time_s=float(offset_ns[-1]) / 1e9 * (between + 1) / between,
        range_min_m=lidar.range_min_mm / 1e3,
        range_max_m=lidar.range_max_mm / 1e3,
        range_m=turn.range_m,
        intensity=turn.intensity if intensity else np.empty(0, np.float32),
        beam_bearing_rad=bearing_rad,
        beam_offset_ns=offset_ns,
    )
    return TimedScan(scan, arrival_ns, line.uncertainty_ns)


def _joined(parts: list[Points]) -> Points:
    return Points(
        np.concatenate([part.angle_deg for part in parts]),
        np.concatenate([part.range_m for part in parts]),
        np.concatenate([part.intensity for part in parts]),
        np.concatenate([part.sensor_ns for part in parts]),
    )
