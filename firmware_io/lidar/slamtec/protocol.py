"""Protocol of Slamtec lidars as pure functions of bytes. Numbers are little-endian, angles grow clockwise.

A request is A5 and a command, with a payload also its length and the xor of all bytes. A reply begins with a
descriptor: A5 5A, length (30 bits) and mode (2 bits), type. A stream has one descriptor, then nodes of 5 bytes,
capsules of 84, ultra capsules of 132 or ultra-dense capsules of 170. Invalid bytes raise ProtocolError.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from operator import xor
from typing import Final

import numpy as np
from jaxtyping import Float64, Int64
from numpy import ndarray

from scanwright.design.arrays import Float32s
from scanwright.design.errors import ProtocolError

STOP: Final = 0x25
SCAN: Final = 0x20
INFO: Final = 0x50
HEALTH: Final = 0x52
SAMPLE_TIMES: Final = 0x59
EXPRESS_SCAN: Final = 0x82
GET_CONF: Final = 0x84
MOTOR_PWM: Final = 0xF0
MOTOR_RPM: Final = 0xA8

NODES: Final = 0x81
CAPSULES: Final = 0x82
ULTRA: Final = 0x84
DENSE: Final = 0x85
ULTRA_DENSE: Final = 0x86

CONF_SAMPLE_US: Final = 0x71
CONF_ANSWER: Final = 0x75
CONF_TYPICAL: Final = 0x7C

_MARK = b"\xa5\x5a"
_DESCRIPTOR_SIZE = 7  # rplidar_sdk 2.1
_LONGEST_REPLY = 512  # beyond it a descriptor is damage
_CAPSULE_SIZE, _ULTRA_SIZE, _ULTRA_DENSE_SIZE = 84, 132, 170
_NODE_SIZE = 5  # rplidar_sdk 2.1
SIZES: Final = {
    NODES: _NODE_SIZE,
    CAPSULES: _CAPSULE_SIZE,
    ULTRA: _ULTRA_SIZE,
    DENSE: _CAPSULE_SIZE,
    ULTRA_DENSE: _ULTRA_DENSE_SIZE,
}
POINTS: Final = {NODES: 1, CAPSULES: 32, ULTRA: 96, DENSE: 40, ULTRA_DENSE: 64}
_SCALE_COUNT = np.array([0, 512, 1280, 1792, 3328])  # of an ultra capsule: start of each part of its scale,
_SCALE_MM = np.array([0, 512, 2048, 4096, 16_384])  # and its range, in steps of 1, 2, 4, 8 and 16 mm
_NO_RETURN = (-512, 511)  # of a predicted range
_DENSE_SCALE_MM = np.array([0, 2046, 8187, 24_567])  # of an ultra-dense capsule: start of steps of 2, 3, 4 and 5 mm
_CABINS = np.dtype([("distance", "<u2", 2), ("offsets", "u1")])


@dataclass(frozen=True, slots=True)
class Descriptor:
    """Header of a reply or stream."""

    size: int  # bytes of the reply or of each packet
    stream: bool  # whether packets follow without end
    kind: int  # type


@dataclass(frozen=True, slots=True)
class Info:
    """Identity of a sensor."""

    model: int  # upper four bits: the series
    firmware: str
    serial_number: str


@dataclass(frozen=True, slots=True, eq=False)
class SlamtecPacket:
    """One packet of a stream."""

    start_deg: float  # clockwise from the front
    first: bool  # whether it begins the stream, or of a node, a turn
    range_m: Float32s  # shape (n,), NaN without a return
    quality: Float32s  # shape (n,), 0 in capsules without it
    offset_deg: Float64[ndarray, " n"]  # of each point before its even place between two starts, shape (n,)
    words: Int64[ndarray, " cabins"] | None = None  # of an ultra capsule, shape (32,); None for the others

    def before(self, after: SlamtecPacket) -> SlamtecPacket:
        """Return this packet completed by the next one, to which an ultra capsule's last range refers."""
        if self.words is None or after.words is None:
            return self
        return _ultra(self.start_deg, self.words, int(after.words[0]), first=self.first)


def request(command: int, payload: bytes = b"") -> bytes:
    """Encode a command, with payload and checksum if it has a payload."""
    head = bytes([0xA5, command])
    if not command & 0x80:
        return head
    body = head + bytes([len(payload)]) + payload
    return body + bytes([reduce(xor, body)])


def descriptor(data: bytes) -> Descriptor:
    """Decode the 7 bytes before a reply."""
    if len(data) != _DESCRIPTOR_SIZE or data[:2] != _MARK:
        raise ProtocolError(f"RPLIDAR: {data.hex(' ')}: not a descriptor")
    word, kind = struct.unpack_from("<IB", data, 2)
    return Descriptor(word & 0x3FFF_FFFF, bool(word >> 30 & 1), kind)


def info(data: bytes) -> Info:
    """Decode the reply to INFO."""
    if len(data) != 20:
        raise ProtocolError(f"RPLIDAR: {len(data)} bytes of device information, not 20")
    return Info(data[0], f"{data[2]}.{data[1]:02d}", data[4:].hex().upper())


def health(data: bytes) -> tuple[int, int]:
    """Decode the reply to HEALTH: 0 good, 1 warning, 2 fault; and its code."""
    if len(data) != 3 or data[0] > 2:
        raise ProtocolError(f"RPLIDAR: {data.hex(' ')}: not a health state")
    return data[0], data[1] | data[2] << 8


def sample_times(data: bytes) -> tuple[int, int]:
    """Decode the reply to SAMPLE_TIMES: time between two points of a standard and an express scan [us]."""
    if len(data) != 4:
        raise ProtocolError(f"RPLIDAR: {len(data)} bytes of sample times, not 4")
    return struct.unpack("<HH", data)


def node(data: bytes) -> SlamtecPacket:
    """Decode a node: one point with its angle."""
    if len(data) != _NODE_SIZE or (data[0] ^ data[0] >> 1) & 1 == 0 or not data[1] & 1:
        raise ProtocolError(f"RPLIDAR: {data.hex(' ')}: not a node")
    angle, distance = struct.unpack_from("<HH", data, 1)
    if angle >> 1 > 360 * 64 + 64:
        raise ProtocolError(f"RPLIDAR: a node at {(angle >> 1) / 64:.1f} deg")
    return SlamtecPacket(
        start_deg=(angle >> 1) / 64 % 360,
        first=bool(data[0] & 1),
        range_m=_ranges_m(np.array([distance / 4])),
        quality=np.array([data[0] >> 2], np.float32),
        offset_deg=np.zeros(1),
    )


def capsule(data: bytes) -> SlamtecPacket:
    """Decode an express capsule: 32 points between its start and the next one's."""
    start_deg, first = _capsule_start(data, _CAPSULE_SIZE)
    cabins = np.frombuffer(data, _CABINS, 16, 4)
    distance = cabins["distance"].astype(np.int64)
    low = np.stack([cabins["offsets"] & 0xF, cabins["offsets"] >> 4], axis=1).astype(np.int64)
    offset = low | (distance & 3) << 4
    offset -= (offset & 0x20) << 1  # six bits with a sign, eighths of a degree
    return SlamtecPacket(
        start_deg, first, _ranges_m((distance >> 2).ravel()), np.zeros(32, np.float32), (offset / 8.0).ravel()
    )


def ultra(data: bytes) -> SlamtecPacket:
    """Decode an ultra capsule: 96 points between its start and the next one's; see `SlamtecPacket.before`."""
    start_deg, first = _capsule_start(data, _ULTRA_SIZE)
    return _ultra(start_deg, np.frombuffer(data, "<u4", 32, 4).astype(np.int64), 0, first=first)


def dense(data: bytes) -> SlamtecPacket:
    """Decode a dense capsule: 40 points, evenly between its start and the next one's."""
    start_deg, first = _capsule_start(data, _CAPSULE_SIZE)
    range_mm = np.frombuffer(data, "<u2", 40, 4)
    return SlamtecPacket(start_deg, first, _ranges_m(range_mm), np.zeros(40, np.float32), np.zeros(40))


def ultra_dense(data: bytes) -> SlamtecPacket:
    """Decode an ultra-dense capsule: 64 points, evenly between its start and the next one's.

    Each has 20 bits: two that select the scale, 10 to 13 of the range and 8 to 5 of the quality. The time and the
    state before the start angle are undocumented, and rplidar_sdk 2.1 ignores them too.
    """
    start_deg, first = _capsule_start(data, _ULTRA_DENSE_SIZE, angle_at=8)
    cabins = np.frombuffer(data, _CABINS, 32, 10)
    high = np.stack([cabins["offsets"] & 0xF, cabins["offsets"] >> 4], axis=1).astype(np.int64)
    word = (cabins["distance"] | high << 16).ravel()
    scale = word & 3
    range_mm = (word >> 2 & (1 << 10 + scale) - 1) * (2 + scale) + _DENSE_SCALE_MM[scale]
    quality = (word >> 12 + scale << scale).astype(np.float32)
    return SlamtecPacket(start_deg, first, _ranges_m(range_mm), quality, np.zeros(64))


_READ: dict[int, Callable[[bytes], SlamtecPacket]] = {
    NODES: node,
    CAPSULES: capsule,
    ULTRA: ultra,
    DENSE: dense,
    ULTRA_DENSE: ultra_dense,
}


class ReplySplitter:
    """Splitter of the bytes before a stream into replies; skips other bytes."""

    def __init__(self) -> None:
        self.bad = 0  # bytes of a stream are no lost replies
        self.cut_in()

    def cut_in(self) -> None:
        """Expect the middle of a reply next."""
        self._rest = b""

    def feed(self, data: bytes) -> list[tuple[Descriptor, bytes]]:
        """Return the replies that these bytes complete; that of a stream has all bytes after its descriptor."""
        self._rest += data
        packets: list[tuple[Descriptor, bytes]] = []
        while (at := self._rest.find(_MARK)) >= 0 and len(self._rest) >= at + _DESCRIPTOR_SIZE:
            begin = at + _DESCRIPTOR_SIZE
            reply = descriptor(self._rest[at:begin])
            end = len(self._rest) if reply.stream else begin + reply.size
            if reply.size > _LONGEST_REPLY:
                self._rest = self._rest[at + 1 :]
                continue
            if end > len(self._rest):
                break
            packets.append((reply, self._rest[begin:end]))
            self._rest = self._rest[end:]
        if at < 0:
            self._rest = self._rest[-1:]
        return packets


class SlamtecSplitter:
    """Splitter of a byte stream into packets of one type; skips other bytes."""

    def __init__(self, kind: int) -> None:
        self.bad = 0  # packets lost
        self._size, self._read = SIZES[kind], _READ[kind]
        self._rest = b""
        self._passed = 0

    def cut_in(self) -> None:
        """Expect the middle of a packet next, and do not count it as bad."""
        self._rest, self._passed = b"", 1

    def feed(self, data: bytes) -> list[tuple[SlamtecPacket, int]]:
        """Return the packets that these bytes complete, each with the number of bytes skipped before it."""
        self._rest += data
        packets: list[tuple[SlamtecPacket, int]] = []
        at = 0
        while at + self._size <= len(self._rest):
            try:
                packet = self._read(self._rest[at : at + self._size])
                if self._passed and self._size == _NODE_SIZE:  # only three bits are checked: require three more nodes
                    if at + 4 * _NODE_SIZE > len(self._rest):
                        break
                    for following in range(at + _NODE_SIZE, at + 4 * _NODE_SIZE, _NODE_SIZE):
                        self._read(self._rest[following : following + _NODE_SIZE])
            except ProtocolError:
                self.bad += self._passed % self._size == 0
                self._passed += 1
                at += 1
            else:
                packets.append((packet, self._passed))
                self._passed = 0
                at += self._size
        self._rest = self._rest[at:]
        return packets


def _ultra(start_deg: float, words: Int64[ndarray, " cabins"], next_word: int, *, first: bool) -> SlamtecPacket:
    """Decode an ultra capsule: a major range of 12 bits, and two of 10 bits predicted from it and from the next word's.

    The angle is corrected for the parallax of triangulation (rplidar_sdk 2.1, handler_capsules.cpp).
    """
    major = np.append(words, next_word) & 0xFFF
    bits = np.searchsorted(_SCALE_COUNT, major, side="right") - 1
    range_mm = _SCALE_MM[bits] + (major - _SCALE_COUNT[bits] << bits)
    known = np.where((range_mm[:-1] == 0) & (range_mm[1:] > 0), 1, 0) + np.arange(32)
    steps = np.stack([words >> 12 & 0x3FF, words >> 22 & 0x3FF])
    steps -= (steps & 0x200) << 1
    bases = np.stack([known, np.arange(1, 33)])
    predicted_mm = np.where(np.isin(steps, _NO_RETURN), 0, range_mm[bases] + (steps << bits[bases]))
    all_mm = np.stack([range_mm[:-1], *predicted_mm], axis=1).ravel()
    ratio = 98_361 // np.maximum(4 * all_mm, 1)
    offset_deg = np.where(all_mm >= 50, 8.0 - np.degrees((64 * ratio + ratio**3 / 98_304) / 65_536), 7.5)
    return SlamtecPacket(start_deg, first, _ranges_m(all_mm), np.zeros(96, np.float32), offset_deg, words)


def _capsule_start(data: bytes, size: int, angle_at: int = 2) -> tuple[float, bool]:
    if len(data) != size or data[0] >> 4 != 0xA or data[1] >> 4 != 0x5:
        raise ProtocolError(f"RPLIDAR: {len(data)} bytes that begin with {data[:2].hex()}: not a capsule")
    if reduce(xor, data[2:]) != (data[0] & 0xF | (data[1] & 0xF) << 4):
        raise ProtocolError("RPLIDAR: the checksum of a capsule is wrong")
    word = int.from_bytes(data[angle_at : angle_at + 2], "little")
    if word & 0x7FFF > 360 * 64 + 64:
        raise ProtocolError(f"RPLIDAR: a capsule at {(word & 0x7FFF) / 64:.1f} deg")
    return (word & 0x7FFF) / 64 % 360, bool(word & 0x8000)


def _ranges_m(range_mm: ndarray) -> Float32s:
    return np.where(range_mm > 0, range_mm / 1e3, np.nan).astype(np.float32)
