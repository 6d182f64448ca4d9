"""Emulator of LD06, LD19 and STL27L.

Written from the maker's description of the packet; undocumented values are marked [assumed].
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np

from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import DeviceError, suggest
from scanwright.firmware_io.emulators.lidar_line import LidarLine, Ranging
from scanwright.firmware_io.emulators.world import spun_up, turned_deg

BAUDS = {"LD06": 230_400, "LD19": 230_400, "STL-19P": 230_400, "STL27L": 921_600}  # data sheets of LDROBOT
_POINTS = 12  # LD19 development manual
_BYTES = 47  # LD19 development manual
_BACKLOG = 1 << 10  # bytes [assumed]: some packets
_CHUNK_NS = 8_000_000  # measured together: one ray costs as much as a hundred
_BOOT_NS = 1_000_000_000  # [assumed]


def checksum(data: bytes) -> int:
    """Return the remainder of the bytes, as a binary polynomial, by x^8 + x^6 + x^3 + x^2 + 1."""
    rest = int.from_bytes(data, "big") << 8
    for bit in range(rest.bit_length() - 1, 7, -1):
        if rest >> bit & 1:
            rest ^= 0x14D << (bit - 8)
    return rest


def write_packet(speed_deg_s: float, start_deg: float, end_deg: float, stamp_ms: int, points: list[list[int]]) -> bytes:
    """Encode a packet; each point is a range [mm] and an intensity."""
    data = bytearray([0x54, 0x2C])
    for number in (round(speed_deg_s), round(start_deg * 100) % 36_000):
        data += number.to_bytes(2, "little")
    for range_mm, intensity in points:
        data += range_mm.to_bytes(2, "little") + bytes([intensity])
    for number in (round(end_deg * 100) % 36_000, stamp_ms % 30_000):
        data += number.to_bytes(2, "little")
    return bytes(data) + bytes([checksum(bytes(data))])


@dataclass
class LdrobotMachine:
    """The state of one sensor; times are true ones."""

    lidar: Lidar  # of the catalogue
    ranging: Ranging  # its surroundings
    began_ns: int  # when its clock was 0
    baud: int  # of its line
    rate_error: float = 0.0  # of its clock, 5e-5 is 50 ppm fast
    first_ms: int = 0  # first clock value

    def __post_init__(self) -> None:
        self._packet = 0
        self._from_rest = False

    @property
    def scanning(self) -> object:
        """Constant: it always scans."""
        return True

    @property
    def point_ns(self) -> float:
        """True time between two points, defined by its clock."""
        return 1e9 / (self.lidar.steps_per_turn * self.lidar.scan_rate_hz) / (1 + self.rate_error)

    def receive(self, _received: bytes, _now_ns: int) -> tuple[bytes, bytes]:
        """Ignore requests."""
        return b"", b""

    def next_ns(self) -> int:
        """Return the end of the next packets."""
        return self.began_ns + round((self._packet + self._together) * _POINTS * self.point_ns)

    def next_packets(self) -> list[tuple[int, bytes]]:
        """Measure the packets of the next milliseconds."""
        number = _POINTS * self._packet + np.arange(_POINTS * self._together)
        since_ns = number * self.point_ns
        turning_s, share = spun_up(since_ns / 1e9) if self._from_rest else (since_ns / 1e9, np.ones(since_ns.size))
        angle_deg, speed_deg_s = turned_deg(self.lidar.scan_rate_hz, turning_s)
        time_ns = self.began_ns + np.rint(since_ns).astype(np.int64)
        range_m, intensity = self.ranging(time_ns, -np.radians(angle_deg % 360))  # clockwise
        measured = np.isfinite(range_m) & (range_m > 0) & (range_m < 65.0)
        range_mm = np.where(measured, np.rint(np.where(measured, range_m, 0) * 1e3), 0).astype(int)
        level = np.where(measured, np.clip(np.nan_to_num(intensity) / 16, 1, 255), 0).astype(int)
        packets = []
        for first in range(0, number.size, _POINTS):
            last = first + _POINTS - 1
            stamp_ms = self.first_ms + math.floor(since_ns[last] * (1 + self.rate_error) / 1e6)
            points = np.stack([range_mm, level], axis=1)[first : last + 1].tolist()
            data = write_packet(share[first] * speed_deg_s[first], angle_deg[first], angle_deg[last], stamp_ms, points)
            packets.append((int(time_ns[last]) + round(_BYTES * 10 / self.baud * 1e9), data))
        self._packet += self._together
        return packets

    def skip_to(self, before_ns: int) -> None:
        """Skip the packets before a time."""
        behind = (before_ns - self.next_ns()) / (_POINTS * self.point_ns)
        self._packet += max(math.floor(behind), 0)

    def power_cycle(self, now_ns: int) -> None:
        """Restart: no packets while it starts, clock at 0, motor at rest."""
        self._from_rest = True
        self.began_ns, self.first_ms, self._packet = now_ns + _BOOT_NS, 0, 0

    @property
    def _together(self) -> int:
        return max(round(_CHUNK_NS / (_POINTS * self.point_ns)), 1)


def ldrobot_emulator(
    lidar: Lidar, ranging: Ranging, seed: int = 0, *, rate_error: float = 0.0, first_ms: int = 0
) -> LidarLine[LdrobotMachine]:
    """Return the emulator of a catalogue sensor; `rate_error` and `first_ms` are of its clock."""
    if lidar.name not in BAUDS:
        raise DeviceError(f"no LDROBOT emulator of the lidar '{lidar.name}'{suggest(lidar.name, BAUDS)}")
    machine = LdrobotMachine(lidar, ranging, time.monotonic_ns(), BAUDS[lidar.name], rate_error, first_ms)
    return LidarLine(lidar.name, machine, head=6, backlog=_BACKLOG, network=False, seed=seed)
