"""Emulator of a TiM or LMS1xx."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import ProtocolError
from scanwright.firmware_io.emulators.lidar_line import LidarLine, Ranging
from scanwright.firmware_io.lidar.sick.cola import Telegram, TelegramSplitter, Writer, framed
from scanwright.firmware_io.lidar.sick.scan_data import WRAP_US, Channel, ScanData, telegram_of
from scanwright.firmware_io.lidar.sick.values import Kind, Reader

_NEVER_NS = 1 << 62  # 146 years
_SEND_NS = 3_000_000  # from the last beam to the telegram: between the captures of an LMS100 and of a TiM55x
_BOOT_NS = 1_000_000_000  # [assumed]
_HEAD = 100  # bytes of a telegram before its ranges
# factory passwords of the access levels; telegram listing 8014631
_PASSWORDS = {2: 0xB21ACE26, 3: 0xF4724744, 4: 0x81BE23AA}
_CLIENT = 3  # lowest level for writing and for starting; telegram listing 8014631
# types of the values of its filters; telegram listing 8014631
_FILTERS: dict[str, tuple[Kind, ...]] = {
    "FREchoFilter": ("u8",),
    "LFPmeanfilter": ("u8", "u16", "u8"),
    "LFPparticle": ("u8", "u16"),
}
_FIELDS = [f"{number:03}" for number in range(30)]  # of an LMS1xx, as read by sick_scan_xd
_FILTERS_OFF = {"FREchoFilter": [2], "LFPmeanfilter": [0, 10, 0], "LFPparticle": [0, 500]}
_ACCESS_DENIED, _UNKNOWN_METHOD, _UNKNOWN_VARIABLE, _INVALID = 1, 2, 3, 5


@dataclass(slots=True)
class _Scanning:
    """Requested scans."""

    binary: bool  # in CoLa B
    turn: int  # next one


@dataclass
class SickMachine:
    """State of one sensor."""

    lidar: Lidar
    ranging: Ranging
    began_ns: int  # true time at which its clock was `clock_us`
    clock_us: int = 0
    rate_error: float = 0.0  # of its clock, 5e-5 is 50 ppm fast
    stamps_end: bool | None = None  # whether its scan time is the end of the last beam; None for that of its model
    status: int = 0  # second status byte of its scans: 2 dirt warning, 5 dirt error, 1 fault
    busy_until_ns: int = 0  # reports busy until then
    silent_until_ns: int = 0  # silent until then
    dialects: tuple[bool, ...] = (True, False)  # dialects understood; True is CoLa B
    refusals: list[int] = field(default_factory=list)  # error codes for the next requests, one each
    filters: dict[str, list[float]] = field(default_factory=dict)  # values by name
    without: tuple[str, ...] = ()  # variables that this firmware does not have
    serial_number: int = 18_030_000
    run_tenth_h: int = 6641  # operating time in tenths of an hour
    starts: int = 597  # number of starts
    scanning: _Scanning | None = None
    intensity: bool = False
    interval: int = 1
    measuring: bool = False
    _level: int = 0
    _telegrams: int = 0
    setting: tuple[int, int] = (0, 0)  # reported scan rate, 0.01 Hz, and step, 1e-4 deg; scans have those of the model
    _output: list[int] = field(default_factory=lambda: [1, *[0] * 10, 1])

    def __post_init__(self) -> None:
        own = round(self.lidar.scan_rate_hz * 100), self._angles()[1]
        self.setting = self.setting if any(self.setting) else own
        if self.stamps_end is None:
            self.stamps_end = self.lidar.name.startswith("TiM")  # captures of TiM55x and TiM56x; LMS100, LMS511

    @property
    def period_ns(self) -> float:
        """Period of a turn."""
        return 1e9 / self.lidar.scan_rate_hz

    @property
    def beam_ns(self) -> float:
        """Time between two beams."""
        return self.period_ns / self.lidar.steps_per_turn

    def receive(self, received: bytes, now_ns: int) -> tuple[bytes, bytes]:
        """Return the replies to complete requests, and the bytes of an incomplete one."""
        splitter = TelegramSplitter()
        requests = splitter.feed(received)
        if now_ns < self.silent_until_ns:
            return b"", splitter.rest
        answers = [framed(self._answer(request, now_ns)) for request in requests if request.binary in self.dialects]
        return b"".join(answers), splitter.rest

    def next_ns(self) -> int:
        """Return the time of sending of the next scan."""
        if self.scanning is None:
            return _NEVER_NS
        beams = self.lidar.last_step - self.lidar.first_step + 1
        return self._first_beam_ns(self.scanning.turn) + round(beams * self.beam_ns) + _SEND_NS

    def next_packets(self) -> list[tuple[int, bytes]]:
        """Measure the next turn."""
        if self.scanning is None:
            return []
        sent_ns, turn, binary = self.next_ns(), self.scanning.turn, self.scanning.binary
        scan = self._scan(turn, sent_ns)
        self.scanning.turn += self.interval
        return [(sent_ns, framed(telegram_of(scan, binary=binary)))]

    def skip_to(self, before_ns: int) -> None:
        """Skip the turns before a time."""
        while self.scanning is not None and self.next_ns() < before_ns:
            self.scanning.turn += self.interval
            self._telegrams += 1

    def power_cycle(self, now_ns: int) -> None:
        """Restart: clock at 0, no scans, replies after a second."""
        self.began_ns, self.clock_us = now_ns, 0
        self.scanning, self.measuring, self._level = None, False, 0
        self.silent_until_ns = now_ns + _BOOT_NS

    def _us(self, time_ns: int) -> int:
        return (self.clock_us + math.floor((time_ns - self.began_ns) * (1 + self.rate_error) / 1e3)) % WRAP_US

    def _first_beam_ns(self, turn: int) -> int:
        return self.began_ns + round(turn * self.period_ns)

    def _scan(self, turn: int, sent_ns: int) -> ScanData:
        lidar = self.lidar
        steps = np.arange(lidar.last_step - lidar.first_step + 1)
        first_ns = self._first_beam_ns(turn)
        range_m, shown = self.ranging(first_ns + np.rint(steps * self.beam_ns).astype(np.int64), lidar.bearings_rad())
        seen = np.isfinite(range_m)
        scale = 1.0 if lidar.range_max_mm < 65_536 else 2.0  # 16 bits reach 80 m in steps of 2 mm
        raw = np.rint(np.where(seen, range_m, 0.0) * 1e3 / scale).clip(0, 65535).astype(np.uint16)
        start, step = self._angles()
        channels = [Channel("DIST1", scale, 0.0, start, step, raw)]
        if self.intensity:
            bright = np.where(seen, shown, 0.0).clip(0, 65535).astype(np.uint16)
            channels.append(Channel("RSSI1", 1.0, 0.0, start, step, bright))
        self._telegrams += 1
        stamp_ns = first_ns + (round(steps.size * self.beam_ns) if self.stamps_end else 0)
        return ScanData(
            serial_number=self.serial_number,
            status=self.status,
            telegram_count=self._telegrams % 65536,
            scan_count=turn % 65536,
            scan_us=self._us(stamp_ns),
            sent_us=self._us(sent_ns),
            layer=0,
            scan_rate_hz=lidar.scan_rate_hz,
            measuring_rate_hz=round(lidar.scan_rate_hz * lidar.steps_per_turn / 100) * 100,
            encoders=(),
            wide=tuple(channels),
            narrow=(),
        )

    @property
    def _span(self) -> int:
        """Angle from the first to the last beam, 1e-4 deg."""
        return (self.lidar.last_step - self.lidar.first_step) * 3_600_000 // self.lidar.steps_per_turn

    def _angles(self) -> tuple[int, int]:
        """Return first angle and step, rounded to 1e-4 deg."""
        per_step = 3_600_000 / self.lidar.steps_per_turn
        return 900_000 + round((self.lidar.first_step - self.lidar.front_step) * per_step), round(per_step)

    def _answer(self, request: Telegram, now_ns: int) -> Telegram:
        if self.refusals:
            return _refused(request, self.refusals.pop(0))
        try:
            return self._reply(request, now_ns)
        except ProtocolError:
            return _refused(request, _INVALID)

    def _reply(self, request: Telegram, now_ns: int) -> Telegram:
        word, name, values = request.word, request.name.decode("ascii", "replace"), request.values()
        answers = {b"sRN": "sRA", b"sWN": "sWA", b"sMN": "sAN", b"sEN": "sEA"}
        if word not in answers:
            return _refused(request, _UNKNOWN_METHOD)
        if name in self.without:
            return _refused(request, _UNKNOWN_VARIABLE)
        out = Writer(f"{answers[word]} {name}", binary=request.binary)
        match word, name:
            case b"sRN", "DeviceIdent":
                return out.text(self.lidar.name).text("V1.00").telegram()
            case b"sRN", "SerialNumber":
                return out.text(str(self.serial_number)).telegram()
            case b"sRN", "ODoprh":
                return out.number("u32", self.run_tenth_h).telegram()
            case b"sRN", "ODpwrc":
                return out.number("u32", self.starts).telegram()
            case b"sRN", "SCdevicestate":
                return out.number("u8", int(now_ns >= self.busy_until_ns)).telegram()
            case b"sRN", "FirmwareVersion":
                return out.text("V1.00").telegram()
            case b"sRN", "LocationName":
                return out.text("not defined").telegram()
            case b"sRN" | b"sWN", "FREchoFilter" | "LFPmeanfilter" | "LFPparticle":
                return self._filter(request, name, values, out)
            case b"sRN" | b"sWN", "LMPoutputRange":
                return self._output_range(request, values, out)
            case b"sRN", "LMDscandatacfg":
                return out.numbers("u8", self._output[:11]).number("u16", self._output[11]).telegram()
            case b"sWN", "EIHstCola":  # both dialects are understood anyway
                values.number("u8")
                return self._for_clients(request, out)
            case b"sRN", "LIDinputstate":
                return (
                    out.number("u16", 0)
                    .number("u32", self._us(now_ns))
                    .numbers("u8", [0] * 4)
                    .number("u16", 0)
                    .telegram()
                )
            case b"sRN", _ if name[:5] == "field" and name[5:] in _FIELDS and self.lidar.name.startswith("LMS"):
                return self._field(int(name[5:]), out)
            case b"sEN", "LIDinputstate" | "LIDoutputstate" | "LFErec":  # events that never occur
                return out.number("u8", values.number("u8")).telegram()
            case b"sRN", "LMPscancfg":
                return self._scan_setting(out, *self.setting)
            case b"sMN", "mLMPsetscancfg" if self.lidar.name.startswith("LMS"):
                return self._set_scan(request, values, out)
            case b"sMN", "SetAccessMode":
                level = values.number("u8")
                self._level = level if _PASSWORDS.get(level) == values.number("u32") else 0
                return out.number("u8", int(self._level > 0)).telegram()
            case b"sMN", "LMCstartmeas" | "LMCstopmeas" | "Run":
                return self._method(request, name, out)
            case b"sWN", "LMDscandatacfg":
                return self._configured(request, values, out)
            case b"sEN", "LMDscandata":
                on = values.number("u8")
                turn = math.ceil((now_ns - self.began_ns) / self.period_ns)
                self.scanning = _Scanning(request.binary, turn) if on and self.measuring else None
                return out.number("u8", on).telegram()
        return _refused(request, _UNKNOWN_VARIABLE if word in (b"sRN", b"sWN") else _UNKNOWN_METHOD)

    def _filter(self, request: Telegram, name: str, values: Reader, out: Writer) -> Telegram:
        """Read or set a filter, which has no effect."""
        kinds = _FILTERS[name]
        if request.word == b"sRN":
            for kind, value in zip(kinds, self.filters.get(name, _FILTERS_OFF[name]), strict=True):
                out.number(kind, value)
        elif self._level < _CLIENT:
            return _refused(request, _ACCESS_DENIED)
        else:
            self.filters[name] = [values.number(kind) for kind in kinds]
        return out.telegram()

    def _for_clients(self, request: Telegram, out: Writer) -> Telegram:
        """Return the reply, or an error below the level of an authorized client."""
        return _refused(request, _ACCESS_DENIED) if self._level < _CLIENT else out.telegram()

    def _output_range(self, request: Telegram, values: Reader, out: Writer) -> Telegram:
        """Read or set the angles of the first and last beam; only the full field can be set."""
        start, step = self._angles()
        if request.word == b"sRN":
            return out.number("u16", 1).number("u32", step).numbers("i32", [start, start + self._span]).telegram()
        values.number("u16")
        requested = [values.number("u32"), *values.numbers("i32", 2)]
        present = [step, start, start + self._span]
        if max(abs(new - old) for new, old in zip(requested, present, strict=True)) > step:
            return _refused(request, _INVALID)
        return self._for_clients(request, out)

    def _scan_setting(self, out: Writer, rate: int, step: int) -> Telegram:
        start = self._angles()[0]
        out.number("u32", rate).number("u16", 1).number("u32", step)
        return out.numbers("i32", [start, start + self._span]).telegram()

    def _set_scan(self, request: Telegram, values: Reader, out: Writer) -> Telegram:
        """Set rate and step, if they are those of the catalogue; codes of LMS500 instructions 8013796."""
        if self._level < _CLIENT:
            return _refused(request, _ACCESS_DENIED)
        rate, _, step = values.number("u32"), values.number("u16"), values.number("u32")
        code = (rate != round(self.lidar.scan_rate_hz * 100)) + 2 * (abs(step - self._angles()[1]) > 1)
        self.setting = self.setting if code else (rate, step)
        return self._scan_setting(out.number("u8", code), *self.setting)

    def _field(self, number: int, out: Writer) -> Telegram:
        """Return an evaluation field without points, in the layout of sick_scan_xd's test server."""
        start, step = self._angles()
        out.number("f32", 1).number("f32", 0).number("u32", step).number("i32", start).numbers("u8", [2, number + 1])
        return out.numbers("u16", [1, 0, 0, 0, 0, 1]).text(f"Field{number + 1:03}").number("u16", 0).telegram()

    def _method(self, request: Telegram, name: str, out: Writer) -> Telegram:
        if self._level < _CLIENT:
            return _refused(request, _ACCESS_DENIED)
        if name == "Run":  # ends the login
            self._level = 0
            return out.number("u8", not self.lidar.name.startswith("LMS5")).telegram()  # manual 8013796/ZM63, p. 34
        self.measuring = name == "LMCstartmeas"
        return out.number("u8", 0).telegram()

    def _configured(self, request: Telegram, values: Reader, out: Writer) -> Telegram:
        if self._level < _CLIENT:
            return _refused(request, _ACCESS_DENIED)
        self._output = [*values.numbers("u8", 11), values.number("u16")]
        self.intensity, self.interval = bool(self._output[2]), max(self._output[11], 1)
        return out.telegram()


def sick_emulator(
    lidar: Lidar, ranging: Ranging, seed: int = 0, *, jitter_s: float = 0.0, **state: Any
) -> LidarLine[SickMachine]:
    """Return the emulator of a catalogue sensor in a given state; `jitter_s`: largest random delay of scans."""
    machine = SickMachine(lidar, ranging, time.monotonic_ns(), **state)
    return LidarLine(lidar.name, machine, jitter_s=jitter_s, head=_HEAD, seed=seed)


def _refused(request: Telegram, code: int) -> Telegram:
    if request.binary:
        return Telegram(b"sFA" + code.to_bytes(2, "big"), binary=True)
    return Telegram(b"sFA %X" % code, binary=False)
