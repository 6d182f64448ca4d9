"""Hokuyo lidar on a serial port, USB or Ethernet.

with ScipLidar("/dev/ttyACM0") as lidar:
    lidar.start(intensity=True)
    scan = lidar.read().scan
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import replace

from scanwright.design.errors import DeviceError, DeviceTimeoutError, ProtocolError
from scanwright.firmware_io.device_ports import lidar_ports
from scanwright.firmware_io.lidar.device_clock import DeviceClock, Exchange, StampCounter, TimeSync, synchronised
from scanwright.firmware_io.lidar.lidar import StampAt, TimedScan
from scanwright.firmware_io.lidar.scip import measurement, parameters, protocol
from scanwright.firmware_io.lidar.scip.dialogue import ScipDialogue
from scanwright.firmware_io.lidar.sensor_line import LineDriver
from scanwright.firmware_io.samples import Scan

_EXCHANGES = 60  # about a second
# states without a fault, from captures and from firmware of the EW and UST
_NORMAL = ("sensor works well", "stable 000 no error", "sensor is working normally")
_WRONG_TIMES = ("1.16.02(19/Jan./2010)",)  # this firmware of the UTM-30LX replies to TM1 23 ms off its stamps


class ScipLidar(LineDriver):
    """A SCIP lidar; `sync` is its clock's offset at the last connection, None without time replies."""

    _clusters = True

    def __init__(
        self,
        address: str,
        _model: str | None = None,
        stamp_at: StampAt | None = None,
        *,
        search: Callable[[], Iterable[str]] = lidar_ports,
    ) -> None:
        """Open it; raises as `open_lidar`.

        Args:
            address: serial port, or HOST:PORT.
            stamp_at: step of its timestamps.
            search: returns further ports to search after an unplug.
        """
        self.address = address
        self.dropped = 0  # missing scans between those read, by their stamps
        self._search = search
        self._stamp_at = stamp_at
        self._counter = StampCounter()
        self._request = b""
        self._stamp_ms = -1
        self._dialogue = ScipDialogue(address)
        self._line = self._dialogue.line
        with self._line.closed_on_error():
            self.parameters = parameters.parameters(self.information("PP"))
            version = self.information("VV")
            self.serial_number, self.firmware = version.get("SERI", ""), version.get("FIRM", "")
            self._begin_clock()

    @property
    def model(self) -> str:
        """Reported model."""
        return self.parameters.model

    @property
    def scan_rate_hz(self) -> float:
        """Reported turns per second."""
        return 1 / self.parameters.scan_period_s

    def information(self, command: str) -> dict[str, str]:
        """Return keys and texts of VV (version), PP (parameters) or II (state); drops scans meanwhile."""
        return protocol.information(self._dialogue.ask(command.encode()))

    def condition(self) -> tuple[str, ...]:
        """Return its state if that is normal (STAT of II); other states are warnings of its scans."""
        status = self.information("II").get("STAT", "")
        return (f"status: {status}",) if _is_normal(status) else ()

    def _begin(self, intensity: bool, skip: int) -> None:
        window = replace(self.parameters.window, cluster=self._cluster, intensity=intensity)
        bytes_s = window.bytes_per_scan / self.parameters.scan_period_s / (skip + 1)
        self._dialogue.speed_up(bytes_s, without_speed=self._search)
        self._request = measurement.continuous(window, skip=skip)
        self._period_ms = self.parameters.scan_period_s * 1e3 * (skip + 1)
        self._stamp_ms = -1
        status = self.information("II").get("STAT", "")
        self._warning = f"status: {status}; switch it off and on" if status and not _is_normal(status) else ""
        self._dialogue.insist(self._request, "00")

    def _turn(self, deadline_s: float) -> TimedScan:
        while True:
            reply, arrival_ns = self._line.next(deadline_s)
            if reply.echo[:-2] != self._request[:-2] or reply.status == "00":
                continue
            if reply.status.isdigit() and 50 <= int(reply.status) <= 97:
                raise DeviceError(f"{self._line.name}: status {reply.status}: {reply.meaning()}")
            if measurement.is_scan(reply):
                try:
                    return self._timed(measurement.measurement(reply), arrival_ns)
                except ProtocolError:
                    self._bad_contents += 1

    def _halt(self) -> None:
        """Switch the laser off."""
        self._request = b""
        try:
            self._dialogue.insist(b"QT", "00")
        except DeviceTimeoutError:  # the reply may have been merged with noise
            self._dialogue.insist(b"QT", "00")

    def _find(self) -> None:
        """Search all ports for its serial number."""
        errors = []
        for address in dict.fromkeys([self.address, *self._search()]):
            try:
                self._line.reopen(address)
                self._dialogue.begin()
                with self._line.closed_on_error():
                    if self.information("VV").get("SERI") != self.serial_number:
                        raise DeviceError(f"{address}: another lidar answers")
                    self._counter.restart()  # a sensor powered by the port has restarted
                    self._begin_clock()
                self.address = address
                return
            except DeviceError as error:
                errors.append(error)
        raise errors[0]

    def _synchronise(self) -> TimeSync | None:
        """Compare the clocks by requests; this switches the laser off."""
        if self.firmware in _WRONG_TIMES or self._dialogue.ask(b"TM0").status not in ("00", "02"):
            return None
        try:
            exchanges = []
            for _ in range(_EXCHANGES):
                sent_ns = time.monotonic_ns()
                reply, arrival_ns = self._dialogue.ask_timed(b"TM1")
                stamp_ms = self._counter.unwrap(measurement.stamp(reply), arrival_ns)
                exchanges.append(Exchange(sent_ns, stamp_ms, arrival_ns))
        finally:
            self._dialogue.insist(b"TM2", "00", "03")
        return synchronised(exchanges)

    def _begin_clock(self) -> None:
        """Compare the clocks and start a new one.

        Nothing arrives before the end of the last step. On a serial line all times are late by its bytes' duration.
        """

        def since_stamp_ns(step: int) -> int:
            return round(self.parameters.since_stamp_s(step, self._stamp_at) * 1e9)

        self.sync = self._synchronise()
        self._clock = DeviceClock(
            self.parameters.scan_period_s,
            smallest_delay_ns=since_stamp_ns(self.parameters.last_step + 1),
            first_beam_ns=since_stamp_ns(self.parameters.first_step),
        )
        if self.sync is not None:
            self._clock.synchronise(self.sync)

    def _timed(self, measured: measurement.Measurement, arrival_ns: int) -> TimedScan:
        stamp_ms = self._counter.unwrap(measured.stamp_ms, arrival_ns)
        if 0 <= self._stamp_ms < stamp_ms:
            self.dropped += max(round((stamp_ms - self._stamp_ms) / self._period_ms) - 1, 0)
        self._stamp_ms = stamp_ms
        moment = self._clock.update(stamp_ms, arrival_ns, self._counter.restarts)
        of, cluster = self.parameters, measured.window.cluster
        middle = (cluster - 1) / 2
        scan = Scan(
            stamp_ns=moment.time_ns + round(middle * of.step_s * 1e9),
            angle_min_rad=(measured.window.first_step + middle - of.front_step) * of.step_rad,
            angle_increment_rad=cluster * of.step_rad,
            time_increment_s=cluster * of.step_s,
            scan_time_s=of.scan_period_s,
            range_min_m=of.range_min_mm / 1e3,
            range_max_m=of.range_max_mm / 1e3,
            range_m=parameters.ranges_m(measured.value, of),
            intensity=measured.intensity.astype("float32"),
        )
        return TimedScan(scan, arrival_ns, moment.uncertainty_ns)


def _is_normal(status: str) -> bool:
    return status.rstrip(". ").lower() in _NORMAL
