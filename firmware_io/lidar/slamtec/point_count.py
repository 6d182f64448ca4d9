"""Points of an RPLIDAR's packets, with angles and times: they follow evenly, and their count is the clock."""

from __future__ import annotations

import math

import numpy as np

from scanwright.firmware_io.lidar.arrival_line import ArrivalLine
from scanwright.firmware_io.lidar.slamtec import protocol
from scanwright.firmware_io.lidar.turn import Points

_RATE_MAX = 0.05  # of points per second beside what it states: A1s measure 4 to 8 thousand
_JUMP_DEG = 20.0  # from node to node: some were lost; angles that are triangulated go to and fro by less
_UNEVEN = 0.1  # of a capsule's span, which no motor changes so fast: something was lost between two


class PointCount:
    """What was measured since the stream began.

    Attributes:
        arrivals: the sensor's time, told by the count, on the host's clock.
        broken: so much was lost that nobody can tell how many points; what comes next needs a new count.
    """

    def __init__(self, kind: int, point_ns: float, baud: int) -> None:
        """Nothing was measured yet.

        Args:
            kind: type of the packets.
            point_ns: between two points, as the sensor states it.
            baud: of its line.
        """
        self._kind, self._point_ns = kind, point_ns
        packet_ns = round(protocol.SIZES[kind] * 10 / baud * 1e9)
        self.arrivals = ArrivalLine(smallest_delay_ns=packet_ns, rate_max=_RATE_MAX, grain_ns=point_ns)
        self.broken = False
        self._before: protocol.SlamtecPacket | None = None
        self._points = 0
        self._span_deg = 0.0  # of a capsule; 0 before one was whole

    def placed(self, packets: list[tuple[protocol.SlamtecPacket, int]], arrival_ns: int) -> list[Points]:
        """The points that are known now, up to where the count breaks.

        Args:
            packets: that came together, at least one, each with how many bytes were passed over before it.
            arrival_ns: when they came.
        """
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
        """Points with angles of their own; what was passed over was some of them, a jump tells of others."""
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
        """Its start ends the capsule before it, whose points are placed now; lost ones are told by the angle.

        It tells them but for whole turns. What comes half a turn late behind lost ones has more of them before it, and
        what comes before the lost ones could have been measured has none: the motor is changing its speed.
        """
        many = protocol.POINTS[self._kind]
        before, self._before = self._before, packet
        points = None
        if before is not None:
            span_deg = (packet.start_deg - before.start_deg) % 360
            capsules = span_deg / self._span_deg if self._span_deg else 1.0
            lost = max(round(capsules) - 1, 0)
            if lost or after_garbage or abs(capsules - 1) > _UNEVEN:
                late_ns = arrival_ns - self.arrivals.arrives_ns((self._points + many * (lost + 1) - 1) * self._point_ns)
                if self._span_deg and late_ns > 180 / self._span_deg * many * self._point_ns:
                    self.broken = True
                    return None
                if late_ns < -lost * many * self._point_ns / 2:
                    lost = 0
            if lost == 0 and not after_garbage:
                self._span_deg = span_deg
                number = self._points + np.arange(-many, 0)
                angle_deg = (before.start_deg + np.arange(many) * (span_deg / many) - before.offset_deg) % 360
                points = Points(angle_deg, before.range_m, before.quality, number * self._point_ns)
            self._points += many * lost
        self._points += many
        self.arrivals.add((self._points - 1) * self._point_ns, arrival_ns)
        return points
