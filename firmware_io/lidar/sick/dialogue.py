"""Requests to a SICK lidar in its dialect of CoLa, and its replies; failures raise DeviceError."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

from scanwright.design.errors import DeviceError, DeviceTimeoutError, ProtocolError
from scanwright.firmware_io.lidar.sensor_line import SensorLine
from scanwright.firmware_io.lidar.sick.cola import (
    LONGEST,
    Telegram,
    TelegramSplitter,
    Writer,
    error_code,
    error_words,
    framed,
)
from scanwright.firmware_io.lidar.sick.values import Reader

T = TypeVar("T")

POLL_S = 0.1  # between two requests for a state
_REPLY_S = 0.5  # long for Ethernet [assumed]
_BUSY, _CONDITION = 0x0D, 0x04
_UNKNOWN = (0x02, 0x03, 0x0B, 0x0C)  # codes of sFA: method, variable or command
_REPLIES = {b"sRN": b"sRA", b"sWN": b"sWA", b"sMN": b"sAN", b"sEN": b"sEA"}


class RefusedError(DeviceError):
    """The sensor answered sFA."""

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code  # see `cola.ERRORS`

    @property
    def unknown(self) -> bool:
        """Whether the sensor does not know the requested name."""
        return self.code in _UNKNOWN

    @property
    def untimely(self) -> bool:
        """Whether its state does not allow the request."""
        return self.code == _CONDITION


class ColaDialogue:
    """Dialogue with one sensor, whose dialect is detected and whose telegrams are stopped first."""

    def __init__(self, address: str) -> None:
        self.line = SensorLine(address, LONGEST)
        self.begin()

    def writer(self, command: str) -> Writer:
        """Begin a request; `command`: command type and name."""
        return Writer(command, binary=self._binary)

    def ask(self, out: Writer) -> Reader:
        """Return the values of the reply; repeats a busy method. An sFA raises RefusedError."""
        request = out.telegram()
        name = request.name.decode()
        deadline_s = time.monotonic() + _REPLY_S
        while True:
            reply = self._reply(request, deadline_s)
            if reply.word != b"sFA":
                return reply.values()
            code = self.checked(name, error_code, reply)
            if code != _BUSY or time.monotonic() > deadline_s:
                raise RefusedError(f"{self.line.name}: {name}: {error_words(code)}", code)
            time.sleep(POLL_S / 2)

    def insist(self, out: Writer, expect: int) -> None:
        """Send a request whose reply must begin with `expect`."""
        name = out.telegram().name.decode()
        got = self.checked(name, self.ask(out).number, "u8")
        if got != expect:
            what = "its password was changed, or this access is switched off" if name == "SetAccessMode" else "refused"
            raise DeviceError(f"{self.line.name}: {name} answered {got}, not {expect}: {what}")

    def checked(self, name: str, decode: Callable[..., T], *arguments: object) -> T:
        """Return `decode(*arguments)`; a ProtocolError gets the names of sensor and request."""
        try:
            return decode(*arguments)
        except ProtocolError as error:
            raise ProtocolError(f"{self.line.name}: {name}: {error}") from error

    def _reply(self, request: Telegram, deadline_s: float) -> Telegram:
        self.line.send(framed(request))
        while True:
            reply: Telegram = self.line.next(deadline_s)[0]
            if reply.binary == request.binary and (
                reply.word == b"sFA" or (reply.word, reply.name) == (_REPLIES[request.word], request.name)
            ):
                return reply

    def begin(self) -> None:
        """Detect the dialect on an opened line; close it if no sensor answers."""
        self.line.split_by(TelegramSplitter())
        with self.line.closed_on_error():
            for self._binary in (True, False):
                try:
                    self.ask(self.writer("sEN LMDscandata").number("u8", 0))
                except DeviceTimeoutError:
                    continue
                self.line.forgive()
                return
            raise DeviceTimeoutError(f"{self.line.address}: no SICK sensor answers; check power, cable and port")
