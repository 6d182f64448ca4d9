"""Error against run time of the ways to go between two samples of the servo's encoder."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from design.accuracy.trials import Trial
from design.arrays import Floats
from firmware_io.assembly.axis_curve import interpolation_orders
from firmware_io.samples import JointLog

SECONDS = 36.0  # two turns at 20 deg/s
RATE_HZ = 100.0  # of the encoder
BEAMS = 400_000
TURN_RAD_S = math.radians(20)
STEP_RAD = 2 * math.pi / 4096


def axis_trials(progress: Callable[[str], None]) -> Iterator[Trial]:
    """Each order on a turn with 1 % ripple; the error is the root mean square over all beams, at the end of 10 m."""
    progress("interpolation of the servo's angle")
    seconds = np.arange(0, SECONDS, 1 / RATE_HZ)
    steps = np.rint(_truth_rad(seconds) / STEP_RAD)
    log = JointLog(np.rint(seconds * 1e9).astype(np.int64), steps * STEP_RAD)
    for point in interpolation_orders(log, _truth_rad, BEAMS):
        yield Trial(
            choice=f"servo angle of {BEAMS:,} beams",
            method="between encoder samples",
            setting=point.method,
            error=point.rms_mm_at_10m,
            unit="mm at 10 m",
            seconds=(point.prepare_s + point.ns_per_beam * BEAMS / 1e9,),
            chosen=point.method == "smoothed",
        )


def _truth_rad(seconds: Floats) -> Floats:
    """Constant speed and the ripple of a servo."""
    turned = TURN_RAD_S * seconds
    return turned + 0.01 * np.sin(turned) / 2 + 0.002 * np.sin(3 * turned)
