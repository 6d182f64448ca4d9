"""RPLIDAR on its serial line.

Its streams have no timestamps: points are evenly spaced, and their count is the clock.
"""

from __future__ import annotations

import struct
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import DeviceError, DeviceFaultError, DeviceTimeoutError
from scanwright.firmware_io.lidar.lidar import StampAt, TimedScan
from scanwright.firmware_io.lidar.sensor_line import TURN_S, LineDriver
from scanwright.firmware_io.lidar.slamtec import protocol
from scanwright.firmware_io.lidar.slamtec.dialogue import SlamtecDialogue, typical_mode
from scanwright.firmware_io.lidar.slamtec.point_count import PointCount
from scanwright.firmware_io.lidar.turn import TurnQueue, timed_scan


@dataclass(frozen=True, slots=True)
class Series:
    """One series."""

    models: tuple[str, ...]  # catalogue names, first that of a sensor whose model is not named
    bauds: tuple[int, ...]  # A2M8: 115,200
    motor: Literal["dtr", "pwm", "rpm", "scan"]  # signal or request that starts the motor


# by the upper half of the model byte (rplidar_sdk 2.1)
SERIES = {
    1: Series(("RPLIDAR A1",), (115_200,), "dtr"),
    2: Series(("RPLIDAR A2",), (256_000, 115_200), "pwm"),
    3: Series(("RPLIDAR A3",), (256_000,), "pwm"),
    4: Series(("RPLIDAR C1",), (460_800,), "scan"),
    6: Series(("RPLIDAR S1",), (256_000,), "rpm"),
    7: Series(("RPLIDAR S2", "RPLIDAR S2L"), (1_000_000,), "rpm"),
    8: Series(("RPLIDAR S3",), (1_000_000, 460_800), "rpm"),  # 460,800: model 0x82
}


_START_S = 3.0  # longest wait for the first turn while the motor starts
_TRIES = 3  # the first reply can be lost in the stream
_SILENCE_NS = 500_000_000  # five turns: it may have restarted
_PAUSE_S = 0.1  # pause of the reader, shorter than a turn, so that angles show the lost points
_BUFFER_BYTES = 4095  # of a terminal (Linux, n_tty.c): nothing is lost before it is full
_PWM = 660  # the SDK's default
_RPM = 600  # the SDK's default


class SlamtecLidar(LineDriver):
    """An RPLIDAR."""

    def __init__(self, address: str, model: str | None = None, _stamp_at: StampAt | None = None) -> None:
        """Open it and stop its stream; `model`: catalogue name, or None for any."""
        self.address = address
        self._turns = TurnQueue()
        self._turning = False
        self._pause_s = _PAUSE_S
        self._dialogue = SlamtecDialogue(address)
        self._line = self._dialogue.line
        self._recognise(model)

    @property
    def dropped(self) -> int:
        """Missing turns between those read."""
        return self._turns.dropped

    def _begin(self, intensity: bool, skip: int) -> None:
        status, code = self._dialogue.ask(protocol.HEALTH, 6, protocol.health)
        if status == 2:
            raise DeviceFaultError(f"{self._line.name}: it reports fault {code:#06x}; switch it off and on")
        self._warning = f"health warning {code:#06x}; it still scans" if status else ""
        self._intensity = intensity
        self._mode = typical_mode(self._dialogue)
        self._turn_motor(on=True)
        mode = struct.pack("<BHH", self._mode.number, 0, 0)
        command = protocol.SCAN if self._mode.kind == protocol.NODES else protocol.EXPRESS_SCAN
        self._dialogue.request(command, mode)
        answer, _ = self._dialogue.reply()
        if not answer.stream or answer.kind != self._mode.kind:
            raise DeviceError(f"{self._line.name}: it sends packets of type {answer.kind:#x}, not {self._mode.kind:#x}")
        byte_ns = self._mode.point_ns * protocol.POINTS[answer.kind] / protocol.SIZES[answer.kind]
        self._pause_s = max(_PAUSE_S, _BUFFER_BYTES * byte_ns / 1e9)
        self._turning = False
        self._line.split_by(protocol.SlamtecSplitter(self._mode.kind))
        self._turns.restart(skip)
        self._line.drop_waiting()
        self._resume()

    def _patience_s(self) -> float:
        return TURN_S if self._turning else _START_S

    def _turn(self, deadline_s: float) -> TimedScan | None:
        while (turn := self._turns.next(self._count.arrivals)) is None:
            received, arrival_ns = self._line.receive(deadline_s, self._pause_s)
            if not received:
                self._resume()
                return None
            self._add(received, arrival_ns)
        self._turning = True
        arrivals = self._count.arrivals
        uncertainty_ns = self._line.widened(arrivals.uncertainty_ns)
        return timed_scan(turn[0], arrivals, self._lidar, turn[1], uncertainty_ns, intensity=self._intensity)

    def _halt(self) -> None:
        """Switch off laser and motor."""
        self._dialogue.request(protocol.STOP)
        self._turn_motor(on=False)

    def _find(self) -> None:
        self._line.reopen()
        self._recognise(self.model)

    def _recognise(self, model: str | None) -> None:
        """Stop its stream and identify it; close the line if nothing replies."""
        with self._line.closed_on_error():
            possible = [series for series in SERIES.values() if model is None or model in series.models]
            bauds = list(dict.fromkeys(baud for series in possible for baud in series.bauds))
            bauds = bauds if self._line.serial is not None else bauds[:1]  # a serial server sets its own baud rate
            for baud in bauds:
                if self._line.serial is not None:
                    self._line.serial.baud = baud
                for _ in range(_TRIES):
                    before = self._line.received
                    with suppress(DeviceTimeoutError):
                        self._dialogue.request(protocol.STOP)
                        self._line.drop_waiting()
                        info = self._dialogue.ask(protocol.INFO, 4, protocol.info)
                        self._accept(info, model)
                        self._baud = baud
                        return
                    if self._line.received == before and len(bauds) > 1:
                        break
            raise DeviceTimeoutError(f"{self.address}: no RPLIDAR answers; check power, cable and port")

    def _accept(self, info: protocol.Info, model: str | None) -> None:
        series = SERIES.get(info.model >> 4)
        if series is None or (model is not None and model not in series.models):
            other = f"model {info.model:#04x} of Slamtec" if series is None else " or ".join(series.models)
            raise DeviceError(f"{self._line.name}: this is a {other}, {f'not a {model}' if model else 'not supported'}")
        if self.serial_number not in ("", info.serial_number):
            raise DeviceError(f"{self._line.name}: this is {info.serial_number}, not {self.serial_number}")
        self._motor = series.motor
        self._lidar = load_catalogue().get(model or series.models[0], Lidar)
        self.serial_number, self.firmware = info.serial_number, info.firmware

    def _turn_motor(self, *, on: bool) -> None:
        if self._motor == "dtr" and self._line.serial is not None:
            self._line.serial.set_dtr(not on)
        elif self._motor == "pwm":
            self._dialogue.request(protocol.MOTOR_PWM, struct.pack("<H", _PWM if on else 0))
        elif self._motor == "rpm":
            self._dialogue.request(protocol.MOTOR_RPM, struct.pack("<H", _RPM if on else 0))

    def _resume(self) -> None:
        """Start a new count and a new turn at the next packet."""
        self._turns.resume()
        self._count = PointCount(self._mode.kind, self._mode.point_ns, self._baud)
        self._last_ns = 0

    def _add(self, received: list[tuple[protocol.SlamtecPacket, int]], arrival_ns: int) -> None:
        silent = self._last_ns and arrival_ns - self._last_ns > _SILENCE_NS
        self._last_ns = arrival_ns
        for points in [] if silent else self._count.placed(received, arrival_ns):
            self._turns.add(points, arrival_ns)
        if silent or self._count.broken:
            self._line.drop_waiting()
            self._resume()
