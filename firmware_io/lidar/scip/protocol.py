"""SCIP 2.0, the protocol of Hokuyo lidars (specification C-42-03320B), as pure functions of bytes.

    request   VV LF      GD 0044 0725 01 LF      MD 0000 1080 01 0 00 LF
    reply     echo LF  status sum LF  [line sum LF] ...  LF

Text lines (VV, PP, II) are `KEY:text;`, and their sum excludes the semicolon. Data lines have 64 characters of
0x30..0x6F, the last one fewer, and can contain semicolons; the echo shows which kind a reply has. The sum has six bits
and ignores the upper two of each byte, so lengths and characters are checked too. The echo has no sum: compare it with
the request. In SCIP 1.1 the status has one character and there are no sums; `SCIP_2` switches to 2.0.
Invalid bytes raise ProtocolError.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanwright.design.errors import ProtocolError

Integers = NDArray[np.int32]

SCIP_2 = b"SCIP2.0"
LINE_CHARACTERS = 64  # of data in a line; SCIP 2.0
LONGEST_REPLY = 1 << 16  # five times the longest reply, range and intensity of 2161 steps
_REQUEST = rb"(?:VV|PP|II|BM|QT|R[STB]|TM\d|SS\d{6}|CR\d\d|HS\d|DB\d\d|SCIP2\.0|%S[LT]|[GH][DSE]\d{10}|[MN][DSE]\d{13})"
_ECHO = re.compile(_REQUEST + rb"(?:;[\w .+@]{0,16})?")
_ECHO_LINE = re.compile(rb"^(?:" + _ECHO.pattern + rb")$", re.MULTILINE)

STATUS = {
    "0A": "the sensor has an internal fault",
    "0B": "the request came twice, or its buffer is full",
    "0C": "the request lacks parameters",
    "0D": "the request is unknown",
    "0E": "the request is unknown, or the sensor is adjusting its time",
    "0F": "the request lacks parameters",
    "0G": "the request's text is too long",
    "0H": "the request's text has a letter that is not allowed",
    "0I": "the sensor is waiting for a firmware update",
    "0L": "the sensor is in an abnormal state",
    "0M": "the sensor is unstable",
    "10": "the laser is off",
    "98": "the sensor went on after checking itself",
}


@dataclass(frozen=True, slots=True)
class Reply:
    """One checked reply."""

    echo: bytes  # the request; in a scan, its last two digits count down
    status: str  # two characters, one in SCIP 1.1
    lines: tuple[bytes, ...]  # text without semicolon and sum, or data without sum

    @property
    def command(self) -> bytes:
        """The two letters of the request."""
        return self.echo[:2]

    def meaning(self) -> str:
        """Return the description of the status."""
        if self.status.isdigit() and 21 <= int(self.status) <= 49:
            return "the sensor stopped to check itself"
        if self.status.isdigit() and 50 <= int(self.status) <= 97:
            return "the sensor has a hardware fault; switch it off and on"
        return STATUS.get(self.status, "refused")


def checksum(text: bytes) -> int:
    """Return the checksum character of a text."""
    return (sum(text) & 0x3F) + 0x30


def summed(text: bytes) -> bytes:
    """Append the checksum to a text."""
    return text + bytes([checksum(text)])


def encode(values: Iterable[int], characters: int) -> bytes:
    """Encode numbers with 6 bits per character, upper bits first."""
    column = np.fromiter(values, np.int64)[:, None] >> (6 * np.arange(characters - 1, -1, -1))
    return ((column & 0x3F) + 0x30).astype(np.uint8).tobytes()


def decode(text: bytes, characters: int) -> Integers:
    """Decode numbers written by `encode`."""
    sixes = np.frombuffer(text, np.uint8).astype(np.int32) - 0x30
    if len(text) % characters:
        raise ProtocolError(f"{len(text)} characters: not a multiple of {characters}")
    if sixes.size and not (sixes.min() >= 0 and sixes.max() <= 0x3F):
        raise ProtocolError("data with a character outside 0x30..0x6F")
    return (sixes.reshape(-1, characters) << (6 * np.arange(characters - 1, -1, -1, dtype=np.int32))).sum(
        axis=1, dtype=np.int32
    )


def reply(echo: bytes, status: str, lines: Sequence[bytes] = ()) -> bytes:
    """Encode a reply whose lines have their sums."""
    return b"\n".join([echo, summed(status.encode()), *lines, b"", b""])


def text_lines(pairs: Iterable[tuple[str, str]]) -> list[bytes]:
    """Encode the lines of VV, PP and II."""
    texts = [f"{key}:{text}".encode() for key, text in pairs]
    return [text + b";" + bytes([checksum(text)]) for text in texts]


def data_lines(stamp_ms: int, payload: bytes) -> list[bytes]:
    """Encode the lines of a scan."""
    cuts = range(0, len(payload), LINE_CHARACTERS)
    return [summed(encode([stamp_ms], 4)), *(summed(payload[cut : cut + LINE_CHARACTERS]) for cut in cuts)]


def parse(block: bytes) -> Reply:
    """Check and split one reply, without the two LF at its end."""
    echo, _, after = block.partition(b"\n")
    status, *rest = after.split(b"\n")
    if not _ECHO.fullmatch(echo):
        raise ProtocolError(f"not a reply: {_shown(block)}")
    if len(status) == 1 and not rest and status.isalnum():  # SCIP 1.1
        return Reply(echo, status.decode(), ())
    if len(status) != 3:
        raise ProtocolError(f"{echo.decode()}: not a status: {_shown(status)}")
    code = _unsummed(status, echo)
    if not code.isalnum():
        raise ProtocolError(f"{echo.decode()}: not a status: {_shown(status)}")
    if echo[:2] in (b"VV", b"PP", b"II"):
        return Reply(echo, code.decode(), tuple(_text(line, echo) for line in rest))
    return Reply(echo, code.decode(), tuple(_unsummed(line, echo) for line in rest))


class Splitter:
    """Splitter of a byte stream into replies; skips garbage, cut lines and merged lines."""

    def __init__(self) -> None:
        self.bad = 0  # replies dropped
        self._pending = b""

    def cut_in(self) -> None:
        """Expect the middle of a reply next."""
        self._pending = b""

    def feed(self, received: bytes) -> list[Reply]:
        """Return the replies that end in `received`, in order."""
        *blocks, self._pending = (self._pending + received).split(b"\n\n")
        if len(self._pending) > LONGEST_REPLY:
            self.bad += 1
            self._pending = b""
        return [reply for block in blocks for reply in self._parsed(block.strip(b"\n"))]

    def _parsed(self, block: bytes) -> list[Reply]:
        if not block:
            return []
        # Bytes before the last echo are a reply whose end was lost.
        echo = max((match.start() for match in _ECHO_LINE.finditer(block)), default=0)
        self.bad += echo > 0
        try:
            return [parse(block[echo:])]
        except ProtocolError:
            self.bad += 1
            return []


def information(reply: Reply) -> dict[str, str]:
    """Return keys and texts of a VV, PP or II reply."""
    if reply.status != "00":
        raise ProtocolError(f"{reply.echo.decode()}: status {reply.status}: {reply.meaning()}")
    pairs = [line.decode("ascii", "replace").partition(":") for line in reply.lines]
    if not all(colon for _, colon, _ in pairs):
        raise ProtocolError(f"{reply.echo.decode()}: a line without a key")
    return {key: text for key, _, text in pairs}


def _unsummed(line: bytes, echo: bytes) -> bytes:
    if len(line) < 2 or line[-1] != checksum(line[:-1]):
        raise ProtocolError(f"{echo.decode()}: wrong sum: {_shown(line)}")
    return line[:-1]


def _text(line: bytes, echo: bytes) -> bytes:
    text, semicolon, total = line[:-2], line[-2:-1], line[-1:]
    # Some firmware of the UTM-30LX ends the sum at "<-"; other sensors include the semicolon.
    sums = {checksum(text), checksum(text + b";"), checksum(text.partition(b"<-")[0])}
    if semicolon != b";" or total[0] not in sums:
        raise ProtocolError(f"{echo.decode()}: wrong sum: {_shown(line)}")
    return text


def _shown(text: bytes) -> str:
    return repr(text[:40])[1:]
