"""Emulator of RPLIDARs with a motor of varying speed.

Written from the maker's protocol manual and SDK; undocumented values are marked [assumed].
"""

from __future__ import annotations

import math
import struct
import time
from dataclasses import dataclass
from typing import Final

import numpy as np

from scanwright.design.arrays import Floats, Times
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import DeviceError, suggest
from scanwright.firmware_io.emulators.lidar_line import LidarLine, Ranging
from scanwright.firmware_io.emulators.slamtec import packets
from scanwright.firmware_io.emulators.slamtec.models import (
    DENSE,
    EXPRESS,
    IDENTITIES,
    STANDARD,
    ULTRA,
    ULTRA_DENSE,
    ScanMode,
)
from scanwright.firmware_io.emulators.world import spun_up, turned_deg

_STOP, _RESET, _SCAN, _FORCE_SCAN, _EXPRESS_SCAN = 0x25, 0x40, 0x20, 0x21, 0x82
_INFO, _HEALTH, _SAMPLE_TIMES, _GET_CONF = 0x50, 0x52, 0x59, 0x84
_MOTOR_PWM, _MOTOR_RPM, _BOARD_FLAG = 0xF0, 0xA8, 0xFF

_CHUNK_NS = 8_000_000  # measured together, to save time
_BOOT_NS = 1_000_000_000  # [assumed]
_POINTS_ERROR = 2e-3  # relative, it measures faster than it states [assumed]
_NEVER_NS = 1 << 62  # 146 years
_POINTS: Final = {
    STANDARD: 8,
    EXPRESS: 32,
    ULTRA: 96,
    DENSE: 40,
    ULTRA_DENSE: 64,
}  # of a packet; 8 nodes are sent together
_SIZES: Final = {STANDARD: 5, EXPRESS: 84, ULTRA: 132, DENSE: 84, ULTRA_DENSE: 170}
_MOST_MM: Final = {
    STANDARD: 16_383,
    EXPRESS: 16_383,
    ULTRA: 28_655,
    DENSE: 65_535,
    ULTRA_DENSE: 65_522,
}  # largest range of a packet
_EIGHTHS = np.round(9 * np.sin(np.arange(32) / 3)).astype(int)  # of both signs, as with triangulation
_FAR_OFFSET_DEG = 8.0  # of a triangulated beam, as corrected by the SDK
_OFFSET_WITHIN_DEG = 0.1  # largest difference of two estimates; edges exceed it and have no return


@dataclass
class SlamtecMachine:
    """State of one sensor; times are true ones."""

    lidar: Lidar
    ranging: Ranging
    began_ns: int  # end of its start
    points_error: float = 0.0  # relative, it measures faster than it states
    health: int = 0  # 0 good, 1 a warning, 2 a fault

    def __post_init__(self) -> None:
        self.identity = IDENTITIES[self.lidar.name]
        self.scanning: object | None = None
        self._mode = self.identity.usual
        self._packet = 0
        self._from_ns = self._line_free_ns = 0
        self._first = False
        self._ahead_mm: int | None = None  # the next capsule's first range, to which an ultra capsule refers
        self._started_ns: int | None = None  # of the motor
        self._rest_deg = 0.0

    @property
    def point_ns(self) -> float:
        """True time between two points."""
        return self._mode.point_us * 1e3 / (1 + self.points_error)

    def receive(self, received: bytes, now_ns: int, /) -> tuple[bytes, bytes]:
        """As `Machine.receive`; there is no reply to a wrong checksum."""
        answers = b""
        while (at := received.find(b"\xa5")) >= 0 and len(received) >= at + 2:
            command, received = received[at + 1], received[at:]
            if not command & 0x80:
                answers += self._answer(command, b"", now_ns)
                received = received[2:]
                continue
            if len(received) < 3 or len(received) < 4 + received[2]:
                return answers, received
            body, total = received[: 3 + received[2]], 0
            for byte in body:
                total ^= byte
            if total == received[len(body)]:
                answers += self._answer(command, body[3:], now_ns)
                received = received[len(body) + 1 :]
            else:
                received = received[1:]
        return answers, received if at >= 0 else b""

    def next_ns(self) -> int:
        """Return the end of the next packets."""
        if self.scanning is None:
            return _NEVER_NS
        return self._from_ns + round((self._packet + self._chunk) * self._many * self.point_ns)

    def next_packets(self) -> list[tuple[int, bytes]]:
        """Measure the packets of the next milliseconds, sent no faster than its line."""
        number = self._many * self._packet + np.arange(self._many * self._chunk + 1)
        time_ns = self._from_ns + np.rint(number * self.point_ns).astype(np.int64)
        angle_deg = self._turned_deg(time_ns)
        sent, byte_ns = [], 10e9 / self.identity.baud
        writers = {STANDARD: self._nodes, EXPRESS: self._capsule, ULTRA: self._ultra}
        write = writers.get(self._mode.kind, self._dense)
        for first in range(0, self._many * self._chunk, self._many):
            of = slice(first, first + self._many + 1)
            data = write(angle_deg[of], time_ns[of])
            sending_ns, waits_ns = (round(size * byte_ns) for size in (len(data), _SIZES[self._mode.kind]))
            self._line_free_ns = max(self._line_free_ns + sending_ns, int(time_ns[of][-2]) + waits_ns)
            sent.append((self._line_free_ns, data))
        self._packet += self._chunk
        return sent

    def skip_to(self, before_ns: int) -> None:
        """Skip the packets before a time."""
        if self.scanning is not None:
            behind = math.floor((before_ns - self.next_ns()) / (self._many * self.point_ns))
            if behind > 0:
                self._packet += behind
                self._ahead_mm = None

    def power_cycle(self, now_ns: int) -> None:
        """Restart, without replies meanwhile."""
        self._turn_motor(now_ns, on=False)
        self.began_ns, self.scanning = now_ns + _BOOT_NS, None

    @property
    def _many(self) -> int:
        return _POINTS[self._mode.kind]

    @property
    def _chunk(self) -> int:
        return max(round(_CHUNK_NS / (self._many * self.point_ns)), 1)

    def _answer(self, command: int, payload: bytes, now_ns: int) -> bytes:
        if now_ns < self.began_ns:
            return b""
        if command in (_STOP, _RESET):
            self.scanning = None
            if self.identity.motor == "scan":
                self._turn_motor(now_ns, on=False)
            return b""
        if command == (_MOTOR_PWM if self.identity.motor == "pwm" else _MOTOR_RPM) and len(payload) >= 2:
            self._turn_motor(now_ns, on=payload[:2] != b"\0\0")
            return b""
        mode = self._mode_of(command, payload)
        return self._information(command, payload) if mode is None else self._begin(mode, now_ns)

    def _information(self, command: int, payload: bytes) -> bytes:
        identity = self.identity
        if command == _INFO:
            major, minor = identity.firmware
            return packets.reply(0x04, bytes([identity.model, minor, major, 7]) + bytes(range(16)))
        if command == _HEALTH:
            return packets.reply(0x06, struct.pack("<BH", self.health, 0x8002 if self.health else 0))
        if command == _SAMPLE_TIMES:
            standard = identity.modes[0] if identity.modes else identity.legacy
            return packets.reply(0x15, struct.pack("<HH", round(standard.point_us), round(identity.legacy.point_us)))
        if command == _BOARD_FLAG and identity.motor != "rpm":
            return packets.reply(0xFF, struct.pack("<I", identity.motor == "pwm"))
        if command == _GET_CONF and (values := identity.configuration(payload)) is not None:
            return packets.reply(0x20, values)
        return b""

    def _mode_of(self, command: int, payload: bytes) -> ScanMode | None:
        """Return the scan mode that a request starts; None for another request, or an unsupported mode."""
        identity = self.identity
        if command in (_SCAN, _FORCE_SCAN):
            return identity.modes[0] if identity.modes else ScanMode("", STANDARD, 2 * identity.legacy.point_us, 0.0)
        if command != _EXPRESS_SCAN or not payload:
            return None
        if payload[0] == 0:
            return identity.legacy
        return identity.modes[payload[0]] if payload[0] < len(identity.modes) else None

    def _begin(self, mode: ScanMode, now_ns: int) -> bytes:
        """Start to scan, unless it has a fault; return the descriptor of the stream."""
        if self.health == 2:
            return b""
        if self.identity.motor != "pwm":
            self._turn_motor(now_ns, on=True)
        self.scanning, self._mode, self._ahead_mm = object(), mode, None
        self._from_ns, self._packet, self._first = now_ns, 0, True
        return packets.stream_begins(mode.kind, _SIZES[mode.kind])

    def _turn_motor(self, now_ns: int, *, on: bool) -> None:
        if on == (self._started_ns is None):
            self._rest_deg = float(self._turned_deg(np.array([now_ns]))[0])
            self._started_ns = now_ns if on else None

    def _turned_deg(self, time_ns: Times) -> Floats:
        """Return the angle of the motor, which approaches its speed exponentially."""
        if self._started_ns is None:
            return np.full(time_ns.size, self._rest_deg)
        since_s = np.maximum((time_ns - self._started_ns) / 1e9, 0.0)
        return self._rest_deg + turned_deg(self.lidar.scan_rate_hz, spun_up(since_s)[0])[0]

    def _seen_mm(self, time_ns: Times, angle_deg: Floats) -> Times:
        """Return ranges in integer millimetres, 0 without a return."""
        range_mm = self.ranging(time_ns, -np.radians(angle_deg % 360))[0] * 1e3
        measured = np.isfinite(range_mm) & (range_mm > 0) & (range_mm <= _MOST_MM[self._mode.kind])
        return np.rint(np.where(measured, range_mm, 0.0)).astype(np.int64)

    def _nodes(self, angle_deg: Floats, time_ns: Times) -> bytes:
        at_deg = angle_deg[:-1]
        turn = np.floor(np.concatenate([[2 * angle_deg[0] - angle_deg[1]], at_deg]) / 360)
        seen = zip(at_deg.tolist(), self._seen_mm(time_ns[:-1], at_deg).tolist(), np.diff(turn) > 0, strict=True)
        return b"".join(packets.node(deg, mm, first=bool(first)) for deg, mm, first in seen)

    def _capsule(self, angle_deg: Floats, time_ns: Times) -> bytes:
        even_deg = np.linspace(angle_deg[0], angle_deg[-1], 32, endpoint=False)
        seen = self._seen_mm(time_ns[:-1], even_deg - _EIGHTHS / 8)
        return packets.capsule(angle_deg[0], seen.tolist(), _EIGHTHS.tolist(), first=self._begins())

    def _ultra(self, angle_deg: Floats, time_ns: Times) -> bytes:
        even_deg = np.linspace(angle_deg[0], angle_deg[-1], 97)
        about_deg = triangulation_offset_deg(self._seen_mm(time_ns, even_deg - _FAR_OFFSET_DEG))
        seen = self._seen_mm(time_ns, even_deg - about_deg)
        seen[np.abs(triangulation_offset_deg(seen) - about_deg) > _OFFSET_WITHIN_DEG] = 0
        if self._ahead_mm is not None:
            seen[0] = self._ahead_mm
        self._ahead_mm = int(seen[-1])
        return packets.ultra(angle_deg[0], seen.tolist(), first=self._begins())

    def _dense(self, angle_deg: Floats, time_ns: Times) -> bytes:
        seen = self._seen_mm(time_ns[:-1], np.linspace(angle_deg[0], angle_deg[-1], self._many, endpoint=False))
        encode = packets.dense if self._mode.kind == DENSE else packets.ultra_dense
        return encode(angle_deg[0], seen.tolist(), first=self._begins())

    def _begins(self) -> bool:
        first, self._first = self._first, False
        return first


def triangulation_offset_deg(range_mm: Times) -> Floats:
    """Return the angle by which beams of an ultra capsule precede their even places, as corrected by rplidar_sdk."""
    ratio = 98_361 // np.maximum(4 * range_mm, 1)
    return np.where(range_mm >= 50, _FAR_OFFSET_DEG - np.degrees((64 * ratio + ratio**3 / 98_304) / 65_536), 7.5)


def slamtec_emulator(lidar: Lidar, ranging: Ranging, seed: int = 0) -> LidarLine[SlamtecMachine]:
    """Return the emulator of a catalogue sensor, or raise DeviceError."""
    if lidar.name not in IDENTITIES:
        raise DeviceError(f"no RPLIDAR emulator of the lidar '{lidar.name}'{suggest(lidar.name, IDENTITIES)}")
    machine = SlamtecMachine(lidar, ranging, time.monotonic_ns(), _POINTS_ERROR)
    return LidarLine(lidar.name, machine, backlog=1 << 12, network=False, seed=seed)
