"""Packets of the STS on the side of the servo: decoding of requests, encoding of statuses.

Written from Feetech's protocol manual, not from the driver, so that each checks the other.
"""

from __future__ import annotations

from scanwright.firmware_io.emulators.servo.machine import Request

_LONGEST = 250  # of the length byte; more is damage


def take(buffer: bytearray) -> Request | None:
    """Remove the next request, and the bytes before it, from the buffer; None until one is complete."""
    while (at := buffer.find(b"\xff\xff")) >= 0:
        del buffer[:at]
        if len(buffer) < 4:
            return None
        servo_id, length = buffer[2], buffer[3]
        if servo_id == 0xFF or length < 2 or length > _LONGEST:
            del buffer[0]
            continue
        if len(buffer) < 4 + length:
            return None
        wire = bytes(buffer[: 4 + length])
        del buffer[: 4 + length]
        intact = (sum(wire[2:]) & 0xFF) == 0xFF  # the checksum completes the sum to FF
        return Request(servo_id, wire[4], wire[5:-1], wire, intact)
    del buffer[: max(0, len(buffer) - 1)]
    return None


def status(servo_id: int, error: int, data: bytes) -> bytes:
    """Encode a status."""
    packet = bytearray(b"\xff\xff") + bytes([servo_id, 2 + len(data), error]) + data
    packet.append(0xFF - sum(packet[2:]) % 256)
    return bytes(packet)
