"""Angles and times of an RPLIDAR's points, which are evenly spaced: their count is the clock."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from scanwright.firmware_io.lidar.arrival_line import ArrivalLine
from scanwright.firmware_io.lidar.slamtec import protocol
from scanwright.firmware_io.lidar.turn import Points

_RATE_MAX = 0.05  # relative error of the stated rate of points: A1s measure 4 to 8 thousand a second
_JUMP_DEG = 20.0  # between two nodes if some were lost; triangulated angles vary by less
_UNEVEN = 0.1  # relative change of a capsule's span that a motor at speed does not reach: some were lost
_BEYOND = 1.5  # times the span at full speed: between one capsule and two
_EVEN = 5  # capsules with equal spans that show a motor at speed: 60 ms of an A1, 6 ms of an S2


class PointCount:
    """Numbers points since the stream began; `arrivals` converts their count to host time."""

    def __init__(self, kind: int, point_ns: float, baud: int) -> None:
        """`kind`: type of the packets; `point_ns`: stated time between two points."""
        self._kind, self._point_ns = kind, point_ns
        packet_ns = round(protocol.SIZES[kind] * 10 / baud * 1e9)
        self.arrivals = ArrivalLine(smallest_delay_ns=packet_ns, rate_max=_RATE_MAX, grain_ns=point_ns)
        self.broken = False  # an unknown number of points was lost: start a new count
        self._before: protocol.SlamtecPacket | None = None
        self._points = 0
        self._spans_deg: deque[float] = deque(maxlen=_EVEN)  # of the last capsules
        self._fastest_deg = 0.0  # span at the highest even speed

    def placed(self, packets: list[tuple[protocol.SlamtecPacket, int]], arrival_ns: int) -> list[Points]:
        """Return the completed points, up to a break; `packets` have the number of bytes skipped before each."""
        if self.arrivals.is_behind:
            self.broken = True
            return []
        if self._kind == protocol.NODES:
            return self._nodes(packets, arrival_ns)
        placed = []
        for packet, passed in packets:
            points = self._capsule(packet, passed > 0, arrival_ns)
            if self.broken:
                break
            if points is not None:
                placed.append(points)
        return placed

    def _nodes(self, packets: list[tuple[protocol.SlamtecPacket, int]], arrival_ns: int) -> list[Points]:
        """Place nodes; skipped bytes and jumps of the angle are lost ones."""
        before = [packets[0][0] if self._before is None else self._before, *(packet for packet, _ in packets)]
        self._before = packets[-1][0]
        steps_deg = np.diff([packet.start_deg for packet in before])
        if (np.abs((steps_deg + 180) % 360 - 180) > _JUMP_DEG).any():
            self.broken = True
            return []
        number = np.cumsum([1 + math.ceil(passed / protocol.SIZES[protocol.NODES]) for _, passed in packets])
        sensor_ns = (self._points + number - 1) * self._point_ns
        self._points += int(number[-1])
        self.arrivals.add(float(sensor_ns[-1]), arrival_ns)
        angle_deg = np.array([packet.start_deg for packet, _ in packets])
        range_m = np.concatenate([packet.range_m for packet, _ in packets])
        quality = np.concatenate([packet.quality for packet, _ in packets])
        return [Points(angle_deg, range_m, quality, sensor_ns)]

    def _capsule(self, packet: protocol.SlamtecPacket, after_garbage: bool, arrival_ns: int) -> Points | None:
        """Place the points of the capsule before this one, which ends at this one's start."""
        many = protocol.POINTS[self._kind]
        before, self._before = self._before, packet
        points = None
        if before is not None:
            span_deg = (packet.start_deg - before.start_deg) % 360
            lost = self._lost(span_deg, after_garbage, arrival_ns)
            if self.broken:
                return None
            if lost == 0 and not after_garbage:
                self._spans_deg.append(span_deg)
                whole = before.before(packet)
                number = self._points + np.arange(-many, 0)
                angle_deg = (before.start_deg + np.arange(many) * (span_deg / many) - whole.offset_deg) % 360
                points = Points(angle_deg, whole.range_m, whole.quality, number * self._point_ns)
            self._points += many * lost
        self._points += many
        self.arrivals.add((self._points - 1) * self._point_ns, arrival_ns)
        return points

    def _lost(self, span_deg: float, after_garbage: bool, arrival_ns: int) -> int:
        """Return the number of capsules lost between two starts; sets `broken` if unknown.

        At full speed the span shows it, except for entire turns. A capsule half a turn late follows lost ones; one too
        early follows none: the motor changes its speed. While the motor starts, none are lost between contiguous bytes.
        """
        if len(self._spans_deg) < _EVEN or max(self._spans_deg) > (1 + _UNEVEN) * min(self._spans_deg):
            self.broken = after_garbage
            return 0
        usual_deg = sum(self._spans_deg) / _EVEN
        self._fastest_deg = max(self._fastest_deg, usual_deg)
        if not usual_deg:  # the motor is at rest
            return 0
        many_ns = protocol.POINTS[self._kind] * self._point_ns
        capsules = span_deg / usual_deg
        lost = max(round(capsules) - 1, 0)
        if lost or after_garbage or abs(capsules - 1) > _UNEVEN:
            last_ns = self._points * self._point_ns + (lost + 1) * many_ns - self._point_ns
            late_ns = arrival_ns - self.arrivals.arrives_ns(last_ns)
            self.broken = late_ns > 180 / usual_deg * many_ns
            if late_ns < -lost * many_ns / 2 or (not after_garbage and span_deg < _BEYOND * self._fastest_deg):
                return 0
        return lost
