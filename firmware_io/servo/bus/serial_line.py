"""The serial port under the servo bus: what is sent, what comes, and when."""

from __future__ import annotations

import time

from scanwright.design.errors import ProtocolError
from scanwright.firmware_io.serial_port import open_serial_port

_MANY = 4096  # bytes, more than come in a moment
_MOST_LATE = 512  # bytes: several of the longest answers
_OVERSLEPT_S = 0.02  # a waiting process wakes up within some ms unless the computer is busy
_SLICE_S = 0.005  # of one wait for bytes: pyserial sets the port up anew whenever its time-out is changed


class SerialLine:
    """An open port, with what packet handlers ask of one to read an answer; those names are the Dynamixel SDK's.

    Attributes:
        wait_s: how long an answer may take beyond the time of its bytes: twice the USB latency timer of up to 16 ms,
            the return delay, a busy host.
        began_ns: when it was written.
        ended_ns: when the last byte came.
    """

    wait_s = 0.050

    def __init__(self, port: str, baud: int) -> None:
        self.port = open_serial_port(port, baud, _SLICE_S)  # of pyserial
        self.is_using = False  # which the SDK clears after reading
        self.echoes = False  # whether the adapter returns what it sends
        self.deadline_s = 0.0  # until when to wait, on the monotonic clock
        self.began_ns = self.ended_ns = 0
        self.sent = b""  # the last request
        self._echo_due = False
        self._late_bytes = 0

    def clearPort(self) -> None:
        """Drop what has come."""
        self.port.reset_input_buffer()

    def isPacketTimeout(self) -> bool:
        """Whether the deadline has passed."""
        return time.monotonic() >= self.deadline_s

    def expect(self, seconds: float) -> None:
        """Wait that long from now, and then take what has come meanwhile: this computer may have been late, not it."""
        self.deadline_s = time.monotonic() + seconds
        self._late_bytes = _MOST_LATE

    def overslept(self) -> bool:
        """Whether this computer has come back from a wait much later than it meant to."""
        return time.monotonic() > self.deadline_s + _OVERSLEPT_S

    def readPort(self, length: int) -> bytes:
        """Up to that many bytes of an answer; fewer when the deadline passes."""
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
        """What comes in that time without having been asked for."""
        self.expect(seconds)
        return self._read(_MANY)

    def find_echo(self) -> None:
        """Whether the adapter returns what it sends, tried with a byte that no servo answers."""
        self.expect(self.wait_s)
        self.clearPort()
        self.write(b"\0")
        self.echoes = self._read(1) == b"\0"

    @property
    def byte_s(self) -> float:
        """How long one byte takes, with its start and stop bit."""
        return 10 / float(self.port.baudrate)

    def _read(self, length: int) -> bytes:
        data = b""
        while len(data) < length:
            over = self.isPacketTimeout()  # told before the last look: what came while we were kept waiting counts
            if over and self._late_bytes <= 0:
                break
            more = self.port.read(length - len(data))
            data += more
            if over:
                self._late_bytes -= len(more)  # garbage has no end
                break
        return data
