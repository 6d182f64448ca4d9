"""An RPLIDAR on its serial line: asked who it is, its motor started, its typical mode streamed.

It has no clock of its own in these modes: its points follow each other evenly, and counting them is the clock.
"""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from types import TracebackType
from typing import Literal, TypeVar

import numpy as np

from design.catalogue.catalogue import load_catalogue
from design.catalogue.products import Lidar
from design.errors import DeviceError, DeviceTimeoutError, ProtocolError
from firmware_io.lidar.arrival_line import ArrivalLine
from firmware_io.lidar.byte_stream import Gone, SerialStream, next_heard, open_stream, until_back
from firmware_io.lidar.lidar import StampAt, TimedScan
from firmware_io.lidar.slamtec import protocol
from firmware_io.lidar.turn import Points, TurnQueue, timed_scan

_ANSWER_S = 0.5
_TURN_S = 3.0  # the motor takes its time to start
_TRIES = 3
_RATE_MAX = 0.05  # of points per second beside what it states: A1s measure 4 to 8 thousand
_PAUSE_NS = 500_000_000
_PWM = 660  # the SDK's default
_RPM = 600

Told = TypeVar("Told")


@dataclass(frozen=True, slots=True)
class _Series:
    """What tells one series from another: the catalogue's name, the line's speed, and what starts the motor."""

    model: str
    baud: int
    motor: Literal["dtr", "pwm", "rpm", "scan"]


# by the higher half of the model's byte; that of the C1 is one user's word
_SERIES = {
    1: _Series("RPLIDAR A1", 115_200, "dtr"),
    2: _Series("RPLIDAR A2", 256_000, "pwm"),
    3: _Series("RPLIDAR A3", 256_000, "pwm"),
    4: _Series("RPLIDAR C1", 460_800, "scan"),
    6: _Series("RPLIDAR S1", 256_000, "rpm"),
    7: _Series("RPLIDAR S2", 1_000_000, "rpm"),
}


@dataclass(frozen=True, slots=True)
class _Mode:
    """How it streams: its number, the type of its packets, and between two points [ns]."""

    number: int
    kind: int
    point_ns: float


class SlamtecLidar:
    """An RPLIDAR; `LidarDriver` says what its methods promise.

    Attributes:
        address: where it was found.
        serial_number: by which it is known again.
        firmware: version.
    """

    def __init__(self, address: str, model: str | None = None) -> None:
        """Open it and stop what it does; `model` is a name of the catalogue, None for whatever answers.

        Raises:
            DeviceError: no such port, it is in use, another model answers, or none.
        """
        self.address = address
        self.serial_number = self.firmware = ""
        self._bad_before = 0
        self._splitter = protocol.SlamtecSplitter(protocol.CAPSULES)
        self._turns = TurnQueue()
        self._scanning = self._intensity = False
        self._skip = 0
        self._rest = b""
        self._heard: list[tuple[protocol.SlamtecPacket, int]] = []
        self._connect(model)

    def __enter__(self) -> SlamtecLidar:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.stop()
        except DeviceError as unsafe:
            if error is None:
                raise
            error.add_note(f"its laser may still be on: {unsafe}")
        finally:
            self._stream.close()

    @property
    def model(self) -> str:
        """Name of its type."""
        return self._lidar.name

    @property
    def scan_rate_hz(self) -> float:
        """Turns per second, by the catalogue; it holds them to some parts in a hundred."""
        return self._lidar.scan_rate_hz

    @property
    def dropped(self) -> int:
        """Turns that are missing between those that were read."""
        return self._turns.dropped

    @property
    def bad_packets(self) -> int:
        """Packets that were thrown away."""
        return self._bad_before + self._splitter.bad

    def start(self, *, intensity: bool = False, cluster: int = 1, skip: int = 0) -> None:
        """Start the motor and scan until `stop`.

        Raises:
            DeviceError: clusters, which it has not; it refuses, reports a fault, or is gone.
        """
        if cluster != 1:
            raise DeviceError(f"{self._name()}: cluster = {cluster}: a {self.model} tells every point: leave it at 1")
        status, code = self._told(protocol.HEALTH, 6, protocol.health)
        if status == 2:
            raise DeviceError(f"{self._name()}: it reports fault {code:#06x}: take its power away, and give it again")
        self._intensity, self._skip = intensity, skip
        self._mode = self._typical_mode()
        self._turn_motor(on=True)
        mode = struct.pack("<BHH", self._mode.number, 0, 0)
        command = protocol.SCAN if self._mode.kind == protocol.NODES else protocol.EXPRESS_SCAN
        self._send(protocol.request(command, mode))
        told = self._descriptor(time.monotonic() + _ANSWER_S)
        if not told.stream or told.kind != self._mode.kind:
            raise DeviceError(f"{self._name()}: it sends packets of type {told.kind:#x}, not {self._mode.kind:#x}")
        self._scanning = True
        self._bad_before = self.bad_packets
        self._splitter = protocol.SlamtecSplitter(self._mode.kind)
        self._begin_anew()
        self._heard += [(packet, passed) for packet, passed in self._splitter.feed(self._rest)]
        self._rest = b""

    def read(self, timeout_s: float | None = None) -> TimedScan:
        """The next turn; it is waited for for three seconds if nothing else is said.

        Raises:
            DeviceTimeoutError: none came in time.
            DeviceError: it was unplugged, or was not started.
        """
        if not self._scanning:
            raise DeviceError(f"{self._name()}: not started")
        deadline = time.monotonic() + (_TURN_S if timeout_s is None else timeout_s)
        longest = 2 * protocol.SIZES[self._mode.kind]
        while (turn := self._turns.next()) is None:
            heard, arrival_ns = next_heard(self._stream, self._name(), deadline, self._splitter.feed, longest)
            self._take([*self._heard, *heard], arrival_ns)
            self._heard = []
        return timed_scan(turn[0], self._line, self._lidar, turn[1], intensity=self._intensity)

    def stop(self) -> None:
        """Laser and motor off.

        Raises:
            DeviceError: the sensor is gone.
        """
        self._scanning = False
        self._send(protocol.request(protocol.STOP))
        self._turn_motor(on=False)

    def reconnect(self, timeout_s: float = 3.0) -> None:
        """Open it again where it was, after an unplug or a reset, and scan on if it did.

        Raises:
            DeviceError: it did not turn up in time.
        """
        scanning = self._scanning
        self._stream.close()

        def connect() -> None:
            self._connect(self.model)
            if scanning:
                try:
                    self.start(intensity=self._intensity, skip=self._skip)
                except DeviceError:
                    self._stream.close()
                    raise

        until_back(self._name(), timeout_s, connect)

    def _connect(self, model: str | None) -> None:
        """Open the port, stop what it does, and hear who it is."""
        series = [series for series in _SERIES.values() if model in (None, series.model)]
        serial_number = self.serial_number
        self._stream = open_stream(self.address)
        try:
            for baud in dict.fromkeys(one.baud for one in series):
                if isinstance(self._stream, SerialStream):
                    self._stream.baud = baud
                for _ in range(_TRIES):
                    with suppress(DeviceTimeoutError):
                        self._send(protocol.request(protocol.STOP))
                        self._drain()
                        told = self._told(protocol.INFO, 4, protocol.info)
                        found = _SERIES.get(told.model >> 4)
                        if found is None or found not in series:
                            other = f"a model {told.model:#04x} of Slamtec's" if found is None else f"a {found.model}"
                            raise DeviceError(f"{self._name()}: this is {other}, not a {model}")
                        if serial_number not in ("", told.serial_number):
                            raise DeviceError(f"{self._name()}: this is {told.serial_number}, not {serial_number}")
                        self._motor = found.motor
                        self._baud = baud
                        self._lidar = load_catalogue().get(found.model, Lidar)
                        self.serial_number, self.firmware = told.serial_number, told.firmware
                        return
            raise DeviceTimeoutError(f"{self.address}: no RPLIDAR answers; check power, cable and port")
        except BaseException:
            self._stream.close()
            raise

    def _typical_mode(self) -> _Mode:
        """The mode that it streams best in; firmware without modes has express scans."""
        with suppress(DeviceTimeoutError):
            number = self._configured(protocol.CONF_TYPICAL, b"", "<H")
            of_mode = struct.pack("<H", number)
            kind = self._configured(protocol.CONF_ANSWER, of_mode, "<B")
            point_us = self._configured(protocol.CONF_SAMPLE_US, of_mode, "<I") / 256
            if kind in protocol.SIZES and point_us > 0:
                return _Mode(number, kind, point_us * 1e3)
        standard_us, express_us = self._told(protocol.SAMPLE_TIMES, 0x15, _two_numbers)
        if express_us:
            return _Mode(0, protocol.CAPSULES, express_us * 1e3)
        return _Mode(0, protocol.NODES, max(standard_us, 1) * 1e3)

    def _configured(self, key: int, payload: bytes, layout: str) -> int:
        """A number of its configuration."""

        def value(data: bytes) -> int:
            if len(data) < 4 + struct.calcsize(layout) or int.from_bytes(data[:4], "little") != key:
                raise ProtocolError(f"RPLIDAR: {data.hex(' ')}: not the configuration {key:#x}")
            return int(struct.unpack_from(layout, data, 4)[0])

        return self._told(protocol.GET_CONF, 0x20, value, struct.pack("<I", key) + payload)

    def _turn_motor(self, *, on: bool) -> None:
        if self._motor == "dtr" and isinstance(self._stream, SerialStream):
            self._stream.set_dtr(not on)
        elif self._motor == "pwm":
            self._send(protocol.request(protocol.MOTOR_PWM, struct.pack("<H", _PWM if on else 0)))
        elif self._motor == "rpm":
            self._send(protocol.request(protocol.MOTOR_RPM, struct.pack("<H", _RPM if on else 0)))

    def _begin_anew(self) -> None:
        size = protocol.SIZES[self._mode.kind]
        self._line = ArrivalLine(
            smallest_delay_ns=round(size * 10 / self._baud * 1e9), rate_max=_RATE_MAX, grain_ns=self._mode.point_ns
        )
        self._turns.begin_anew(self._skip)
        self._heard = []
        self._before: protocol.SlamtecPacket | None = None
        self._points = 0  # measured since we began, by their count
        self._span_deg = 0.0  # of a capsule; 0 before one was whole
        self._last_ns = 0

    def _take(self, heard: list[tuple[protocol.SlamtecPacket, int]], arrival_ns: int) -> None:
        if self._last_ns and arrival_ns - self._last_ns > _PAUSE_NS:
            self._begin_anew()
        self._last_ns = arrival_ns
        if self._mode.kind == protocol.NODES:
            self._take_nodes(heard, arrival_ns)
        else:
            for packet, passed in heard:
                self._take_capsule(packet, passed > 0, arrival_ns)

    def _take_nodes(self, heard: list[tuple[protocol.SlamtecPacket, int]], arrival_ns: int) -> None:
        """Points with angles of their own; what was passed over was some of them."""
        number = np.cumsum([1 + math.ceil(passed / protocol.SIZES[protocol.NODES]) for _, passed in heard])
        sensor_ns = (self._points + number - 1) * self._mode.point_ns
        self._points += int(number[-1])
        self._line.add(float(sensor_ns[-1]), arrival_ns)
        angle_deg = np.array([packet.start_deg for packet, _ in heard])
        range_m, quality = (
            np.concatenate(part) for part in zip(*((one.range_m, one.quality) for one, _ in heard), strict=True)
        )
        self._turns.add(Points(angle_deg, range_m, quality, sensor_ns), arrival_ns)

    def _take_capsule(self, packet: protocol.SlamtecPacket, after_garbage: bool, arrival_ns: int) -> None:
        """Its start ends the capsule before it, whose points are placed now; lost ones are told by the angle."""
        many = protocol.POINTS[self._mode.kind]
        before, self._before = self._before, packet
        if before is not None:
            span_deg = (packet.start_deg - before.start_deg) % 360
            lost = max(round(span_deg / self._span_deg) - 1, 0) if self._span_deg else 0
            if lost == 0 and not after_garbage:
                self._span_deg = span_deg
                number = self._points + np.arange(-many, 0)
                angle_deg = (before.start_deg + np.arange(many) * (span_deg / many) - before.offset_deg) % 360
                points = Points(angle_deg, before.range_m, before.quality, number * self._mode.point_ns)
                self._turns.add(points, arrival_ns)
            self._points += many * lost
        self._points += many
        self._line.add((self._points - 1) * self._mode.point_ns, arrival_ns)

    def _told(self, command: int, kind: int, read: Callable[[bytes], Told], payload: bytes = b"") -> Told:
        """What it answers to a request.

        Raises:
            DeviceTimeoutError: nothing in time.
            DeviceError: something else.
        """
        self._rest = b""
        self._send(protocol.request(command, payload))
        deadline = time.monotonic() + _ANSWER_S
        while True:
            told = self._descriptor(deadline)
            data = self._bytes(min(told.size, 512), deadline)
            if told.kind == kind:
                return read(data)

    def _descriptor(self, deadline: float) -> protocol.Descriptor:
        while True:
            at = self._rest.find(b"\xa5\x5a")
            self._rest = self._rest[at:] if at >= 0 else self._rest[-1:]
            if at >= 0 and len(self._rest) >= 7:
                return protocol.descriptor(self._bytes(7, deadline))
            self._more(deadline)

    def _bytes(self, count: int, deadline: float) -> bytes:
        while len(self._rest) < count:
            self._more(deadline)
        data, self._rest = self._rest[:count], self._rest[count:]
        return data

    def _more(self, deadline: float) -> None:
        if time.monotonic() > deadline + _ANSWER_S:  # noise without end
            raise DeviceTimeoutError(f"{self._name()}: nothing that is an answer; check power and cable")
        pieces, _ = next_heard(self._stream, self._name(), deadline, lambda data: [data] if data else [], 0)
        self._rest += b"".join(pieces)

    def _drain(self) -> None:
        """What it had sent before it stopped."""
        end = time.monotonic() + 0.2
        while time.monotonic() < end and self._stream.read(0.03):
            pass

    def _send(self, data: bytes) -> None:
        with Gone(self._name()):
            self._stream.write(data)

    def _name(self) -> str:
        return f"{self.address}: lidar"


def _two_numbers(data: bytes) -> tuple[int, int]:
    if len(data) != 4:
        raise ProtocolError(f"RPLIDAR: {len(data)} bytes of sample times, not 4")
    return struct.unpack("<HH", data)


def open_slamtec(address: str, model: str | None = None, _stamp_at: StampAt = "step_0") -> SlamtecLidar:
    """Open the lidar at a serial port or HOST:PORT.

    Raises:
        DeviceError: no such port, it is in use, or no RPLIDAR answers.
    """
    return SlamtecLidar(address, model)
