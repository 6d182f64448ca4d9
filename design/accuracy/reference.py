"""Reference values of J: by separate code, two digits more exact than the program.

If the axis makes full turns with an integer number of lines, the polar angle is cut where a beam enters or leaves the
ball, and the smooth pieces between are integrated by Gauss-Legendre. The counts come from the law of cosines and an
ordered list of the start phases at which a line enters or leaves; the difference of two orders is the error. Only the
weight on a circle comes from the program; tests compare it with the other reference. All other cases (sweeps, turns
with a seam, lowest counts) are drawn at random: `design.objective.counted`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numba import njit
from numpy import ndarray
from scipy.spatial.transform import Rotation
from scipy.special import roots_legendre

from scanwright.design.arrays import Array, Setting
from scanwright.design.objective.counted import counted_J
from scanwright.design.objective.problem import Problem
from scanwright.design.sphere.polar_rule import breaks_of
from scanwright.design.task.task import LoadedTask

ORDERS = 12, 20, 40, 80, 160  # Gauss-Legendre nodes of each piece, raised until J converges
ENOUGH = 1e-8  # difference of J between two orders: two digits below the error of the program
DRAWN = 2**18  # directions of each of eight shifts of the net
EVEN = 1e-9  # lines: closer to an integer number of lines, a turn has no seam


@dataclass(frozen=True, slots=True)
class Reference:
    """Reference J and its own error: the difference of two orders, or three standard errors."""

    J: float
    J_error: float


def reference(loaded: LoadedTask, problem: Problem, angles_rad: Setting) -> Reference:
    """Return the reference J of a setting; see the top of this file."""
    if is_smooth(problem):
        return smooth_reference(problem, angles_rad)
    drawn = counted_J(loaded, angles_rad, seed=0, points=DRAWN)
    return Reference(drawn.J, drawn.J_error)


def is_smooth(problem: Problem) -> bool:
    """Return whether J is a sum of integrals over smooth pieces: full turns without a seam, and means."""
    lines = problem.lines
    even = abs(2 * np.pi / lines.step_rad - lines.count) < EVEN * lines.count
    means = all(moment.gathered == "mean" for moment in problem.objective.moments)
    return problem.sweep is None and problem.grid_step_deg is None and even and means


def smooth_reference(problem: Problem, angles_rad: Setting) -> Reference:
    """Return J from smooth pieces, for a problem that `is_smooth`."""
    axis = Rotation.from_euler("XY", angles_rad[:2]).as_matrix()[:, 2]
    bearings = problem.bearings_rad
    in_laser = np.stack([np.cos(bearings), np.sin(bearings), 0 * bearings], axis=1)
    beams = Rotation.from_euler("YX", angles_rad[[3, 2]]).apply(in_laser)
    polar, azimuth = np.arctan2(np.hypot(beams[:, 0], beams[:, 1]), beams[:, 2]), np.arctan2(beams[:, 1], beams[:, 0])
    edges = np.concatenate([polar - problem.ball_rad, polar + problem.ball_rad])
    J: list[float] = []
    for order in ORDERS:
        moments = []
        for moment in problem.objective.moments:
            t, width = smooth_pieces(breaks_of(moment.field, axis, edges), order)
            weight = width * np.sin(t) * moment.field.on_circles(axis, t)[0]
            t, weight = t[weight > 0], weight[weight > 0]
            table = moment.g(problem.lines.repeats * np.arange(problem.lines.count * len(beams) + 1.0))
            g = mean_over_phases(t, polar, azimuth, problem.lines.count, problem.ball_rad, table)
            moments.append(float(weight @ g / weight.sum()))
        J.append(float(problem.objective.join(np.array(moments))))
        if len(J) > 1 and abs(J[-1] - J[-2]) <= ENOUGH:
            break
    return Reference(J[-1], abs(J[-1] - J[-2]))


def smooth_pieces(breaks: Float[ndarray, " n"], order: int) -> tuple[Array, Array]:
    """Return Gauss-Legendre nodes between each two breaks and their widths, for pieces that end in square roots."""
    x, w = roots_legendre(order)
    s = (x + 1) * np.pi / 2  # t = a + (b - a) sin^2(s / 2): square roots at both ends become smooth
    a, b = breaks[:-1, None], breaks[1:, None]
    t = a + (b - a) * np.sin(s / 2) ** 2
    return t.ravel(), ((b - a) * np.sin(s) * w * np.pi / 4).ravel()


@njit(cache=True)
def mean_over_phases(t: Array, polar: Array, azimuth: Array, lines: int, ball: float, g: Array) -> Array:
    """Return the mean over the start phase of g of the count at polar angles (n,), for evenly spaced lines of a turn.

    Every phase occurs once between one line and the next: the count rises by one where the foremost line of a beam
    enters its window, and falls by one where the last one leaves.
    """
    means = np.zeros(len(t))
    step = 2 * np.pi / lines
    at = np.empty(2 * len(polar))
    by = np.empty(2 * len(polar), np.int64)
    for i in range(len(t)):
        count, n = 0, 0
        for b in range(len(polar)):
            if abs(t[i] - polar[b]) > ball:
                continue
            across = np.sin(t[i]) * np.sin(polar[b])
            cosine = np.cos(ball) - np.cos(t[i]) * np.cos(polar[b])
            if cosine <= -across:
                count += lines
                continue
            if cosine > across:
                continue
            half = np.arccos(cosine / across)
            first, last = (azimuth[b] - half) / step, (azimuth[b] + half) / step
            count += int(np.floor(last) - np.ceil(first)) + 1
            at[n], by[n] = last - np.floor(last), -1
            at[n + 1], by[n + 1] = first - np.floor(first), 1
            n += 2
        total, reached = 0.0, 0.0
        for k in np.argsort(at[:n]):
            total += g[count] * (at[k] - reached)
            reached = at[k]
            count += by[k]
        means[i] = total + g[count] * (1 - reached)
    return means
