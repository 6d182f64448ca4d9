"""Emulator of an LMS 200 or LMS 291, written from documents; undocumented values are marked [assumed].

Source of modes, status (31) and configuration (74, 77): SickLMS2xx.cc of sicktoolbox.
"""

from __future__ import annotations

import math
import struct
import time
from dataclasses import dataclass

import numpy as np

from scanwright.design.catalogue.lidar import Lidar
from scanwright.firmware_io.emulators.lidar_line import LidarLine, Ranging

_NEVER_NS = 1 << 62  # 146 years
_BOOT_NS = 1_000_000_000  # [assumed]; a real one needs up to a minute until its motor is at speed
_TURN_NS = 1e9 / 75  # of its mirror
_MODES = (0x24, 0x25, 0x40, 0x41, 0x42, 0x48)  # supported modes of the command 0x20 without a password
_INSTALLATION, _PASSWORD = 0, b"SICK_LMS"
_CONFIGURATION = 34  # bytes
_STATUS = 152  # bytes of its reply to 0x31
_BAUDS = {0x40: 38_400, 0x41: 19_200, 0x42: 9600, 0x48: 500_000}  # by mode
_HEAD = 8  # bytes of a telegram before its ranges
_NO_RANGE = 0x1FFF  # code: too far


def remainder(data: bytes) -> int:
    """Return the checksum of a telegram: a shift register by x^16 + x^15 + x^2 + 1 with pairs of bytes added."""
    register = 0
    for low, high in zip(data, b"\0" + data[:-1], strict=True):
        register <<= 1
        if register >> 16:
            register ^= 0x18005
        register ^= high << 8 | low
    return register


def write_telegram(payload: bytes, address: int = 0x80) -> bytes:
    """Encode a telegram of command and values."""
    data = bytes([2, address]) + len(payload).to_bytes(2, "little") + payload
    return data + remainder(data).to_bytes(2, "little")


@dataclass
class LmsMachine:
    """State of one sensor; times are true ones."""

    lidar: Lidar
    ranging: Ranging
    began_ns: int  # end of its start
    millimetres: bool = True  # unit of its ranges: millimetres (up to 8 m) or centimetres
    status: int = 0x10  # last byte of its replies; bits of unknown meaning [assumed]
    rate_error: float = 1e-3  # of its motor, positive if fast

    def __post_init__(self) -> None:
        self.scanning: object | None = None
        self.baud = 9600
        self.configuration = bytes([0, 0, 70, 0, 1, 0, int(self.millimetres), *[0] * (_CONFIGURATION - 7)])
        self._mode = 0x25
        self._field_deg, self._step_centideg = 180, 100
        self._number = 0

    @property
    def turns(self) -> int:
        """Mirror turns per telegram."""
        return max(round(100 / self._step_centideg), 1)

    @property
    def period_ns(self) -> float:
        """Time between two telegrams."""
        return self.turns * _TURN_NS / (1 + self.rate_error)

    def receive(self, received: bytes, now_ns: int, /) -> tuple[bytes, bytes]:
        """As `Machine.receive`; the reply to a wrong checksum is 15."""
        answers = b""
        while (at := received.find(b"\x02\x00")) >= 0 and len(received) >= at + 4:
            size = 6 + int.from_bytes(received[at + 2 : at + 4], "little")
            if size > 64:
                received = received[at + 1 :]
                continue
            if len(received) < at + size:
                return answers, received[at:]
            telegram, received = received[at : at + size], received[at + size :]
            if now_ns < self.began_ns:
                continue
            if int.from_bytes(telegram[-2:], "little") != remainder(telegram[:-2]):
                answers += b"\x15"
                continue
            answer = self._answer(telegram[4:-2], now_ns)
            answers += b"\x06" + write_telegram(answer + bytes([self.status])) if answer else b"\x15"
        return answers, received[at:] if at >= 0 else received[-1:]

    def next_ns(self) -> int:
        """Return the time of the last beam of the next telegram."""
        if self.scanning is None:
            return _NEVER_NS
        return self.began_ns + round((self._number + 1) * self.period_ns - _TURN_NS / 2)

    def next_packets(self) -> list[tuple[int, bytes]]:
        """Measure the next telegram: beams between the degrees are measured in the turns after the first."""
        half_centideg = 50 * self._field_deg
        bearing_rad = np.radians(np.arange(-half_centideg, half_centideg + 1, self._step_centideg) / 100)
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
        self._number += max(math.ceil(len(data) * 10 / self.baud * 1e9 / self.period_ns), 1)  # the line is busy
        return [(sent_ns, data)]

    def skip_to(self, before_ns: int) -> None:
        """Skip the telegrams before a time."""
        if self.scanning is not None:
            self._number += max(math.floor((before_ns - self.next_ns()) / self.period_ns), 0)

    def power_cycle(self, now_ns: int) -> None:
        """Restart at 9600 baud with the default variant, silent while it starts."""
        self.began_ns = now_ns + _BOOT_NS
        self.scanning, self.baud, self._mode = None, 9600, 0x25
        self._field_deg, self._step_centideg = 180, 100

    def _answer(self, request: bytes, now_ns: int) -> bytes:
        match request[0]:
            case 0x20 if request[1:2] == bytes([_INSTALLATION]):
                known = request[2:] == _PASSWORD
                self._mode = _INSTALLATION if known else self._mode
                return bytes([0xA0, not known])
            case 0x20 if len(request) == 2 and request[1] in _MODES:
                if request[1] in _BAUDS:
                    self.baud = _BAUDS[request[1]]
                else:
                    self._mode = request[1]
                    self.scanning = object() if request[1] == 0x24 else None
                    self._number = max(math.ceil((now_ns - self.began_ns) / self.period_ns), 0)
                return b"\xa0\x00"
            case 0x31:
                return self._status()
            case 0x32:
                return b"\xb2"  # no errors
            case 0x74:
                return b"\xf4" + self.configuration
            case 0x77 if len(request) == 1 + _CONFIGURATION:
                if done := self._mode == _INSTALLATION:
                    self.configuration = request[1:]
                    self.millimetres = bool(self.configuration[6])
                return bytes([0xF7, done]) + self.configuration
            case 0x3A:
                return b"\xba" + self.lidar.name.replace(" ", "").encode() + b";30106;V02.30"
            case 0x3B if len(request) == 5:
                angle_deg, step_centideg = struct.unpack("<HH", request[1:])
                known = step_centideg in {100: (25, 50, 100), 180: (50, 100)}.get(angle_deg, ())
                if known:
                    self._field_deg, self._step_centideg = angle_deg, step_centideg
                return b"\xbb" + struct.pack("<BHH", int(known), angle_deg, step_centideg)
        return b""

    def _status(self) -> bytes:
        """Return the reply to a status request; its other bytes are 0 [assumed]."""
        status = bytearray(_STATUS)
        status[0:8] = b"\xb1V02.30 "
        status[8] = self._mode
        status[107:111] = struct.pack("<HH", self._field_deg, self._step_centideg)
        status[116:118] = (0x8000 + round(1e6 / self.baud)).to_bytes(2, "little")  # [assumed]
        status[122], status[123] = self.configuration[6], 1
        status[124:131] = b"V01.10 "
        return bytes(status)


def lms_emulator(lidar: Lidar, ranging: Ranging, seed: int = 0) -> LidarLine[LmsMachine]:
    """Return the emulator of a catalogue sensor."""
    machine = LmsMachine(lidar, ranging, time.monotonic_ns())
    return LidarLine(lidar.name, machine, head=_HEAD, network=False, seed=seed)
