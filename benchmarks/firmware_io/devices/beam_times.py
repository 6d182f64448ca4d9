"""Times of beams of a lidar of each family against the true ones of its emulator.

    uv run python -m benchmarks.firmware_io.devices.beam_times [TURNS] [MODEL...]

Each emulator is driven through its line for so many turns (default 200). It notes when it measured in which direction;
each beam of the driver is compared with the nearest of these. Emulators run in real time: a busy computer adds to the
errors.
"""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from pkgutil import resolve_name

import numpy as np

from scanwright.design.arrays import Floats, Times
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.firmware_io.lidar.families import family_of, open_lidar
from scanwright.firmware_io.samples import Scan

MODELS = ("UTM-30LX", "LD19", "STL27L", "RPLIDAR A2", "RPLIDAR C1", "RPLIDAR S2", "TiM561", "LMS111", "LMS 200")
LEARNT = 20  # turns after which a clock is known
_NEAR_NS = 20_000_000


class Watched:
    """A wall of one metre, and when it was looked at in which direction."""

    def __init__(self) -> None:
        self.looks: list[tuple[Times, Floats]] = []  # one list: the emulator adds to it meanwhile

    def __call__(self, time_ns: Times, bearing_rad: Floats) -> tuple[Floats, Floats]:
        """What the emulator sees."""
        self.looks.append((time_ns, bearing_rad))
        return np.ones(time_ns.size), np.ones(time_ns.size)

    def late_ns(self, scan: Scan, rate_rad_s: float) -> Floats:
        """By how much the times that a scan tells are late, of every twentieth beam; NaN where it was not looked.

        Args:
            scan: as it was read.
            rate_rad_s: at which the sensor turns, positive counter-clockwise.
        """
        # beams of turns that are interlaced are looked at in another order than that of time
        time_ns, bearing_rad = (np.concatenate(part) for part in zip(*self.looks[-400:], strict=True))
        late = []
        for told_ns, told_rad in list(zip(scan.time_ns.tolist(), scan.bearing_rad.tolist(), strict=True))[::20]:
            near = np.abs(time_ns - told_ns) < _NEAR_NS
            off_rad = np.remainder(told_rad - bearing_rad[near] + np.pi, 2 * np.pi) - np.pi
            if not off_rad.size:
                late.append(np.nan)
                continue
            best = int(np.argmin(np.abs(off_rad)))
            late.append(told_ns - time_ns[near][best] - off_rad[best] / rate_rad_s * 1e9)
        return np.array(late)


def measured_ns(model: str, turns: int) -> Floats:
    """By how much each beam's time is late, turn by turn."""
    lidar, watched = load_catalogue().get(model, Lidar), Watched()
    late: list[Floats] = []
    with (
        resolve_name(family_of(model).emulator)(lidar, watched, 0) as emulator,
        open_lidar(emulator.port, model) as driver,
    ):
        driver.start()
        clockwise = driver.read().scan.angle_increment_rad < 0
        for turn in range(turns):
            timed = driver.read()
            if turn >= LEARNT:
                rate_rad_s = 2 * np.pi * driver.scan_rate_hz
                late.append(watched.late_ns(timed.scan, -rate_rad_s if clockwise else rate_rad_s))
    return np.concatenate(late)


def main() -> None:
    """Measure those that are named, or one of each kind, and print a table."""
    turns = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    with suppress(PermissionError):
        os.nice(-10)  # emulators need their time, as hardware does not
    print("| lidar | turns | late, median | off, 95 % | off, worst |")
    print("| --- | --- | --- | --- | --- |")
    for model in sys.argv[2:] or MODELS:
        late_ms = measured_ns(model, turns + LEARNT) / 1e6
        off_ms = np.abs(late_ms[np.isfinite(late_ms)])
        worst = f"{np.quantile(off_ms, 0.95):.2f} ms | {off_ms.max():.2f} ms"
        print(f"| {model} | {turns} | {np.nanmedian(late_ms):+.2f} ms | {worst} |", flush=True)


if __name__ == "__main__":
    main()
