"""Requests to a SCIP lidar and its replies, at any baud rate and in SCIP 1.1 or 2.0."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from contextlib import suppress

from scanwright.design.errors import DeviceError, DeviceTimeoutError
from scanwright.firmware_io.lidar.byte_stream import FIRST_BAUD
from scanwright.firmware_io.lidar.scip import measurement, protocol
from scanwright.firmware_io.lidar.sensor_line import SensorLine

_REPLY_S = 0.5  # a sensor replies within milliseconds, or after the scan that it is sending
_TRIES = 3  # the first request can be appended to an incomplete one of another client, and is then rejected
_BAUDS = (FIRST_BAUD, 19_200, 57_600, 250_000, 500_000, 750_000)  # SCIP 2.0, p. 4; 19200 after power-up
_FASTER_BAUDS = (250_000, 500_000, 750_000)  # SCIP 2.0, request SS


class ScipDialogue:
    """Dialogue with one sensor, whose laser is switched off first."""

    def __init__(self, address: str) -> None:
        self.line = SensorLine(address, protocol.LONGEST_REPLY)
        self.begin()

    def begin(self) -> None:
        """Switch the laser off on an opened line; close it if no sensor answers."""
        self.line.split_by(protocol.Splitter())
        with self.line.closed_on_error():
            self._quiet()
        self.line.forgive()

    def ask(self, request: bytes, timeout_s: float | None = None) -> protocol.Reply:
        """Return the reply to a request, or raise DeviceTimeoutError."""
        return self.ask_timed(request, timeout_s)[0]

    def ask_timed(self, request: bytes, timeout_s: float | None = None) -> tuple[protocol.Reply, int]:
        """Return the reply to a request and its arrival; drops all replies before it. Raises as `ask`."""
        self.line.send(request + b"\n")
        deadline_s = time.monotonic() + (_REPLY_S if timeout_s is None else timeout_s)
        while True:
            reply, arrival_ns = self.line.next(deadline_s)
            if reply.echo == request and not measurement.is_scan(reply):
                return reply, arrival_ns

    def insist(self, request: bytes, *statuses: str) -> None:
        """Send a request; DeviceError if its status is another."""
        reply = self.ask(request)
        if reply.status not in statuses:
            raise DeviceError(f"{self.line.name}: {reply.echo.decode()}: status {reply.status}: {reply.meaning()}")

    def speed_up(self, bytes_s: float, without_speed: Callable[[], Iterable[str]]) -> None:
        """Raise the baud rate for `bytes_s`, if sensor and adapter support it; not on the ports `without_speed`."""
        port = self.line.serial
        if port is None or self.line.address in without_speed():
            return
        needed, usual = 10 * bytes_s, port.baud
        for baud in _FASTER_BAUDS:
            if needed <= usual or baud < needed:
                continue
            if not port.can(baud) or self.ask(b"SS%06d" % baud).status not in ("00", "03"):
                continue
            port.baud = baud
            with suppress(DeviceTimeoutError):
                self.insist(b"QT", "00")
                return
            port.baud = usual  # the line fails at this rate: the sensor uses one of the two
            with suppress(DeviceTimeoutError):
                self.insist(b"QT", "00")
                continue
            self._quiet()

    def _quiet(self) -> None:
        """Switch the laser off, at any baud rate and in any version of SCIP."""
        port = self.line.serial
        for baud in _BAUDS if port is not None else (0,):
            if port is not None and port.baud != baud:
                port.baud = baud
            for _ in range(_TRIES):
                before = self.line.received
                try:
                    reply = self.ask(b"QT", timeout_s=_REPLY_S / 2)
                except DeviceTimeoutError:
                    if self.line.received == before and baud != _BAUDS[0]:
                        break
                    continue
                if reply.status == "00":
                    if port is not None and baud != FIRST_BAUD:
                        self.insist(b"SS%06d" % FIRST_BAUD, "00", "03", "04")
                        port.baud = FIRST_BAUD
                    return
                # SCIP 1.1 has no QT; a sensor that adjusts its time accepts only TM.
                self.ask(protocol.SCIP_2 if len(reply.status) == 1 else b"TM2")
        raise DeviceTimeoutError(f"{self.line.address}: no SCIP sensor answers; check power, cable and port")
