"""Telegrams of SICK's LMS 2xx as pure functions of bytes. Numbers are little-endian.

    request   02  00  length  command values  crc          length: of command and values
    answer    06  02  80  length  command + 80  values  status  crc

Sources: citations of SICK's telegram listing, and sicktoolbox; not tested on a sensor. Invalid bytes raise
ProtocolError.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32
from numpy import ndarray

from scanwright.design.errors import ProtocolError

MODE, TYPE, VARIANT = 0x20, 0x3A, 0x3B
ANSWER = 0x80  # set in the command of an answer
SCAN = 0xB0  # 0x30 | ANSWER
STREAM, ON_REQUEST = 0x24, 0x25
BAUD_MODES = {9600: 0x42, 19_200: 0x41, 38_400: 0x40, 500_000: 0x48}  # values of MODE
ACKNOWLEDGED, REFUSED = 0x06, 0x15

POLLUTED = 0x80  # bit of the status
FATAL = 3  # severity in the three lowest bits: 0 none, 1 information, 2 warning, 3 error, 4 fatal error
LONGEST = 812  # bytes of a telegram; sicktoolbox
_STX = 0x02  # begins a telegram
_OVERHEAD = 6  # start, address, length, sum
_FIRST_CODE = 0x1FF7  # values from here on are error codes: too far, dazzled, too weak


@dataclass(frozen=True, slots=True)
class LmsTelegram:
    """One checked telegram."""

    address: int  # 0 to a sensor, 80 from a single sensor
    command: int  # with bit ANSWER in a reply
    values: bytes  # after the command; in a reply the last byte is the sensor's status

    @property
    def status(self) -> int:
        """Status of the sensor."""
        return self.values[-1] if self.values else 0


@dataclass(frozen=True, slots=True, eq=False)
class LmsScan:
    """The ranges of one telegram."""

    range_m: Float32[ndarray, " n"]  # NaN without a return, shape (n,), in order of bearing
    status: int  # of the sensor, see FATAL and POLLUTED


def crc16(data: bytes) -> int:
    """Return the checksum of a telegram over all bytes before it."""
    crc = before = 0
    for byte in data:
        crc = (crc << 1 ^ (0x8005 if crc & 0x8000 else 0)) & 0xFFFF
        crc ^= byte | before << 8
        before = byte
    return crc


def telegram(command: int, values: bytes = b"") -> bytes:
    """Encode a request."""
    body = struct.pack("<BBHB", _STX, 0, 1 + len(values), command) + values
    return body + struct.pack("<H", crc16(body))


def variant(angle_deg: int, step_centideg: int) -> bytes:
    """Encode the request for a field of 100 or 180 deg in steps of 100, 50 or 25 hundredths of a degree."""
    return telegram(VARIANT, struct.pack("<HH", angle_deg, step_centideg))


def accepted_variant(reply: LmsTelegram) -> tuple[int, int] | None:
    """Return the present field [deg] and step [0.01 deg]; None if the request was rejected."""
    if reply.command != VARIANT | ANSWER or len(reply.values) != 6:
        raise ProtocolError(f"LMS 2xx: {len(reply.values)} bytes about its variant, not 6")
    done, angle_deg, step_centideg, _ = struct.unpack("<BHHB", reply.values)
    return (angle_deg, step_centideg) if done == 1 else None


def scan(reply: LmsTelegram) -> LmsScan:
    """Decode a telegram of a complete scan."""
    if reply.command != SCAN or len(reply.values) < 3:
        raise ProtocolError(f"LMS 2xx: telegram {reply.command:02X}: not a scan")
    head = reply.values[0] | reply.values[1] << 8
    count, partial, unit = head & 0x3FF, head >> 13 & 1, head >> 14
    if partial or unit not in (0, 1):
        raise ProtocolError(f"LMS 2xx: a scan of kind {head >> 10:06b}: not complete, or neither in cm nor in mm")
    if len(reply.values) != 2 + 2 * count + 1:
        raise ProtocolError(f"LMS 2xx: {len(reply.values) - 3} bytes for {count} ranges")
    raw = np.frombuffer(reply.values, "<u2", count, 2) & 0x1FFF
    range_m = np.where((raw > 0) & (raw < _FIRST_CODE), raw * (1e-3 if unit else 1e-2), np.nan)
    return LmsScan(range_m.astype(np.float32), reply.status)


class LmsSplitter:
    """Splitter of a byte stream into telegrams; skips other bytes."""

    def __init__(self) -> None:
        self.bad = 0  # runs of other bytes, acknowledgements excluded
        self.rest = b""  # received bytes of an incomplete telegram
        self._lost = False

    def cut_in(self) -> None:
        """Expect the middle of a telegram next, and do not count it as bad."""
        self.rest, self._lost = b"", True

    def feed(self, data: bytes) -> list[LmsTelegram]:
        """Return the telegrams that these bytes complete."""
        self.rest += data
        telegrams: list[LmsTelegram] = []
        at = 0
        while at < len(self.rest):
            size = _announced(self.rest[at : at + 4])
            if size is not None and at + size > len(self.rest):
                break
            candidate = self.rest[at : at + (size or 0)]
            if size and crc16(candidate[:-2]) == candidate[-2] | candidate[-1] << 8:
                telegrams.append(LmsTelegram(candidate[1], candidate[4], candidate[5:-2]))
                self._lost = False
                at += size
                continue
            if self.rest[at] not in (ACKNOWLEDGED, REFUSED):
                self.bad += not self._lost
                self._lost = True
            at += 1
        self.rest = self.rest[at:]
        return telegrams


def _announced(head: bytes) -> int | None:
    """Return the size of the telegram that begins so, or a lower bound; None if none begins so."""
    if head[0] != _STX:
        return None
    if len(head) < 4:
        return _OVERHEAD + 1
    size = _OVERHEAD + (head[2] | head[3] << 8)
    return size if head[1] in (0x00, 0x80) and _OVERHEAD < size <= LONGEST else None
