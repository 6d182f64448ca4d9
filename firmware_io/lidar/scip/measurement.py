"""Measurement requests and replies of SCIP 2.0 as pure functions; invalid bytes raise ProtocolError."""

from __future__ import annotations

import re
from dataclasses import dataclass

from scanwright.design.errors import ProtocolError
from scanwright.firmware_io.lidar.scip.protocol import LINE_CHARACTERS, Integers, Reply, decode

_SCAN_ECHO = re.compile(rb"([GM])([DSE])(\d{4})(\d{4})(\d\d)(?:(\d)(\d\d))?(?:;.*)?")


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """Measured steps and their encoding."""

    first_step: int
    last_step: int  # inclusive
    cluster: int = 1  # steps that share one value, the smallest range among them
    characters: int = 3  # per value: 3 for 18 bit, 2 for 12 bit (ranges to 4095 mm)
    intensity: bool = False  # a second value after each range

    def __post_init__(self) -> None:
        if not 0 <= self.first_step <= self.last_step <= 9999:
            raise ProtocolError(f"steps {self.first_step}..{self.last_step}: not within 0..9999 in this order")
        if not 1 <= self.cluster <= 99:
            raise ProtocolError(f"cluster = {self.cluster}: not within 1..99")
        if self.characters not in (2, 3) or (self.intensity and self.characters == 2):
            raise ProtocolError(f"{self.characters} characters per value: 3, or 2 without intensity")

    @classmethod
    def requested(cls, letter: bytes, first: bytes, last: bytes, cluster: bytes) -> Window:
        """Return the window of a request: second letter of its command, and its numbers."""
        return cls(
            first_step=int(first),
            last_step=int(last),
            cluster=max(int(cluster), 1),
            characters=2 if letter == b"S" else 3,
            intensity=letter == b"E",
        )

    @property
    def size(self) -> int:
        """Number of ranges."""
        return (self.last_step - self.first_step) // self.cluster + 1

    @property
    def full_clusters(self) -> int:
        """Number of ranges of a sensor that omits an incomplete last cluster; which sensors do is undocumented."""
        return (self.last_step - self.first_step + 1) // self.cluster

    @property
    def bytes_per_scan(self) -> int:
        """Bytes of a reply: echo, status, stamp, and lines of 64 characters with their sum and end."""
        characters = self.size * self.characters * (2 if self.intensity else 1)
        return 16 + 4 + 6 + 1 + characters + 2 * -(-characters // LINE_CHARACTERS)

    @property
    def letter(self) -> str:
        """Second letter of the command."""
        return "E" if self.intensity else "S" if self.characters == 2 else "D"


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """Content of a scan reply."""

    window: Window
    remaining: int  # further scans; 0 for the last one and without a limit
    stamp_ms: int  # sensor time, 24 bit
    value: Integers  # shape (n,), millimetres or error codes
    intensity: Integers  # shape (n,) or (0,)


def continuous(window: Window, *, skip: int = 0, count: int = 0) -> bytes:
    """Encode the request (without LF) for `count` scans (0: no limit), with `skip` dropped after each."""
    if not (0 <= skip <= 9 and 0 <= count <= 99):
        raise ProtocolError(f"skip = {skip}, count = {count}: not within 0..9 and 0..99")
    steps = f"{window.first_step:04d}{window.last_step:04d}{window.cluster:02d}"
    return f"M{window.letter}{steps}{skip}{count:02d}".encode()


def is_scan(reply: Reply) -> bool:
    """Whether a reply contains a scan; other replies only accept or reject the request."""
    return (reply.echo[:1] == b"M" and reply.status == "99") or (reply.echo[:1] == b"G" and reply.status == "00")


def measurement(reply: Reply) -> Measurement:
    """Decode a scan reply."""
    match = _SCAN_ECHO.fullmatch(reply.echo)
    if match is None or not is_scan(reply):
        raise ProtocolError(f"{reply.echo.decode()}: status {reply.status}: {reply.meaning()}")
    _, letter, first, last, cluster, _, remaining = match.groups()
    window = Window.requested(letter, first, last, cluster)
    stamp, *data = reply.lines or (b"",)
    if len(stamp) != 4 or any(len(line) != LINE_CHARACTERS for line in data[:-1]):
        raise ProtocolError(f"{reply.echo.decode()}: a line was cut")
    numbers = decode(b"".join(data), window.characters)
    each = 2 if window.intensity else 1
    if numbers.size not in (window.size * each, window.full_clusters * each):
        raise ProtocolError(f"{reply.echo.decode()}: {numbers.size} numbers for {window.size} steps")
    value, intensity = (numbers[::2], numbers[1::2]) if window.intensity else (numbers, numbers[:0])
    return Measurement(window, int(remaining or 0), int(decode(stamp, 4)[0]), value, intensity)


def stamp(reply: Reply) -> int:
    """Return the sensor time [ms, 24 bit] of a TM1 reply."""
    if reply.echo[:3] != b"TM1" or reply.status != "00" or len(reply.lines) != 1 or len(reply.lines[0]) != 4:
        raise ProtocolError(f"{reply.echo.decode()}: status {reply.status}: {reply.meaning()}")
    return int(decode(reply.lines[0], 4)[0])
