"""Error against run time of interpolations between two samples of the servo's encoder."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator

import numpy as np
from scipy.interpolate import CubicSpline

from scanwright.design.accuracy.trials import Trial
from scanwright.design.arrays import Floats
from scanwright.design.progress import Progress
from scanwright.firmware_io.assembly.axis_curve import axis_curve
from scanwright.firmware_io.samples import AxisCurve, JointLog, straight

SECONDS = 36.0  # two turns at 20 deg/s
RATE_HZ = 100.0  # of the encoder
BEAMS = 400_000  # about half of a full scan of 18 s
TURN_RAD_S = math.radians(20)  # a turn in 18 s, as in the task ground_ahead
STEP_RAD = 2 * math.pi / 4096  # encoder of 12 bits a turn, as Dynamixel X has


def axis_trials(progress: Progress) -> Iterator[Trial]:
    """Measure each interpolation on turns with 1 % ripple; the error is the rms over all beams at 10 m."""
    progress("interpolation of the servo's angle")
    seconds = np.arange(0, SECONDS, 1 / RATE_HZ)
    steps = np.rint(_truth_rad(seconds) / STEP_RAD)
    log = JointLog(np.rint(seconds * 1e9).astype(np.int64), steps * STEP_RAD)
    at_ns = np.linspace(0, log.time_ns[-1], BEAMS).astype(np.int64)
    true = _truth_rad(at_ns / 1e9)
    for name, prepare in interpolations(log).items():
        start = time.perf_counter()
        angle = prepare().angle_at(at_ns)
        run_s = time.perf_counter() - start
        yield Trial(
            choice=f"servo angle of {BEAMS:,} beams",
            method="between encoder samples",
            setting=name,
            error=float(np.sqrt(np.mean((angle - true) ** 2))) * 10_000,
            unit="mm at 10 m",
            seconds=(run_s,),
            chosen=name == "smoothed",
        )


def interpolations(log: JointLog) -> dict[str, Callable[[], AxisCurve]]:
    """Return the interpolations of a log by name: three orders and the smoothing spline."""

    def last_sample() -> AxisCurve:
        rows = np.zeros((log.time_ns.size - 1, 4))
        rows[:, 0] = log.position_rad[:-1]
        return AxisCurve(log.time_ns, rows)

    def cubic() -> AxisCurve:
        seconds = (log.time_ns - log.time_ns[0]) / 1e9
        return AxisCurve(log.time_ns, np.ascontiguousarray(CubicSpline(seconds, log.position_rad).c[::-1].T))

    return {
        "order 0, last sample": last_sample,
        "order 1, straight": lambda: straight(log),
        "order 3, through samples": cubic,
        "smoothed": lambda: axis_curve(log, at_rest=False)[0],
    }


def _truth_rad(seconds: Floats) -> Floats:
    """Return the true angle: constant speed with the ripple of a servo."""
    turned = TURN_RAD_S * seconds
    return turned + 0.01 * np.sin(turned) / 2 + 0.002 * np.sin(3 * turned)
