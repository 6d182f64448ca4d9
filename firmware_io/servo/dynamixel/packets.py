"""Packets of the protocols 1.0 and 2.0, through the packet handlers of the official SDK.

Only its packing and unpacking are used, because of its faults (measured with version 4.1.0):
- its readers index past a short status, and return 0 for no data: `ServoBus` checks the length;
- it polls the wall clock, and forever during garbage: `SerialLine` waits on the monotonic clock;
- it leaves the port "in use" after an exception: it never sends here;
- it mistakes the echo of a protocol 1.0 request for the reply: `SerialLine` removes it;
- it does not stuff protocol 2.0 requests, and unstuffs FF FF FD FD FF FF FD FD wrongly: both are done here.
"""

from __future__ import annotations

from dynamixel_sdk import COMM_RX_TIMEOUT, COMM_SUCCESS, Protocol1PacketHandler, Protocol2PacketHandler

from scanwright.design.errors import DeviceTimeoutError, ProtocolError
from scanwright.firmware_io.servo.bus.packet_format import NO_ANSWER, Meaning, PacketFormat, Status
from scanwright.firmware_io.servo.bus.serial_line import SerialLine

_CONDITIONS_1 = 0b0010_0101  # overload, overheating, voltage: states of the servo
_CHECKSUM_1 = 0b0001_0000  # bit of the error byte: the request arrived damaged
_REFUSALS_1 = {2: "an angle beyond its limits", 8: "a value out of range", 64: "an instruction it does not know"}
_HEADER, _STUFFED = b"\xff\xff\xfd", b"\xff\xff\xfd\xfd"
_ALERT_2 = 0x80  # bit of the error byte: see hardware_error
_CRC_2 = 3  # error number: the request arrived damaged
_REFUSALS_2 = {
    1: "it could not carry it out",
    2: "an instruction it does not know",
    4: "a value out of range",
    5: "a wrong length",
    6: "a value beyond its limit",
    7: "an address that cannot be accessed now",
}


class Protocol1(PacketFormat):
    """Factory protocol of AX and MX: FF FF, sum of the bytes."""

    protocol = "1.0"
    overhead = 14

    def packet(self, servo_id: int, instruction: int, parameters: bytes) -> bytes:
        """Encode a request."""
        tape, length = _Tape(), (len(parameters) + 2).to_bytes(1, "little")
        Protocol1PacketHandler().txPacket(tape, [0, 0, servo_id, *length, instruction, *parameters, 0])
        return tape.packet

    def acknowledged(self, servo_id: int) -> bytes:
        """As `PacketFormat.acknowledged`."""
        return b"\xff\xff%c\x02" % servo_id

    def receive(self, line: SerialLine) -> Status:
        """As `PacketFormat.receive`."""
        packet = _checked(*Protocol1PacketHandler().rxPacket(line))
        if len(packet) != packet[3] + 4 or len(packet) < 6:
            raise ProtocolError(f"an answer of a wrong length: {packet.hex(' ')}")
        return Status(packet[2], packet[4], packet[5:-1], len(packet))

    def meaning(self, error: int) -> Meaning:
        """Decode the error byte."""
        refusal = next((text for bit, text in _REFUSALS_1.items() if error & bit), None)
        return Meaning(error & _CONDITIONS_1, bool(error & _CHECKSUM_1), refusal)


class Protocol2(PacketFormat):
    """Protocol of X and of updated MX: FF FF FD 00, CRC, stuffing."""

    protocol = "2.0"
    overhead = 25
    address_bytes = 2

    def packet(self, servo_id: int, instruction: int, parameters: bytes) -> bytes:
        """Encode a request."""
        tape, parameters = _Tape(), parameters.replace(_HEADER, _STUFFED)
        length = (len(parameters) + 3).to_bytes(2, "little")
        Protocol2PacketHandler().txPacket(tape, [0, 0, 0, 0, servo_id, *length, instruction, *parameters, 0, 0])
        return tape.packet

    def acknowledged(self, servo_id: int) -> bytes:
        """As `PacketFormat.acknowledged`."""
        return b"\xff\xff\xfd\x00%c\x04\x00\x55" % servo_id

    def receive(self, line: SerialLine) -> Status:
        """As `PacketFormat.receive`."""
        packet = _checked(*Protocol2PacketHandler().rxPacket(line, True))  # "fast": without unstuffing
        if len(packet) != packet[5] + 256 * packet[6] + 7:
            raise ProtocolError(f"an answer of a wrong length: {packet.hex(' ')}")
        body = packet[7:-2].replace(_STUFFED, _HEADER)
        if len(body) < 2:
            raise ProtocolError(f"an answer that is cut short: {packet.hex(' ')}")
        return Status(packet[4], body[1], body[2:], len(packet))

    def meaning(self, error: int) -> Meaning:
        """Decode the error byte."""
        conditions, number = error & _ALERT_2, error & ~_ALERT_2
        return Meaning(conditions, number == _CRC_2, _REFUSALS_2.get(number, f"error {number}") if number else None)


PROTOCOL_1, PROTOCOL_2 = Protocol1(), Protocol2()


def _checked(packet: list[int], result: int) -> bytes:
    """Return what the SDK received; raises DeviceTimeoutError or ProtocolError."""
    if result == COMM_RX_TIMEOUT:
        raise DeviceTimeoutError(NO_ANSWER)
    if result != COMM_SUCCESS:
        raise ProtocolError(f"damaged answer {bytes(packet).hex(' ')}: check cable, ground and other senders")
    return bytes(packet)


class _Tape:
    """A port for the SDK that stores the request."""

    is_using = False
    packet = b""

    def clearPort(self) -> None:
        pass

    def writePort(self, packet: list[int]) -> int:
        self.packet = bytes(packet)
        return len(packet)
