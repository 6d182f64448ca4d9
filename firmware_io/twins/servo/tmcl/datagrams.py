"""Datagrams of TMCL as the module sees them: nine bytes out of a stream, nine bytes back.

Written from the tables "TMCL command format" and "TMCL reply format" of the maker's manuals, and not from the driver's.
"""

from __future__ import annotations

from scanwright.firmware_io.twins.servo.machine import Request

STRING = -1  # the status of a version as a text, which has no status and no sum


def take(buffer: bytearray) -> Request | None:
    """Take the next nine bytes off the buffer; there is no header, so whatever they are."""
    if len(buffer) < 9:
        return None
    wire = bytes(buffer[:9])
    del buffer[:9]
    return Request(wire[0], wire[1], wire[2:8], wire, wire[8] == sum(wire[:8]) % 256)


def reply(host: int, module: int, status: int, command: int, value: bytes) -> bytes:
    """The bytes of a reply; `value` with its highest byte first."""
    if status == STRING:
        return bytes([host]) + value
    packet = bytes([host, module, status, command]) + value
    return packet + bytes([sum(packet) % 256])
