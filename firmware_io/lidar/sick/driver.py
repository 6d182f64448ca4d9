"""A SICK lidar of the TiM5xx, TiM7xx or LMS1xx that speaks CoLa A or B, over TCP.

Written from documents; no sensor has been at the other end yet.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from types import TracebackType
from typing import Self, TypeVar

import numpy as np

from design.catalogue.catalogue import load_catalogue
from design.catalogue.products import Lidar
from design.errors import DeviceError, DeviceFaultError, DeviceTimeoutError, ProtocolError
from firmware_io.lidar.byte_stream import Gone, open_stream
from firmware_io.lidar.device_clock import DeviceClock, StampCounter
from firmware_io.lidar.lidar import StampAt, TimedScan
from firmware_io.lidar.sick.cola import Reader, Telegram, TelegramSplitter, Writer, error_code, error_words, framed
from firmware_io.lidar.sick.scan_data import DIRT, DIRT_WARNING, FAULT, WRAP_US, ScanData, scan_data
from firmware_io.samples import Scan

T = TypeVar("T")

_ANSWER_S = 0.5
_SCAN_S = 1.0
_READY_S = 30.0  # a motor that was off takes ten seconds
_POLL_S = 0.1
_CLIENT, _PASSWORD = 3, 0xF4724744  # of all these sensors from the factory
_BUSY, _CONDITION = 0x0D, 0x04
_UNKNOWN = (0x02, 0x03, 0x0B, 0x0C)
_STLMS_READY = 7
_SET_UP = {1: "its scan frequency", 2: "its resolution", 3: "its scan frequency and resolution", 4: "its scan area"}


class RefusedError(DeviceError):
    """The sensor answered sFA.

    Attributes:
        code: its number, see `cola.ERRORS`.
    """

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


class SickLidar:
    """A SICK lidar, opened; `with` leaves it stopped and its port closed.

    Attributes:
        address: where it is.
        model: name of its type, as in the catalogue.
        serial_number: by which it is known again.
        firmware: version, as the sensor writes it.
        dropped: telegrams that are missing between those that were read, by their counter.
    """

    def __init__(self, address: str, model: str | None = None) -> None:
        """Open it.

        Args:
            address: where it is.
            model: name in the catalogue; None takes the name that it gives itself, where the catalogue has that.

        Raises:
            DeviceError: no such port, what answers speaks no CoLa, or it is not known which model it is.
        """
        self.address = address
        self.dropped = 0
        self._measuring = False
        self._bad_before = 0
        self._splitter = TelegramSplitter()
        self._binary = True
        self._started: tuple[bool, int] | None = None
        self._stamps = StampCounter(WRAP_US, per_ms=1000)
        self._connect()
        try:
            said = self._identity()
            known = [lidar.name for lidar in load_catalogue() if isinstance(lidar, Lidar) and lidar.family == "sick"]
            if model is None and said[0] not in known:
                raise DeviceError(
                    f"{self._name()} calls itself '{said[0]}', which leaves open what it is: name its model; "
                    f"known: {', '.join(sorted(known))}"
                )
            self.model = model or said[0]
            self.firmware = said[1]
            self.serial_number = self._serial_number()
        except BaseException:
            self._stream.close()
            raise
        self._product = load_catalogue().get(self.model, Lidar)
        self._forget()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.stop()
        except DeviceError as unsafe:
            if error is None:
                raise
            error.add_note(f"it may still scan: {unsafe}")
        finally:
            self._stream.close()

    @property
    def scan_rate_hz(self) -> float:
        """Turns per second, as the catalogue says and `start` has set."""
        return self._product.scan_rate_hz

    @property
    def bad_packets(self) -> int:
        """Telegrams that were thrown away."""
        return self._bad_before + self._splitter.bad

    def start(self, *, intensity: bool = False, cluster: int = 1, skip: int = 0) -> None:
        """Scan until `stop`, at the rate and resolution of the catalogue.

        Args:
            intensity: measure it too.
            cluster: 1; these sensors share no values.
            skip: turns to leave out between two.

        Raises:
            DeviceError: the sensor refuses, does not get ready, or is gone.
        """
        if cluster != 1:
            raise DeviceError(f"{self._name()}: cluster = {cluster}: a {self.model} cannot, take 1")
        self._begin(intensity, skip, _READY_S)

    def _begin(self, intensity: bool, skip: int, patience_s: float) -> None:
        self._login()
        self._set_rate()
        # channels, intensity, its resolution, unit, encoders, position, name, comment, time of day
        wanted = self._writer("sWN LMDscandatacfg").numbers("u8", [1, 0, intensity, 1, 0, 0, 0, 0, 0, 0, 0])
        self._ask(wanted.number("u16", skip + 1))
        self._measuring = True
        self._ask(self._writer("sMN LMCstartmeas"), expect=0)
        self._wait_until_ready(patience_s)
        self._ask(self._writer("sMN Run"), expect=1)
        self._forget()
        self._ask(self._writer("sEN LMDscandata").number("u8", 1))
        self._started = (intensity, skip)

    def read(self, timeout_s: float | None = None) -> TimedScan:
        """The next turn; it is waited for for a second if nothing else is said.

        Raises:
            DeviceTimeoutError: none came in time.
            DeviceFaultError: the sensor reports a fault, or that its window is too dirty.
            DeviceError: it is gone.
        """
        deadline = time.monotonic() + (_SCAN_S if timeout_s is None else timeout_s)
        while True:
            told, arrival_ns = self._next(deadline)
            if (told.word, told.name) != (b"sSN", b"LMDscandata"):
                continue
            try:
                scan = scan_data(told)
                return self._timed(scan, arrival_ns)
            except ProtocolError:
                self._bad_before += 1

    def stop(self) -> None:
        """Stop the telegrams, and what `start` lit; a laser that cannot be put out stays on.

        Raises:
            DeviceError: the sensor is gone.
        """
        self._started = None
        self._ask(self._writer("sEN LMDscandata").number("u8", 0))
        if not self._measuring:
            return
        self._login()
        self._measuring = False
        try:
            self._ask(self._writer("sMN LMCstopmeas"))
        except RefusedError as refused:
            if refused.code not in (*_UNKNOWN, _CONDITION):
                raise

    def reconnect(self, timeout_s: float = 3.0) -> None:
        """Find the sensor again at its address, and scan on if it did.

        Raises:
            DeviceError: it did not turn up in time.
        """
        started, self._started = self._started, None
        self._stream.close()
        deadline = time.monotonic() + timeout_s
        while True:
            try:
                self._connect()
                if self._serial_number() != self.serial_number:
                    raise DeviceError(f"{self._name()}: it has another serial number")
                self._forget()
                if started is not None:
                    self._begin(*started, max(deadline - time.monotonic(), 0.0))
                return
            except DeviceError as error:
                self._stream.close()
                self._started = started
                if time.monotonic() > deadline:
                    raise DeviceError(
                        f"{self.address}: lidar {self.serial_number} did not come back in {timeout_s:.1f} s; "
                        f"check its plug ({error})"
                    ) from error
            time.sleep(0.05)

    def _connect(self) -> None:
        self._bad_before = self.bad_packets
        self._splitter = TelegramSplitter()
        self._waiting: list[tuple[Telegram, int]] = []
        self._stream = open_stream(self.address)
        try:
            for self._binary in (True, False):
                try:
                    self._ask(self._writer("sEN LMDscandata").number("u8", 0))
                except DeviceTimeoutError:
                    continue
                self._splitter.bad = 0
                return
            raise DeviceTimeoutError(f"{self.address}: no SICK sensor answers; check power, cable and port")
        except BaseException:
            self._stream.close()
            raise

    def _identity(self) -> tuple[str, str]:
        """Name and version, as the sensor writes them."""
        told = self._ask(self._writer("sRN DeviceIdent"))
        return self._checked(lambda: (told.text().strip(), told.text().strip()), "DeviceIdent")

    def _serial_number(self) -> str:
        """Empty from a sensor that does not tell it."""
        try:
            told = self._ask(self._writer("sRN SerialNumber"))
        except RefusedError:
            return ""
        return self._checked(told.text, "SerialNumber").strip()

    def _login(self) -> None:
        out = self._writer("sMN SetAccessMode").number("u8", _CLIENT).number("u32", _PASSWORD)
        self._ask(out, expect=1)

    def _set_rate(self) -> None:
        """Rate, resolution and field of the catalogue, in a sensor that has a choice."""
        lidar = self._product
        step = round(3_600_000 / lidar.steps_per_turn)
        first = 900_000 + round((lidar.first_step - lidar.front_step) * 3_600_000 / lidar.steps_per_turn)
        last = 900_000 + round((lidar.last_step - lidar.front_step) * 3_600_000 / lidar.steps_per_turn)
        rate = round(lidar.scan_rate_hz * 100)
        try:
            now = self._ask(self._writer("sRN LMPscancfg"))
        except RefusedError as refused:
            if refused.code in _UNKNOWN:
                return
            raise
        set_to = self._checked(
            lambda: (now.number("u32"), now.number("u16"), now.number("u32"), now.number("i32"), now.number("i32")),
            "LMPscancfg",
        )
        if (set_to[0], abs(set_to[2] - step) <= 1) == (rate, True):
            return
        out = self._writer("sMN mLMPsetscancfg").number("u32", rate).number("u16", 1).number("u32", step)
        answer = self._ask(out.number("i32", first).number("i32", last))
        code = self._checked(lambda: answer.number("u8"), "mLMPsetscancfg")
        if code:
            raise DeviceError(
                f"{self._name()}: {lidar.scan_rate_hz:g} turns/s in steps of {step / 1e4:g} deg: it refuses "
                f"{_SET_UP.get(code, f'with code {code}')}; is it a {self.model}?"
            )

    def _wait_until_ready(self, patience_s: float) -> None:
        """A sensor that starts its motor, or is busy with somebody else, is asked again and again."""
        deadline = time.monotonic() + patience_s
        asked, ready = "SCdevicestate", 1
        while True:
            try:
                told = self._ask(self._writer(f"sRN {asked}"))
                if self._checked(lambda: told.number("u8" if ready == 1 else "u16"), asked) == ready:  # noqa: B023
                    return
            except RefusedError as refused:
                if asked == "STlms" or refused.code not in _UNKNOWN:
                    raise
                asked, ready = "STlms", _STLMS_READY
                continue
            if time.monotonic() > deadline:
                raise DeviceTimeoutError(f"{self._name()}: it is still busy after {patience_s:.0f} s")
            time.sleep(_POLL_S)

    def _forget(self) -> None:
        """What comes next is of another run of the sensor."""
        self._stamps.restart()
        self._count: int | None = None
        self._clock: DeviceClock | None = None

    def _timed(self, scan: ScanData, arrival_ns: int) -> TimedScan:
        if scan.status & FAULT:
            if scan.status & DIRT:
                raise DeviceFaultError(f"{self._name()}: its window is too dirty to see through: clean it")
            raise DeviceFaultError(f"{self._name()}: it reports a fault of its own (status {scan.status:X})")
        first = scan.channel("DIST1")
        if first is None:
            raise ProtocolError("no DIST1")
        if self._count is not None:
            self.dropped += (scan.telegram_count - self._count - 1) % 65536
        self._count = scan.telegram_count
        restarts = self._stamps.restarts
        sent_us = self._stamps.unwrap(scan.sent_us, arrival_ns)
        skip = self._started[1] if self._started else 0
        if self._clock is None or restarts != self._stamps.restarts:
            self._clock = DeviceClock((skip + 1) / scan.scan_rate_hz, smallest_delay_ns=0, fine=True)
        moment = self._clock.update(sent_us / 1e3, arrival_ns)
        start_deg, step_deg = first.bearing_deg
        shown = scan.channel("RSSI1")
        intensity = shown.raw * shown.scale + shown.offset if shown else np.empty(0)
        taken = Scan(
            stamp_ns=moment.time_ns - round(scan.first_beam_before_sent_us * 1e3),
            angle_min_rad=float(np.radians(start_deg)),
            angle_increment_rad=self._step_rad(step_deg),
            time_increment_s=scan.beam_us / 1e6,
            scan_time_s=(skip + 1) / scan.scan_rate_hz,
            range_min_m=self._product.range_min_mm / 1e3,
            range_max_m=self._product.range_max_mm / 1e3,
            range_m=first.range_m(),
            intensity=intensity.astype(np.float32),
        )
        warning = "its window is dirty, though it still sees: clean it" if scan.status & DIRT_WARNING else ""
        return TimedScan(taken, arrival_ns, moment.uncertainty_ns, warning)

    def _step_rad(self, step_deg: float) -> float:
        """A step of a third of a degree is sent as 0.3333: 0.027 deg are missing at the end of 811 beams."""
        exact_deg = 360 / self._product.steps_per_turn
        return float(np.radians(exact_deg if abs(step_deg - exact_deg) < 1e-4 else step_deg))

    def _writer(self, command: str) -> Writer:
        return Writer(command, binary=self._binary)

    def _ask(self, out: Writer, expect: int | None = None) -> Reader:
        """The values of the answer.

        Raises:
            RefusedError: it is an sFA.
            DeviceError: its first value is not the expected one, or the sensor is gone.
            DeviceTimeoutError: none came.
        """
        asked = out.telegram()
        name = asked.name.decode()
        answer = {b"sRN": b"sRA", b"sWN": b"sWA", b"sMN": b"sAN", b"sEN": b"sEA"}[asked.word]
        deadline = time.monotonic() + _ANSWER_S
        while True:
            self._waiting.clear()
            with Gone(self._name()):
                self._stream.write(framed(asked))
            while True:
                told, _ = self._next(deadline)
                if told.binary != asked.binary:
                    continue
                if told.word == b"sFA" or (told.word, told.name) == (answer, asked.name):
                    break
            if told.word != b"sFA":
                break
            code = self._checked(lambda: error_code(told), name)  # noqa: B023
            if code != _BUSY or time.monotonic() > deadline:
                raise RefusedError(f"{self._name()}: {name}: {error_words(code)}", code)
            time.sleep(_POLL_S / 2)
        values = told.values()
        if expect is not None and (got := self._checked(lambda: values.number("u8"), name)) != expect:
            what = "its password was changed, or this access is switched off" if name == "SetAccessMode" else "refused"
            raise DeviceError(f"{self._name()}: {name} answered {got}, not {expect}: {what}")
        return values

    def _checked(self, take: Callable[[], T], name: str) -> T:
        try:
            return take()
        except ProtocolError as error:
            raise ProtocolError(f"{self._name()}: {name}: {error}") from error

    def _next(self, deadline: float) -> tuple[Telegram, int]:
        while not self._waiting:
            over = time.monotonic() > deadline  # told before the look: what came while we were kept waiting counts
            with Gone(self._name()):
                received = self._stream.read(deadline - time.monotonic())
            arrival_ns = time.monotonic_ns()
            self._waiting += [(told, arrival_ns) for told in self._splitter.feed(received)]
            if over and not self._waiting:
                raise DeviceTimeoutError(f"{self._name()}: nothing came in time; check power and cable")
        return self._waiting.pop(0)

    def _name(self) -> str:
        return f"{self.address}: lidar"


def open_sick(address: str, model: str | None = None, _stamp_at: StampAt = "step_0") -> SickLidar:
    """Open "192.168.0.1:2112", whatever the sensor is doing.

    Raises:
        DeviceError: no such host, or what answers is no SICK sensor.
    """
    return SickLidar(address, model)
