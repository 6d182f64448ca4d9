"""Datagrams of TMCL over RS485 or USB: nine bytes each way, the last their sum, values with their highest byte first.

A request is module, command, type, motor or bank, value; a reply is host, module, status, command, value. There is no
header: a module takes nine bytes that come without a pause of 5 ms (UART_TIMEOUT_VALUE of the maker's open firmware),
so a reply is the right nine bytes by its module, its command and its sum. Source is the maker's "TMCL firmware manual",
chapters "binary command format", "reply format" and "status codes", the same for all modules.

What a module knows is asked for by different commands; here each has an address, whose thousands tell which.
"""

from __future__ import annotations

import struct

from scanwright.design.errors import DeviceTimeoutError, ProtocolError
from scanwright.firmware_io.servo.bus.packet_format import NO_ANSWER, Meaning, Status
from scanwright.firmware_io.servo.bus.serial_line import SerialLine

AXIS, GLOBAL, USER, INPUT, COMMAND = 0, 1000, 2000, 3000, 4000
ROTATE_RIGHT, MOVE_TO, FIRMWARE_VERSION = COMMAND + 1, COMMAND + 4, COMMAND + 136

_ROTATE_LEFT = 2
_GET_AXIS, _SET_AXIS, _GET_GLOBAL, _SET_GLOBAL, _GET_INPUT = 6, 5, 10, 9, 15
# What reads and what writes there, and which bank: user variables are the global parameters of bank 2, analogue inputs
# those of bank 1.
_COMMANDS = {
    AXIS: (_GET_AXIS, _SET_AXIS, 0),
    GLOBAL: (_GET_GLOBAL, _SET_GLOBAL, 0),
    USER: (_GET_GLOBAL, _SET_GLOBAL, 2),
    INPUT: (_GET_INPUT, None, 1),
}
_TELLING = (_GET_AXIS, _GET_GLOBAL, _GET_INPUT)
_LENGTH = 9
_DONE, _DAMAGED = 100, 1
_REFUSALS = {
    2: "a command it does not know",
    3: "a type it does not know",
    4: "a value out of range",
    5: "its memory is locked",
    6: "a command that is not available",
}


def datagram(module: int, command: int, kind: int, bank: int, value: int) -> bytes:
    """The bytes of a request."""
    body = struct.pack(">BBBBi", module, command, kind, bank, value)
    return body + bytes([sum(body) & 0xFF])


def reading(module: int, address: int) -> bytes:
    """The request for what stands at an address."""
    if address == FIRMWARE_VERSION:
        return datagram(module, address - COMMAND, 1, 0, 0)  # 1: as a number
    command, _, bank = _COMMANDS[address // 1000 * 1000]
    return datagram(module, command, address % 1000, bank, 0)


def writing(module: int, address: int, value: int) -> bytes:
    """The request to take a value to an address; negative ones of "rotate right" are the same to the left."""
    if address == ROTATE_RIGHT and value < 0:
        return datagram(module, _ROTATE_LEFT, 0, 0, -value)
    if address >= COMMAND:
        return datagram(module, address - COMMAND, 0, 0, value)
    _, command, bank = _COMMANDS[address // 1000 * 1000]
    assert command is not None, f"an input cannot be written: {address}"
    return datagram(module, command, address % 1000, bank, value)


def reply_in(heard: bytes, asked: bytes) -> bytes | None:
    """The first nine bytes that are a reply to this request; None where there are none yet."""
    for start in range(len(heard) - _LENGTH + 1):
        reply = heard[start : start + _LENGTH]
        if reply[1] == asked[0] and reply[3] == asked[1] and reply[8] == sum(reply[:8]) & 0xFF:
            return reply
    return None


def status(reply: bytes) -> Status:
    """Take a reply apart; its value with the lowest byte first, and none where nothing was asked."""
    value = reply[7:3:-1]
    if reply[3] == FIRMWARE_VERSION - COMMAND:
        value = value[2:]  # the upper half is the number of the model, the lower the version
    elif reply[3] not in _TELLING:
        value = b""
    return Status(reply[1], reply[2], value, _LENGTH)


class Tmcl:
    """The `PacketFormat` of them."""

    protocol = "TMCL"
    overhead = 14  # of two datagrams, beside the four bytes of a value
    everyone = 1  # a module answers to its own number only

    def ping(self, servo_id: int) -> bytes:
        """As `PacketFormat.ping`, and so are those below: there is none, but whoever is there tells its version."""
        return reading(servo_id, FIRMWARE_VERSION)

    def reading(self, servo_id: int, address: int, size: int) -> bytes:
        """The request for the value at an address; of four bytes each, but the number of the model."""
        del size
        return reading(servo_id, address)

    def writing(self, servo_id: int, address: int, values: bytes) -> bytes:
        """The request to take a value to an address."""
        return writing(servo_id, address, int.from_bytes(values, "little", signed=True))

    def reboot(self, servo_id: int) -> bytes:
        """The request to restart, which the manuals do not have."""
        raise NotImplementedError(f"servo {servo_id}: TMCL knows no restart")

    def acknowledged(self, servo_id: int) -> bytes:
        """What the reply to a setting of the axis begins with, behind the number of the host."""
        return bytes([servo_id, _DONE, _SET_AXIS])

    def receive(self, line: SerialLine) -> Status:
        """The next reply to what was asked last; raises as `PacketFormat.receive`."""
        heard = b""
        while (reply := reply_in(heard, line.sent)) is None:
            more = line.readPort(max(1, _LENGTH - len(heard)))
            if not more:
                if heard:
                    raise ProtocolError(f"damaged answer {heard.hex(' ')}: look at cable, ground and other senders")
                raise DeviceTimeoutError(NO_ANSWER)
            heard = heard[1 - _LENGTH :] + more if len(heard) >= _LENGTH else heard + more
        return status(reply)

    def meaning(self, error: int) -> Meaning:
        """What the status means: it tells of the request only."""
        if error == _DONE:
            return Meaning()
        return Meaning(damaged=error == _DAMAGED, refusal=_REFUSALS.get(error, f"status {error}"))


TMCL = Tmcl()
