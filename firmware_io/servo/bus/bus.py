"""Transactions with the servos on one serial port, in any packet format.

The echo of an adapter is detected and removed. A reply must have the requested length. Failures raise `DeviceError`,
after retries if these can help.
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

_TRIES = 3  # at one damaged reply in ten, one reading in a thousand fails
_EXCUSED = 10  # tries that do not count because this process was suspended during them
_LATE = 4  # times the wait for a reply, after which none arrives


@dataclass(frozen=True, slots=True)
class ServoAnswer:
    """One status packet.

    Attributes:
        sampled_ns: `time.monotonic_ns()` when the servo sampled its values: the middle of the transaction, without the
            time of the bytes on the wire and without the return delay.
    """

    data: bytes  # parameters
    conditions: int  # fault bits, in protocol 2.0 a single one; 0 without a fault
    sampled_ns: int
    bound_ns: int  # largest error of `sampled_ns`


class ServoBus:
    """The servos on one port, which is locked."""

    def __init__(self, port: str, packets: PacketFormat, baud: int = 57600) -> None:
        self.port = port
        self.packets = packets  # writable
        self.return_delay_ns = 0.0  # of the servo between request and reply
        self.lost_replies = 0  # number of damaged or missing replies
        self._line = SerialLine(port, baud)

    def listen(self, seconds: float) -> bytes:
        """Return the bytes received in that time without a request; a servo sends none."""
        with self._port_errors():
            return self._line.listen(seconds)

    def find_echo(self) -> None:
        """Detect an echo of the adapter, before the first request."""
        with self._port_errors():
            self._line.find_echo()

    @property
    def baud(self) -> int:
        """Baud rate."""
        return int(self._line.port.baudrate)

    def set_baud(self, baud: int) -> bool:
        """Set the baud rate; False if the adapter does not support it."""
        with self._port_errors():
            try:
                self._line.port.baudrate = baud
            except ValueError:
                return False
        return True

    @property
    def is_open(self) -> bool:
        """Whether the port is open."""
        return bool(self._line.port.is_open)

    def fileno(self) -> int:
        """Return the descriptor of the open port, which the watchdog process inherits."""
        return int(self._line.port.fileno())

    def close(self) -> None:
        """Close the port; can be called again."""
        self._line.port.close()

    def lower_latency(self) -> None:
        """Set the USB adapter to forward bytes at once, until the port is closed."""
        with suppress(OSError, ValueError, AttributeError, NotImplementedError):  # unsupported by some drivers
            self._line.port.set_low_latency_mode(True)

    def read(self, servo_id: int, register: Register) -> ServoAnswer:
        """Read a register or a block; DeviceTimeoutError or ProtocolError after three tries, else DeviceError."""
        request = self.packets.reading(servo_id, register.address, register.size)
        return self._ask(servo_id, request, register.size, reads=True)

    def write(self, servo_id: int, register: Register, data: bytes) -> ServoAnswer:
        """Write the bytes of a register; raises as `read` does."""
        return self._ask(servo_id, self.write_packet(servo_id, register, data))

    def write_packet(self, servo_id: int, register: Register, data: bytes) -> bytes:
        """Encode a write."""
        return self.packets.writing(servo_id, register.address, data)

    def write_unanswered(self, servo_id: int, register: Register, data: bytes) -> None:
        """Write to a servo that is possibly set not to reply to writes."""
        with self._port_errors():
            self._line.port.write(self.write_packet(servo_id, register, data))

    def ping(self, servo_id: int, wait_s: float) -> list[int]:
        """Return the ids of the servos that reply in time to a ping of one or all; drops damaged replies."""
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
                    self._drop_late_replies()

    def _send(self, request: bytes, wait_s: float) -> None:
        self._line.clearPort()
        self._line.write(request)
        self._line.expect(len(request) * self._line.byte_s + wait_s)

    def _drop_late_replies(self) -> None:
        """Wait for late replies and drop them: without a number, one would be mistaken for the next reply."""
        self._line.expect(_LATE * self._line.wait_s)
        with suppress(DeviceTimeoutError):
            while True:
                with suppress(ProtocolError):
                    self.packets.receive(self._line)

    def _receive(self, servo_id: int) -> Status:
        while True:
            status = self.packets.receive(self._line)
            if status.id == servo_id:
                return status

    def _checked(self, status: Status, expected: int, *, reads: bool) -> ServoAnswer:
        meaning, complete = self.packets.meaning(status.error), len(status.data) == expected
        if meaning.damaged:
            raise ProtocolError("the request arrived damaged: check cable and ground")
        if meaning.refusal and not (complete and reads):  # a read that returns its values is valid
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
