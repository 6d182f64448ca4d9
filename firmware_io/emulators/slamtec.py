"""RPLIDARs in software: requests in, descriptors and streams out, from a motor that wanders.

Written from the maker's protocol; what nobody found described is marked [assumed].
"""

from __future__ import annotations

import math
import struct
import time
from dataclasses import dataclass

import numpy as np

from scanwright.design.arrays import Floats, Times
from scanwright.design.catalogue.products import Lidar
from scanwright.design.errors import DeviceError, suggest
from scanwright.firmware_io.emulators.lidar_line import LidarLine, Ranging
from scanwright.firmware_io.emulators.world import turned_deg

_FIRMWARE = (1, 29)
_CHUNK_NS = 8_000_000
_BOOT_NS = 1_000_000_000  # [assumed]
_NEVER_NS = 1 << 62
_STANDARD, _EXPRESS, _DENSE = 0x81, 0x82, 0x85


@dataclass(frozen=True, slots=True)
class SlamtecIdentity:
    """What tells one model from another: the byte of INFO, its line, its typical stream, points in a second.

    `modes` tells whether it knows its modes (GET_CONF); older firmware stays silent.
    """

    model: int
    baud: int
    stream: int
    points_s: int
    modes: bool = True


IDENTITIES = {
    "RPLIDAR A1": SlamtecIdentity(0x18, 115_200, _EXPRESS, 8000, modes=False),
    "RPLIDAR A2": SlamtecIdentity(0x2C, 256_000, _EXPRESS, 16_000),
    "RPLIDAR A3": SlamtecIdentity(0x31, 256_000, _DENSE, 16_000),  # ultra capsules, which are typical, are left out
    "RPLIDAR S1": SlamtecIdentity(0x61, 256_000, _EXPRESS, 9200),
    "RPLIDAR S2": SlamtecIdentity(0x71, 1_000_000, _DENSE, 32_000),
    "RPLIDAR C1": SlamtecIdentity(0x41, 460_800, _STANDARD, 5000),  # 4 for its series is assumed
}
_TOGETHER = {_STANDARD: 8, _EXPRESS: 32, _DENSE: 40}  # points in a packet; nodes are written some at a time


@dataclass
class SlamtecMachine:
    """The state of one sensor; times are true ones.

    Attributes:
        lidar: of the catalogue.
        ranging: what it sees.
        began_ns: when it got its power.
        points_error: it measures this part faster than it says.
        health: 0 good, 1 a warning, 2 a fault.
    """

    lidar: Lidar
    ranging: Ranging
    began_ns: int
    points_error: float = 0.0
    health: int = 0

    def __post_init__(self) -> None:
        self.identity = IDENTITIES[self.lidar.name]
        self.scanning: object | None = None
        self._packet = 0
        self._from_ns = 0
        self._first = False

    @property
    def point_ns(self) -> float:
        """True time between two points."""
        return 1e9 / self.identity.points_s / (1 + self.points_error)

    def hear(self, received: bytes, now_ns: int, /) -> tuple[bytes, bytes]:
        """Answers to whole requests; a sum that is wrong, or what is none, is not answered."""
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
        """When the packets that it measures next are over."""
        if self.scanning is None:
            return _NEVER_NS
        return self._from_ns + round((self._packet + self._chunk) * self._many * self.point_ns)

    def next_packets(self) -> list[tuple[int, bytes]]:
        """Packets of the next milliseconds."""
        number = self._many * self._packet + np.arange(self._many * self._chunk + 1)
        time_ns = self._from_ns + np.rint(number * self.point_ns).astype(np.int64)
        angle_deg = turned_deg(self.lidar.scan_rate_hz, (time_ns - self.began_ns) / 1e9)[0]
        packets = []
        write = {_STANDARD: self._nodes, _EXPRESS: self._capsule, _DENSE: self._dense}[self.identity.stream]
        for first in range(0, self._many * self._chunk, self._many):
            of = slice(first, first + self._many)
            data = write(angle_deg[first : first + self._many + 1], time_ns[of])
            alone = 5 if self.identity.stream == _STANDARD else len(data)  # a node goes as soon as it is measured
            packets.append((int(time_ns[of][-1]) + round(alone * 10 / self.identity.baud * 1e9), data))
        self._packet += self._chunk
        return packets

    def leave_out(self, before_ns: int) -> None:
        """Passes over what should have been measured before."""
        if self.scanning is not None:
            behind = (before_ns - self.next_ns()) / (self._many * self.point_ns)
            self._packet += max(math.floor(behind), 0)

    def power_cycle(self, now_ns: int) -> None:
        """It stands, silent for as long as it starts."""
        self.began_ns, self.scanning = now_ns + _BOOT_NS, None

    @property
    def _many(self) -> int:
        return _TOGETHER[self.identity.stream]

    @property
    def _chunk(self) -> int:
        return max(round(_CHUNK_NS / (self._many * self.point_ns)), 1)

    def _answer(self, command: int, payload: bytes, now_ns: int) -> bytes:
        if now_ns < self.began_ns:
            return b""
        if command in (0x25, 0x40):
            self.scanning = None
            return b""
        if command == 0x50:
            minor, major = _FIRMWARE[1], _FIRMWARE[0]
            return reply(0x04, bytes([self.identity.model, minor, major, 7]) + bytes(range(16)))
        if command == 0x52:
            return reply(0x06, bytes([self.health]) + (0x8002 if self.health else 0).to_bytes(2, "little"))
        if command == 0x59:
            microseconds = round(1e6 / self.identity.points_s)
            return reply(0x15, struct.pack("<HH", 500, microseconds))
        if command == 0x84 and self.identity.modes:
            return self._configuration(payload)
        if command in (0x20, 0x82) and (command == 0x20) == (self.identity.stream == _STANDARD) and self.health < 2:
            self.scanning, self._from_ns, self._packet, self._first = object(), now_ns, 0, True
            size = 5 if self.identity.stream == _STANDARD else 84
            return stream_begins(self.identity.stream, size)
        return b""

    def _configuration(self, payload: bytes) -> bytes:
        key = int.from_bytes(payload[:4], "little")
        values = {
            0x70: struct.pack("<H", 1),
            0x71: struct.pack("<I", round(256e6 / self.identity.points_s)),
            0x75: bytes([self.identity.stream]),
            0x7C: struct.pack("<H", 0),
        }
        return reply(0x20, payload[:4] + values[key]) if key in values else b""

    def _seen_mm(self, time_ns: Times, angle_deg: Floats, most: int) -> Floats:
        range_m = self.ranging(time_ns, -np.radians(angle_deg % 360))[0]
        measured = np.isfinite(range_m) & (range_m > 0) & (range_m * 1e3 <= most)
        return np.where(measured, np.where(measured, range_m, 0.0) * 1e3, 0.0)

    def _nodes(self, angle_deg: Floats, time_ns: Times) -> bytes:
        at_deg = angle_deg[:-1]
        data = b""
        before = at_deg[0] - (at_deg[1] - at_deg[0])
        for deg, mm in zip(at_deg, self._seen_mm(time_ns, at_deg, 16_383), strict=True):
            first = math.floor(deg / 360) > math.floor(before / 360)
            before = deg
            quality = 47 if mm else 0
            data += struct.pack(
                "<BHH",
                quality << 2 | (1 if first else 2),
                (math.floor(deg * 64) % 23_040) << 1 | 1,
                round(mm * 4),
            )
        return data

    def _capsule(self, angle_deg: Floats, time_ns: Times) -> bytes:
        eighths = np.round(9 * np.sin(np.arange(32) / 3)).astype(int)  # as triangulation has them, of both signs
        even_deg = angle_deg[0] + (angle_deg[-1] - angle_deg[0]) * np.arange(32) / 32
        seen = np.rint(self._seen_mm(time_ns, even_deg - eighths / 8, 16_383)).astype(int).tolist()
        data = self._start(angle_deg[0])
        for one in range(0, 32, 2):
            for k in (one, one + 1):
                data += (seen[k] << 2 | (int(eighths[k]) >> 4) & 3).to_bytes(2, "little")
            data.append((int(eighths[one]) & 15) | (int(eighths[one + 1]) & 15) << 4)
        return summed(data)

    def _dense(self, angle_deg: Floats, time_ns: Times) -> bytes:
        even_deg = angle_deg[0] + (angle_deg[-1] - angle_deg[0]) * np.arange(40) / 40
        data = self._start(angle_deg[0])
        for mm in np.rint(self._seen_mm(time_ns, even_deg, 65_535)).astype(int).tolist():
            data += mm.to_bytes(2, "little")
        return summed(data)

    def _start(self, angle_deg: float) -> bytearray:
        word = math.floor(angle_deg * 64) % 23_040 | (0x8000 if self._first else 0)
        self._first = False
        return bytearray(word.to_bytes(2, "little"))


def reply(kind: int, data: bytes) -> bytes:
    """One answer behind its descriptor."""
    return b"\xa5\x5a" + struct.pack("<IB", len(data), kind) + data


def stream_begins(kind: int, size: int) -> bytes:
    """The descriptor of packets without end."""
    return b"\xa5\x5a" + struct.pack("<IB", 1 << 30 | size, kind)


def summed(data: bytearray) -> bytes:
    """A capsule: its sum in two halves before it."""
    total = 0
    for byte in data:
        total ^= byte
    return bytes([0xA0 | total & 15, 0x50 | total >> 4]) + bytes(data)


class SlamtecEmulator(LidarLine):
    """A lidar that answers as an RPLIDAR."""

    machine: SlamtecMachine

    def __init__(
        self, lidar: Lidar, ranging: Ranging, *, points_error: float = 2e-3, jitter_s: float = 0.0, seed: int = 0
    ) -> None:
        """Nothing runs before `with`.

        Args:
            lidar: of the catalogue.
            ranging: what it sees.
            points_error: it measures this part faster than it says.
            jitter_s: packets arrive up to this much late.
            seed: of jitter and faults.

        Raises:
            DeviceError: there is no emulator of this model.
        """
        if lidar.name not in IDENTITIES:
            raise DeviceError(f"no RPLIDAR emulator of the lidar '{lidar.name}'{suggest(lidar.name, IDENTITIES)}")
        machine = SlamtecMachine(lidar, ranging, time.monotonic_ns(), points_error)
        super().__init__(lidar.name, machine, jitter_s=jitter_s, head=0, backlog=1 << 12, network=False, seed=seed)


def slamtec_emulator(lidar: Lidar, ranging: Ranging, seed: int = 0) -> SlamtecEmulator:
    """The emulator of a sensor of the catalogue.

    Raises:
        DeviceError: there is no emulator of this model.
    """
    return SlamtecEmulator(lidar, ranging, seed=seed)
