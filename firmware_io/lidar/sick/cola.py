"""CoLa, the protocol of SICK lidars, in both dialects as pure functions of bytes.

    CoLa A    02  sRN DeviceIdent  03                      numbers are upper-case hex, separated by one space
    CoLa B    02 02 02 02  length  sRN DeviceIdent  xor    numbers are big-endian, length and xor of the payload only

The content is the same: a command type of three letters, a name, and values in a fixed order of types, which `Writer`
and `values.Reader` encode and decode. CoLa A has no checksum: only invalid hex or a short telegram shows damage.
Sources: SICK LMS4000 manual 8023198 (framing), TiM781 manual 8024232 (error codes), LMS500 instructions 8013796.
Invalid bytes raise ProtocolError.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import reduce
from operator import xor

from scanwright.design.errors import ProtocolError
from scanwright.firmware_io.lidar.sick.values import FORMAT, Kind, Reader

LONGEST = 1 << 15  # payload: LMS1xx with all its channels needs a fifth
_START_B = b"\x02\x02\x02\x02"
_STX, _ETX = 0x02, 0x03
_WORDS = (b"sRN", b"sRA", b"sWN", b"sWA", b"sMN", b"sMA", b"sAN", b"sEN", b"sEA", b"sSN", b"sFA")

ERRORS = {  # telegram listing 8014631, codes of sFA
    0x01: "access denied: login required",
    0x02: "unknown method",
    0x03: "unknown variable",
    0x04: "a condition for it is not met",
    0x05: "invalid data",
    0x06: "unknown error",
    0x07: "buffer overflow",
    0x08: "buffer underflow",
    0x09: "unknown type",
    0x0A: "writing is not allowed",
    0x0B: "the name server does not know the command",
    0x0C: "unknown command",
    0x0D: "the method is busy: ask again",
    0x0E: "array out of bounds",
    0x0F: "unknown event",
    0x10: "value overflow",
    0x11: "invalid character",
    0x12: "no message of the operating system",
    0x13: "no answer of the operating system",
    0x14: "internal error",
    0x15: "hub address is damaged",
    0x16: "hub address cannot be decoded",
    0x17: "hub address is exceeded",
    0x18: "hub address is not expected",
    0x19: "asynchronous methods are suppressed",
    0x1A: "arrays of this kind are not supported",
}


@dataclass(frozen=True, slots=True)
class Telegram:
    """One checked telegram."""

    payload: bytes  # command type, name and values
    binary: bool  # CoLa B

    @property
    def word(self) -> bytes:
        """Command type: read sRN, write sWN, method sMN, event sEN; replies sRA, sWA, sAN, sEA; data sSN, error sFA."""
        return self.payload[:3]

    @property
    def name(self) -> bytes:
        """Name of the variable, method or event; empty in an error."""
        return b"" if self.word == b"sFA" else self.payload[4:].split(b" ", 1)[0]

    def values(self) -> Reader:
        """Return a reader of the values."""
        return Reader(self.payload[5 + len(self.name) :], self.binary)


def framed(telegram: Telegram) -> bytes:
    """Return the bytes to send; raises ValueError if a CoLa A payload contains 02 or 03."""
    payload = telegram.payload
    if telegram.binary:
        return _START_B + struct.pack(">I", len(payload)) + payload + bytes([reduce(xor, payload, 0)])
    if _STX in payload or _ETX in payload:
        raise ValueError("CoLa A cannot hold 02 or 03")
    return bytes([_STX]) + payload + bytes([_ETX])


def error_code(telegram: Telegram) -> int:
    """Return the code of an sFA: one or two bytes, with or without a space before it."""
    rest = telegram.payload[3:]
    if telegram.binary:
        rest = rest[1:] if rest[:1] == b" " else rest
        if not 1 <= len(rest) <= 2:
            raise ProtocolError(f"sFA: {len(rest)} bytes for its code")
        return int.from_bytes(rest, "big")
    return Reader(rest.removeprefix(b" "), binary=False).number("u16")


def error_words(code: int) -> str:
    """Return the description of an error with its code."""
    return f"error {code:X}: {ERRORS.get(code, 'not in the manual')}"


class Writer:
    """Encoder of a telegram: command type and name, then values."""

    def __init__(self, command: str, *, binary: bool) -> None:
        """`command`: command type and name, such as "sRN DeviceIdent"."""
        self._binary = binary
        self._parts = [command.encode("ascii")]

    def number(self, kind: Kind, value: float) -> Writer:
        """Append one number; raises ValueError if it does not fit its type."""
        try:
            packed = struct.pack(FORMAT[kind], value)
        except (struct.error, OverflowError) as error:
            raise ValueError(f"{value}: not a {kind}") from error
        digits = packed.hex().upper().encode() if kind == "f32" else b"%X" % int.from_bytes(packed, "big")
        self._parts.append(packed if self._binary else digits)
        return self

    def numbers(self, kind: Kind, values: list[int]) -> Writer:
        """Append several numbers of one type."""
        for value in values:
            self.number(kind, value)
        return self

    def name(self, text: str) -> Writer:
        """Append a name of fixed length."""
        self._parts.append(text.encode("ascii"))
        return self

    def text(self, text: str) -> Writer:
        """Append a text, preceded by its length."""
        return self.number("u16", len(text)).name(text)

    def telegram(self) -> Telegram:
        """Return the telegram."""
        command, *values = self._parts
        if not values:
            return Telegram(command, self._binary)
        joined = b"".join(values) if self._binary else b" ".join(values)
        return Telegram(command + b" " + joined, self._binary)


class TelegramSplitter:
    """Splitter of a byte stream into telegrams of both dialects; skips garbage."""

    def __init__(self) -> None:
        self.bad = 0  # telegrams and runs of garbage dropped
        self.rest = b""  # received bytes of an incomplete telegram
        self._lost = False

    def cut_in(self) -> None:
        """Expect the middle of a telegram next, and do not count it as bad."""
        self.rest, self._lost = b"", True

    def feed(self, received: bytes) -> list[Telegram]:
        """Return the telegrams that these bytes complete."""
        self.rest += received
        telegrams: list[Telegram] = []
        while self.rest:
            used, telegram, broken = _first(self.rest)
            if not used:
                break
            self.rest = self.rest[used:]
            if telegram is not None:
                telegrams.append(telegram)
                self._lost = False
            else:
                self.bad += broken or not self._lost
                self._lost = True
        return telegrams


def _first(buffer: bytes) -> tuple[int, Telegram | None, bool]:
    """Return the number of bytes to consume (0: wait), their telegram if any, and whether they are a damaged one."""
    start = buffer.find(_STX)
    if start:
        return (start if start > 0 else len(buffer)), None, False
    if buffer.startswith(_START_B[: len(buffer)]) and len(buffer) < 8:
        return 0, None, False
    if buffer.startswith(_START_B):
        length = int.from_bytes(buffer[4:8], "big")
        payload = buffer[8 : 8 + length]
        if not 3 <= length <= LONGEST or not any(word.startswith(payload[:3]) for word in _WORDS):
            return 1, None, False
        if len(buffer) < 9 + length:
            return 0, None, False
        if reduce(xor, payload) != buffer[8 + length]:
            return 1, None, True
        return 9 + length, Telegram(payload, binary=True), False
    if not any(word.startswith(buffer[1:4]) for word in _WORDS):
        return 1, None, False
    end, other = buffer.find(_ETX), buffer.find(_STX, 1)
    if other > 0 and (end < 0 or other < end):
        return other, None, True
    if end < 0:
        return (len(buffer), None, True) if len(buffer) > 4 * LONGEST else (0, None, False)
    payload = buffer[1:end]
    if len(payload) < 3 or not payload.isascii():
        return end + 1, None, True
    return end + 1, Telegram(payload, binary=False), False
