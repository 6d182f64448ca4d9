"""Emulated Hokuyo lidar without its line, at given times."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from scanwright.design.arrays import Floats, Times
from scanwright.firmware_io.emulators.hokuyo_models import Identity, Quartz
from scanwright.firmware_io.lidar.lidar import StampAt
from scanwright.firmware_io.lidar.scip import measurement, protocol

TurnRanging = Callable[[Times], tuple[Floats, Floats]]

_SCAN = re.compile(rb"([GHMN])([DSE])(\d{4})(\d{4})(\d\d)(?:(\d)(\d\d))?")
_BOOT_NS = 1_000_000_000  # [assumed]
_NEVER_NS = 1 << 62  # 146 years


@dataclass(slots=True)
class Scanning:
    """Requested scans."""

    window: measurement.Window
    echo: bytes  # without its last two digits and text
    text: bytes
    skip: int
    remaining: int
    endless: bool
    turn: int  # next one
    skipped: int = 0


@dataclass
class LidarMachine:
    """State of one sensor; times are true ones."""

    identity: Identity
    ranging: TurnRanging  # true times of all beams of a turn -> ranges and intensities, (n,) or (echoes, n)
    quartz: Quartz  # the sensor's clock
    motor_error: float = 0.0  # relative, turns are longer than reported
    stamp_at: StampAt = "step_0"  # step of its timestamps
    scip_1: bool = False  # whether it uses SCIP 1.1 until SCIP 2.0 is requested
    state: str = "Sensor works well."  # STAT of II
    laser: bool = False  # whether it is on
    scanning: Scanning | None = None
    _adjusting: bool = False
    _rebooting: bool = False
    _silent_until_ns: int = 0
    _zero_ns: int = field(init=False)

    def __post_init__(self) -> None:
        self._zero_ns = self.quartz.began_ns

    @property
    def period_ns(self) -> float:
        """True duration of a turn."""
        return self.identity.parameters.scan_period_s * (1 + self.motor_error) * 1e9

    @property
    def arc_ns(self) -> int:
        """Time from the stamp to the end of the last step, before which no scan arrives."""
        parameters = self.identity.parameters
        return round(parameters.since_stamp_s(parameters.last_step + 1, self.stamp_at) * (1 + self.motor_error) * 1e9)

    def turn_ns(self, turn: int) -> int:
        """Return the true time of step 0 of a turn."""
        return self._zero_ns + round(turn * self.period_ns)

    def receive(self, received: bytes, now_ns: int) -> tuple[bytes, bytes]:
        """Return the replies to complete requests, and the bytes of an incomplete one."""
        *requests, rest = received.replace(b"\r", b"\n").split(b"\n")
        return b"".join(self.answer(request, now_ns) for request in requests), rest

    def next_packets(self) -> list[tuple[int, bytes]]:
        """Measure the next turn; no packet if it is skipped or not requested."""
        end_ns = self.next_ns()
        scan = self.next_scan()
        return [(end_ns, scan)] if scan else []

    def next_ns(self) -> int:
        """Return the end of the next requested turn."""
        if self.scanning is None:
            return _NEVER_NS
        parameters = self.identity.parameters
        part = (parameters.last_step + 1) / parameters.steps_per_turn
        return self.turn_ns(self.scanning.turn) + round(part * self.period_ns)

    def power_cycle(self, now_ns: int) -> None:
        """Restart: clock at 0, laser off, no reply for a second."""
        self._reset(now_ns)
        self._silent_until_ns = now_ns + _BOOT_NS

    def skip_to(self, before_ns: int) -> None:
        """Skip the turns that end before a time."""
        if self.scanning is not None:
            behind = math.floor((before_ns - self.next_ns()) / self.period_ns)
            self.scanning.turn += max(behind, 0)

    def next_scan(self) -> bytes:
        """Measure the next turn; empty if it is skipped."""
        scanning = self.scanning
        if scanning is None:
            return b""
        turn, scanning.turn = scanning.turn, scanning.turn + 1
        scanning.skipped += 1
        if scanning.skipped <= scanning.skip:
            return b""
        scanning.skipped = 0
        if not scanning.endless:
            scanning.remaining -= 1
            if not scanning.remaining:
                self.scanning, self.laser = None, False
        echo = scanning.echo + b"%02d" % scanning.remaining + scanning.text
        return protocol.reply(echo, "99", self._lines(scanning.window, turn, all_echoes=echo[:1] == b"N"))

    def answer(self, request: bytes, now_ns: int) -> bytes:
        """Return the reply to one request without its LF; empty while it starts."""
        if now_ns < self._silent_until_ns or not request:
            return b""
        body, _, text = request.partition(b";")
        if self.scip_1:
            self.scip_1 = body != protocol.SCIP_2
            return request + (b"\nE\n\n" if self.scip_1 else b"\n0\n\n")
        if len(text) > 16:
            return protocol.reply(request, "0G")
        if body == b"TM1" and self._adjusting:
            return protocol.reply(request, "00", [protocol.summed(protocol.encode([self.quartz.ms(now_ns)], 4))])
        if body[:2] == b"TM":
            return protocol.reply(request, self._adjust(body))
        if self._adjusting:
            return protocol.reply(request, "0E")
        if match := _SCAN.fullmatch(body):
            return self._scan_request(request, match, now_ns)
        information = {b"VV": self._version, b"PP": self._parameters, b"II": self._state}.get(body)
        if information is not None:
            return protocol.reply(request, "00", protocol.text_lines(information(now_ns)))
        if body == b"%ST":
            state = b"004" if self.scanning else b"003" if self.laser else b"000"
            return protocol.reply(request, "00", [protocol.summed(state)])
        return protocol.reply(request, self._command(body, now_ns))

    def _command(self, body: bytes, now_ns: int) -> str:
        """Execute a request without data and return its status."""
        rebooting, self._rebooting = self._rebooting, body == b"RB"
        if body == b"BM":
            was_on, self.laser = self.laser, True
            return "02" if was_on else "00"
        if body in (b"QT", b"%SL"):
            self.scanning, self.laser = None, False
            return "00"
        if body in (b"RS", b"RT"):
            self._reset(now_ns)
            return "00"
        if body == b"RB":
            if rebooting:
                self.power_cycle(now_ns)
            return "00" if rebooting else "01"
        if re.fullmatch(rb"CR(0\d|10|99)", body):
            return self.identity.speed_request
        if re.fullmatch(rb"SS\d{6}", body):
            return "00"
        return "0E"

    def _adjust(self, body: bytes) -> str:
        if body == b"TM0":
            was, self._adjusting = self._adjusting, True
            self.scanning, self.laser = None, False
            return "02" if was else "00"
        if body == b"TM2":
            was, self._adjusting = self._adjusting, False
            return "00" if was else "03"
        return "04" if body == b"TM1" else "01"

    def _scan_request(self, request: bytes, match: re.Match[bytes], now_ns: int) -> bytes:
        kind, letter, first, last, cluster, skip, count = match.groups()
        once, all_echoes = kind in b"GH", kind in b"HN"
        if once != (count is None):
            return protocol.reply(request, "0D" if once else "0C")
        if (letter == b"E" and not self.identity.intensity) or (
            all_echoes and (letter == b"S" or not self.identity.echoes)
        ):
            return protocol.reply(request, "0E")
        if int(last) > self.identity.parameters.last_step:
            return protocol.reply(request, "04")
        if int(last) < int(first) or int(first) < self.identity.parameters.first_step:
            return protocol.reply(request, "05")
        if once and not self.laser:
            return protocol.reply(request, "10")
        window = measurement.Window.requested(letter, first, last, cluster)
        began = (now_ns - self._zero_ns) / self.period_ns
        if once:
            turn = math.floor(began - self.arc_ns / self.period_ns)
            return protocol.reply(request, "00", self._lines(window, turn, all_echoes=all_echoes))
        self.laser = True
        body, semicolon, text = request.partition(b";")
        remaining = int(count)
        self.scanning = Scanning(
            window, body[:-2], semicolon + text, int(skip), remaining, remaining == 0, math.ceil(began)
        )
        return protocol.reply(request, "00")

    def _lines(self, window: measurement.Window, turn: int, *, all_echoes: bool) -> list[bytes]:
        """Measure a turn and return the lines of its reply."""
        parameters = self.identity.parameters
        steps = np.arange(parameters.first_step, parameters.last_step + 1)
        step_ns = self.period_ns / parameters.steps_per_turn
        range_m, intensity = self.ranging(self.turn_ns(turn) + np.rint(steps * step_ns).astype(np.int64))
        begin, end = window.first_step - parameters.first_step, window.last_step - parameters.first_step + 1
        parts = []
        for echo_m, bright in zip(np.atleast_2d(range_m), np.atleast_2d(intensity), strict=True):
            value = clustered(self._numbers(echo_m[begin:end]), window.cluster, parameters.range_min_mm)
            if window.characters == 2:
                value = np.minimum(value, 4095)
            if window.intensity:
                shown = np.clip(np.nan_to_num(bright[begin : end : window.cluster]), 0, (1 << 18) - 1)
                value = np.stack([value, np.rint(shown).astype(np.int64)], axis=1).ravel()
            parts.append(protocol.encode(value.tolist(), window.characters))
        payload = parts[0]
        if all_echoes:  # each further echo of a beam follows a "&" (urg_library, urg_sensor.c)
            size = window.characters * (2 if window.intensity else 1)
            seen = [np.isfinite(echo_m[begin : end : window.cluster]) for echo_m in np.atleast_2d(range_m)]
            payload = b"".join(
                b"&".join(
                    part[size * k : size * (k + 1)]
                    for part, here in zip(parts, seen, strict=True)
                    if here[k] or part is parts[0]
                )
                for k in range(window.size)
            )
        stamp_ns = self.turn_ns(turn) - round(parameters.since_stamp_s(0, self.stamp_at) * (1 + self.motor_error) * 1e9)
        return protocol.data_lines(self.quartz.ms(stamp_ns), payload)

    def _numbers(self, range_m: Floats) -> Times:
        """Return integer millimetres, and error codes of invalid ranges."""
        parameters = self.identity.parameters
        lost = np.isnan(range_m) | (range_m * 1e3 > parameters.range_max_mm)
        near = ~lost & (range_m * 1e3 < parameters.range_min_mm)
        value = np.rint(np.where(lost | near, 0.0, range_m) * 1e3).astype(np.int64)
        return np.where(lost, self.identity.no_return, np.where(near, self.identity.too_near, value))

    def _reset(self, now_ns: int) -> None:
        self.scanning, self.laser, self._adjusting = None, False, False
        self.quartz = replace(self.quartz, began_ns=now_ns, clock_ms=0)

    def _version(self, _: int) -> list[tuple[str, str]]:
        return [
            ("VEND", "Hokuyo Automatic Co.,Ltd."),
            ("PROD", self.identity.product),
            ("FIRM", self.identity.firmware),
            ("PROT", "SCIP 2.0"),
            ("SERI", self.identity.serial_number),
        ]

    def _parameters(self, _: int) -> list[tuple[str, str]]:
        of = self.identity.parameters
        return [
            ("MODL", f"{of.model}(Hokuyo Automatic Co.,Ltd.)"),
            ("DMIN", str(of.range_min_mm)),
            ("DMAX", str(of.range_max_mm)),
            ("ARES", str(of.steps_per_turn)),
            ("AMIN", str(of.first_step)),
            ("AMAX", str(of.last_step)),
            ("AFRT", str(of.front_step)),
            ("SCAN", str(of.rpm)),
        ]

    def _state(self, now_ns: int) -> list[tuple[str, str]]:
        return [
            ("MODL", f"{self.identity.parameters.model}(Hokuyo Automatic Co.,Ltd.)"),
            ("LASR", "ON" if self.laser else "OFF"),
            ("SCSP", self.identity.speed),
            ("MESM", self.identity.mode),
            ("SBPS", self.identity.line),
            ("TIME", f"{self.quartz.ms(now_ns):06X}"),
            ("STAT", self.state),
        ]


def clustered(value: Times, cluster: int, range_min_mm: int) -> Times:
    """Return one number per cluster: the smallest that is not an error code, or its first (SCIP 2.0, p. 10)."""
    padded = np.append(value, np.repeat(value[-1:], -value.size % cluster)).reshape(-1, cluster)
    valid = np.where(padded >= range_min_mm, padded, np.iinfo(np.int64).max)
    return np.where((padded >= range_min_mm).any(axis=1), valid.min(axis=1), padded[:, 0])
