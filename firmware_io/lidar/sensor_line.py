"""Line to one sensor, and the life cycle shared by its drivers.

Arrival times are right only if bytes are read when they arrive. After a pause of the reader, bytes waited in the
buffers of kernel and adapter, and others are missing. A device that is gone, silent or refuses raises DeviceError.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from types import TracebackType
from typing import Self, TypeVar

from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import DeviceError, DeviceTimeoutError, UnsafeError, UnsafeNote
from scanwright.firmware_io.lidar.byte_stream import SerialStream, open_stream
from scanwright.firmware_io.lidar.lidar import Echo, TimedScan
from scanwright.firmware_io.serial_port import latency_ms

TURN_S = 1.0  # without a turn: ten turns of the slowest sensor
_MOST_RESUMES = 20  # in one read: a busy computer catches up after a few
_POLL_S = 0.05  # between two tries to connect
_LOOK_S = 0.05  # of one read at most: a read that returns much later was held up, however silent the sensor is
_SETTLE_S = 0.03  # adapters and sensors that had to wait send the rest of their own buffers within this
_READS = 10_000  # without finding the port empty

Packet = TypeVar("Packet")


class SensorLine:
    """The line to one sensor, open.

    Attributes:
        address: where it is: a serial port, or HOST:PORT.
        stream: its bytes.
        longest: bytes of what can be whole; so much that comes too late, and is nothing, ends the waiting.
        received: count of bytes that came; 0 shows that nothing answers at this speed.
    """

    def __init__(self, address: str, longest: int) -> None:
        """Open it."""
        self.address, self.longest, self.received = address, longest, 0
        self._open(address)

    @property
    def name(self) -> str:
        """Name of the sensor, in messages."""
        return f"{self.address}: lidar"

    @property
    def serial(self) -> SerialStream | None:
        """Its port, where it is a serial one."""
        return self.stream if isinstance(self.stream, SerialStream) else None

    def send(self, data: bytes) -> None:
        """Send all of it."""
        with self.broken_line_as_error():
            self.stream.write(data)

    def hear(
        self, feed: Callable[[bytes], list[Packet]], deadline_s: float, pause_s: float = math.inf
    ) -> tuple[list[Packet], int]:
        """Return the next complete packets and their arrival [ns, time.monotonic_ns].

        Args:
            feed: splitter of the received bytes.
            deadline_s: on time.monotonic.
            pause_s: if arrivals are the sensor's clock, longest time between two reads after which they can be trusted.
                After a longer one, all waiting bytes are dropped and no packet is returned: the next one continues
                nothing.

        Raises:
            DeviceTimeoutError: no complete packet in time.
            DeviceError: the connection broke.
        """
        late_bytes = 0
        while True:
            over = time.monotonic() > deadline_s  # told before the look: what came while we were kept waiting counts
            read_ns = self._read_ns
            received = self._look(min(deadline_s - time.monotonic(), _LOOK_S))
            arrival_ns = self._read_ns
            if arrival_ns - read_ns > pause_s * 1e9:
                self.drop_waiting()
                return [], self._read_ns
            packets = feed(received)
            if packets:
                return packets, arrival_ns
            late_bytes += len(received) if over else 0
            if over and (not received or late_bytes > self.longest):
                raise DeviceTimeoutError(f"{self.name}: nothing came in time; check power and cable")

    def drop_waiting(self) -> None:
        """Drop all bytes that wait; raises DeviceTimeoutError if the sensor sends faster than it is read."""
        settled_s = time.monotonic() + _SETTLE_S
        for _ in range(_READS):
            if not self._look(settled_s - time.monotonic()) and time.monotonic() >= settled_s:
                return
        raise DeviceTimeoutError(f"{self.name}: it sends faster than this computer reads; end other programs")

    def widened(self, uncertainty_ns: float) -> int:
        """Return the standard uncertainty of an arrival time with the even delay of a USB adapter added."""
        return round(math.hypot(uncertainty_ns, self._gathers_ns / math.sqrt(3)))

    def close(self) -> None:
        """Let go of the port; what is closed stays so."""
        self.stream.close()

    def reopen(self, address: str | None = None) -> None:
        """Open it again, where it was or elsewhere."""
        self.close()
        self._open(address or self.address)
        self.address = address or self.address

    def _open(self, address: str) -> None:
        self.stream = open_stream(address)
        self._gathers_ns = 1_000_000 * latency_ms(address)
        self._read_ns = time.monotonic_ns()  # when the last read returned

    def _look(self, timeout_s: float) -> bytes:
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
        """Turn the exceptions of a vanished port into a DeviceError of one line."""
        try:
            yield
        # A port that we closed after it vanished is None to pyserial, and -1 to select.
        except (OSError, TypeError, ValueError) as error:
            raise DeviceError(f"{self.name}: connection lost ({error}); plug it in again") from error


class LineDriver:
    """Life cycle of a lidar on a line; `LidarDriver` documents the public methods.

    A family implements `_find` (connect), `_begin`, `_turn` and `_halt`. `with` stops the sensor and closes the line.
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

    @property
    def model(self) -> str:
        """Name of its type."""
        return self._lidar.name

    @property
    def scan_rate_hz(self) -> float:
        """Turns per second, by the catalogue."""
        return self._lidar.scan_rate_hz

    def condition(self) -> tuple[str, ...]:
        """Nothing, unless the family reports age or state."""
        return ()

    def set_filters(self, echo: Echo | None, *, mean_filter_off: bool) -> None:
        """Refuse: only some families have filters; raises as `LidarDriver.set_filters`."""
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
        """Laser off, if it can be; raises as `LidarDriver.stop`."""
        self._begun = None
        self._halt()

    def reconnect(self, timeout_s: float = 3.0) -> None:
        """Find the sensor again, and scan on if it did; raises as `LidarDriver.reconnect`."""
        self._until_s = time.monotonic() + timeout_s
        try:
            while (error := self._still_away()) is not None:
                if time.monotonic() > self._until_s:
                    gone = f"{self.address}: lidar {self.serial_number}".strip()
                    raise DeviceError(
                        f"{gone} did not come back in {timeout_s:.1f} s; check its plug ({error})"
                    ) from error
                time.sleep(_POLL_S)
        finally:
            self._until_s = math.inf

    def _still_away(self) -> DeviceError | None:
        """Try once to reconnect; why that failed."""
        try:
            self._find()
            if self._begun is not None:
                with self._line.closed_on_error():
                    self._begin(*self._begun)
        except DeviceError as error:
            return error
        return None

    def _patience_s(self) -> float:
        """How long the next turn may take."""
        return TURN_S

    def _find(self) -> None:
        """Open the line again and recognise the sensor."""

    def _begin(self, intensity: bool, skip: int) -> None:
        """Begin to scan."""

    def _turn(self, deadline_s: float) -> TimedScan | None:
        """Return the next turn; None if what had waited for this computer was dropped."""

    def _halt(self) -> None:
        """Stop the sensor."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.stop()
        except DeviceError as unsafe:
            if error is None:
                raise UnsafeError(f"{unsafe}: its laser may still be on") from unsafe
            error.add_note(UnsafeNote(f"its laser may still be on: {unsafe}"))
        finally:
            self._line.close()
