"""Values of a CoLa telegram, decoded one by one in either dialect; invalid bytes raise ProtocolError."""

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
        """One whole number."""
        bits = _bits(kind)
        if self._binary:
            value = int.from_bytes(self._next(bits // 8), "big")
        else:
            token = self._token()
            if not _TOKEN.fullmatch(token):
                raise ProtocolError(f"no number: {token[:20]!r}")
            if token[:1] in b"+-":
                value = int(token)
                if kind.startswith("i"):
                    if not -(1 << bits - 1) <= value < 1 << bits - 1:
                        raise ProtocolError(f"{value} is no {kind}")
                    return value
            else:
                value = int(token, 16)
        # A sensor writes a negative word of 16 bits as eight hex digits or as four.
        if kind.startswith("i") and value >= 1 << bits - 1:
            value -= 1 << (32 if value >> bits else bits)
            if value < -(1 << bits - 1):
                raise ProtocolError(f"{value} is no {kind}")
        elif not 0 <= value < 1 << bits:
            raise ProtocolError(f"{value} is no {kind}")
        return value

    def real(self) -> float:
        """One number of IEEE 754, 32 bits."""
        if not self._binary and self._values[self._at : self._at + 1] == b"+":
            raise ProtocolError("a decimal where a float stands")
        value = float(struct.unpack(">f", struct.pack(">I", self.number("u32")))[0])
        if not abs(value) < 1e9:
            raise ProtocolError(f"{value} is no scale")
        return value

    def numbers(self, kind: Kind, count: int) -> list[int]:
        """Several of one type; raises as `number` does."""
        if count * (_bits(kind) // 8 if self._binary else 2) > len(self._values) - self._at + 1:
            raise ProtocolError(f"{count} values announced, fewer came")
        if self._binary:
            raw = self._next(count * _bits(kind) // 8)
            return list(struct.unpack(f">{count}{FORMAT[kind][1]}", raw))
        return [self.number(kind) for _ in range(count)]

    def name(self, length: int) -> str:
        """A name of fixed length."""
        raw = self._next(length)
        if not self._binary:
            self._skip_space()
        if not (raw.isascii() and raw.decode("ascii").isprintable()):
            raise ProtocolError(f"no name: {raw[:20]!r}")
        return raw.decode("ascii")

    def text(self) -> str:
        """A text of any length, its length before it; raises as `name` does."""
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

    def _skip_space(self) -> None:
        if self._at < len(self._values):
            if self._values[self._at] != 0x20:
                raise ProtocolError("a name that is longer than its length")
            self._at += 1


def _bits(kind: Kind) -> int:
    return 8 * struct.calcsize(FORMAT[kind])
