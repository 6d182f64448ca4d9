"""Connection to one sensor, and the life cycle of its drivers. Failures raise DeviceError.

Arrival times are correct only if bytes are read when they arrive. After a pause of the reader, bytes have waited in the
buffers of kernel and adapter, and others are lost.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, Protocol, Self

from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import DeviceError, DeviceTimeoutError, UnsafeError, UnsafeNote
from scanwright.firmware_io.lidar.byte_stream import SerialStream, open_stream
from scanwright.firmware_io.lidar.lidar import Echo, TimedScan
from scanwright.firmware_io.serial_port import latency_ms

TURN_S = 1.0  # without a turn: ten turns of the slowest sensor
_MOST_RESUMES = 20  # in one read: a busy computer catches up after a few
_POLL_S = 0.05  # between two attempts to connect
_READ_S = 0.05  # longest timeout of one read, so that a much later return shows a pause of the reader
_SETTLE_S = 0.03  # adapters and sensors send the rest of their buffers within this
_READS = 10_000  # without finding the port empty


class PacketSplitter(Protocol):
    """Splitter of a byte stream into packets; skips other bytes."""

    bad: int  # packets lost

    def feed(self, data: bytes, /) -> list[Any]:
        """Return the packets that these bytes complete."""

    def cut_in(self) -> None:
        """Expect the middle of a packet next, and do not count it as bad."""


class SensorLine:
    """Open connection to one sensor; call `split_by` before `receive`.

    Attributes:
        address: serial port, or HOST:PORT.
        longest: size of the longest packet; `receive` stops after as many invalid bytes past its deadline.
        received: number of received bytes; if 0, nothing replies at this baud rate.
    """

    def __init__(self, address: str, longest: int) -> None:
        self.address, self.longest, self.received = address, longest, 0
        self._bad_before = 0
        self._splitter: PacketSplitter | None = None
        self._waiting: deque[tuple[Any, int]] = deque()
        self._open(address)

    @property
    def name(self) -> str:
        """Name of the sensor, in messages."""
        return f"{self.address}: lidar"

    @property
    def serial(self) -> SerialStream | None:
        """The serial port; None for TCP."""
        return self.stream if isinstance(self.stream, SerialStream) else None

    @property
    def bad(self) -> int:
        """Number of packets lost."""
        return self._bad_before + (self._splitter.bad if self._splitter else 0)

    def split_by(self, splitter: PacketSplitter) -> None:
        """Drop received packets, and split the next bytes by another splitter."""
        self._bad_before = self.bad
        self._splitter = splitter
        self._waiting.clear()

    def forgive(self) -> None:
        """Do not count the packets lost since `split_by`: opening the port cuts one."""
        if self._splitter:
            self._splitter.bad = 0

    def send(self, data: bytes) -> None:
        """Drop received packets, and send all bytes."""
        self._waiting.clear()
        with self.broken_line_as_error():
            self.stream.write(data)

    def next(self, deadline_s: float) -> tuple[Any, int]:
        """Return the next packet and its arrival; raises as `receive`."""
        if not self._waiting:
            packets, arrival_ns = self.receive(deadline_s)
            self._waiting.extend((packet, arrival_ns) for packet in packets)
        return self._waiting.popleft()

    def receive(self, deadline_s: float, pause_s: float = math.inf) -> tuple[list[Any], int]:
        """Return the next complete packets and their arrival [ns, time.monotonic_ns].

        Args:
            deadline_s: on time.monotonic.
            pause_s: longest time between two reads. After a longer one, all waiting bytes are dropped and no packet is
                returned.

        Raises:
            DeviceTimeoutError: no complete packet in time.
            DeviceError: the connection broke.
        """
        assert self._splitter
        late_bytes = 0
        while True:
            over = time.monotonic() > deadline_s  # before the read, so bytes that waited in a pause still count
            read_ns = self._read_ns
            received = self._read(min(deadline_s - time.monotonic(), _READ_S))
            arrival_ns = self._read_ns
            if arrival_ns - read_ns > pause_s * 1e9:
                self.drop_waiting()
                return [], self._read_ns
            packets = self._splitter.feed(received)
            if packets:
                return packets, arrival_ns
            late_bytes += len(received) if over else 0
            if over and (not received or late_bytes > self.longest):
                raise DeviceTimeoutError(f"{self.name}: nothing came in time; check power and cable")

    def drop_waiting(self) -> None:
        """Drop all waiting bytes; DeviceTimeoutError if the sensor sends faster than it is read."""
        settled_s = time.monotonic() + _SETTLE_S
        for _ in range(_READS):
            if not self._read(settled_s - time.monotonic()) and time.monotonic() >= settled_s:
                if self._splitter:
                    self._splitter.cut_in()
                return
        raise DeviceTimeoutError(f"{self.name}: it sends faster than this computer reads; end other programs")

    def widened(self, uncertainty_ns: float) -> int:
        """Return the standard uncertainty of an arrival time with the uniform delay of a USB adapter added."""
        return round(math.hypot(uncertainty_ns, self._latency_ns / math.sqrt(3)))

    def close(self) -> None:
        """Close the port, if it is open."""
        self.stream.close()

    def reopen(self, address: str | None = None) -> None:
        """Open it again, at the same or another address."""
        self.close()
        self._open(address or self.address)
        self.address = address or self.address

    def _open(self, address: str) -> None:
        self.stream = open_stream(address)
        self._latency_ns = 1_000_000 * latency_ms(address)
        self._read_ns = time.monotonic_ns()  # when the last read returned

    def _read(self, timeout_s: float) -> bytes:
        with self.broken_line_as_error():
            received = self.stream.read(timeout_s)
        self._read_ns = time.monotonic_ns()
        self.received += len(received)
        return received

    @contextmanager
    def closed_on_error(self) -> Iterator[None]:
        """Close the line if the body fails."""
        try:
            yield
        except BaseException:
            self.close()
            raise

    @contextmanager
    def broken_line_as_error(self) -> Iterator[None]:
        """Convert the exceptions of a vanished port to DeviceError."""
        try:
            yield
        # After a vanished port is closed, pyserial has None as its descriptor, and select gets -1.
        except (OSError, TypeError, ValueError) as error:
            raise DeviceError(f"{self.name}: connection lost ({error}); plug it in again") from error


class LineDriver:
    """Life cycle of a lidar; `LidarDriver` documents the public methods.

    A family implements `_find`, `_begin`, `_turn` and `_halt`. `with` stops the sensor and closes the line.
    """

    address: str
    serial_number = ""
    firmware = ""
    _line: SensorLine
    _lidar: Lidar  # of the catalogue
    _begun: tuple[bool, int] | None = None  # intensity, skip; None while it does not scan
    _warning = ""
    _clusters = False  # whether beams can share a value
    _until_s = math.inf  # end of the present attempt to reconnect
    _bad_contents = 0  # packets with impossible content

    @property
    def model(self) -> str:
        """Catalogue name."""
        return self._lidar.name

    @property
    def scan_rate_hz(self) -> float:
        """Turns per second, by the catalogue."""
        return self._lidar.scan_rate_hz

    @property
    def bad_packets(self) -> int:
        """Packets dropped."""
        return self._bad_contents + self._line.bad

    def condition(self) -> tuple[str, ...]:
        """Return no lines; a family that reports age or state overrides this."""
        return ()

    def set_filters(self, echo: Echo | None, *, mean_filter_off: bool) -> None:
        """Raise DeviceError for any filter; a family with filters overrides this."""
        if echo is not None or mean_filter_off:
            raise DeviceError(f"{self._line.name}: echo, mean_filter_off: a {self.model} has no such filter; omit them")

    def start(self, *, intensity: bool = False, cluster: int = 1, skip: int = 0) -> None:
        """Scan until `stop`; raises as `LidarDriver.start`."""
        if cluster != 1 and not self._clusters:
            raise DeviceError(f"{self._line.name}: cluster = {cluster}: a {self.model} sends every beam; use 1")
        self._cluster = cluster
        self._begin(intensity, skip)
        self._begun = intensity, skip

    def read(self, timeout_s: float | None = None) -> TimedScan:
        """Return the next turn; raises as `LidarDriver.read`."""
        if self._begun is None:
            raise DeviceError(f"{self._line.name}: not started")
        patience_s = self._patience_s() if timeout_s is None else timeout_s
        for _ in range(_MOST_RESUMES):
            if (turn := self._turn(time.monotonic() + patience_s)) is not None:
                return replace(turn, warning=turn.warning or self._warning)
        raise DeviceTimeoutError(f"{self._line.name}: this computer is always too late to read it; end other programs")

    def stop(self) -> None:
        """Switch the laser off; raises as `LidarDriver.stop`."""
        self._begun = None
        self._halt()

    def reconnect(self, timeout_s: float = 3.0) -> None:
        """Find the sensor again and continue to scan; raises as `LidarDriver.reconnect`."""
        self._until_s = time.monotonic() + timeout_s
        try:
            while (error := self._failed_attempt()) is not None:
                if time.monotonic() > self._until_s:
                    gone = f"{self.address}: lidar {self.serial_number}".strip()
                    raise DeviceError(
                        f"{gone} did not come back in {timeout_s:.1f} s; check its plug ({error})"
                    ) from error
                time.sleep(_POLL_S)
        finally:
            self._until_s = math.inf

    def _failed_attempt(self) -> DeviceError | None:
        """Try once to reconnect; return the error if that fails."""
        try:
            self._find()
            if self._begun is not None:
                with self._line.closed_on_error():
                    self._begin(*self._begun)
        except DeviceError as error:
            return error
        return None

    def _patience_s(self) -> float:
        """Return the longest duration of the next turn."""
        return TURN_S

    def _find(self) -> None:
        """Open the line again and identify the sensor."""

    def _begin(self, intensity: bool, skip: int) -> None:
        """Start to scan."""

    def _turn(self, deadline_s: float) -> TimedScan | None:
        """Return the next turn; None after a pause of the reader."""

    def _halt(self) -> None:
        """Stop the sensor."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        try:
            self.stop()
        except DeviceError as unsafe:
            if error is None:
                raise UnsafeError(f"{unsafe}: its laser may still be on") from unsafe
            error.add_note(UnsafeNote(f"its laser may still be on: {unsafe}"))
        finally:
            self._line.close()
