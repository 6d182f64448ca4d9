"""The line to one sensor as every driver has it: what comes until something is whole, what is left when it ends."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from design.errors import DeviceError, DeviceTimeoutError, UnsafeError, UnsafeNote
from firmware_io.lidar.byte_stream import SerialStream, open_stream

_POLL_S = 0.05

Heard = TypeVar("Heard")


class SensorLine:
    """The line to one sensor, open.

    Attributes:
        address: where it is: a serial port, or HOST:PORT.
        stream: its bytes.
        longest: bytes of what can be whole; so much that comes too late, and is nothing, ends the waiting.
        heard: bytes that came, whatever they were: none tell that nobody listens at this speed.
    """

    def __init__(self, address: str, longest: int) -> None:
        """Open it.

        Raises:
            DeviceError: no such port or host, or it is in use.
        """
        self.address, self.longest, self.heard = address, longest, 0
        self.stream = open_stream(address)

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
        with self.told_when_gone():
            self.stream.write(data)

    def hear(self, feed: Callable[[bytes], list[Heard]], deadline_s: float) -> tuple[list[Heard], int]:
        """What comes until something is whole, and when that came [ns, time.monotonic_ns].

        Args:
            feed: what the bytes make whole.
            deadline_s: on time.monotonic.

        Raises:
            DeviceTimeoutError: nothing was whole in time.
            DeviceError: the connection broke.
        """
        late_bytes = 0
        while True:
            over = time.monotonic() > deadline_s  # told before the look: what came while we were kept waiting counts
            with self.told_when_gone():
                received = self.stream.read(deadline_s - time.monotonic())
            arrival_ns = time.monotonic_ns()
            self.heard += len(received)
            found = feed(received)
            if found:
                return found, arrival_ns
            late_bytes += len(received) if over else 0
            if over and (not received or late_bytes > self.longest):
                raise DeviceTimeoutError(f"{self.name}: nothing came in time; check power and cable")

    def close(self) -> None:
        """Let go of the port; what is closed stays so."""
        self.stream.close()

    def reopen(self, address: str | None = None) -> None:
        """Open it again, where it was or elsewhere.

        Raises:
            DeviceError: no such port or host, or it is in use.
        """
        self.close()
        self.stream = open_stream(address or self.address)
        self.address = address or self.address

    def leave(self, stop: Callable[[], None], error: BaseException | None) -> None:
        """End a `with`: stop the sensor, and close the line whatever happens; an error of the body stays in front.

        Args:
            stop: the driver's.
            error: what ended the body, None where nothing did.

        Raises:
            UnsafeError: it could not be stopped, and its laser may still be on.
        """
        try:
            stop()
        except DeviceError as unsafe:
            if error is None:
                raise UnsafeError(f"{unsafe}: its laser may still be on") from unsafe
            error.add_note(UnsafeNote(f"its laser may still be on: {unsafe}"))
        finally:
            self.close()

    @contextmanager
    def closed_on_error(self) -> Iterator[None]:
        """Closes the line where the body fails."""
        try:
            yield
        except BaseException:
            self.close()
            raise

    @contextmanager
    def told_when_gone(self) -> Iterator[None]:
        """Turns what a vanished port raises into a DeviceError of one line."""
        try:
            yield
        # A port that we closed after it vanished is None to pyserial, and -1 to select.
        except (OSError, TypeError, ValueError) as error:
            raise DeviceError(f"{self.name}: the connection broke ({error}); plug it in again") from error


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
