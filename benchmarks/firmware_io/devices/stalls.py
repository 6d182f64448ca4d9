"""Stated errors of beam times when the reader is held up.

    python -m benchmarks.firmware_io.devices.stalls [STALLS]
    python -m benchmarks.firmware_io.devices.stalls --soak HOURS [--only MODEL ...]
    python -m benchmarks.firmware_io.devices.stalls --real MINUTES [--only MODEL]

Each lidar streams to its driver on one virtual clock, and the driver is held up STALLS times (default 20, which are 560
in all), for 0.05 to 10 s, in a read or between two. What comes meanwhile waits in a buffer of a pseudo-terminal's or of
a serial port's size; what finds it full is lost. An adapter hands bytes over every 1 or 16 ms. Ranges tell when each
beam was measured. A soak runs one lidar of each family for hours of that clock, with a stall every 20 s in the mean.
`--real` reads one emulated lidar (default: LD19) on its pseudo-terminal in real time, beside eight busy processes.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import Pipe, Process
from multiprocessing.connection import Connection
from pkgutil import resolve_name
from unittest.mock import patch

import numpy as np

from scanwright.cli.console import high_priority
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
from scanwright.firmware_io.lidar.scip import dialogue as scip_dialogue
from scanwright.firmware_io.lidar.scip import driver as scip
from scanwright.firmware_io.lidar.sick import dialogue as cola
from scanwright.firmware_io.lidar.sick import driver as sick
from scanwright.firmware_io.lidar.slamtec import dialogue
from scanwright.firmware_io.samples import Scan

MODELS = ["LD06", "LD19", "STL27L", "LMS 200"]
MODELS += [f"RPLIDAR {series}" for series in ("A1", "A2", "A3", "S1", "S2", "C1")]
NOT_GATHERED = ["URG-04LX", "UTM-30LX", "TiM561"]  # USB devices of their own, and Ethernet
MODELS += [*NOT_GATHERED, "RPLIDAR S3"]
SOAKED = ("LD19", "RPLIDAR C1", "LMS 200", "URG-04LX", "TiM561")
BUFFER_BYTES = (4095, 69_631)
LATENCY_MS = dict(zip(BUFFER_BYTES, (1, 16), strict=True))
ROUNDED_MS = {model: 0.8 if " A" in model else 0.2 if " S3" in model else 0.1 for model in MODELS}
"""Rounding of a range: 8 mm of ultra capsules, 1.5 of ultra-dense ones, or 1."""

_TIMED = (sensor_line, dialogue, ldrobot, lms2xx, scip_dialogue, scip, cola, sick)
_M_S = 10.0  # by which the range grows
_CYCLE_S = 0.63  # no whole number of turns
_NEAREST_M = 1.0
_BUSY = 8  # processes
_SOAK_STALL_S = 20.0  # from stall to stall: 17 s in the mean, and 2 s of its own


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
        self._latency_ns = 1 if model in NOT_GATHERED else LATENCY_MS[buffer_bytes] * 1_000_000
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
        told, self._received = self.machine.receive(self._received + data, self.now_ns)
        if self.machine.scanning is not scanning:
            self._coming.clear()
        if told:
            self._coming.append((self.now_ns, told))

    def read(self, timeout_s: float) -> bytes:
        """As `Stream.read`; one packet at a time."""
        self._hold_up()
        end_ns = self.now_ns + max(round(timeout_s * 1e9), 0)
        while not self._comes_before(end_ns) and self.machine.next_ns() <= end_ns:
            self._coming.extend(self._handed_over(packet) for packet in self.machine.next_packets())
        sent_ns = self._coming[0][0] if self._comes_before(end_ns) else end_ns
        self.now_ns = max(sent_ns, self.now_ns + 1000)  # a look takes its time
        self._hold_up()
        return self._coming.popleft()[1] if self._comes_before(self.now_ns) else b""

    def close(self) -> None:
        """As `Stream.close`."""

    def _handed_over(self, packet: tuple[int, bytes]) -> tuple[int, bytes]:
        """The packet, at the time at which the adapter next empties its buffer."""
        return packet[0] + -packet[0] % self._latency_ns, packet[1]

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
                    self._coming.append(self._handed_over((sent_ns, data)))
        self.machine.skip_to(self.now_ns)


@contextmanager
def held_up(
    model: str, stalls: list[tuple[float, float]], buffer_bytes: int
) -> Iterator[tuple[LidarDriver, deque[tuple[int, int]]]]:
    """The lidar, opened on a line whose reader is held up, and the stalls that are still to come."""
    line = HeldUpLine(model, stalls, buffer_bytes)
    clocks = [patch.object(module, "time", line) for module in _TIMED]
    spun_up = patch.object(world, "SPIN_UP_S", 1e-6)  # turns are counted at full speed
    gathers = patch.object(sensor_line, "latency_ms", lambda _: LATENCY_MS[buffer_bytes])
    with patch.object(sensor_line, "open_stream", lambda _: line), gathers, spun_up:
        for clock in clocks:
            clock.start()
        try:
            with open_lidar("virtual", model) as lidar:
                yield lidar, line.stalls
        finally:
            for clock in clocks:
                clock.stop()


def random_stalls(
    rng: np.random.Generator, count: int, first_s: float, apart_s: tuple[float, float] = (0.05, 2.0)
) -> list[tuple[float, float]]:
    """When and how long [s]: 0.05 to 10 s, as often short as long, `apart_s` after each other."""
    length_s = np.exp(rng.uniform(np.log(0.05), np.log(10.0), count))
    after_s = np.exp(rng.uniform(np.log(apart_s[0]), np.log(apart_s[1]), count))
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
        timed = [one for one, _ in _turns(lidar, to_come)]
        turn_ns = 1e9 / lidar.scan_rate_hz
        steps = np.diff([one.scan.stamp_ns for one in timed]) / turn_ns
        return timed, Missing(round(float(np.rint(steps - 1).sum())), lidar.dropped)


def _turns(lidar: LidarDriver, to_come: deque[tuple[int, int]]) -> Iterator[tuple[TimedScan, int]]:
    """Each turn until a second after the last stall, and how many stalls were still to come."""
    lidar.start()
    while to_come:
        yield lidar.read(), len(to_come)
    for _ in range(round(lidar.scan_rate_hz)):
        yield lidar.read(), 0


@dataclass(slots=True)
class Judged:
    """Turns of a run, judged one after the other.

    Attributes:
        turns: that were handed out.
        missing: turns between those, by their stamps.
        counted: turns that the driver counted as missing.
        beams: with a range.
        within: of them, within one, two and three times the stated standard error.
        worst_ms: error of a beam.
        back: stamps that were earlier than the one before.
        wrong: stalls after which a beam lay beyond three times its stated error.
    """

    turns: int
    missing: int
    counted: int
    beams: int
    within: Times
    worst_ms: float
    back: int
    wrong: set[int]


def judge(model: str, stalls: list[tuple[float, float]], buffer_bytes: int) -> Judged:
    """Run a lidar through its stalls, and keep sums only."""
    with held_up(model, stalls, buffer_bytes) as (lidar, to_come):
        return _judged(model, lidar, _turns(lidar, to_come))


def judge_in_real_time(model: str, minutes: float) -> Judged:
    """Read a lidar on its pseudo-terminal beside eight busy processes, and keep sums only."""
    ours, theirs = Pipe()
    sensor = Process(target=_sensor, args=(model, theirs), daemon=True)
    sensor.start()
    busy = [subprocess.Popen(["nice", "-n", "15", sys.executable, "-c", "while True: pass"]) for _ in range(_BUSY)]
    try:
        with high_priority(), open_lidar(ours.recv(), model) as lidar:  # as the command `scan` does
            return _judged(model, lidar, _turns_for(lidar, minutes))
    finally:
        ours.send(None)
        for one in busy:
            one.kill()
            one.wait()
        sensor.join()


def _sensor(model: str, ours: Connection) -> None:
    """Emulate a lidar ahead of all other processes, if that is allowed: a real one has a processor of its own."""
    with suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    with resolve_name(family_of(model).emulator)(load_catalogue().get(model, Lidar), _seen_at, 0) as emulator:
        ours.send(emulator.port)
        ours.recv()


def _turns_for(lidar: LidarDriver, minutes: float) -> Iterator[tuple[TimedScan, int]]:
    end_s = time.monotonic() + 60 * minutes
    lidar.start()
    while time.monotonic() < end_s:
        yield lidar.read(), 0


def _judged(model: str, lidar: LidarDriver, turns: Iterator[tuple[TimedScan, int]]) -> Judged:
    found = Judged(0, 0, 0, 0, np.zeros(3, np.int64), 0.0, 0, set())
    last_ns = 0
    for one, still in turns:
        off, stated = _errors_ms(model, one)
        found.turns += 1
        found.beams += off.size
        found.within += [int(np.sum(off < k * stated)) for k in (1, 2, 3)]
        found.worst_ms = max(found.worst_ms, float(off.max(initial=0.0)))
        if np.any(off >= 3 * stated):
            found.wrong.add(still)
        if last_ns:
            found.back += one.scan.stamp_ns < last_ns
            found.missing += round((one.scan.stamp_ns - last_ns) / 1e9 * lidar.scan_rate_hz - 1)
        last_ns = one.scan.stamp_ns
    found.counted = lidar.dropped
    return found


def _seen_at(time_ns: Times, bearing_rad: Floats) -> tuple[Floats, Floats]:
    """Ranges that tell when they were measured."""
    since_s = time_ns % round(_CYCLE_S * 1e9) / 1e9
    return _NEAREST_M + _M_S * since_s, np.full(bearing_rad.size, 200.0)


def main() -> None:
    """Print a row for each lidar and buffer, and after how many stalls every beam was right, or dropped and counted."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("stalls", nargs="?", type=int, default=20)
    arguments.add_argument("--soak", type=float, metavar="HOURS")
    arguments.add_argument("--real", type=float, metavar="MINUTES")
    arguments.add_argument("--only", nargs="+", choices=SOAKED, default=SOAKED, metavar="MODEL")
    chosen = arguments.parse_args()
    print(
        "| lidar | buffer, latency | turns | missing, counted | within 1, 2, 3 times the stated error | worst | back |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- |", flush=True)
    wrong, count = 0, chosen.stalls if chosen.soak is None else round(chosen.soak * 3600 / _SOAK_STALL_S)
    runs = [(model, size) for model in MODELS for size in BUFFER_BYTES]
    if chosen.real is not None:
        runs = [(chosen.only[0], BUFFER_BYTES[0])]
    elif chosen.soak is not None:
        runs = [(model, BUFFER_BYTES[0]) for model in chosen.only]
    for model, buffer_bytes in runs:
        rng = np.random.default_rng([count, MODELS.index(model), buffer_bytes])
        apart_s = (0.05, 2.0) if chosen.soak is None else (2.0, 60.0)
        if chosen.real is None:
            found = judge(model, random_stalls(rng, count, 1.0, apart_s), buffer_bytes)
        else:
            found = judge_in_real_time(model, chosen.real)
        latency_ms = 0 if model in NOT_GATHERED or chosen.real else LATENCY_MS[buffer_bytes]
        within = ", ".join(f"{100 * part / found.beams:.2f}" for part in found.within)
        print(
            f"| {model} | {buffer_bytes:,}, {latency_ms} ms | {found.turns:,} | "
            f"{found.missing:,}, {found.counted:,} | {within} % | {found.worst_ms:.2f} ms | {found.back} |",
            flush=True,
        )
        wrong += len(found.wrong)
    if chosen.real is not None:
        return
    total = count * len(runs)
    print(
        f"\nafter {total - wrong} of {total} stalls every beam was within three times its stated error, or was dropped"
    )


def _errors_ms(model: str, timed: TimedScan) -> tuple[Floats, Floats]:
    """Of each beam that came back: what its time is off beyond the rounding of its range, and what is stated."""
    off = off_ms(timed.scan)
    off = np.maximum(np.abs(off[~np.isnan(off)]) - ROUNDED_MS[model], 0.0)
    return off, np.full(off.size, timed.uncertainty_ns / 1e6)


if __name__ == "__main__":
    main()
