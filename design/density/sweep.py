"""Beam density of a sweeping scanner, from its real trajectory; it is not rotationally symmetric about the axis.

The servo passes every angle twice in a period, once in each direction. Beam b lies within the ball about a direction
(polar angle t, azimuth p in the rotation frame) while the joint angle is within `delta_b(t)` of `p - p_b`
(`design.density.spin`): one or two time intervals in each half of the period. Scans start at the times `(k + s) / f`
with the start phase s in 0 .. 1, so the count is a step function of s, and its statistics over s are exact.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numba import njit
from numpy import ndarray

from scanwright.design.arrays import Array, Counts, Ints
from scanwright.design.concurrency.parallel import in_chunks
from scanwright.design.density.beams import polar_and_azimuth
from scanwright.design.density.phase_walk import NO_LEVEL, TIE, half_width, kernel_inputs, sort_by_buckets
from scanwright.design.density.spin import PhaseStatistics
from scanwright.design.density.value_table import with_value_table
from scanwright.design.motion import Sweep


@dataclass(frozen=True, slots=True)
class SweepLines:
    """The scan lines of one sweep period, at the times `(k + s) / scan_rate_hz`."""

    motion: Sweep
    scan_rate_hz: float

    @property
    def scans(self) -> float:
        """Mean number of scans in one period over the start phase."""
        return self.motion.period_s * self.scan_rate_hz

    def angles_rad(self, start: float) -> Float[ndarray, " lines"]:
        """Return the joint angles of all lines for a start phase in 0 .. 1."""
        k = np.arange(int(np.ceil(self.scans - start - 1e-12)))
        return self.motion.angle_rad((k + start) / self.scan_rate_hz)

    def numbers(self) -> Float[ndarray, " 6"]:
        """Return lower limit, range [rad], cruise speed [rad/s], ramp, half period [s], scan rate [Hz] for kernels."""
        motion = self.motion
        lower, upper = np.radians(motion.limits_deg)
        cruise = np.radians(motion.cruise_deg_s)
        return np.array([lower, upper - lower, cruise, motion.ramp_s, motion.period_s / 2, self.scan_rate_hz])


def mean_count_swept(
    directions_rot: Float[ndarray, "n 3"],
    beams_rot: Float[ndarray, "beams 3"],
    lines: SweepLines,
    ball_rad: float,
) -> Float[ndarray, " n"]:
    """Return the mean count of beams within a ball over the start phase, for each direction, shape (n,).

    Directions and beams are unit vectors in the rotation frame at joint angle 0.
    """
    t, p, t_b, p_b = _sorted(directions_rot, beams_rot)
    numbers = lines.numbers()
    parts = in_chunks(lambda chunk: _mean(*kernel_inputs(t[chunk], t_b, ball_rad), p[chunk], p_b, numbers), len(t))
    return np.concatenate(parts)


def phase_statistics_swept(
    directions_rot: Float[ndarray, "n 3"],
    beams_rot: Float[ndarray, "beams 3"],
    lines: SweepLines,
    ball_rad: float,
    g: Callable[[Counts], Array],
) -> PhaseStatistics:
    """Return exact statistics of the count over the start phase; arguments as for `mean_count_swept`.

    `g` is a function of the count, element by element.
    """
    t, p, t_b, p_b = _sorted(directions_rot, beams_rot)
    numbers = lines.numbers()

    def statistics(which: Ints, table: Array) -> tuple[Array, Array, Array, Array, Ints]:
        return _statistics(*kernel_inputs(t[which], t_b, ball_rad), p[which], p_b, numbers, table)

    return PhaseStatistics(*with_value_table(statistics, len(t), g, 1, smallest=1))


def _sorted(
    directions: Float[ndarray, "n 3"], beams: Float[ndarray, "beams 3"]
) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"], Float[ndarray, " beams"], Float[ndarray, " beams"]]:
    """Return polar angles and azimuths of the directions, and of the beams in the order of their polar angle."""
    t_b, p_b = polar_and_azimuth(beams)
    order = np.argsort(t_b, kind="stable")
    return *polar_and_azimuth(directions), t_b[order], p_b[order]


@njit(cache=True, nogil=True, error_model="numpy")
def _time(done: float, numbers: Array) -> float:
    """Return the time [s] at which the sweep first passes `done` rad above its lower limit: `Sweep.time_s` compiled."""
    span, cruise, ramp, half = numbers[1], numbers[2], numbers[3], numbers[4]
    if cruise <= 0.0:
        return half if done > 0.0 else 0.0
    if done <= 0.0:
        return 0.0
    if done >= span:
        return half
    slow = 0.5 * cruise * ramp
    if done < slow:
        return np.sqrt(2 * done * ramp / cruise)
    if span - done < slow:
        return half - np.sqrt(2 * (span - done) * ramp / cruise)
    return 0.5 * ramp + done / cruise


@njit(cache=True, nogil=True, error_model="numpy")
def _intervals(centre: float, half_angle: float, numbers: Array, out: Array) -> int:
    """Write the (start, end) times [scans] of the joint within an angle of `centre` into `out`; return their number."""
    lower, span, half, rate = numbers[0], numbers[1], numbers[4], numbers[5]
    n = 0
    turn = 2 * np.pi
    if half_angle >= np.pi:
        out[0, 0], out[0, 1] = 0.0, 2 * half * rate
        return 1
    # all copies of the window, a turn apart, that overlap the range of the sweep
    start = centre - half_angle - lower
    start -= turn * (np.floor(start / turn) + 1.0)  # twice as fast as `%`
    while start <= span:
        end = start + 2 * half_angle
        if end >= 0.0:
            a, b = _time(max(start, 0.0), numbers), _time(end, numbers)
            if end >= span:  # the window contains the turning point: one interval
                out[n, 0], out[n, 1] = a * rate, (2 * half - a) * rate
                n += 1
            else:
                out[n, 0], out[n, 1] = a * rate, b * rate
                out[n + 1, 0], out[n + 1, 1] = (2 * half - b) * rate, (2 * half - a) * rate
                n += 2
        start += turn
    return n


@njit(cache=True, nogil=True, error_model="numpy")
def _mean(ends: Ints, polar: Array, beams: Array, ball: Array, p: Array, p_b: Array, numbers: Array) -> Array:
    out = np.zeros(len(p))
    pairs = np.empty((6, 2))
    for i in range(len(p)):
        for b in range(ends[0, i], ends[1, i]):
            half = half_width(polar[0, i], polar[1, i], beams[0, b], beams[1, b], ball[0], ball[1])
            if half < 0.0:
                continue
            for k in range(_intervals(p[i] - p_b[b], half, numbers, pairs)):
                out[i] += pairs[k, 1] - pairs[k, 0]
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _statistics(
    ends: Ints, polar: Array, beams: Array, ball: Array, p: Array, p_b: Array, numbers: Array, g: Array
) -> tuple[Array, Array, Array, Array, Ints]:
    """Return the statistics of `even_statistics` for each direction of a sweep."""
    n = len(p)
    need = np.zeros(n, np.int64)
    mean_g, mean, least, most = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    at, rise = np.empty(12 * len(p_b)), np.empty(12 * len(p_b), np.int64)
    order, starts = np.empty(len(at), np.int64), np.empty(len(at) + 1, np.int64)
    pairs = np.empty((6, 2))
    for i in range(n):
        level, steps = 0, 0
        for b in range(ends[0, i], ends[1, i]):
            half = half_width(polar[0, i], polar[1, i], beams[0, b], beams[1, b], ball[0], ball[1])
            if half < 0.0:
                continue
            for k in range(_intervals(p[i] - p_b[b], half, numbers, pairs)):
                first, last = pairs[k, 0], pairs[k, 1]
                mean[i] += last - first
                # floor(last - s) - ceil(first - s) + 1 scans k + s lie in first .. last
                level += int(np.floor(last)) - int(np.ceil(first)) + 1
                at[steps], rise[steps] = first - np.floor(first), 1
                if first == np.floor(first):  # already counted at s = 0
                    at[steps], rise[steps] = 0.0, 0
                at[steps + 1], rise[steps + 1] = last - np.floor(last), -1
                steps += 2
        need[i] = level + steps // 2 + 2
        if need[i] > len(g):
            continue
        sort_by_buckets(at, steps, order, starts)
        here, lowest, highest = 0.0, NO_LEVEL, 0
        for j in range(steps):
            k = order[j]
            if at[k] > here:
                mean_g[i] += g[level] * (at[k] - here)
                if at[k] - here > TIE:
                    lowest, highest = min(lowest, level), max(highest, level)
                here = at[k]
            level += rise[k]
        mean_g[i] += g[level] * (1.0 - here)
        if 1.0 - here > TIE:
            lowest, highest = min(lowest, level), max(highest, level)
        least[i], most[i] = lowest, highest
    return mean_g, mean, least, most, need
