"""Stated errors of beam times when the reader is held up: `python -m benchmarks.firmware_io.devices.stalls [STALLS]`.

Each lidar without an exact clock of its own streams to its driver, on one virtual clock, and the driver is held up
STALLS times (default 25, which are 500 in all), for 0.05 to 10 s, in a read or between two. What comes meanwhile waits
in a buffer of a pseudo-terminal's or of a serial port's size; what finds it full is lost. Ranges tell when each beam
was measured.
"""

from __future__ import annotations

import sys
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pkgutil import resolve_name
from unittest.mock import patch

import numpy as np

from scanwright.design.arrays import Floats, Times
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.firmware_io.emulators import world
from scanwright.firmware_io.emulators.lidar_line import Machine
from scanwright.firmware_io.lidar import sensor_line
from scanwright.firmware_io.lidar.families import family_of, open_lidar
from scanwright.firmware_io.lidar.ldrobot import driver as ldrobot
from scanwright.firmware_io.lidar.lidar import LidarDriver, TimedScan
from scanwright.firmware_io.lidar.lms2xx import driver as lms2xx
from scanwright.firmware_io.lidar.slamtec import dialogue
from scanwright.firmware_io.lidar.slamtec import driver as slamtec
from scanwright.firmware_io.samples import Scan

MODELS = ["LD06", "LD19", "STL27L", "LMS 200"]
MODELS += [f"RPLIDAR {series}" for series in ("A1", "A2", "A3", "S1", "S2", "C1")]
BUFFER_BYTES = (4095, 69_631)
ROUNDED_MS = {model: 0.8 if " A" in model else 0.1 for model in MODELS}  # of a range: 8 mm of ultra capsules, or 1 mm

_M_S = 10.0  # by which the range grows
_CYCLE_S = 0.63  # no whole number of turns
_NEAREST_M = 1.0


class HeldUpLine:
    """A lidar's line and the clock of both ends, which goes forward only where somebody waits or is held up."""

    def __init__(self, model: str, stalls: list[tuple[float, float]], buffer_bytes: int) -> None:
        """The sensor has its power.

        Args:
            model: name in the catalogue.
            stalls: when the reader is held up, and for how long [s].
            buffer_bytes: what the line keeps meanwhile.
        """
        emulator = resolve_name(family_of(model).emulator)(load_catalogue().get(model, Lidar), _seen_at, 0)
        self.machine: Machine = emulator.machine
        if model.startswith("LMS"):
            emulator.machine.baud = 500_000
        self.now_ns = time.monotonic_ns()  # when the machine was made
        self.stalls = deque((self.now_ns + round(at_s * 1e9), round(length_s * 1e9)) for at_s, length_s in stalls)
        self._buffer_bytes = buffer_bytes
        self._received = b""
        self._coming: deque[tuple[int, bytes]] = deque()

    def monotonic(self) -> float:
        """As `time.monotonic`."""
        return self.now_ns / 1e9

    def monotonic_ns(self) -> int:
        """As `time.monotonic_ns`."""
        return self.now_ns

    def sleep(self, seconds: float) -> None:
        """As `time.sleep`."""
        self.now_ns += round(seconds * 1e9)

    def write(self, data: bytes) -> None:
        """As `Stream.write`."""
        scanning = self.machine.scanning
        told, self._received = self.machine.hear(self._received + data, self.now_ns)
        if self.machine.scanning is not scanning:
            self._coming.clear()
        if told:
            self._coming.append((self.now_ns, told))

    def read(self, timeout_s: float) -> bytes:
        """As `Stream.read`; one packet at a time."""
        self._hold_up()
        end_ns = self.now_ns + max(round(timeout_s * 1e9), 0)
        while not self._comes_before(end_ns) and self.machine.next_ns() <= end_ns:
            self._coming.extend(self.machine.next_packets())
        sent_ns = self._coming[0][0] if self._comes_before(end_ns) else end_ns
        self.now_ns = max(sent_ns, self.now_ns + 1000)  # a look takes its time
        self._hold_up()
        return self._coming.popleft()[1] if self._comes_before(self.now_ns) else b""

    def close(self) -> None:
        """As `Stream.close`."""

    def _comes_before(self, end_ns: int) -> bool:
        return bool(self._coming) and self._coming[0][0] <= end_ns

    def _hold_up(self) -> None:
        """Hold the reader up, if it is time for that; what finds the buffer full is lost."""
        if not self.stalls or self.now_ns < self.stalls[0][0]:
            return
        self.now_ns += self.stalls.popleft()[1]
        waiting = sum(len(data) for _, data in self._coming)
        while waiting < self._buffer_bytes and self.machine.next_ns() <= self.now_ns:
            for sent_ns, data in self.machine.next_packets():
                waiting += len(data)
                if waiting <= self._buffer_bytes:
                    self._coming.append((sent_ns, data))
        self.machine.leave_out(self.now_ns)


@contextmanager
def held_up(
    model: str, stalls: list[tuple[float, float]], buffer_bytes: int
) -> Iterator[tuple[LidarDriver, deque[tuple[int, int]]]]:
    """The lidar, opened on a line whose reader is held up, and the stalls that are still to come."""
    line = HeldUpLine(model, stalls, buffer_bytes)
    clocks = [patch.object(module, "time", line) for module in (sensor_line, dialogue, slamtec, ldrobot, lms2xx)]
    spun_up = patch.object(world, "SPIN_UP_S", 1e-6)  # turns are counted at full speed
    with patch.object(sensor_line, "open_stream", lambda _: line), spun_up:
        for clock in clocks:
            clock.start()
        try:
            with open_lidar("virtual", model) as lidar:
                yield lidar, line.stalls
        finally:
            for clock in clocks:
                clock.stop()


def random_stalls(rng: np.random.Generator, count: int, first_s: float) -> list[tuple[float, float]]:
    """When and how long [s]: 0.05 to 10 s, as often short as long, 0.05 to 2 s after each other."""
    length_s = np.exp(rng.uniform(np.log(0.05), np.log(10.0), count))
    after_s = np.exp(rng.uniform(np.log(0.05), np.log(2.0), count))
    begin_s = first_s + np.cumsum(length_s + after_s) - length_s
    return list(zip(begin_s.tolist(), length_s.tolist(), strict=True))


def off_ms(scan: Scan) -> Floats:
    """By how much the times of the beams are wrong; NaN where nothing came back."""
    true_s = (scan.range_m.astype(float) - _NEAREST_M) / _M_S
    half_s = _CYCLE_S / 2
    off_s: Floats = (scan.time_ns % round(_CYCLE_S * 1e9) / 1e9 - true_s + half_s) % _CYCLE_S - half_s
    return off_s * 1e3


@dataclass(frozen=True, slots=True)
class Missing:
    """Turns that were not handed out, by the stamps of those that were, and as the driver counted them."""

    seen: int
    counted: int


def scans_of(model: str, stalls: list[tuple[float, float]], buffer_bytes: int) -> tuple[list[TimedScan], Missing]:
    """Every turn that the driver hands out until a second after the last stall."""
    with held_up(model, stalls, buffer_bytes) as (lidar, to_come):
        lidar.start()
        timed = [lidar.read()]
        while to_come:
            timed.append(lidar.read())
        timed += [lidar.read() for _ in range(round(lidar.scan_rate_hz))]
        turn_ns = 1e9 / lidar.scan_rate_hz
        steps = np.diff([one.scan.stamp_ns for one in timed]) / turn_ns
        return timed, Missing(round(float(np.rint(steps - 1).sum())), lidar.dropped)


def _seen_at(time_ns: Times, bearing_rad: Floats) -> tuple[Floats, Floats]:
    """Ranges that tell when they were measured."""
    since_s = time_ns % round(_CYCLE_S * 1e9) / 1e9
    return _NEAREST_M + _M_S * since_s, np.full(bearing_rad.size, 200.0)


def main() -> None:
    """Print how many beams lie within one, two and three times the stated standard uncertainty, for each lidar."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 25
    print("| lidar | buffer | turns | missing, counted | within 1, 2, 3 times the stated error | worst | steps back |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for model in MODELS:
        for buffer_bytes in BUFFER_BYTES:
            rng = np.random.default_rng([count, MODELS.index(model), buffer_bytes])
            timed, missing = scans_of(model, random_stalls(rng, count, 1.0), buffer_bytes)
            errors = [_errors_ms(model, one) for one in timed]
            off, stated = (np.concatenate(part) for part in zip(*errors, strict=True))
            within = ", ".join(f"{100 * np.mean(off < k * stated):.2f}" for k in (1, 2, 3))
            back = int((np.diff([one.scan.stamp_ns for one in timed]) < 0).sum())
            print(
                f"| {model} | {buffer_bytes:,} | {len(timed):,} | {missing.seen:,}, {missing.counted:,} | {within} % | "
                f"{off.max():.2f} ms | {back} |",
                flush=True,
            )


def _errors_ms(model: str, timed: TimedScan) -> tuple[Floats, Floats]:
    """Of each beam that came back: what its time is off beyond the rounding of its range, and what is stated."""
    off = off_ms(timed.scan)
    off = np.maximum(np.abs(off[~np.isnan(off)]) - ROUNDED_MS[model], 0.0)
    return off, np.full(off.size, timed.uncertainty_ns / 1e6)


if __name__ == "__main__":
    main()
