"""Turns of sensors that see all around, cut from a stream of points whose bearings and times wander."""

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

_MEAN_TURNS = 64  # speeds wander by a per cent, and a pause of 10 s is 100 turns
_BACK_DEG = 10.0  # by which the angle of a point may lie before that of the one before it


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Consecutive points of a sensor that turns clockwise, as seen from above."""

    angle_deg: Float64[ndarray, " n"]  # clockwise from its front, shape (n,)
    range_m: Float32[ndarray, " n"]  # NaN without a return, shape (n,)
    intensity: Float32[ndarray, " n"]  # as reported, shape (n,)
    sensor_ns: Float64[ndarray, " n"]  # when each was measured, on a clock that runs evenly, shape (n,)

    def part(self, where: slice) -> Points:
        """Some of them."""
        return Points(self.angle_deg[where], self.range_m[where], self.intensity[where], self.sensor_ns[where])


class TurnCutter:
    """Cuts a stream of points at the sensor's front; the incomplete first turn is dropped.

    Angles of triangulating sensors go back a little: a turn ends where its front is first passed, so the next one can
    begin a little before 0 and end a little after 360 deg.
    """

    def __init__(self) -> None:
        self._parts: list[Points] | None = None
        self._last_deg: float | None = None

    def add(self, points: Points) -> list[Points]:
        """The turns that these points end."""
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
                turns.append(_joined([*self._parts, counted.part(slice(begin, end))]))
            self._parts, begin = [], end
        if self._parts is not None:
            self._parts.append(counted.part(slice(begin, None)))
        return turns


class TurnQueue:
    """Turns that wait to be read."""

    def __init__(self) -> None:
        self.dropped = 0  # missing turns between returned or skipped ones
        self.begin_anew(0)

    def begin_anew(self, skip: int) -> None:
        """A new stream, before which nothing is missing; of its turns `skip` are left out between two."""
        self._begin_ns = self._seen = 0
        self._turn_ns = 0.0
        self._skip = self._skipped = skip
        self.resume()

    def resume(self) -> None:
        """What comes next does not continue what came: turns between are missing, and a new line tells the time."""
        self._waiting: deque[tuple[Points, int]] = deque()
        self.cut()

    def cut(self) -> None:
        """Points are missing: the turn that they were of is left out."""
        self._cutter = TurnCutter()

    def add(self, points: Points, arrival_ns: int) -> None:
        """Points that came together."""
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
    """A turn on the host's clock; its even grid is the one from its first to its last beam."""
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


def _joined(parts: list[Points]) -> Points:
    return Points(
        np.concatenate([part.angle_deg for part in parts]),
        np.concatenate([part.range_m for part in parts]),
        np.concatenate([part.intensity for part in parts]),
        np.concatenate([part.sensor_ns for part in parts]),
    )
