"""Serial port of the servo bus, with times of requests and replies."""

from __future__ import annotations

import time

from scanwright.design.errors import ProtocolError
from scanwright.firmware_io.serial_port import open_serial_port

_MANY = 4096  # bytes, more than arrive in `listen`
_MOST_LATE = 512  # bytes: several of the longest replies
_OVERSLEPT_S = 0.02  # a waiting process wakes up within some ms unless the computer is busy
_SLICE_S = 0.005  # one wait for bytes, constant because pyserial reconfigures the port at each change of its timeout


class SerialLine:
    """An open port; the Dynamixel SDK requires `is_using`, `clearPort`, `isPacketTimeout` and `readPort`."""

    wait_s = 0.050  # for a reply: twice the USB latency of up to 16 ms, the return delay, a busy host

    def __init__(self, port: str, baud: int) -> None:
        self.port = open_serial_port(port, baud, _SLICE_S)
        self.is_using = False
        self.echoes = False  # whether the adapter has an echo
        self.deadline_s = 0.0  # on the monotonic clock
        self.began_ns = self.ended_ns = 0  # time of the request, and of the last byte of the reply
        self.sent = b""  # the last request
        self._echo_due = False
        self._late_bytes = 0

    def clearPort(self) -> None:
        """Drop the received bytes."""
        self.port.reset_input_buffer()

    def isPacketTimeout(self) -> bool:
        """Whether the deadline has passed."""
        return time.monotonic() >= self.deadline_s

    def expect(self, seconds: float) -> None:
        """Set the deadline; bytes that arrived while this process was suspended are still read after it."""
        self.deadline_s = time.monotonic() + seconds
        self._late_bytes = _MOST_LATE

    def overslept(self) -> bool:
        """Whether the last wait ended much too late."""
        return time.monotonic() > self.deadline_s + _OVERSLEPT_S

    def readPort(self, length: int) -> bytes:
        """Return up to that many bytes of a reply; fewer after the deadline."""
        if self._echo_due:
            self._echo_due = False
            if self._read(len(self.sent)) != self.sent:
                raise ProtocolError(
                    "the adapter's echo differs from what was sent: another program may send on this port"
                )
        data = self._read(length)
        if data:
            self.ended_ns = time.monotonic_ns()
        return data

    def write(self, packet: bytes) -> None:
        """Send a request."""
        self.sent, self._echo_due = packet, self.echoes
        self.began_ns = self.ended_ns = time.monotonic_ns()
        self.port.write(packet)

    def listen(self, seconds: float) -> bytes:
        """Return the bytes received in that time."""
        self.expect(seconds)
        return self._read(_MANY)

    def find_echo(self) -> None:
        """Detect an echo of the adapter with a byte to which no servo replies."""
        self.expect(self.wait_s)
        self.clearPort()
        self.write(b"\0")
        self.echoes = self._read(1) == b"\0"

    @property
    def byte_s(self) -> float:
        """Duration of one byte with start and stop bit."""
        return 10 / float(self.port.baudrate)

    def _read(self, length: int) -> bytes:
        data = b""
        while len(data) < length:
            over = self.isPacketTimeout()  # before the read, so bytes that waited in a pause still count
            if over and self._late_bytes <= 0:
                break
            more = self.port.read(length - len(data))
            data += more
            if over:
                self._late_bytes -= len(more)  # garbage has no end
                break
        return data
