"""Turns of 360 deg sensors, cut from a stream of points with uneven bearings and times."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64
from numpy import ndarray

from scanwright.design.catalogue.lidar import Lidar
from scanwright.firmware_io.lidar.arrival_line import ArrivalLine
from scanwright.firmware_io.lidar.lidar import TimedScan
from scanwright.firmware_io.samples import Scan

_MEAN_TURNS = 64  # speeds vary by 1 %, and a pause of 10 s is 100 turns
_BACK_DEG = 10.0  # largest decrease of the angle between two points


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Consecutive points of a sensor that turns clockwise, as seen from above."""

    angle_deg: Float64[ndarray, " n"]  # clockwise from its front, shape (n,)
    range_m: Float32[ndarray, " n"]  # NaN without a return, shape (n,)
    intensity: Float32[ndarray, " n"]  # as reported, shape (n,)
    sensor_ns: Float64[ndarray, " n"]  # sensor time of each, shape (n,)

    def part(self, rows: slice) -> Points:
        """Return some of the points."""
        return Points(self.angle_deg[rows], self.range_m[rows], self.intensity[rows], self.sensor_ns[rows])


class TurnCutter:
    """Splitter of a stream of points at the sensor's front; drops the incomplete first turn.

    Angles of triangulating sensors can decrease: a turn ends at the first point past the front, so the next one can
    begin a little before 0 and end a little after 360 deg.
    """

    def __init__(self) -> None:
        self._parts: list[Points] | None = None
        self._last_deg: float | None = None

    def add(self, points: Points) -> list[Points]:
        """Return the turns that these points end."""
        before_deg = points.angle_deg[0] if self._last_deg is None else self._last_deg
        steps_deg = (np.diff(points.angle_deg, prepend=before_deg) + _BACK_DEG) % 360 - _BACK_DEG
        counted_deg = before_deg + np.cumsum(steps_deg)
        turn = np.maximum.accumulate(np.maximum(np.floor(counted_deg / 360), 0))
        angle_deg = counted_deg - 360 * turn
        self._last_deg = float(angle_deg[-1])
        counted = Points(angle_deg, points.range_m, points.intensity, points.sensor_ns)
        turns = []
        begin = 0
        for end in np.flatnonzero(np.diff(turn, prepend=0) > 0).tolist():
            if self._parts is not None:
                parts = [*self._parts, counted.part(slice(begin, end))]
                columns = ("angle_deg", "range_m", "intensity", "sensor_ns")
                turns.append(Points(*(np.concatenate([getattr(part, name) for part in parts]) for name in columns)))
            self._parts, begin = [], end
        if self._parts is not None:
            self._parts.append(counted.part(slice(begin, None)))
        return turns


class TurnQueue:
    """Queue of unread turns."""

    def __init__(self) -> None:
        self.dropped = 0  # missing turns between returned or skipped ones
        self.restart(0)

    def restart(self, skip: int) -> None:
        """Start a new stream, without missing turns before it; skip `skip` turns after each returned one."""
        self._begin_ns = self._seen = 0
        self._turn_ns = 0.0
        self._skip = self._skipped = skip
        self.resume()

    def resume(self) -> None:
        """Drop waiting turns; the next points have a new line, and turns before them are missing."""
        self._waiting: deque[tuple[Points, int]] = deque()
        self.cut()

    def cut(self) -> None:
        """Drop the present turn, which misses points."""
        self._cutter = TurnCutter()

    def add(self, points: Points, arrival_ns: int) -> None:
        """Add points of one arrival."""
        self._waiting.extend((turn, arrival_ns) for turn in self._cutter.add(points))

    def next(self, line: ArrivalLine) -> tuple[Points, int] | None:
        """Return the next complete turn and its arrival, or None; `line` counts the missing turns."""
        while self._waiting:
            turn, arrival_ns = self._waiting.popleft()
            begin_ns, end_ns = (line.host_ns(float(turn.sensor_ns[at])) for at in (0, -1))
            turn_ns = (end_ns - begin_ns) * turn.sensor_ns.size / max(turn.sensor_ns.size - 1, 1)
            self._seen += 1
            self._turn_ns += (turn_ns - self._turn_ns) / min(self._seen, _MEAN_TURNS)
            if self._begin_ns and self._turn_ns > 0:
                self.dropped += max(round((begin_ns - self._begin_ns) / self._turn_ns) - 1, 0)
            self._begin_ns = begin_ns
            self._skipped += 1
            if self._skipped > self._skip:
                self._skipped = 0
                return turn, arrival_ns
        return None


def timed_scan(
    turn: Points, line: ArrivalLine, lidar: Lidar, arrival_ns: int, uncertainty_ns: int, *, intensity: bool
) -> TimedScan:
    """Convert a turn to host time; its even grid spans the first to the last beam."""
    since_ns = (turn.sensor_ns - turn.sensor_ns[0]) * line.rate
    offset_ns = np.maximum.accumulate(np.rint(since_ns)).astype(np.int64)
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
    return TimedScan(scan, arrival_ns, uncertainty_ns)
