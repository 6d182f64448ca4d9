"""Transactions with the servos on one serial port, through the packet handlers of the official SDK.

The SDK packs requests and unpacks answers, and nothing else, because of its faults (measured with version 4.1.0):

- its readers index past the end of a short status, and give 0 for no data: here the length must be the one asked for;
- it waits by the wall clock, at full load, and for ever while garbage flows: `SerialLine` waits on the monotonic clock,
  asleep, and past the deadline gives nothing more;
- it leaves the port "in use" after an exception: it never sends;
- it takes the echo of a protocol 1.0 request for the answer: an adapter that echoes is found on opening, and exactly
  what was sent is taken off what comes;
- it does not stuff protocol 2.0 requests, and unstuffs answers in place, so that FF FD FD loses a byte after the first
  FF FF FD FD: both are done here, outside of it.

Whatever goes wrong is a `DeviceError`; what can be mended by asking again (a bit error, a lost packet) is asked again.
"""

from __future__ import annotations

import termios
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

from dynamixel_sdk import COMM_RX_TIMEOUT, COMM_SUCCESS, Protocol1PacketHandler, Protocol2PacketHandler

from design.errors import DeviceError, DeviceTimeoutError, ProtocolError
from firmware_io.servo.dynamixel.registers import Register
from firmware_io.servo.dynamixel.serial_line import SerialLine, Tape

PING, READ, WRITE, REBOOT = 1, 2, 3, 8
BROADCAST = 254

_TRIES = 3
_EXCUSED = 10  # tries in which this computer was kept from running: they say nothing of the servo
_LATE = 4  # times the wait for an answer, until it is given up for good

_CONDITIONS_1 = 0b0010_0101  # overload, overheating, voltage: states of the servo, not answers to the request
_CHECKSUM_1 = 0b0001_0000
_REFUSALS_1 = {2: "an angle beyond its limits", 8: "a value out of range", 64: "an instruction it does not know"}
_HEADER, _STUFFED = b"\xff\xff\xfd", b"\xff\xff\xfd\xfd"
_ALERT_2 = 0x80
_CRC_2 = 3
_REFUSALS_2 = {
    1: "it could not carry it out",
    2: "an instruction it does not know",
    4: "a value out of range",
    5: "a wrong length",
    6: "a value beyond its limit",
    7: "an address that cannot be accessed now",
}


@dataclass(frozen=True, slots=True)
class ServoAnswer:
    """One status packet.

    Attributes:
        data: parameters.
        conditions: fault bits of the servo, protocol 1.0; the alert bit, protocol 2.0; 0 when it is well.
        sampled_ns: `time.monotonic_ns()` when the servo took its values: the middle of the transaction, without the
            bytes' own time on the wire and without the return delay.
        bound_ns: the sampling lies within this of `sampled_ns`.
    """

    data: bytes
    conditions: int
    sampled_ns: int
    bound_ns: int


class ServoBus:
    """The servos behind one port, which nobody else can open meanwhile.

    Attributes:
        port: name of the port.
        protocol: 1.0 or 2.0; may be changed.
        return_delay_ns: what the servo waits between request and answer.
    """

    def __init__(self, port: str, baud: int = 57600, protocol: float = 1.0) -> None:
        self.port = port
        self.protocol = protocol
        self.return_delay_ns = 0.0
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
        """Send at another speed from now on; False where the adapter cannot."""
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
        """The bytes of a register or a block.

        Raises:
            DeviceTimeoutError: nothing came, three times, or the port is gone.
            ProtocolError: what came was damaged, three times.
            DeviceError: the servo refuses.
        """
        return self._ask(servo_id, READ, self._number(register.address) + self._number(register.size), register.size)

    def write(self, servo_id: int, register: Register, data: bytes) -> ServoAnswer:
        """Write the bytes of a register; raises as `read` does."""
        return self._ask(servo_id, WRITE, self._number(register.address) + data, 0)

    def write_packet(self, servo_id: int, register: Register, data: bytes) -> bytes:
        """The bytes on the wire of a write."""
        return self._packet(servo_id, WRITE, self._number(register.address) + data)

    def write_unanswered(self, servo_id: int, register: Register, data: bytes) -> None:
        """Write to a servo that may be set not to answer writes."""
        with self._port_errors():
            self._line.port.write(self.write_packet(servo_id, register, data))

    def ping(self, servo_id: int, wait_s: float) -> list[int]:
        """Which servos answer a ping of one, or of all (254), in time; damaged answers are left out."""
        found: set[int] = set()
        with self._port_errors():
            self._send(self._packet(servo_id, PING, b""), wait_s)
            while not self._line.isPacketTimeout() and servo_id not in found:
                with suppress(DeviceTimeoutError, ProtocolError):
                    found.add(self._receive().id)
        return sorted(found)

    def reboot(self, servo_id: int) -> None:
        """Restart a servo of protocol 2.0; raises as `read` does."""
        self._ask(servo_id, REBOOT, b"", 0)

    def _number(self, value: int) -> bytes:
        """An address or a length."""
        return value.to_bytes(2 if self.protocol == 2.0 else 1, "little")

    def _packet(self, servo_id: int, instruction: int, parameters: bytes) -> bytes:
        tape = Tape()
        if self.protocol == 2.0:
            parameters = parameters.replace(_HEADER, _STUFFED)
            length = (len(parameters) + 3).to_bytes(2, "little")
            Protocol2PacketHandler().txPacket(tape, [0, 0, 0, 0, servo_id, *length, instruction, *parameters, 0, 0])
        else:
            length = (len(parameters) + 2).to_bytes(1, "little")
            Protocol1PacketHandler().txPacket(tape, [0, 0, servo_id, *length, instruction, *parameters, 0])
        return tape.packet

    def _ask(self, servo_id: int, instruction: int, parameters: bytes, expected: int) -> ServoAnswer:
        request = self._packet(servo_id, instruction, parameters)
        with self._port_errors():
            tries = excused = 0
            while True:
                try:
                    self._send(request, self._line.wait_s + (expected + 11) * self._line.byte_s)
                    return self._checked(self._receive(servo_id), instruction, expected)
                except (DeviceTimeoutError, ProtocolError) as error:
                    silent = isinstance(error, DeviceTimeoutError)
                    if silent and self._line.overslept() and excused < _EXCUSED:
                        excused += 1
                    else:
                        tries += 1
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
                    self._receive()

    def _receive(self, servo_id: int | None = None) -> _Status:
        """The next status of a servo, or of any.

        Raises:
            DeviceTimeoutError: the deadline passed.
            ProtocolError: what came is damaged.
        """
        while True:
            if self.protocol == 2.0:
                packet, result = Protocol2PacketHandler().rxPacket(self._line, True)  # "fast": without unstuffing
            else:
                packet, result = Protocol1PacketHandler().rxPacket(self._line)
            if result == COMM_RX_TIMEOUT:
                raise DeviceTimeoutError(
                    "no answer: look at its power and cable; another program may have set another speed"
                )
            if result != COMM_SUCCESS:
                raise ProtocolError(f"damaged answer {bytes(packet).hex(' ')}: look at cable, ground and other senders")
            status = _split_2(packet) if self.protocol == 2.0 else _split_1(packet)
            if servo_id in (None, status.id):
                return status

    def _checked(self, status: _Status, instruction: int, expected: int) -> ServoAnswer:
        error, complete = status.error, len(status.data) == expected
        if self.protocol == 2.0:
            conditions, number = error & _ALERT_2, error & ~_ALERT_2
            damaged, refusal = number == _CRC_2, _REFUSALS_2.get(number, f"error {number}") if number else None
        else:
            conditions, damaged = error & _CONDITIONS_1, bool(error & _CHECKSUM_1)
            refusal = next((text for bit, text in _REFUSALS_1.items() if error & bit), None)
        if damaged:
            raise ProtocolError("the request arrived damaged: look at cable and ground")
        if refusal and not (complete and instruction == READ):  # a read that brings its values was no mistake
            raise DeviceError(f"{self.port}: servo {status.id}: refused: {refusal}")
        if not complete:
            raise ProtocolError(f"{len(status.data)} bytes where {expected} were asked for")
        wire_ns = (len(self._line.sent) - status.length) * self._line.byte_s * 1e9
        total_ns = self._line.ended_ns - self._line.began_ns
        known_ns = (len(self._line.sent) + status.length) * self._line.byte_s * 1e9 + self.return_delay_ns
        return ServoAnswer(
            data=status.data,
            conditions=conditions,
            sampled_ns=self._line.began_ns + round((total_ns + wire_ns - self.return_delay_ns) / 2),
            bound_ns=max(0, round((total_ns - known_ns) / 2)),
        )

    @contextmanager
    def _port_errors(self) -> Iterator[None]:
        try:
            yield
        except (OSError, termios.error) as error:  # pyserial's own are OSErrors
            raise DeviceTimeoutError(
                f"{self.port}: the port is gone ({error}): plug the adapter in, then open it again"
            ) from error


@dataclass(frozen=True, slots=True)
class _Status:
    id: int
    error: int
    data: bytes
    length: int  # on the wire


def _split_1(packet: list[int]) -> _Status:
    if len(packet) != packet[3] + 4 or len(packet) < 6:
        raise ProtocolError(f"an answer of a wrong length: {bytes(packet).hex(' ')}")
    return _Status(packet[2], packet[4], bytes(packet[5:-1]), len(packet))


def _split_2(packet: list[int]) -> _Status:
    if len(packet) != packet[5] + 256 * packet[6] + 7:
        raise ProtocolError(f"an answer of a wrong length: {bytes(packet).hex(' ')}")
    body = bytes(packet[7:-2]).replace(_STUFFED, _HEADER)
    if len(body) < 2:
        raise ProtocolError(f"an answer that is cut short: {bytes(packet).hex(' ')}")
    return _Status(packet[4], body[1], body[2:], len(packet))
