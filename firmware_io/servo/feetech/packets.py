"""Packets of Feetech's STS and SMS servos: FF FF, id, length, instruction or status, parameters, sum.

The maker's SDK (`ftservo-python-sdk` 2.0.1) copies the Dynamixel one with its faults, so it is not used. Frame and sum
are those of Dynamixel's protocol 1.0, so each family replies to the other's pings; status byte, registers and signs
differ. A damaged request gets no reply. Invalid bytes raise ProtocolError.
"""

from __future__ import annotations

from scanwright.design.errors import DeviceTimeoutError, ProtocolError
from scanwright.firmware_io.servo.bus.packet_format import NO_ANSWER, Meaning, PacketFormat, Status
from scanwright.firmware_io.servo.bus.serial_line import SerialLine

_HEADER = b"\xff\xff"
_SHORTEST = 6  # header, id, length, status, sum
_LAST_ID = b"\xfd"
_LONGEST = 250  # of the length byte; more is damage


def checksum(body: bytes) -> int:
    """Checksum of everything between header and sum."""
    return ~sum(body) & 0xFF


def from_header(data: bytes) -> bytes:
    """Drop the bytes before the first one with which a status can begin."""
    for start in range(len(data)):
        head = data[start : start + 4]
        fits = head[2:3] <= _LAST_ID and (len(head) < 4 or 2 <= head[3] <= _LONGEST)
        if fits and _HEADER.startswith(head[:2]):
            return data[start:]
    return b""


def packet_length(data: bytes) -> int:
    """Return the length of the status that begins here; the shortest one if that is not yet received."""
    return data[3] + 4 if len(data) > 3 else _SHORTEST


def status(data: bytes) -> Status:
    """Decode a complete status."""
    if data[-1] != checksum(data[2:-1]):
        raise ProtocolError(f"damaged answer {data.hex(' ')}: check cable, ground and other senders")
    return Status(data[2], data[4], data[5:-1], len(data))


class Sts(PacketFormat):
    """Packet format of STS and SMS."""

    protocol = "STS"
    overhead = 14

    def packet(self, servo_id: int, instruction: int, parameters: bytes) -> bytes:
        """Encode a request."""
        body = bytes([servo_id, len(parameters) + 2, instruction]) + parameters
        return _HEADER + body + bytes([checksum(body)])

    def acknowledged(self, servo_id: int) -> bytes:
        """As `PacketFormat.acknowledged`."""
        return _HEADER + bytes([servo_id, 2])

    def receive(self, line: SerialLine) -> Status:
        """As `PacketFormat.receive`."""
        received, is_damaged = b"", False
        while len(received) < (length := packet_length(received)):
            more = line.readPort(length - len(received))
            if not more:
                if is_damaged:
                    raise ProtocolError(f"damaged answer {received.hex(' ')}: check cable, ground and other senders")
                raise DeviceTimeoutError(NO_ANSWER)
            received, is_damaged = from_header(received + more), True
        return status(received)

    def meaning(self, error: int) -> Meaning:
        """Decode the status byte, which has only faults of the servo."""
        return Meaning(conditions=error)


STS = Sts()
