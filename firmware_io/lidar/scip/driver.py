"""A Hokuyo lidar on a serial port, USB or Ethernet: it scans on, and says what it saw and when that arrived.

with open_scip("/dev/ttyACM0") as lidar:
    lidar.start(intensity=True)
    scan = lidar.read().scan    # its times are the host's
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import replace
from types import TracebackType

from design.errors import DeviceError, DeviceTimeoutError, ProtocolError
from firmware_io.device_ports import lidar_ports
from firmware_io.lidar.byte_stream import FIRST_BAUD, Gone, SerialStream, open_stream
from firmware_io.lidar.device_clock import DeviceClock, Exchange, StampCounter, TimeSync, synchronised
from firmware_io.lidar.lidar import StampAt, TimedScan
from firmware_io.lidar.scip import parameters, protocol
from firmware_io.lidar.scip.raw_scan import RawScan, to_laser_scan

_ANSWER_S = 0.5  # a sensor answers within milliseconds; while it scans, after the scan that it is sending
_SCAN_S = 1.0  # without a scan: ten turns of the slowest sensor
_TRIES = 3  # a first request may be glued to what a client before us left half said
_BAUDS = (FIRST_BAUD, 19_200, 57_600, 250_000, 500_000, 750_000)  # SCIP 2.0, p. 4; 19200 after power-up
_FASTER_BAUDS = (250_000, 500_000, 750_000)
_EXCHANGES = 60
_WRONG_TIMES = ("1.16.02(19/Jan./2010)",)  # this firmware of the UTM-30LX answers TM1 with times 23 ms off its stamps


class ScipLidar:
    """A SCIP lidar, opened, its laser off. `with` leaves it with the laser off and the port closed.

    Attributes:
        address: where it was found last.
        firmware: version, as the sensor writes it.
        serial_number: by which it is found again.
        parameters: steps, ranges, speed.
        sync: its clock against the host's when it was opened or found again; None from one that cannot tell.
        dropped: scans that are missing between those that were read, by their stamps.
    """

    def __init__(
        self, address: str, search: Callable[[], Iterable[str]] = lidar_ports, *, stamp_at: StampAt = "step_0"
    ) -> None:
        """Open it.

        Args:
            address: where it is.
            search: the ports where it may turn up after a re-plug, besides its own address.
            stamp_at: which moment of a turn its stamps mean.

        Raises:
            DeviceError: no such port, it is in use, or what answers is no SCIP sensor.
        """
        self.address = address
        self.dropped = 0
        self._search = search
        self._stamp_at: StampAt = stamp_at
        self._bad_before = 0
        self._splitter = protocol.Splitter()
        self._counter = StampCounter()
        self._request = b""
        self._skip = 0
        self._stamp_ms = -1
        self._waiting: list[tuple[protocol.Reply, int]] = []
        self._connect(address)
        try:
            self.parameters = parameters.parameters(self.information("PP"))
            version = self.information("VV")
            self.serial_number = version.get("SERI", "")
            self.firmware = version.get("FIRM", "")
            self.sync = self._synchronise()
            self._clock = self._new_clock()
        except BaseException:
            self._stream.close()
            raise

    def __enter__(self) -> ScipLidar:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.stop()
        except DeviceError as unsafe:
            if error is None:
                raise
            error.add_note(f"its laser may still be on: {unsafe}")
        finally:
            self._stream.close()

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
        """Replies that were thrown away: wrong sums, cut or merged lines."""
        return self._bad_before + self._splitter.bad

    def information(self, command: str) -> dict[str, str]:
        """Keys and texts of VV (version), PP (parameters) or II (state). While it scans, scans are lost meanwhile."""
        return protocol.information(self._ask(command.encode()))

    def start(self, *, intensity: bool = False, cluster: int = 1, skip: int = 0) -> None:
        """Scan until `stop`; the laser lights by itself.

        Args:
            intensity: measure it too (ME; the URG-04LX cannot).
            cluster: steps that share one value, the least range among them.
            skip: scans to leave out between two.

        Raises:
            DeviceError: the sensor refuses, or is gone.
        """
        window = replace(self.parameters.window, cluster=cluster, intensity=intensity)
        self._speed_up(window.bytes_per_scan / self.parameters.scan_period_s / (skip + 1))
        self._request = protocol.continuous(window, skip=skip)
        self._skip = skip
        self._stamp_ms = -1
        self._accepted(self._ask(self._request), "00")

    def read(self, timeout_s: float | None = None) -> TimedScan:
        """The next scan on the host's clock; it is waited for for a second if nothing else is said.

        Raises:
            DeviceTimeoutError: none came in time: switched off, or reset; `reconnect` helps where it is back.
            DeviceError: it was unplugged, or reports a fault.
        """
        raw = self.read_raw(timeout_s)
        moment = self._clock.update(raw.stamp_ms, raw.arrival_ns, raw.restarts)
        scan = to_laser_scan(raw, self.parameters, moment.time_ns)
        return TimedScan(scan, raw.arrival_ns, moment.uncertainty_ns)

    def read_raw(self, timeout_s: float | None = None) -> RawScan:
        """The next scan as the sensor sent it; raises as `read` does, whose clock it passes by."""
        deadline = time.monotonic() + (_SCAN_S if timeout_s is None else timeout_s)
        while True:
            told, arrival_ns = self._next(deadline)
            if told.echo[:-2] != self._request[:-2] or told.status == "00":
                continue
            if told.status.isdigit() and 50 <= int(told.status) <= 97:
                raise DeviceError(f"{self._name()}: status {told.status}: {told.told()}")
            if protocol.is_scan(told):
                try:
                    return self._raw(protocol.measurement(told), arrival_ns)
                except ProtocolError:
                    self._bad_before += 1

    def stop(self) -> None:
        """Laser off; a scan that was on its way is dropped.

        Raises:
            DeviceError: the sensor is gone.
        """
        self._request = b""
        self._accepted(self._ask(b"QT"), "00")

    def reconnect(self, timeout_s: float = 3.0) -> None:
        """Find the sensor again by its serial number, after an unplug or a reset, and scan on if it did.

        Raises:
            DeviceError: it did not turn up in time.
        """
        request = self._request
        self._stream.close()
        deadline = time.monotonic() + timeout_s
        while True:
            for address in dict.fromkeys([self.address, *self._search()]):
                try:
                    self._connect(address)
                    if self.information("VV").get("SERI") == self.serial_number:
                        self.address = address
                        self._counter.restart()  # a sensor that takes its power from the port has begun anew
                        self.sync = self._synchronise()
                        self._clock = self._new_clock()
                        self._request = request
                        if request:
                            self._stamp_ms = -1
                            self._accepted(self._ask(request), "00")
                        return
                    self._stream.close()
                except DeviceError:
                    self._stream.close()
            if time.monotonic() > deadline:
                raise DeviceError(
                    f"{self.address}: lidar {self.serial_number} did not come back in {timeout_s:.1f} s; check its plug"
                )
            time.sleep(0.05)

    def _connect(self, address: str) -> None:
        """Open the port, whatever the sensor is doing, and put the laser out."""
        self._bad_before = self.bad_packets
        self._splitter = protocol.Splitter()
        self._stream = open_stream(address)
        try:
            self._quiet(address)
            self._splitter.bad = 0  # what was on its way when we came is nobody's fault
        except BaseException:
            self._stream.close()
            raise

    def _quiet(self, address: str) -> None:
        """Stop whatever it does, at whatever speed and in whatever version of SCIP it listens."""
        bauds = _BAUDS if isinstance(self._stream, SerialStream) else (0,)
        for baud in bauds:
            if isinstance(self._stream, SerialStream) and self._stream.baud != baud:
                self._stream.baud = baud
            for _ in range(_TRIES):
                try:
                    told = self._ask(b"QT", timeout_s=_ANSWER_S / 2)
                except DeviceTimeoutError:
                    continue
                if told.status == "00":
                    if baud not in (0, FIRST_BAUD) and isinstance(self._stream, SerialStream):
                        self._accepted(self._ask(b"SS%06d" % FIRST_BAUD), "00", "03", "04")
                        self._stream.baud = FIRST_BAUD
                    return
                # SCIP 1.1 knows no QT; a sensor that is adjusting its time knows nothing but TM.
                self._ask(protocol.SCIP_2 if len(told.status) == 1 else b"TM2")
        raise DeviceTimeoutError(f"{address}: no SCIP sensor answers; check power, cable and port")

    def _speed_up(self, bytes_s: float) -> None:
        """Let a sensor on a real serial line talk fast enough for its scans, where sensor and adapter can."""
        if not isinstance(self._stream, SerialStream) or self.address in self._search():  # its own USB has no speed
            return
        needed, usual = 10 * bytes_s, self._stream.baud
        for baud in _FASTER_BAUDS:
            if needed <= usual or baud < needed:
                continue
            if not self._stream.can(baud) or self._ask(b"SS%06d" % baud).status not in ("00", "03"):
                continue
            self._stream.baud = baud
            with suppress(DeviceTimeoutError):
                self._accepted(self._ask(b"QT"), "00")
                return
            self._stream.baud = usual  # the line is not good for it: the sensor is at one of the two
            with suppress(DeviceTimeoutError):
                self._accepted(self._ask(b"QT"), "00")
                continue
            self._quiet(self.address)

    def _synchronise(self) -> TimeSync | None:
        """Compare the clocks by questions and answers. It puts the laser out, so it comes before all scans."""
        if self.firmware in _WRONG_TIMES or self._ask(b"TM0").status not in ("00", "02"):
            return None
        try:
            exchanges = []
            for _ in range(_EXCHANGES):
                asked_ns = time.monotonic_ns()
                told, answered_ns = self._ask_timed(b"TM1")
                stamp_ms = self._counter.unwrap(protocol.stamp(told), answered_ns)
                exchanges.append(Exchange(asked_ns, stamp_ms, answered_ns))
        finally:
            self._accepted(self._ask(b"TM2"), "00", "03")
        return synchronised(exchanges)

    def _new_clock(self) -> DeviceClock:
        """A fresh clock, which gives the times of the first beams.

        Nothing can arrive earlier than the end of the last step; a real serial line takes longer by its bytes' time,
        which nobody declares here: all times are late by it.
        """

        def since_stamp_ns(step: int) -> int:
            return round(self.parameters.since_stamp_s(step, self._stamp_at) * 1e9)

        clock = DeviceClock(
            self.parameters.scan_period_s,
            smallest_delay_ns=since_stamp_ns(self.parameters.last_step + 1),
            first_beam_ns=since_stamp_ns(self.parameters.first_step),
        )
        if self.sync is not None:
            clock.synchronise(self.sync)
        return clock

    def _raw(self, taken: protocol.Measurement, arrival_ns: int) -> RawScan:
        range_m, codes = parameters.ranges_m(taken.value, self.parameters)
        stamp_ms = self._counter.unwrap(taken.stamp_ms, arrival_ns)
        if 0 <= self._stamp_ms < stamp_ms:
            period_ms = self.parameters.scan_period_s * 1e3 * (self._skip + 1)
            self.dropped += max(round((stamp_ms - self._stamp_ms) / period_ms) - 1, 0)
        self._stamp_ms = stamp_ms
        return RawScan(
            stamp_ms=stamp_ms,
            restarts=self._counter.restarts,
            arrival_ns=arrival_ns,
            first_step=taken.window.first_step,
            cluster=taken.window.cluster,
            range_m=range_m,
            intensity=taken.intensity.astype("float32"),
            codes=codes,
        )

    def _ask(self, request: bytes, timeout_s: float | None = None) -> protocol.Reply:
        return self._ask_timed(request, timeout_s)[0]

    def _ask_timed(self, request: bytes, timeout_s: float | None = None) -> tuple[protocol.Reply, int]:
        """The reply to a request and when it came; what comes before it is older and dropped."""
        self._waiting.clear()
        with Gone(self._name()):
            self._stream.write(request + b"\n")
        deadline = time.monotonic() + (_ANSWER_S if timeout_s is None else timeout_s)
        while True:
            told, arrival_ns = self._next(deadline)
            if told.echo == request and not protocol.is_scan(told):
                return told, arrival_ns

    def _next(self, deadline: float) -> tuple[protocol.Reply, int]:
        late_bytes = 0
        while not self._waiting:
            over = time.monotonic() > deadline  # told before the look: what came while we were kept waiting counts
            with Gone(self._name()):
                received = self._stream.read(deadline - time.monotonic())
            arrival_ns = time.monotonic_ns()
            self._waiting += [(told, arrival_ns) for told in self._splitter.feed(received)]
            late_bytes += len(received) if over else 0
            if over and not self._waiting and (not received or late_bytes > protocol.LONGEST_REPLY):
                raise DeviceTimeoutError(f"{self._name()}: nothing came in time; check power and cable")
        return self._waiting.pop(0)

    def _accepted(self, told: protocol.Reply, *statuses: str) -> None:
        if told.status not in statuses:
            raise DeviceError(f"{self._name()}: {told.echo.decode()}: status {told.status}: {told.told()}")

    def _name(self) -> str:
        return f"{self.address}: lidar"


def open_scip(address: str, _model: str | None = None, stamp_at: StampAt = "step_0") -> ScipLidar:
    """Open "/dev/ttyACM0" or "192.168.0.10:10940", whatever the sensor is doing; it says itself which model it is.

    Raises:
        DeviceError: no such port, it is in use, or what answers is no SCIP sensor.
    """
    return ScipLidar(address, stamp_at=stamp_at)
