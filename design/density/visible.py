"""Beam density of a scan in which fixed parts block some beams at some axis angles.

It is not rotationally symmetric, so it is summed over the beams: beam b lies within the ball at polar angle t and
azimuth p while the joint angle is within `delta_b(t)` of `p - p_b` (`design.density.spin`). Its mean count over the
start phase is the number of free lines in that window, from a table over the joint angle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numba import njit
from numpy import ndarray

from scanwright.design.arrays import Array, Ints
from scanwright.design.concurrency.parallel import in_chunks
from scanwright.design.density.beams import ScanLines, polar_and_azimuth
from scanwright.design.density.phase_walk import half_width, kernel_inputs
from scanwright.design.density.sweep import SweepLines


@dataclass(frozen=True, slots=True)
class FreeLines:
    """Mean number of lines over the start phase in which each beam is free, cumulated over the joint angle."""

    low_rad: float  # lowest joint angle
    edges_rad: Float[ndarray, " n"]  # joint angles relative to the lowest one, increasing from 0
    lines: Float[ndarray, "beams n"]  # free lines of each beam up to each edge
    first: float  # place of the first edge on the regular grid of edges, in steps
    step_rad: float  # step of that grid


def free_lines(blocked: Bool[ndarray, "beams angles"], lines: ScanLines, sweep: SweepLines | None) -> FreeLines:
    """Return the table of free lines of a full turn, or of a sweep.

    `blocked` states whether a beam is blocked at equal steps of the axis angle from 0.
    """
    steps = blocked.shape[1]
    step = 2 * np.pi / steps
    low, high = (0.0, 2 * np.pi) if sweep is None else np.radians(sweep.motion.limits_deg)
    first = int(np.floor(low / step + 0.5))  # index of the step of the lowest angle
    last = int(np.ceil(high / step + 0.5)) if high > low else first + 1
    edges = np.clip((np.arange(first, last + 1) - 0.5) * step, low, high)
    if sweep is None:
        passed = lines.repeats * lines.count * edges / (2 * np.pi)
    else:
        passed = 2 * sweep.scan_rate_hz * sweep.motion.time_s(edges)  # out and back
        passed[-1] = sweep.scans  # also if the limits are one angle
    free = np.diff(passed) * ~blocked[:, np.arange(first, last) % steps]
    total = np.concatenate([np.zeros((len(blocked), 1)), np.cumsum(free, axis=1)], axis=1)
    return FreeLines(low, edges - low, total, (low / step + 0.5) - first, step)


def mean_count_free(
    directions_rot: Float[ndarray, "n 3"], beams_rot: Float[ndarray, "beams 3"], free: FreeLines, ball_rad: float
) -> Float[ndarray, " n"]:
    """Return the mean count of free beams within a ball over the start phase, for each direction, shape (n,)."""
    t, p = polar_and_azimuth(directions_rot)
    t_b, p_b = polar_and_azimuth(beams_rot)
    order = np.argsort(t_b, kind="stable")
    t_b, p_b, lines = t_b[order], p_b[order], free.lines[order]
    parts = in_chunks(
        lambda chunk: _counts(
            *kernel_inputs(t[chunk], t_b, ball_rad),
            p[chunk] - free.low_rad,
            p_b,
            free.edges_rad,
            lines,
            free.first,
            free.step_rad,
        ),
        len(t),
    )
    return np.concatenate(parts)


@njit(cache=True, nogil=True, error_model="numpy")
def _up_to(x: float, edges: Array, lines: Array, first: float, step: float) -> float:
    """Return the free lines up to a joint angle x relative to the lowest one, linear between edges."""
    last = len(edges) - 1
    if x <= 0.0:
        return 0.0
    if x >= edges[last]:
        return lines[last]
    k = min(int(x / step + first), last - 1)
    width = edges[k + 1] - edges[k]
    share = min(max((x - edges[k]) / width, 0.0), 1.0) if width > 0.0 else 1.0
    return lines[k] + share * (lines[k + 1] - lines[k])


@njit(cache=True, nogil=True, error_model="numpy")
def _counts(
    ends: Ints, polar: Array, beams: Array, ball: Array, p: Array, p_b: Array, edges: Array, lines: Array,
    first: float, step: float,
) -> Array:  # fmt: skip
    out = np.zeros(len(p))
    span, turn = edges[len(edges) - 1], 2 * np.pi
    for i in range(len(p)):
        for b in range(ends[0, i], ends[1, i]):
            half = half_width(polar[0, i], polar[1, i], beams[0, b], beams[1, b], ball[0], ball[1])
            if half < 0.0:
                continue
            if half >= np.pi:
                out[i] += lines[b, len(edges) - 1]
                continue
            start = p[i] - p_b[b] - half
            start -= turn * (np.floor(start / turn) + 1.0)  # the copy of the window that starts below the range
            while start <= span:
                low = _up_to(start, edges, lines[b], first, step)
                out[i] += _up_to(start + 2 * half, edges, lines[b], first, step) - low
                start += turn
    return out
