"""How true the times of a sensor's scans are: `python -m benchmarks.firmware_io.clock [SECONDS]`.

Simulated sensors against their own true time: clocks 50 ppm fast that stamp whole milliseconds, packets up to 20 ms
late, SECONDS (default 3600) long, after the first 10 and the first 30 seconds. The declared smallest delay counts as
known; nothing else is, not even a time synchronisation.
"""

from __future__ import annotations

import sys

import numpy as np

from scanwright.design.arrays import Times
from scanwright.firmware_io.lidar.device_clock import DeviceClock

DELAY_NS = 21_000_000
LATE_MS, PPM, SEEDS = 20.0, 50.0, 3
CASES = {
    "40 Hz": (25.05, 0.0),
    "40 Hz, a tick in 10 s": (25.0 * (1 + 1e-4), 0.0),
    "40 Hz, a tick in 100 s": (25.0 * (1 + 1e-5), 0.0),
    "40 Hz, in step": (25.0, 0.0),
    "40 Hz, motor wanders by 1e-4": (25.05, 1e-4),
    "10 Hz": (100.2, 0.0),
}


def sensor(seconds: float, period_ms: float, wander: float, seed: int) -> tuple[Times, Times, Times]:
    """True beginnings of turns [ns], stamps [ms] and arrivals [ns]; a motor wanders in waves of 20 s."""
    rng = np.random.default_rng(seed)
    count = int(seconds * 1000 / period_ms)
    wave = np.sin(2 * np.pi * np.arange(count) * period_ms / 20_000)
    shown_ms = 1234.567 + np.cumsum(period_ms * (1 + wander * wave))
    true_ns = np.int64(7e15) + np.rint((shown_ms - shown_ms[0]) / (1 + PPM * 1e-6) * 1e6).astype(np.int64)
    late_ns = np.rint(rng.uniform(0, LATE_MS, count) * 1e6).astype(np.int64)
    return true_ns, np.floor(shown_ms).astype(np.int64), np.maximum.accumulate(true_ns + DELAY_NS + late_ns)


def main() -> None:
    """Print the errors of every case."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 3600.0
    print("| sensor | after 10 s: median, worst | after 30 s: median, worst |")
    print("| --- | --- | --- |")
    for name, (period_ms, wander) in CASES.items():
        found = []
        for seed in range(SEEDS):
            true_ns, stamp_ms, arrival_ns = sensor(seconds, period_ms, wander, seed)
            clock = DeviceClock(round(period_ms) / 1e3, smallest_delay_ns=DELAY_NS)
            stream = zip(stamp_ms.tolist(), arrival_ns.tolist(), strict=True)
            off_ms = np.abs(np.array([clock.update(*scan).time_ns for scan in stream]) - true_ns) / 1e6
            since_s = (true_ns - true_ns[0]) / 1e9
            found.append([f(off_ms[since_s > after]) for after in (10, 30) for f in (np.median, np.max)])
        a, b, c, d = np.max(found, axis=0)
        print(f"| {name} | {a:.3f} ms, {b:.2f} ms | {c:.3f} ms, {d:.2f} ms |", flush=True)


if __name__ == "__main__":
    main()
