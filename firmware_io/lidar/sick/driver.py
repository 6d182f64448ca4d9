"""SICK TiM5xx, TiM7xx, LMS1xx or LMS5xx over TCP in CoLa A or B. Not tested on a sensor."""

from __future__ import annotations

import time

import numpy as np

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import DeviceError, DeviceFaultError, DeviceTimeoutError, ProtocolError
from scanwright.firmware_io.lidar.arrival_line import QUARTZ_RATE, ArrivalLine
from scanwright.firmware_io.lidar.device_clock import TICK_NS, StampCounter
from scanwright.firmware_io.lidar.lidar import Echo, StampAt, TimedScan
from scanwright.firmware_io.lidar.sensor_line import LineDriver
from scanwright.firmware_io.lidar.sick.dialogue import POLL_S, ColaDialogue, RefusedError
from scanwright.firmware_io.lidar.sick.scan_data import DIRT, DIRT_WARNING, FAULT, WRAP_US, ScanData, scan_data
from scanwright.firmware_io.lidar.sick.values import Kind
from scanwright.firmware_io.samples import Scan

_READY_S = 30.0  # the motor needs ten seconds to start
_CLIENT, _PASSWORD = 3, 0xF4724744  # factory setting
_ECHOES = {0: "first echo", 1: "all echoes", 2: "last echo"}  # of FREchoFilter; telegram listing 8014631
SICK_STAMPS: tuple[StampAt, ...] = ("first_beam", "last_beam")
_STLMS_READY = 7  # state of STlms; telegram listing 8014631


class SickLidar(LineDriver):
    """A SICK lidar."""

    def __init__(self, address: str, model: str | None = None, stamp_at: StampAt | None = None) -> None:
        """Open it.

        Args:
            address: HOST:PORT.
            model: catalogue name; None for the reported one.
            stamp_at: beam of its scan time. None decides by its telegrams: the first beam, unless one was sent sooner
                after its scan time than the duration of a scan. Captures: LMS100 23 ms and LMS511 41 ms, longer than
                their scans (15 and 21 ms); TiM55x 3.8 ms, TiM56x 4.9 and 5.1 ms, shorter (50 ms).
        """
        self.address = address
        self.dropped = 0  # missing telegrams between those read, by their counter
        self._stamp_at: StampAt | None = stamp_at
        self._stamps_last = stamp_at == "last_beam"
        self._measuring = False
        self._requested_echo: int | None = None
        self._mean_filter_off = False
        self._stamps = StampCounter(WRAP_US, per_ms=1000)
        self._dialogue = ColaDialogue(address)
        self._line = self._dialogue.line
        with self._line.closed_on_error():
            reply = self._dialogue.ask(self._dialogue.writer("sRN DeviceIdent"))
            identity = [self._dialogue.checked("DeviceIdent", reply.text).strip() for _ in range(2)]  # name, version
            known = [lidar.name for lidar in load_catalogue() if isinstance(lidar, Lidar) and lidar.family == "sick"]
            if model is None and identity[0] not in known:
                raise DeviceError(
                    f"{self._line.name}: it reports type '{identity[0]}', which is ambiguous: name its model; "
                    f"known: {', '.join(sorted(known))}"
                )
            self.firmware = identity[1]
            self.serial_number = self._serial_number()
        self._lidar = load_catalogue().get(model or identity[0], Lidar)
        self._reset()

    def condition(self) -> tuple[str, ...]:
        """Return the reported operating hours, number of starts and filters."""
        lines = [f"it has run for {hours / 10:,.1f} h" for hours in self._values("ODoprh", "u32")]
        lines += [f"it was switched on {starts:,} times" for starts in self._values("ODpwrc", "u32")]
        lines += [f"echo filter: {_ECHOES.get(echo, echo)}" for echo in self._values("FREchoFilter", "u8")]
        averaged = self._averaged_scans()
        means = {None: [], 0: ["mean filter: off"]}
        return (*lines, *means.get(averaged, [f"mean filter: {averaged} scans"]))

    def set_filters(self, echo: Echo | None, *, mean_filter_off: bool) -> None:
        """Set filters at the next start, which fails if the sensor has none."""
        self._requested_echo = None if echo is None else {"first": 0, "last": 2}[echo]
        self._mean_filter_off = mean_filter_off

    def _begin(self, intensity: bool, skip: int) -> None:
        """Start at the rate and resolution of the catalogue."""
        self._login()
        set_rate(self._dialogue, self._lidar)
        if self._requested_echo is not None:
            self._dialogue.ask(self._dialogue.writer("sWN FREchoFilter").number("u8", self._requested_echo))
        if self._mean_filter_off:
            off = self._dialogue.writer("sWN LFPmeanfilter").number("u8", 0).number("u16", 2).number("u8", 0)
            self._dialogue.ask(off)
        averaged = self._averaged_scans()
        smeared = f"its mean filter averages {averaged} scans, which smears a turning scan: use --mean-filter-off"
        self._warning = smeared if averaged else ""
        # channels, intensity, its resolution, unit, encoders, position, name, comment, time of day
        content = self._dialogue.writer("sWN LMDscandatacfg").numbers("u8", [1, 0, intensity, 1, 0, 0, 0, 0, 0, 0, 0])
        self._dialogue.ask(content.number("u16", skip + 1))
        self._measuring = True
        self._dialogue.insist(self._dialogue.writer("sMN LMCstartmeas"), 0)
        # An LMS5xx gets ready after this request, and replies 0 (8013796/ZM63, p. 34); the others reply 1.
        self._dialogue.ask(self._dialogue.writer("sMN Run"))
        self._wait_until_ready(min(_READY_S, max(self._until_s - time.monotonic(), 0.0)))
        self._reset()
        self._dialogue.ask(self._dialogue.writer("sEN LMDscandata").number("u8", 1))
        self._every = skip + 1

    def _turn(self, deadline_s: float) -> TimedScan:
        while True:
            reply, arrival_ns = self._line.next(deadline_s)
            if (reply.word, reply.name) != (b"sSN", b"LMDscandata"):
                continue
            try:
                return self._timed(scan_data(reply), arrival_ns)
            except ProtocolError:
                self._bad_contents += 1

    def _halt(self) -> None:
        """Stop the telegrams, and the laser if `start` switched it on and it can be switched off."""
        self._dialogue.ask(self._dialogue.writer("sEN LMDscandata").number("u8", 0))
        if not self._measuring:
            return
        self._login()
        self._measuring = False
        try:
            self._dialogue.ask(self._dialogue.writer("sMN LMCstopmeas"))
        except RefusedError as refused:
            if not (refused.unknown or refused.untimely):
                raise

    def _find(self) -> None:
        self._line.reopen()
        self._dialogue.begin()
        with self._line.closed_on_error():
            if self._serial_number() != self.serial_number:
                raise DeviceError(f"{self._line.name}: it has another serial number")

    def _serial_number(self) -> str:
        """Return the serial number; empty if unreported."""
        try:
            reply = self._dialogue.ask(self._dialogue.writer("sRN SerialNumber"))
        except RefusedError:
            return ""
        return self._dialogue.checked("SerialNumber", reply.text).strip()

    def _averaged_scans(self) -> int | None:
        """Return the number of scans that the mean filter averages, 0 if it is off; None without such a filter."""
        values = self._values("LFPmeanfilter", "u8", "u16")
        return values[0] and values[1] if values else None

    def _values(self, name: str, *kinds: Kind) -> list[int]:
        """Return the first values of a variable; none if the sensor rejects the request."""
        try:
            reply = self._dialogue.ask(self._dialogue.writer(f"sRN {name}"))
        except RefusedError:
            return []
        return [self._dialogue.checked(name, reply.number, kind) for kind in kinds]

    def _login(self) -> None:
        out = self._dialogue.writer("sMN SetAccessMode").number("u8", _CLIENT).number("u32", _PASSWORD)
        self._dialogue.insist(out, 1)

    def _wait_until_ready(self, patience_s: float) -> None:
        """Wait until the motor is at speed and no other client is served."""
        deadline_s = time.monotonic() + patience_s
        while not self._ready():
            if time.monotonic() > deadline_s:
                raise DeviceTimeoutError(f"{self._line.name}: it is still busy after {patience_s:.0f} s")
            time.sleep(POLL_S)

    def _ready(self) -> bool:
        """Read the device state of a TiM, or of an LMS."""
        try:
            state = self._dialogue.ask(self._dialogue.writer("sRN SCdevicestate"))
        except RefusedError as refused:
            if not refused.unknown:
                raise
            state = self._dialogue.ask(self._dialogue.writer("sRN STlms"))
            return self._dialogue.checked("STlms", state.number, "u16") == _STLMS_READY
        return self._dialogue.checked("SCdevicestate", state.number, "u8") == 1

    def _reset(self) -> None:
        """Reset clock and counter before the next telegram."""
        self._stamps.restart()
        self._count: int | None = None
        self._clock: ArrivalLine | None = None

    def _timed(self, scan: ScanData, arrival_ns: int) -> TimedScan:
        if scan.status & FAULT:
            if scan.status & DIRT:
                raise DeviceFaultError(f"{self._line.name}: its window is too dirty to measure: clean it")
            raise DeviceFaultError(f"{self._line.name}: it reports a fault (status {scan.status:X})")
        first = scan.channel("DIST1")
        if first is None:
            raise ProtocolError("no DIST1")
        if self._count is not None:
            self.dropped += (scan.telegram_count - self._count - 1) % 65536
        self._count = scan.telegram_count
        restarts = self._stamps.restarts
        sent_us = self._stamps.unwrap(scan.sent_us, arrival_ns)
        if self._clock is None or restarts != self._stamps.restarts:
            spacing_ns = 1e9 * self._every / scan.scan_rate_hz
            self._clock = ArrivalLine(
                smallest_delay_ns=0, rate_max=QUARTZ_RATE, grain_ns=TICK_NS, spacing_ns=spacing_ns
            )
        self._clock.add(1e3 * sent_us, arrival_ns)
        start_deg, step_deg = first.bearing_deg
        exact_deg = 360 / self._lidar.steps_per_turn  # a third of a degree is sent as 0.3333: 0.027 deg in 811 beams
        step_deg = exact_deg if abs(step_deg - exact_deg) < 1e-4 else step_deg
        shown = scan.channel("RSSI1")
        intensity = shown.raw * shown.scale + shown.offset if shown else np.empty(0)
        turn = Scan(
            stamp_ns=self._clock.host_ns(1e3 * sent_us) - round(self._first_beam_before_sent_us(scan) * 1e3),
            angle_min_rad=float(np.radians(start_deg)),
            angle_increment_rad=float(np.radians(step_deg)),
            time_increment_s=scan.beam_us / 1e6,
            scan_time_s=1 / scan.scan_rate_hz,
            range_min_m=self._lidar.range_min_mm / 1e3,
            range_max_m=self._lidar.range_max_mm / 1e3,
            range_m=first.range_m(),
            intensity=intensity.astype(np.float32),
        )
        dirty = "its window is dirty, but it still measures: clean it" if scan.status & DIRT_WARNING else ""
        return TimedScan(turn, arrival_ns, self._clock.uncertainty_ns, dirty)

    def _first_beam_before_sent_us(self, scan: ScanData) -> float:
        """Return the time from first beam to sending; DeviceError if the requested `first_beam` is impossible."""
        after_us, duration_us = scan.sent_after_us, scan.wide[0].raw.size * scan.beam_us
        if after_us < duration_us:
            if self._stamp_at == "first_beam":
                raise DeviceError(
                    f"{self._line.name}: stamp_at = 'first_beam': sent {after_us / 1e3:.1f} ms after the scan time, "
                    f"but a scan takes {duration_us / 1e3:.1f} ms; use last_beam"
                )
            self._stamps_last = True
        return after_us + duration_us if self._stamps_last else after_us


# error codes of mLMPsetscancfg
_SET_UP = {1: "its scan frequency", 2: "its resolution", 3: "its scan frequency and resolution", 4: "its scan area"}


def set_rate(dialogue: ColaDialogue, lidar: Lidar) -> None:
    """Set rate, resolution and field to those of the catalogue, if the sensor supports that."""
    step = round(3_600_000 / lidar.steps_per_turn)
    first = 900_000 + round((lidar.first_step - lidar.front_step) * 3_600_000 / lidar.steps_per_turn)
    last = 900_000 + round((lidar.last_step - lidar.front_step) * 3_600_000 / lidar.steps_per_turn)
    rate = round(lidar.scan_rate_hz * 100)
    try:
        now = dialogue.ask(dialogue.writer("sRN LMPscancfg"))
    except RefusedError as refused:
        if refused.unknown:
            return
        raise
    rate_now, _, step_now = (dialogue.checked("LMPscancfg", now.number, kind) for kind in ("u32", "u16", "u32"))
    if rate_now == rate and abs(step_now - step) <= 1:
        return
    out = dialogue.writer("sMN mLMPsetscancfg").number("u32", rate).number("u16", 1).number("u32", step)
    reply = dialogue.ask(out.number("i32", first).number("i32", last))
    if code := dialogue.checked("mLMPsetscancfg", reply.number, "u8"):
        raise DeviceError(
            f"{dialogue.line.name}: {lidar.scan_rate_hz:g} Hz in steps of {step / 1e4:g} deg: it rejects "
            f"{_SET_UP.get(code, f'with code {code}')}; is it a {lidar.name}?"
        )
