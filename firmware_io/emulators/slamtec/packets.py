"""Packets sent by an RPLIDAR: replies, nodes, capsules, ultra, dense and ultra-dense capsules; numbers little-endian.

Written from the maker's protocol manual (LR001) and the decoder in rplidar_sdk 2.1, not from the driver.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

_PARTS = ((3328, 16_384, 4), (1792, 4096, 3), (1280, 2048, 2), (512, 512, 1), (0, 0, 0))
"""Parts of the scale of an ultra capsule's major range: first count, first millimetre, bits of a count."""
_DENSE_PARTS = ((0, 2), (2046, 3), (8187, 4), (24_567, 5))
"""Parts of the scale of an ultra-dense capsule: first millimetre and step."""
_NONE = 0x200  # of the ten bits of a predicted range: no return
_LAST_PREDICTED = 510  # steps; 511 and -512 mean no return


def reply(kind: int, data: bytes) -> bytes:
    """Encode a reply with its descriptor."""
    return b"\xa5\x5a" + struct.pack("<IB", len(data), kind) + data


def stream_begins(kind: int, size: int) -> bytes:
    """Encode the descriptor of a stream."""
    return b"\xa5\x5a" + struct.pack("<IB", 1 << 30 | size, kind)


def node(angle_deg: float, range_mm: float, *, first: bool) -> bytes:
    """Encode one point with its angle; `first` marks the first of a turn."""
    quality = 47 if range_mm else 0
    angle = math.floor(angle_deg * 64) % 23_040 << 1 | 1
    return struct.pack("<BHH", quality << 2 | (1 if first else 2), angle, round(range_mm * 4))


def capsule(angle_deg: float, range_mm: Sequence[int], eighths: Sequence[int], *, first: bool) -> bytes:
    """Encode 32 points; `eighths` of a degree by which each precedes its even place."""
    data = _start(angle_deg, first=first)
    for at in range(0, 32, 2):
        for k in (at, at + 1):
            data += (range_mm[k] << 2 | (eighths[k] >> 4) & 3).to_bytes(2, "little")
        data.append((eighths[at] & 15) | (eighths[at + 1] & 15) << 4)
    return summed(data)


def ultra(angle_deg: float, range_mm: Sequence[int], *, first: bool) -> bytes:
    """Encode 96 points of 97 ranges, the last of which is the next capsule's first."""
    data = _start(angle_deg, first=first)
    for at in range(0, 96, 3):
        major, base, bits = _scaled(range_mm[at])
        _, next_base, next_bits = _scaled(range_mm[at + 3])
        if not base and next_base:
            base, bits = next_base, next_bits
        word = major | _predicted(range_mm[at + 1], base, bits) << 12
        data += (word | _predicted(range_mm[at + 2], next_base, next_bits) << 22).to_bytes(4, "little")
    return summed(data)


def dense(angle_deg: float, range_mm: Sequence[int], *, first: bool) -> bytes:
    """Encode 40 points at even angles."""
    return summed(_start(angle_deg, first=first) + struct.pack("<40H", *range_mm))


def ultra_dense(angle_deg: float, range_mm: Sequence[int], *, first: bool) -> bytes:
    """Encode 64 points at even angles, with the quality 40; time and state are 0."""
    data = bytearray(6) + _start(angle_deg, first=first)
    for at in range(0, 64, 2):
        low = _with_quality(range_mm[at])
        high = _with_quality(range_mm[at + 1])
        data += struct.pack("<HHB", low & 0xFFFF, high & 0xFFFF, low >> 16 | high >> 16 << 4)
    return summed(data)


def summed(data: bytearray) -> bytes:
    """Prepend the checksum of a capsule in two halves."""
    total = 0
    for byte in data:
        total ^= byte
    return bytes([0xA0 | total & 15, 0x50 | total >> 4]) + bytes(data)


def _start(angle_deg: float, *, first: bool) -> bytearray:
    return bytearray((math.floor(angle_deg * 64) % 23_040 | (0x8000 if first else 0)).to_bytes(2, "little"))


def _scaled(range_mm: int) -> tuple[int, int, int]:
    """Return count, range of that count [mm] and bits of a count."""
    first, first_mm, bits = next(part for part in _PARTS if range_mm >= part[1])
    count = min(first + (range_mm - first_mm >> bits), 4095)
    return count, first_mm + (count - first << bits), bits


def _with_quality(range_mm: int) -> int:
    """Return 20 bits: the part of the scale, the range in it, and the quality."""
    part = sum(range_mm > first_mm for first_mm, _ in _DENSE_PARTS[1:])
    first_mm, step_mm = _DENSE_PARTS[part]
    return part | round((range_mm - first_mm) / step_mm) << 2 | (40 >> part if range_mm else 0) << 12 + part


def _predicted(range_mm: int, base_mm: int, bits: int) -> int:
    step = round((range_mm - base_mm) / (1 << bits))
    return step & 0x3FF if range_mm and abs(step) <= _LAST_PREDICTED else _NONE
