"""Packets of LDROBOT lidars: pure functions of bytes.

47 bytes, little-endian: 54 2C, speed [deg/s], start [0.01 deg], 12 times range [mm] and intensity, end [0.01 deg],
time [ms, wraps at 30000], CRC-8 (polynomial 4D, from 0, not reflected) of all before it. Angles grow clockwise.
Invalid bytes raise ProtocolError.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from numpy import ndarray

from scanwright.design.arrays import Float32s
from scanwright.design.errors import ProtocolError

POINTS = 12  # of a packet; LD19 development manual
SIZE = 47  # bytes of a packet; the same
STAMP_WRAP_MS = 30_000  # the same
HEAD = b"\x54\x2c"
_TURN = 36_000  # hundredths of a degree
_POLYNOMIAL = 0x4D  # of the CRC-8; the same
_POINT = np.dtype([("range_mm", "<u2"), ("intensity", "u1")])


@dataclass(frozen=True, slots=True, eq=False)
class LdrobotPacket:
    """Content of one packet."""

    speed_deg_s: int  # of the motor
    angle_deg: Float64[ndarray, " 12"]  # clockwise from the front, 0 to 360, shape (12,)
    step_deg: float  # between two points
    range_m: Float32s  # shape (12,), NaN without a return
    intensity: Float32s  # shape (12,)
    stamp_ms: int  # sensor time


def _table() -> bytes:
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = (byte << 1 ^ _POLYNOMIAL) & 0xFF if byte & 0x80 else byte << 1
        table.append(byte)
    return bytes(table)


_CRC = _table()


def crc8(data: bytes) -> int:
    """Return the checksum of a packet without its last byte."""
    crc = 0
    for byte in data:
        crc = _CRC[crc ^ byte]
    return crc


def packet(data: bytes) -> LdrobotPacket:
    """Decode the 47 bytes of a packet."""
    if len(data) != SIZE or data[:2] != HEAD:
        raise ProtocolError(f"LDROBOT: {len(data)} bytes that begin with {data[:2].hex()}: not a packet")
    if crc8(data[:-1]) != data[-1]:
        raise ProtocolError("LDROBOT: the checksum of a packet is wrong")
    speed, start = struct.unpack_from("<HH", data, 2)
    end, stamp = struct.unpack_from("<HH", data, 6 + 3 * POINTS)
    if start > _TURN or end > _TURN or stamp > STAMP_WRAP_MS:
        raise ProtocolError(f"LDROBOT: a packet from {start} to {end} (0.01 deg) at {stamp} ms")
    step_deg = (end - start) % _TURN / 100 / (POINTS - 1)
    points = np.frombuffer(data, _POINT, POINTS, 6)
    return LdrobotPacket(
        speed_deg_s=speed,
        angle_deg=(start / 100 + step_deg * np.arange(POINTS)) % 360,
        step_deg=step_deg,
        range_m=np.where(points["range_mm"], points["range_mm"] / 1e3, np.nan).astype(np.float32),
        intensity=points["intensity"].astype(np.float32),
        stamp_ms=stamp % STAMP_WRAP_MS,
    )


class LdrobotSplitter:
    """Splitter of a byte stream into packets; skips other bytes."""

    def __init__(self) -> None:
        self.bad = 0  # packets lost: one for each started 47 bytes of a run that contains none
        self._rest = b""
        self._passed = 0

    def cut_in(self) -> None:
        """Expect the middle of a packet next, and do not count it as bad."""
        self._rest, self._passed = b"", 1

    def feed(self, data: bytes) -> list[LdrobotPacket]:
        """Return the packets that these bytes complete."""
        self._rest += data
        packets: list[LdrobotPacket] = []
        at = 0
        while at + SIZE <= len(self._rest):
            try:
                packets.append(packet(self._rest[at : at + SIZE]))
            except ProtocolError:
                following = self._rest.find(HEAD, at + 1)
                # without a head skip all but the last byte, which can be the first half of one
                step = (following if following >= 0 else max(len(self._rest) - 1, at + 1)) - at
                self.bad += -(-(self._passed + step) // SIZE) - -(-self._passed // SIZE)
                self._passed += step
                at += step
            else:
                self._passed = 0
                at += SIZE
        self._rest = self._rest[at:]
        return packets
