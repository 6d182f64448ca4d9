"""An LMS 200 or LMS 291 in software. Written from documents; what nobody found described is marked [assumed]."""

from __future__ import annotations

import math
import struct
import time
from dataclasses import dataclass

import numpy as np

from scanwright.design.catalogue.lidar import Lidar
from scanwright.firmware_io.emulators.lidar_line import LidarLine, Ranging

_NEVER_NS = 1 << 62  # 146 years
_BOOT_NS = 1_000_000_000  # [assumed]; a real one takes up to a minute until its motor is steady
_TURN_NS = 1e9 / 75  # of its mirror
_MODES = (0x24, 0x25, 0x40, 0x41, 0x42, 0x48)  # of the command 0x20 that it knows
_BAUDS = {0x40: 38_400, 0x41: 19_200, 0x42: 9600, 0x48: 500_000}  # by mode
_HEAD = 8  # bytes of a telegram before its ranges
_NO_RANGE = 0x1FFF  # code: too far


def remainder(data: bytes) -> int:
    """The sum of a telegram: a shift register by x^16 + x^15 + x^2 + 1, to which pairs of bytes are added."""
    register = 0
    for low, high in zip(data, b"\0" + data[:-1], strict=True):
        register <<= 1
        if register >> 16:
            register ^= 0x18005
        register ^= high << 8 | low
    return register


def write_telegram(payload: bytes, address: int = 0x80) -> bytes:
    """A telegram around its command and values."""
    data = bytes([2, address]) + len(payload).to_bytes(2, "little") + payload
    return data + remainder(data).to_bytes(2, "little")


@dataclass
class LmsMachine:
    """The state of one sensor; times are true ones.

    Attributes:
        lidar: of the catalogue.
        ranging: what it sees.
        began_ns: when it got its power.
        millimetres: whether it tells ranges in them, up to 8 m, and not in centimetres.
        status: that its answers end with.
        rate_error: its motor turns this part too fast.
    """

    lidar: Lidar
    ranging: Ranging
    began_ns: int
    millimetres: bool = True
    status: int = 0x10  # [assumed] bits without a meaning to us
    rate_error: float = 1e-3

    def __post_init__(self) -> None:
        self.scanning: object | None = None
        self.baud = 9600
        self._step_centideg = 100
        self._number = 0

    @property
    def turns(self) -> int:
        """Of the mirror, for one telegram."""
        return max(round(100 / self._step_centideg), 1)

    @property
    def period_ns(self) -> float:
        """From telegram to telegram."""
        return self.turns * _TURN_NS / (1 + self.rate_error)

    def hear(self, received: bytes, now_ns: int, /) -> tuple[bytes, bytes]:
        """Answers to whole requests; a sum that is wrong gets a 15."""
        answers = b""
        while (at := received.find(b"\x02\x00")) >= 0 and len(received) >= at + 4:
            size = 6 + int.from_bytes(received[at + 2 : at + 4], "little")
            if size > 64:
                received = received[at + 1 :]
                continue
            if len(received) < at + size:
                return answers, received[at:]
            one, received = received[at : at + size], received[at + size :]
            if now_ns < self.began_ns:
                continue
            if int.from_bytes(one[-2:], "little") != remainder(one[:-2]):
                answers += b"\x15"
                continue
            answer = self._answer(one[4:-2], now_ns)
            answers += b"\x06" + write_telegram(answer + bytes([self.status])) if answer else b"\x15"
        return answers, received[at:] if at >= 0 else received[-1:]

    def next_ns(self) -> int:
        """When the last beam of the next telegram is measured."""
        if self.scanning is None:
            return _NEVER_NS
        return self.began_ns + round((self._number + 1) * self.period_ns - _TURN_NS / 2)

    def next_packets(self) -> list[tuple[int, bytes]]:
        """The telegram of the next turns: beams between the degrees are measured in the turns after the first."""
        bearing_rad = np.radians(np.arange(0, 18_001, self._step_centideg) / 100 - 90)
        turn = np.arange(bearing_rad.size) % self.turns
        since_ns = (turn + (bearing_rad + np.pi / 2) / (2 * np.pi)) * _TURN_NS
        time_ns = self.began_ns + np.rint(self._number * self.period_ns + since_ns).astype(np.int64)
        range_m = np.empty(bearing_rad.size)
        order = np.argsort(time_ns, kind="stable")
        range_m[order] = self.ranging(time_ns[order], bearing_rad[order])[0]
        scale = 1e3 if self.millimetres else 1e2
        fits = np.isfinite(range_m) & (range_m > 0) & (range_m * scale < 0x1FF0)
        raw = np.where(fits, np.rint(np.where(fits, range_m, 0) * scale), _NO_RANGE).astype("<u2")
        payload = b"\xb0" + struct.pack("<H", raw.size | (0x4000 if self.millimetres else 0)) + raw.tobytes()
        data = write_telegram(payload + bytes([self.status]))
        sent_ns = self.next_ns() + round(len(data) * 10 / self.baud * 1e9)
        self._number += max(math.ceil(len(data) * 10 / self.baud * 1e9 / self.period_ns), 1)  # the line is taken
        return [(sent_ns, data)]

    def leave_out(self, before_ns: int) -> None:
        """Passes over what should have been measured before."""
        if self.scanning is not None:
            self._number += max(math.floor((before_ns - self.next_ns()) / self.period_ns), 0)

    def power_cycle(self, now_ns: int) -> None:
        """At 9600 baud, silent for as long as it starts; its variant is gone."""
        self.began_ns = now_ns + _BOOT_NS
        self.scanning, self.baud, self._step_centideg = None, 9600, 100

    def _answer(self, request: bytes, now_ns: int) -> bytes:
        match request[0]:
            case 0x20 if len(request) == 2 and request[1] in _MODES:
                if request[1] in _BAUDS:
                    self.baud = _BAUDS[request[1]]
                else:
                    self.scanning = object() if request[1] == 0x24 else None
                    self._number = max(math.ceil((now_ns - self.began_ns) / self.period_ns), 0)
                return b"\xa0\x00"
            case 0x31:
                return b"\xb1" + b"V02.30 " + bytes(20)  # [assumed] what else it holds
            case 0x3A:
                return b"\xba" + self.lidar.name.replace(" ", "").encode() + b";30106;V02.30"
            case 0x3B if len(request) == 5:
                angle_deg, step_centideg = struct.unpack("<HH", request[1:])
                known = angle_deg == 180 and step_centideg in (50, 100)  # a quarter of a degree: within 100 deg only
                if known:
                    self._step_centideg = step_centideg
                return b"\xbb" + struct.pack("<BHH", int(known), angle_deg, step_centideg)
        return b""


def lms_emulator(lidar: Lidar, ranging: Ranging, seed: int = 0) -> LidarLine[LmsMachine]:
    """The emulator of a sensor of the catalogue."""
    machine = LmsMachine(lidar, ranging, time.monotonic_ns())
    return LidarLine(lidar.name, machine, head=_HEAD, network=False, seed=seed)
