"""Packets on the side of a servo: decoding of requests, encoding of statuses.

Written from the e-manual's pages protocol1 and protocol2, not from the SDK of the driver, so that each checks the
other.
"""

from __future__ import annotations

from collections.abc import Sequence

from scanwright.firmware_io.emulators.servo.machine import BROADCAST, Request


def packet_checksum(body: bytes) -> int:
    """Return the checksum of protocol 1.0 of all bytes between header and checksum."""
    return ~sum(body) & 0xFF


def crc16(data: bytes) -> int:
    """Return the CRC of protocol 2.0: polynomial 0x8005, from 0, not reflected, over all bytes before it."""
    crc = 0
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x8005 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


def take(buffer: bytearray, protocol: str) -> Request | None:
    """Remove the next request, and the bytes before it, from the buffer; None until one is complete."""
    return _take_2(buffer) if protocol == "2.0" else _take_1(buffer)


def status(protocol: str, servo_id: int, error: int, data: bytes) -> bytes:
    """Encode a status."""
    if protocol == "2.0":
        return packet_2(servo_id, 0x55, bytes([error]) + data)
    body = bytes([servo_id, len(data) + 2, error]) + data
    return b"\xff\xff" + body + bytes([packet_checksum(body)])


def fast_status(size: int, parts: Sequence[tuple[int, int, bytes]]) -> bytes:
    """Encode the common status of a fast read, without stuffing.

    The part of each servo is error, id, data and the CRC of all before it. `size`: data of all servos, with 4 bytes
    for each.
    """
    packet = b"\xff\xff\xfd\x00" + bytes([BROADCAST]) + (size + 1).to_bytes(2, "little") + b"\x55"
    for servo_id, error, data in parts:
        packet += bytes([error, servo_id]) + data
        packet += crc16(packet).to_bytes(2, "little")
    return packet


def packet_2(servo_id: int, instruction: int, parameters: bytes) -> bytes:
    """Encode a packet of protocol 2.0."""
    stuffed = (bytes([instruction]) + parameters).replace(b"\xff\xff\xfd", b"\xff\xff\xfd\xfd")
    packet = b"\xff\xff\xfd\x00" + bytes([servo_id]) + (len(stuffed) + 2).to_bytes(2, "little") + stuffed
    return packet + crc16(packet).to_bytes(2, "little")


def _take_1(buffer: bytearray) -> Request | None:
    while (start := buffer.find(b"\xff\xff")) >= 0:
        del buffer[:start]
        if len(buffer) < 4:
            return None
        if buffer[2] == 0xFF or not 2 <= buffer[3] <= 250:  # a third FF, or no length: not a header
            del buffer[0]
            continue
        end = buffer[3] + 4
        if len(buffer) < end:
            return None
        wire = bytes(buffer[:end])
        del buffer[:end]
        return Request(wire[2], wire[4], wire[5:-1], wire, wire[-1] == packet_checksum(wire[2:-1]))
    del buffer[: max(0, len(buffer) - 1)]
    return None


def _take_2(buffer: bytearray) -> Request | None:
    while (start := buffer.find(b"\xff\xff\xfd")) >= 0:
        del buffer[:start]
        if len(buffer) < 7:
            return None
        length = int.from_bytes(buffer[5:7], "little")
        if buffer[3] == 0xFD or not 3 <= length <= 1024:
            del buffer[0]
            continue
        end = length + 7
        if len(buffer) < end:
            return None
        wire = bytes(buffer[:end])
        del buffer[:end]
        body = wire[7:-2].replace(b"\xff\xff\xfd\xfd", b"\xff\xff\xfd")
        return Request(wire[4], body[0], body[1:], wire, int.from_bytes(wire[-2:], "little") == crc16(wire[:-2]))
    del buffer[: max(0, len(buffer) - 2)]
    return None
