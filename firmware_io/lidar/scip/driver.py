"""Hokuyo lidar on a serial port, USB or Ethernet.

with ScipLidar("/dev/ttyACM0") as lidar:
    lidar.start(intensity=True)
    scan = lidar.read().scan    # on the host's clock
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
from scanwright.firmware_io.lidar.scip.raw_scan import RawScan, to_laser_scan
from scanwright.firmware_io.lidar.sensor_line import TURN_S, LineDriver

_EXCHANGES = 60  # a second or so of them
# of its captures, and of firmware of the EW and UST; what else a sensor says of its state is trouble
_WELL = ("sensor works well", "stable 000 no error", "sensor is working normally")
_WRONG_TIMES = ("1.16.02(19/Jan./2010)",)  # this firmware of the UTM-30LX answers TM1 with times 23 ms off its stamps


class ScipLidar(LineDriver):
    """A SCIP lidar.

    Attributes:
        sync: its clock against the host's when it was opened or found again; None from one that cannot tell.
    """

    _clusters = True

    def __init__(
        self,
        address: str,
        _model: str | None = None,
        stamp_at: StampAt | None = None,
        *,
        search: Callable[[], Iterable[str]] = lidar_ports,
    ) -> None:
        """Open it; it says itself which model it is. Raises as `open_lidar`.

        Args:
            address: where it is.
            stamp_at: which moment of a turn its stamps mean.
            search: the ports where it may turn up after a re-plug, besides its own address.
        """
        self.address = address
        self.dropped = 0  # missing scans between those read, by their stamps
        self._search = search
        self._stamp_at = stamp_at
        self._bad_scans = 0
        self._counter = StampCounter()
        self._request = b""
        self._stamp_ms = -1
        self._dialogue = ScipDialogue(address)
        self._line = self._dialogue.line
        with self._line.closed_on_error():
            self.parameters = parameters.parameters(self.information("PP"))  # steps, ranges, speed
            version = self.information("VV")
            self.serial_number, self.firmware = version.get("SERI", ""), version.get("FIRM", "")
            self._begin_clock()

    @property
    def model(self) -> str:
        """Name of its type."""
        return self.parameters.model

    @property
    def scan_rate_hz(self) -> float:
        """Turns per second, as it says."""
        return 1 / self.parameters.scan_period_s

    @property
    def bad_packets(self) -> int:
        """Replies dropped: wrong sums, cut or merged lines."""
        return self._bad_scans + self._dialogue.bad

    def information(self, command: str) -> dict[str, str]:
        """Keys and texts of VV (version), PP (parameters) or II (state). While it scans, scans are lost meanwhile."""
        return protocol.information(self._dialogue.ask(command.encode()))

    def condition(self) -> tuple[str, ...]:
        """What it says of its state where that is well (STAT of II); trouble comes with its scans."""
        status = self.information("II").get("STAT", "")
        return (f"status: {status}",) if _is_well(status) else ()

    def read_raw(self, timeout_s: float | None = None) -> RawScan:
        """The next scan as the sensor sent it; raises as `read` does, whose clock it passes by."""
        deadline_s = time.monotonic() + (TURN_S if timeout_s is None else timeout_s)
        return self._raw_by(deadline_s)

    def _begin(self, intensity: bool, skip: int) -> None:
        window = replace(self.parameters.window, cluster=self._cluster, intensity=intensity)
        bytes_s = window.bytes_per_scan / self.parameters.scan_period_s / (skip + 1)
        self._dialogue.speed_up(bytes_s, without_speed=self._search)
        self._request = measurement.continuous(window, skip=skip)
        self._period_ms = self.parameters.scan_period_s * 1e3 * (skip + 1)
        self._stamp_ms = -1
        status = self.information("II").get("STAT", "")
        self._warning = f"status: {status}; switch it off and on" if status and not _is_well(status) else ""
        self._dialogue.insist(self._request, "00")

    def _turn(self, deadline_s: float) -> TimedScan:
        raw = self._raw_by(deadline_s)
        moment = self._clock.update(raw.stamp_ms, raw.arrival_ns, raw.restarts)
        return TimedScan(to_laser_scan(raw, self.parameters, moment.time_ns), raw.arrival_ns, moment.uncertainty_ns)

    def _raw_by(self, deadline_s: float) -> RawScan:
        while True:
            reply, arrival_ns = self._dialogue.next(deadline_s)
            if reply.echo[:-2] != self._request[:-2] or reply.status == "00":
                continue
            if reply.status.isdigit() and 50 <= int(reply.status) <= 97:
                raise DeviceError(f"{self._line.name}: status {reply.status}: {reply.meaning()}")
            if measurement.is_scan(reply):
                try:
                    return self._raw(measurement.measurement(reply), arrival_ns)
                except ProtocolError:
                    self._bad_scans += 1

    def _halt(self) -> None:
        """Put the laser out; a scan that was on its way is dropped."""
        self._request = b""
        try:
            self._dialogue.insist(b"QT", "00")
        except DeviceTimeoutError:  # the answer may have been glued to noise
            self._dialogue.insist(b"QT", "00")

    def _find(self) -> None:
        """Look for this very sensor at every port, by its serial number."""
        errors = []
        for address in dict.fromkeys([self.address, *self._search()]):
            try:
                self._dialogue.reopen(address)
                with self._line.closed_on_error():
                    if self.information("VV").get("SERI") != self.serial_number:
                        raise DeviceError(f"{address}: another lidar answers")
                    self._counter.restart()  # a sensor that takes its power from the port has begun anew
                    self._begin_clock()
                self.address = address
                return
            except DeviceError as error:
                errors.append(error)
        raise errors[0]

    def _synchronise(self) -> TimeSync | None:
        """Compare the clocks by questions and answers. It puts the laser out, so it comes before all scans."""
        if self.firmware in _WRONG_TIMES or self._dialogue.ask(b"TM0").status not in ("00", "02"):
            return None
        try:
            exchanges = []
            for _ in range(_EXCHANGES):
                sent_ns = time.monotonic_ns()
                reply, answered_ns = self._dialogue.ask_timed(b"TM1")
                stamp_ms = self._counter.unwrap(measurement.stamp(reply), answered_ns)
                exchanges.append(Exchange(sent_ns, stamp_ms, answered_ns))
        finally:
            self._dialogue.insist(b"TM2", "00", "03")
        return synchronised(exchanges)

    def _begin_clock(self) -> None:
        """Compare the clocks and start a new one for the times of the first beams.

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

    def _raw(self, measured: measurement.Measurement, arrival_ns: int) -> RawScan:
        stamp_ms = self._counter.unwrap(measured.stamp_ms, arrival_ns)
        if 0 <= self._stamp_ms < stamp_ms:
            self.dropped += max(round((stamp_ms - self._stamp_ms) / self._period_ms) - 1, 0)
        self._stamp_ms = stamp_ms
        return RawScan(
            stamp_ms=stamp_ms,
            restarts=self._counter.restarts,
            arrival_ns=arrival_ns,
            first_step=measured.window.first_step,
            cluster=measured.window.cluster,
            range_m=parameters.ranges_m(measured.value, self.parameters),
            intensity=measured.intensity.astype("float32"),
        )


def _is_well(status: str) -> bool:
    return status.rstrip(". ").lower() in _WELL
