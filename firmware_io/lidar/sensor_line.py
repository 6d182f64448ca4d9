"""The line to one sensor, and the life cycle of its driver.

Arrival times of bytes are right only if the bytes are read when they arrive. A reader that was held up (a stopped
process, a busy computer) finds bytes that waited in the buffers of kernel and adapter, and others are missing.
"""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Self, TypeVar

from scanwright.design.errors import DeviceError, DeviceTimeoutError, UnsafeError, UnsafeNote
from scanwright.firmware_io.lidar.byte_stream import SerialStream, open_stream
from scanwright.firmware_io.serial_port import latency_ms

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
        """Open it.

        Raises:
            DeviceError: no such port or host, or it is in use.
        """
        self.address, self.longest, self.received = address, longest, 0
        self._open(address)

    @property
    def name(self) -> str:
        """Of the sensor, in messages."""
        return f"{self.address}: lidar"

    @property
    def serial(self) -> SerialStream | None:
        """Its port, where it is a serial one."""
        return self.stream if isinstance(self.stream, SerialStream) else None

    def send(self, data: bytes) -> None:
        """Send all of it.

        Raises:
            DeviceError: the connection broke.
        """
        with self.broken_line_as_error():
            self.stream.write(data)

    def hear(
        self, feed: Callable[[bytes], list[Packet]], deadline_s: float, pause_s: float = math.inf
    ) -> tuple[list[Packet], int]:
        """What comes until something is whole, and when that came [ns, time.monotonic_ns].

        Args:
            feed: what the bytes make whole.
            deadline_s: on time.monotonic.
            pause_s: where arrivals are the sensor's clock: the longest time between two reads after which arrivals and
                count of packets can still be trusted. After a longer one everything that waited is dropped, and
                nothing is returned: what comes next is fresh, and continues nothing.

        Raises:
            DeviceTimeoutError: nothing was whole in time.
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
        """Drop all that waits to be read, until the port is empty: what comes afterwards has just arrived.

        Raises:
            DeviceTimeoutError: it never is: the sensor sends faster than it is read.
            DeviceError: the connection broke.
        """
        settled_s = time.monotonic() + _SETTLE_S
        for _ in range(_READS):
            if not self._look(settled_s - time.monotonic()) and time.monotonic() >= settled_s:
                return
        raise DeviceTimeoutError(f"{self.name}: it sends faster than this computer reads; end other programs")

    def widened(self, uncertainty_ns: float) -> int:
        """Return the standard uncertainty of a time made of arrivals, with that of an adapter which gathers bytes.

        Bytes wait in it from none to all of its latency, and nothing tells how long: root mean square of the delay.
        """
        return round(math.hypot(uncertainty_ns, self._gathers_ns / math.sqrt(3)))

    def close(self) -> None:
        """Let go of the port; what is closed stays so."""
        self.stream.close()

    def reopen(self, address: str | None = None) -> None:
        """Open it again, where it was or elsewhere.

        Raises:
            DeviceError: no such port or host, or it is in use.
        """
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
        """Closes the line where the body fails."""
        try:
            yield
        except BaseException:
            self.close()
            raise

    @contextmanager
    def broken_line_as_error(self) -> Iterator[None]:
        """Turns what a vanished port raises into a DeviceError of one line."""
        try:
            yield
        # A port that we closed after it vanished is None to pyserial, and -1 to select.
        except (OSError, TypeError, ValueError) as error:
            raise DeviceError(f"{self.name}: connection lost ({error}); plug it in again") from error


class LineDriver(ABC):
    """A sensor on a line; the end of a `with` stops it, and closes the line whatever happens."""

    _line: SensorLine

    @abstractmethod
    def stop(self) -> None:
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


def until_back(name: str, timeout_s: float, connect: Callable[[], None]) -> None:
    """Connect again and again until it works.

    Raises:
        DeviceError: it did not in time.
    """
    deadline_s = time.monotonic() + timeout_s
    while True:
        try:
            connect()
        except DeviceError as error:
            if time.monotonic() > deadline_s:
                raise DeviceError(f"{name} did not come back in {timeout_s:.1f} s; check its plug ({error})") from error
            time.sleep(_POLL_S)
        else:
            return
