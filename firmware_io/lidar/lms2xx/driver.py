"""SICK LMS 200 or LMS 291 on its serial line, with a field of 180 deg.

A telegram contains integer and half degrees, measured in two consecutive turns; each turn becomes one scan. The sensor
sends no timestamps: telegrams are evenly spaced, and their count is the clock. Not tested on a sensor.
"""

from __future__ import annotations

import math
import time
from collections import deque

import numpy as np

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import DeviceError, DeviceFaultError, DeviceTimeoutError, ProtocolError
from scanwright.firmware_io.lidar.arrival_line import ArrivalLine
from scanwright.firmware_io.lidar.lidar import StampAt, TimedScan
from scanwright.firmware_io.lidar.lms2xx import protocol
from scanwright.firmware_io.lidar.lms2xx.protocol import LmsScan
from scanwright.firmware_io.lidar.sensor_line import LineDriver, SensorLine
from scanwright.firmware_io.samples import Scan

_RATE_MAX = 1e-2  # of its motor [assumed]
_GRAIN_NS = 3e5  # jitter of its telegrams [assumed]
_PAUSE = 5  # telegrams that fit in the 4095 bytes of a terminal (Linux, n_tty.c), so none is lost


class TelegramCount:
    """Numbers telegrams since the stream began; `arrivals` converts their count to host time.

    It distinguishes late telegrams from lost ones.
    """

    def __init__(self, period_ns: float, telegram_ns: int, patience: int) -> None:
        """`patience`: further telegrams after which a late one is numbered as following lost ones."""
        self.lost = 0  # missing telegrams between those received
        self._period_ns, self._telegram_ns, self._patience = period_ns, telegram_ns, patience
        self.pause_s = _PAUSE * max(period_ns, telegram_ns) / 1e9  # longest pause of the reader without `resume`
        self._begin(0)

    def resume(self) -> None:
        """Restart at the next telegram, before which an unknown number was lost."""
        self._begin(self.arrivals.arrives_ns(self._number * self._period_ns) if self._number else self._ended_ns)

    def _begin(self, ended_ns: int) -> None:
        """Start a new line; `ended_ns`: arrival of the last telegram before a loss, 0 without a loss."""
        self.arrivals = ArrivalLine(smallest_delay_ns=self._telegram_ns, rate_max=_RATE_MAX, grain_ns=_GRAIN_NS)
        self._pending: list[tuple[LmsScan, int]] = []
        self._number, self._ended_ns = 0, ended_ns

    def add(self, scan: LmsScan, arrival_ns: int) -> list[tuple[LmsScan, float, int]]:
        """Return the scans numbered by now, each with the sensor time of its end [ns] and its arrival."""
        self._pending.append((scan, arrival_ns))
        numbers = self._numbers()
        if numbers[-1] > self._number + len(numbers) and len(numbers) < self._patience:
            return []
        if not self._number and self._ended_ns:
            self.lost += max(round((arrival_ns - self._ended_ns) / self._period_ns) - 1, 0)
        known = []
        for number, (pending, came_ns) in zip(numbers, self._pending, strict=True):
            self.lost += number - self._number - 1
            self._number = number
            self.arrivals.add(number * self._period_ns, came_ns)
            known.append((pending, number * self._period_ns, came_ns))
        self._pending = []
        return known

    def _numbers(self) -> list[int]:
        """Return the numbers of the pending telegrams; gaps are lost ones.

        The line gives the number that fits an arrival. A late telegram with others close behind seems to follow lost
        ones. No telegram is early, so the smallest number that a later one allows is right.
        """
        least = [self._number + 1 + k for k in range(len(self._pending))]
        if not self._number:
            return least
        numbers: list[int] = []
        above = math.inf
        for at_least, (_, came_ns) in zip(reversed(least), reversed(self._pending), strict=True):
            late_ns = came_ns - self._telegram_ns - self.arrivals.host_ns(at_least * self._period_ns)
            above = min(above - 1, at_least + max(round(late_ns / self._period_ns), 0))
            numbers.append(int(above))
        return numbers[::-1]


FAMILY = "lms2xx"

_REPLY_S = 0.5  # 15 times the duration of a reply at 9600 baud
_STREAM_S = 0.1  # several turns of its mirror
_MODE_S = 3.0  # it changes its mode after some turns
_TRIES = 2  # the first reply can be lost in the stream
_FAST_BAUD, _USUAL_BAUD = 500_000, 38_400
_POWER_UP_BAUD = 9600  # after each power-up
_BAUDS = (_POWER_UP_BAUD, _FAST_BAUD, _USUAL_BAUD, 19_200)  # all supported, the most probable first
_TURN_S = 1 / 75  # of its mirror
_PATIENCE = 8  # telegrams: a fifth of a second


class LmsLidar(LineDriver):
    """An LMS 2xx; it reports no serial number."""

    def __init__(self, address: str, model: str | None = None, _stamp_at: StampAt | None = None) -> None:
        """Open it and stop its stream; `model`: catalogue name, or None for the reported one."""
        self.address = address
        self._lost_before = self._skipped = 0
        self._waiting: deque[TimedScan] = deque()
        self._count: TelegramCount | None = None
        self._line = SensorLine(address, 2 * protocol.LONGEST)
        self._recognise(model, _BAUDS)
        self._baud_before = self._baud  # of the last successful start

    @property
    def scan_rate_hz(self) -> float:
        """Mirror turns per second."""
        return self._lidar.scan_rate_hz * self._interlaced

    @property
    def dropped(self) -> int:
        """Missing turns between those read, by the elapsed time."""
        return self._lost_before + self._count.lost * self._interlaced if self._count else self._lost_before

    def _begin(self, intensity: bool, skip: int) -> None:
        if intensity:
            raise DeviceError(f"{self._line.name}: intensity: a {self.model} sends none; omit it")
        step_centideg = round(36_000 / self._lidar.steps_per_turn)
        reply = self._ask(protocol.variant(180, step_centideg), protocol.VARIANT, _MODE_S)
        if protocol.accepted_variant(reply) != (180, step_centideg):
            raise DeviceError(f"{self._line.name}: it rejects 180 deg in steps of {step_centideg / 100:g} deg")
        self._speed_up()
        self._mode(protocol.STREAM)
        self._skip = skip
        self._skipped = 0
        self._lost_before = self.dropped
        self._waiting.clear()
        beams = self._lidar.last_step - self._lidar.first_step + 1
        telegram_ns = round((2 * beams + 10) * 10 / self._baud * 1e9)
        patience = _PATIENCE if self._baud == _FAST_BAUD else 1  # a slow line loses telegrams all the time
        self._count = TelegramCount(self._interlaced * _TURN_S * 1e9, telegram_ns, patience)
        self._baud_before = self._baud

    def _turn(self, deadline_s: float) -> TimedScan | None:
        assert self._count is not None
        while not self._waiting:
            telegrams, arrival_ns = self._line.receive(deadline_s, self._count.pause_s)
            if not telegrams:
                self._count.resume()
                return None
            for reply in telegrams:
                if reply.command == protocol.SCAN:
                    self._add(reply, arrival_ns)
        return self._waiting.popleft()

    def _halt(self) -> None:
        """Stop its stream; its laser cannot be switched off."""
        self._mode(protocol.ON_REQUEST)

    def _find(self) -> None:
        self._line.reopen()
        before = self._baud_before
        if self._line.serial is not None:
            self._line.serial.baud = before
        # it still streams if only the plug was out; to try all four baud rates takes a second longer
        with self._line.closed_on_error(), self._line.broken_line_as_error():
            streams = bool(self._line.stream.read(_STREAM_S))
        self._recognise(self.model, (before, _POWER_UP_BAUD) if streams else (_POWER_UP_BAUD, before))

    def _recognise(self, model: str | None, bauds: tuple[int, ...]) -> None:
        """Stop its stream at one of these baud rates and read its type; close the line if none answers."""
        self._line.split_by(protocol.LmsSplitter())
        with self._line.closed_on_error():
            for baud in bauds if self._line.serial is not None else (_FAST_BAUD,):
                if self._line.serial is not None:
                    self._line.serial.baud = baud
                self._baud = baud
                for _ in range(_TRIES):
                    before = self._line.received
                    try:
                        self._mode(protocol.ON_REQUEST, _REPLY_S)
                        reply = self._ask(protocol.telegram(protocol.TYPE), protocol.TYPE)
                    except DeviceTimeoutError:
                        if self._line.received == before and baud != _POWER_UP_BAUD:
                            break
                        continue
                    self._accept(reply.values[:-1].decode("ascii", "replace"), model)
                    self._line.forgive()
                    return
            raise DeviceTimeoutError(f"{self.address}: no SICK LMS 2xx answers; check power, cable and port")

    def _accept(self, type_text: str, model: str | None) -> None:
        lidars = [product for product in load_catalogue() if isinstance(product, Lidar) and product.family == FAMILY]
        product = next((lidar for lidar in lidars if type_text.startswith(lidar.name.replace(" ", ""))), None)
        if product is None or model not in (None, product.name):
            expected = model or "known LMS"
            raise DeviceError(f"{self._line.name}: it reports type '{type_text.strip()}': not a {expected}")
        self._lidar, self.firmware = product, type_text.rpartition(";")[2].strip()
        self._interlaced = max(round(_TURN_S**-1 / product.scan_rate_hz), 1)

    def _speed_up(self) -> None:
        """Set the highest baud rate that both ends support: below that of its scans, turns are lost."""
        port = self._line.serial
        if port is None:
            return
        for baud in (_FAST_BAUD, _USUAL_BAUD):
            if port.baud == baud:
                return
            if port.can(baud):
                self._mode(protocol.BAUD_MODES[baud])
                port.baud = self._baud = baud
                return

    def _mode(self, mode: int, timeout_s: float = _MODE_S) -> None:
        reply = self._ask(protocol.telegram(protocol.MODE, bytes([mode])), protocol.MODE, timeout_s)
        if reply.values[:1] != b"\0":
            raise DeviceError(f"{self._line.name}: it rejects mode {mode:02X}")

    def _ask(self, request: bytes, command: int, timeout_s: float = _REPLY_S) -> protocol.LmsTelegram:
        self._line.send(request)
        deadline_s = time.monotonic() + timeout_s
        while True:
            telegrams: list[protocol.LmsTelegram] = self._line.receive(deadline_s)[0]
            for reply in telegrams:
                if reply.command == command | protocol.ANSWER:
                    return reply
            if time.monotonic() > deadline_s:  # it only streams
                raise DeviceTimeoutError(f"{self._line.name}: no answer to {command:02X}")

    def _add(self, reply: protocol.LmsTelegram, arrival_ns: int) -> None:
        try:
            measured = protocol.scan(reply)
        except ProtocolError:
            self._bad_contents += 1
            return
        beams = self._lidar.last_step - self._lidar.first_step + 1
        if measured.range_m.size != beams:
            self._bad_contents += 1
            return
        if measured.status & 7 >= protocol.FATAL:
            fault = f"it reports a fault (status {measured.status:02X})"
            raise DeviceFaultError(f"{self._line.name}: {fault}: check its lamps")
        assert self._count is not None
        for ready, end_ns, ready_ns in self._count.add(measured, arrival_ns):
            for turn in range(self._interlaced):
                self._skipped += 1
                if self._skipped > self._skip:
                    self._skipped = 0
                    before_ns = (self._interlaced - 1 - turn + 0.5) * 1e9 * _TURN_S
                    self._waiting.append(self._scan_of(ready, turn, self._count, end_ns - before_ns, ready_ns))

    def _scan_of(
        self, measured: protocol.LmsScan, turn: int, count: TelegramCount, begin_ns: float, arrival_ns: int
    ) -> TimedScan:
        """Return the scan of one turn, which begins at -90 deg at `begin_ns`."""
        bearing_rad = self._lidar.bearings_rad()[turn :: self._interlaced]
        first_ns = begin_ns + (bearing_rad[0] + np.pi / 2) / (2 * np.pi) * _TURN_S * 1e9
        step_rad = float(bearing_rad[1] - bearing_rad[0])
        scan = Scan(
            stamp_ns=count.arrivals.host_ns(first_ns),
            angle_min_rad=float(bearing_rad[0]),
            angle_increment_rad=step_rad,
            time_increment_s=step_rad / (2 * np.pi) * _TURN_S,
            scan_time_s=_TURN_S,
            range_min_m=self._lidar.range_min_mm / 1e3,
            range_max_m=self._lidar.range_max_mm / 1e3,
            range_m=measured.range_m[turn :: self._interlaced],
            intensity=np.empty(0, np.float32),
        )
        warning = "its window is dirty: clean it" if measured.status & protocol.POLLUTED else ""
        if not warning and self._baud < _FAST_BAUD:
            warning = f"at {self._baud} baud most turns are lost; use an adapter with {_FAST_BAUD} baud"
        return TimedScan(scan, arrival_ns, self._line.widened(count.arrivals.uncertainty_ns), warning)
