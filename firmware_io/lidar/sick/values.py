"""Decoder of the values of a CoLa telegram in either dialect; invalid bytes raise ProtocolError."""

from __future__ import annotations

import re
import struct
from typing import Literal

from scanwright.design.errors import ProtocolError

Kind = Literal["u8", "u16", "u32", "i16", "i32", "f32"]

FORMAT: dict[Kind, str] = {"u8": ">B", "u16": ">H", "u32": ">I", "i16": ">h", "i32": ">i", "f32": ">f"}

_TOKEN = re.compile(rb"[0-9A-F]{1,8}|[+-][0-9]{1,10}")


class Reader:
    """Decodes the values of a telegram in order."""

    def __init__(self, values: bytes, binary: bool) -> None:
        self._values, self._binary, self._at = values, binary, 0

    def number(self, kind: Kind) -> int:
        """Return one integer."""
        bits = _bits(kind)
        if self._binary:
            value = int.from_bytes(self._next(bits // 8), "big")
        else:
            token = self._token()
            if not _TOKEN.fullmatch(token):
                raise ProtocolError(f"not a number: {token[:20]!r}")
            if token[:1] in b"+-":
                value = int(token)
                if kind.startswith("i"):
                    if not -(1 << bits - 1) <= value < 1 << bits - 1:
                        raise ProtocolError(f"{value}: not a {kind}")
                    return value
            else:
                value = int(token, 16)
        # A sensor writes a negative word of 16 bits as eight hex digits or as four.
        if kind.startswith("i") and value >= 1 << bits - 1:
            value -= 1 << (32 if value >> bits else bits)
            if value < -(1 << bits - 1):
                raise ProtocolError(f"{value}: not a {kind}")
        elif not 0 <= value < 1 << bits:
            raise ProtocolError(f"{value}: not a {kind}")
        return value

    def real(self) -> float:
        """Return one float of 32 bits."""
        if not self._binary and self._values[self._at : self._at + 1] == b"+":
            raise ProtocolError("a decimal number instead of a float")
        value = float(struct.unpack(">f", struct.pack(">I", self.number("u32")))[0])
        if not abs(value) < 1e9:
            raise ProtocolError(f"{value}: not a scale")
        return value

    def numbers(self, kind: Kind, count: int) -> list[int]:
        """Return several integers of one type."""
        if count * (_bits(kind) // 8 if self._binary else 2) > len(self._values) - self._at + 1:
            raise ProtocolError(f"{count} values announced, fewer received")
        if self._binary:
            raw = self._next(count * _bits(kind) // 8)
            return list(struct.unpack(f">{count}{FORMAT[kind][1]}", raw))
        return [self.number(kind) for _ in range(count)]

    def name(self, length: int) -> str:
        """Return a name of fixed length."""
        raw = self._next(length)
        if not self._binary and self._at < len(self._values):
            if self._values[self._at] != 0x20:
                raise ProtocolError("a name that is longer than its length")
            self._at += 1
        if not (raw.isascii() and raw.decode("ascii").isprintable()):
            raise ProtocolError(f"not a name: {raw[:20]!r}")
        return raw.decode("ascii")

    def text(self) -> str:
        """Return a text, which its length precedes."""
        return self.name(self.number("u16"))

    def _next(self, length: int) -> bytes:
        if self._at + length > len(self._values):
            raise ProtocolError("the telegram ends early")
        self._at += length
        return self._values[self._at - length : self._at]

    def _token(self) -> bytes:
        if self._at >= len(self._values):
            raise ProtocolError("the telegram ends early")
        end = self._values.find(b" ", self._at)
        end = len(self._values) if end < 0 else end
        token = self._values[self._at : end]
        self._at = end + 1
        return token


def _bits(kind: Kind) -> int:
    return 8 * struct.calcsize(FORMAT[kind])
