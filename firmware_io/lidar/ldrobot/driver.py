"""LDROBOT lidar on a serial line. It sends from power-up and accepts no commands, so nothing is started or stopped.

It reports no model or serial number. The rate of points distinguishes the STL27L from the LD06 and LD19.
"""

from __future__ import annotations

import math
import time
from collections import deque
from fractions import Fraction

import numpy as np

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import DeviceError, DeviceTimeoutError
from scanwright.firmware_io.lidar.arrival_line import QUARTZ_RATE, ArrivalLine
from scanwright.firmware_io.lidar.ldrobot import protocol
from scanwright.firmware_io.lidar.lidar import StampAt, TimedScan
from scanwright.firmware_io.lidar.sensor_line import LineDriver, SensorLine
from scanwright.firmware_io.lidar.turn import Points, TurnQueue, timed_scan

FAMILY = "ldrobot"

_BAUDS = {"LD06": 230_400, "LD19": 230_400, "STL-19P": 230_400, "STL27L": 921_600}  # data sheets of LDROBOT
_FIRST_PACKETS_S = 0.5  # it sends hundreds of packets a second
_SILENCE_NS = 500_000_000  # after which the sensor may have restarted
_PAUSE_S = 0.5  # pause of the reader across which timestamps show which packets waited or were lost
_FIRST_PAUSE_S = 0.1  # the same, before the clock is known
_FIRST = 3  # packets that must agree on the rate of points
_STAMPS = 64  # packets over which timestamps are averaged


class _PacketClock:
    """Sensor time of each packet, finer than its timestamps because packets are evenly spaced.

    Times drift by the error of the mean over few stamps, so a line through arrivals needs many.
    """

    def __init__(self, period_ms: float) -> None:
        self._period_ms = period_ms
        self._begin: deque[float] = deque(maxlen=_STAMPS)
        self._number = 0
        self._last = (0, 0)  # unwrapped stamp [ms], arrival [ns]

    @property
    def is_known(self) -> bool:
        """Whether enough stamps are averaged."""
        return len(self._begin) == _STAMPS

    def sensor_ns(self, stamp_ms: int, lost: int, arrival_ns: int) -> float:
        """Return the time of a packet's last point, NaN if the clock restarted; `lost`: packets before it."""
        last_ms, last_ns = self._last
        step_ms = (stamp_ms - last_ms) % protocol.STAMP_WRAP_MS
        elapsed_ms = (arrival_ns - last_ns) / 1e6
        if self._begin and step_ms > elapsed_ms + 1000:  # no buffer holds a second
            return math.nan
        unwrapped_ms = last_ms + step_ms if self._begin else stamp_ms
        self._last = (unwrapped_ms, arrival_ns)
        self._number += 1 + lost
        if abs(step_ms - (1 + lost) * self._period_ms) > 2 * self._period_ms + 2:  # entire turns are missing
            self._begin.clear()
        # stamps are rounded down: on average the time is half a millisecond later
        self._begin.append(unwrapped_ms + 0.5 - self._number * self._period_ms)
        return (sum(self._begin) / len(self._begin) + self._number * self._period_ms) * 1e6


class LdrobotLidar(LineDriver):
    """An LDROBOT lidar; it reports no serial number and no version."""

    def __init__(self, address: str, model: str | None = None, _stamp_at: StampAt | None = None) -> None:
        """Open it; without `model`, choose the first product of the catalogue whose rate of points fits."""
        self.address = address
        self._turns = TurnQueue()
        self._line = SensorLine(address, 2 * protocol.SIZE)
        self._lidar = self._recognised(model)

    @property
    def dropped(self) -> int:
        """Missing turns between those read."""
        return self._turns.dropped

    def _begin(self, intensity: bool, skip: int) -> None:
        self._intensity = intensity
        self._turns.restart(skip)
        self._resume()

    def _turn(self, deadline_s: float) -> TimedScan | None:
        while (turn := self._turns.next(self._arrivals)) is None:
            pause_s = _PAUSE_S if self._clock.is_known else _FIRST_PAUSE_S
            packets, arrival_ns = self._line.receive(deadline_s, pause_s)
            if packets and self._arrivals.is_behind:
                self._line.drop_waiting()
                packets = []
            if not packets:
                self._resume()
                return None
            for packet in packets:
                self._add(packet, arrival_ns)
        uncertainty_ns = self._line.widened(self._arrivals.uncertainty_ns)
        return timed_scan(turn[0], self._arrivals, self._lidar, turn[1], uncertainty_ns, intensity=self._intensity)

    def _find(self) -> None:
        self._line.reopen()
        self._lidar = self._recognised(self.model)

    def _recognised(self, model: str | None) -> Lidar:
        """Detect model and baud rate; close the line if nothing is received."""
        products = [product for product in load_catalogue() if isinstance(product, Lidar) and product.name in _BAUDS]
        named = [product for product in products if model in (None, product.name)]
        with self._line.closed_on_error():
            for baud in dict.fromkeys(_BAUDS[product.name] for product in named):
                if self._line.serial is not None:
                    self._line.serial.baud = baud
                self._line.split_by(protocol.LdrobotSplitter())
                points_s = self._points_s()
                self._line.forgive()
                if points_s is None:
                    continue
                by_speed = [(abs(math.log(points_s / _points_s(product))), product) for product in products]
                nearest = min(by_speed, key=lambda matching: matching[0])[0]
                fitting = [product for off, product in by_speed if off == nearest]
                matching = [product for product in fitting if product in named]
                if not matching:
                    others = " or ".join(product.name for product in fitting)
                    raise DeviceError(f"{self._line.name}: {points_s:.0f} points/s: this is a {others}, not a {model}")
                return matching[0]
            raise DeviceTimeoutError(f"{self.address}: no LDROBOT sensor answers; check power, cable and port")

    def _points_s(self) -> float | None:
        """Return the received points per second, from angles and speed; None if nothing is received."""
        deadline_s = time.monotonic() + _FIRST_PACKETS_S
        rates: list[float] = []
        while len(rates) < _FIRST:
            try:
                packets, _ = self._line.receive(deadline_s)
            except DeviceTimeoutError:
                return None
            rates += [packet.speed_deg_s / packet.step_deg for packet in packets if packet.step_deg > 0]
        return float(np.median(rates)) or None

    def _resume(self) -> None:
        """Start a new clock and a new turn."""
        baud = _BAUDS[self.model]
        self._arrivals = ArrivalLine(
            smallest_delay_ns=round(protocol.SIZE * 10 / baud * 1e9),
            rate_max=QUARTZ_RATE,
            grain_ns=_grain_ns(self._lidar),
        )
        self._clock = _PacketClock(protocol.POINTS / _points_s(self._lidar) * 1e3)
        self._turns.resume()
        self._next_deg = self._last_ns = math.nan

    def _add(self, packet: protocol.LdrobotPacket, arrival_ns: int) -> None:
        span_deg = packet.step_deg * protocol.POINTS
        most_deg = 1.5 * protocol.POINTS * packet.speed_deg_s / _points_s(self._lidar)
        if not 0 < span_deg <= most_deg:  # start and end are of different packets
            self._bad_contents += 1
            return
        if arrival_ns - self._last_ns > _SILENCE_NS:
            self._resume()
        gap_deg = (packet.angle_deg[0] - self._next_deg) % 360
        lost = round(gap_deg / span_deg) if span_deg / 2 < gap_deg < 360 - span_deg / 2 else 0
        sensor_ns = self._clock.sensor_ns(packet.stamp_ms, lost, arrival_ns)
        if math.isnan(sensor_ns):
            self._resume()
            sensor_ns = self._clock.sensor_ns(packet.stamp_ms, 0, arrival_ns)
        self._last_ns = arrival_ns
        self._next_deg = float(packet.angle_deg[-1]) + packet.step_deg
        if not self._clock.is_known:
            self._turns.cut()
            return
        self._arrivals.add(sensor_ns, arrival_ns)
        before_ns = np.arange(1 - protocol.POINTS, 1) * (1e9 / _points_s(self._lidar))
        points = Points(packet.angle_deg, packet.range_m, packet.intensity, sensor_ns + before_ns)
        self._turns.add(points, arrival_ns)


def _points_s(lidar: Lidar) -> float:
    return lidar.steps_per_turn * lidar.scan_rate_hz


def _grain_ns(lidar: Lidar) -> float:
    """Standard uncertainty of the mean of the stamps: packets begin at few phases of a millisecond."""
    phases = Fraction(round(protocol.POINTS * 1e3), round(_points_s(lidar))).denominator
    return 1e6 / math.sqrt(12) * math.hypot(1 / phases, 1 / _STAMPS)
