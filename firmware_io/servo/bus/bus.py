"""Transactions with the servos on one serial port, in any packet format.

An echoing adapter is detected on opening; its echo is removed. An answer must have the requested length. Failures raise
`DeviceError`; those that a retry can cure are retried.
"""

from __future__ import annotations

import termios
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

from scanwright.design.errors import DeviceError, DeviceTimeoutError, ProtocolError
from scanwright.firmware_io.servo.bus.packet_format import PacketFormat, Status
from scanwright.firmware_io.servo.bus.registers import Register
from scanwright.firmware_io.servo.bus.serial_line import SerialLine

_TRIES = 3  # at one damaged answer in ten, one reading in a thousand fails
_EXCUSED = 10  # tries in which this computer was kept from running: they say nothing of the servo
_LATE = 4  # times the wait for an answer, until it is given up for good


@dataclass(frozen=True, slots=True)
class ServoAnswer:
    """One status packet.

    Attributes:
        sampled_ns: `time.monotonic_ns()` when the servo took its values: the middle of the transaction, without the
            bytes' own time on the wire and without the return delay.
    """

    data: bytes  # parameters
    conditions: int  # fault bits of the servo, or in protocol 2.0 one that says there are some; 0 when it is well
    sampled_ns: int
    bound_ns: int  # the sampling lies within this of `sampled_ns`


class ServoBus:
    """The servos behind one port, which is locked."""

    def __init__(self, port: str, packets: PacketFormat, baud: int = 57600) -> None:
        self.port = port  # name of the port
        self.packets = packets  # how they are packed; may be changed
        self.return_delay_ns = 0.0  # what the servo waits between request and answer
        self.lost_replies = 0  # count of answers that were damaged or did not come, and were asked for again
        self._line = SerialLine(port, baud)

    def listen(self, seconds: float) -> bytes:
        """What comes in that time though nobody asked; a servo never speaks first."""
        with self._port_errors():
            return self._line.listen(seconds)

    def find_echo(self) -> None:
        """Find out whether the adapter returns what it sends; before the first request."""
        with self._port_errors():
            self._line.find_echo()

    @property
    def baud(self) -> int:
        """Bits per second."""
        return int(self._line.port.baudrate)

    def set_baud(self, baud: int) -> bool:
        """Send at another speed from now on; False if the adapter cannot."""
        with self._port_errors():
            try:
                self._line.port.baudrate = baud
            except ValueError:
                return False
        return True

    @property
    def is_open(self) -> bool:
        """Whether it was not closed yet."""
        return bool(self._line.port.is_open)

    def fileno(self) -> int:
        """The open port, for the guard to inherit."""
        return int(self._line.port.fileno())

    def close(self) -> None:
        """Close the port; may be called again."""
        self._line.port.close()

    def lower_latency(self) -> None:
        """Ask the USB adapter to hand over bytes at once, until the port is closed."""
        with suppress(OSError, ValueError, AttributeError, NotImplementedError):  # not every driver can, or needs to
            self._line.port.set_low_latency_mode(True)

    def read(self, servo_id: int, register: Register) -> ServoAnswer:
        """Read a register or a block; DeviceTimeoutError or ProtocolError after three tries, else DeviceError."""
        request = self.packets.reading(servo_id, register.address, register.size)
        return self._ask(servo_id, request, register.size, reads=True)

    def write(self, servo_id: int, register: Register, data: bytes) -> ServoAnswer:
        """Write the bytes of a register; raises as `read` does."""
        return self._ask(servo_id, self.write_packet(servo_id, register, data))

    def write_packet(self, servo_id: int, register: Register, data: bytes) -> bytes:
        """The bytes on the wire of a write."""
        return self.packets.writing(servo_id, register.address, data)

    def write_unanswered(self, servo_id: int, register: Register, data: bytes) -> None:
        """Write to a servo that may be set not to answer writes."""
        with self._port_errors():
            self._line.port.write(self.write_packet(servo_id, register, data))

    def ping(self, servo_id: int, wait_s: float) -> list[int]:
        """Which servos answer a ping of one, or of all, in time; damaged answers are left out."""
        answering: set[int] = set()
        with self._port_errors():
            self._send(self.packets.ping(servo_id), wait_s)
            while not self._line.isPacketTimeout() and servo_id not in answering:
                with suppress(DeviceTimeoutError, ProtocolError):
                    answering.add(self.packets.receive(self._line).id)
        return sorted(answering)

    def reboot(self, servo_id: int) -> None:
        """Restart a servo of protocol 2.0; raises as `read` does."""
        self._ask(servo_id, self.packets.reboot(servo_id))

    def _ask(self, servo_id: int, request: bytes, expected: int = 0, *, reads: bool = False) -> ServoAnswer:
        with self._port_errors():
            tries = excused = 0
            while True:
                try:
                    self._send(request, self._line.wait_s + (expected + 11) * self._line.byte_s)
                    return self._checked(self._receive(servo_id), expected, reads=reads)
                except (DeviceTimeoutError, ProtocolError) as error:
                    silent = isinstance(error, DeviceTimeoutError)
                    if silent and self._line.overslept() and excused < _EXCUSED:
                        excused += 1
                    else:
                        tries += 1
                        self.lost_replies += 1
                    if tries == _TRIES:
                        raise type(error)(f"{self.port}: servo {servo_id}: {error}") from error
                    self._let_pass()

    def _send(self, request: bytes, wait_s: float) -> None:
        self._line.clearPort()
        self._line.write(request)
        self._line.expect(len(request) * self._line.byte_s + wait_s)

    def _let_pass(self) -> None:
        """Wait for answers that are late, and drop them: they carry no number, so one would be taken for the next."""
        self._line.expect(_LATE * self._line.wait_s)
        with suppress(DeviceTimeoutError):
            while True:
                with suppress(ProtocolError):
                    self.packets.receive(self._line)

    def _receive(self, servo_id: int) -> Status:
        """The next status of that servo; raises as `PacketFormat.receive`."""
        while True:
            status = self.packets.receive(self._line)
            if status.id == servo_id:
                return status

    def _checked(self, status: Status, expected: int, *, reads: bool) -> ServoAnswer:
        meaning, complete = self.packets.meaning(status.error), len(status.data) == expected
        if meaning.damaged:
            raise ProtocolError("the request arrived damaged: check cable and ground")
        if meaning.refusal and not (complete and reads):  # a read that brings its values was no mistake
            raise DeviceError(f"{self.port}: servo {status.id}: refused: {meaning.refusal}")
        if not complete:
            raise ProtocolError(f"{len(status.data)} bytes instead of {expected}")
        wire_ns = (len(self._line.sent) - status.length) * self._line.byte_s * 1e9
        total_ns = self._line.ended_ns - self._line.began_ns
        known_ns = (len(self._line.sent) + status.length) * self._line.byte_s * 1e9 + self.return_delay_ns
        return ServoAnswer(
            data=status.data,
            conditions=meaning.conditions,
            sampled_ns=self._line.began_ns + round((total_ns + wire_ns - self.return_delay_ns) / 2),
            bound_ns=max(0, round((total_ns - known_ns) / 2)),
        )

    @contextmanager
    def _port_errors(self) -> Iterator[None]:
        try:
            yield
        except DeviceTimeoutError:
            raise
        except (OSError, termios.error) as error:  # pyserial's own are OSErrors
            raise DeviceTimeoutError(
                f"{self.port}: the port is gone ({error}): plug the adapter in, then open it again"
            ) from error
