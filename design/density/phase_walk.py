"""Compiled kernels: statistics of the beam count of a ball over the start phase of a turn (`design.density.spin`).

Azimuths are in steps between lines. A beam lies within a ball if the azimuth of its line lies in a window about the
beam's own azimuth. With rising start phase the count rises when a line enters a window and falls when a line leaves
it; line k does so k steps after line 0.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numba import njit
from numpy import ndarray

from scanwright.design.arrays import Array, Ints
from scanwright.design.sphere.shell_sort import sort_indices

TIE = 1e-9  # share of a gap: counts over shorter intervals are rounding errors
NO_LEVEL = 1 << 62  # above every count


@njit(cache=True, nogil=True, error_model="numpy")
def half_width(sin_t: float, cos_t: float, sin_b: float, cos_b: float, sin_ball: float, cos_ball: float) -> float:
    """Return the azimuth half-width [rad] of a ball at polar angle t on the circle at polar angle t_b.

    It is pi if the circle lies in the ball, and -1 if it misses the ball. The arguments are sines and cosines of half
    the angles: `sin((ball - (t - t_b)) / 2) sin((ball + (t - t_b)) / 2)` keeps full precision if t is close to t_b or
    both are close to a pole, and needs one arcsine for each pair.
    """
    apart, along = sin_t * cos_b - cos_t * sin_b, cos_t * cos_b + sin_t * sin_b
    across = (sin_ball * along - cos_ball * apart) * (sin_ball * along + cos_ball * apart)
    if across < 0.0:
        return -1.0
    around = 4 * sin_t * cos_t * sin_b * cos_b
    if across >= around:
        return np.pi
    return 2.0 * np.arcsin(np.sqrt(across / around))


def kernel_inputs(
    polar_rad: Float[ndarray, " n"], beam_polar_rad: Float[ndarray, " beams"], ball_rad: float
) -> tuple[Ints, Array, Array, Array]:
    """Return the candidate beams of each ball, as index ranges (2, n), and `half_angles` of balls, beams and radius.

    `beam_polar_rad` must increase.
    """
    ends = np.searchsorted(beam_polar_rad, np.stack([polar_rad - ball_rad - 1e-9, polar_rad + ball_rad + 1e-9]))
    return ends, half_angles(polar_rad), half_angles(beam_polar_rad), half_angles(ball_rad)


def half_angles(angle_rad: Array | float) -> Array:
    """Return sine and cosine of half of each angle, shape (2, n)."""
    half = np.asarray(angle_rad) / 2
    return np.stack([np.sin(half), np.cos(half)])


@njit(cache=True, nogil=True, error_model="numpy")
def mean_counts(ends: Ints, polar: Array, beams: Array, ball: Array) -> Array:
    """Return the share of a turn in which each beam lies within the ball, summed over the beams, shape (n,)."""
    out = np.zeros(polar.shape[1])
    for i in range(len(out)):
        for b in range(ends[0, i], ends[1, i]):
            half = half_width(polar[0, i], polar[1, i], beams[0, b], beams[1, b], ball[0], ball[1])
            if half > 0.0:
                out[i] += half / np.pi
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def sort_by_buckets(at: Array, n: int, order: Array, starts: Array) -> None:
    """Write into `order` the indices that sort the first n values of `at`, 0 to 1; fast if they are spread evenly."""
    for b in range(n + 1):
        starts[b] = 0
    most = 0
    for k in range(n):
        b = min(int(at[k] * n), n - 1) + 1
        starts[b] += 1
        most = max(most, starts[b])
    for b in range(n):
        starts[b + 1] += starts[b]
    for k in range(n):
        b = min(int(at[k] * n), n - 1)
        order[starts[b]] = k
        starts[b] += 1
    sort_indices(at, order, n, most)


@njit(cache=True, nogil=True, error_model="numpy")
def window_edges(
    i: int, ends: Ints, polar: Array, beams: Array, ball: Array, beam_steps: Array, turn: float, edges: Array
) -> tuple[int, int]:
    """Write into `edges` the start and end [steps] of the window of each beam for ball i, not reduced to one turn.

    `beam_steps` are the azimuths of the beams. Return the number of edges, and the number of beams whose window is the
    entire circle and has no edges. If `polar` has the half angles of two polar angles, shape (4, n), each window is
    the narrower one of the two: the half-width has one maximum over the polar angle, so none in between is narrower.
    """
    n, full = 0, 0
    for b in range(ends[0, i], ends[1, i]):
        half = half_width(polar[0, i], polar[1, i], beams[0, b], beams[1, b], ball[0], ball[1])
        if len(polar) > 2:
            half = min(half, half_width(polar[2, i], polar[3, i], beams[0, b], beams[1, b], ball[0], ball[1]))
        if half >= np.pi:
            full += 1
        elif half >= 0.0:
            half *= turn / (2 * np.pi)
            edges[n], edges[n + 1] = beam_steps[b] - half, beam_steps[b] + half
            n += 2
    return n, full


@njit(cache=True, nogil=True, error_model="numpy")
def even_statistics(
    ends: Ints, polar: Array, beams: Array, ball: Array, beam_steps: Array, count: int, g: Array
) -> tuple[Array, Array, Array, Array, Ints]:
    """Return statistics over the start phase if all gaps between lines are equal: one gap represents all.

    These are the means of g and of the count, the lowest and the highest count, and the table entries of g that are
    needed, shape (n,) each. If g has fewer entries, the statistics are 0.
    """
    n = polar.shape[1]
    mean_g, mean, least, most = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    need = np.zeros(n, np.int64)
    at = np.empty(2 * len(beam_steps))
    order, starts = np.empty(len(at), np.int64), np.empty(len(at) + 1, np.int64)
    for i in range(n):
        edges, full = window_edges(i, ends, polar, beams, ball, beam_steps, count, at)
        inside, balance = 0.0, 0.0
        for k in range(0, edges, 2):
            inside += at[k + 1] - at[k]
            at[k], at[k + 1] = at[k] - np.floor(at[k]), at[k + 1] - np.floor(at[k + 1])
            balance += at[k] - at[k + 1]
        need[i] = full * count + int(inside) + edges + 2
        if need[i] > len(g):
            continue
        mean[i] = full * count + inside
        # the count at phase 0, from the mean count and all steps: independent of the order of equal steps
        level = full * count + int(np.floor(inside + balance + 0.5))
        sort_by_buckets(at, edges, order, starts)
        here, lowest, highest = 0.0, NO_LEVEL, 0
        for j in range(edges):
            k = order[j]
            width = at[k] - here
            mean_g[i] += g[level] * width
            if width > TIE:
                lowest, highest = min(lowest, level), max(highest, level)
            here = at[k]
            level += 1 - 2 * (k % 2)
        mean_g[i] += g[level] * (1.0 - here)
        if 1.0 - here > TIE:
            lowest, highest = min(lowest, level), max(highest, level)
        least[i], most[i] = lowest, highest
    return mean_g, mean, least, most, need


@njit(cache=True, nogil=True, error_model="numpy")
def _raise(level: Ints, width: Array, first: int, last: int, by: int, g: Array) -> float:
    """Add `by` to the count on the pieces first .. last of a gap; return the change of the sum of g over the gap."""
    change = 0.0
    for j in range(first, last):
        change += width[j] * (g[level[j] + by] - g[level[j]])
        level[j] += by
    return change


@njit(cache=True, nogil=True, error_model="numpy")
def seam_statistics(
    ends: Ints, polar: Array, beams: Array, ball: Array, beam_steps: Array, turn: float, g: Array
) -> tuple[Array, Array, Array, Array, Ints]:
    """Return the statistics of `even_statistics` if the last gap (the seam) is shorter than the others.

    `turn` is the number of steps in a turn, not an integer. Each window edge changes the count once in every gap of the
    start phase. In the gaps before that of the edge the lines reach it through the seam, so the place of the change
    differs (`ahead`) from that in the gaps after it (`behind`). When the loop over the gaps passes an edge, the count
    changes on the arc between the two places, which can continue at the start of the next gap (`wraps`).
    """
    n = polar.shape[1]
    mean_g, mean, least, most = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    need = np.zeros(n, np.int64)
    count = int(np.ceil(turn))
    seam = turn - (count - 1)
    size = 4 * len(beam_steps)
    edge, at, gap, wraps = np.empty(size), np.empty(size), np.empty(size, np.int64), np.empty(size, np.bool_)
    order, rank, starts = np.empty(size, np.int64), np.empty(size, np.int64), np.empty(size + 1, np.int64)
    width, level = np.empty(size + 1), np.empty(size + 1, np.int64)
    for i in range(n):
        edges, full = window_edges(i, ends, polar, beams, ball, beam_steps, turn, edge)
        pieces = 2 * edges + 1
        inside, balance = 0.0, 0.0
        for k in range(0, edges, 2):
            inside += edge[k + 1] - edge[k]
        need[i] = full * count + int(inside) + edges + 2
        if need[i] > len(g):
            continue
        for k in range(edges):
            sign = 1 - 2 * (k % 2)
            edge[k] -= turn * np.floor(edge[k] / turn)
            gap[k] = min(int(edge[k]), count - 1)
            behind = edge[k] - gap[k]
            wraps[k] = behind >= seam
            ahead = behind - seam if wraps[k] else behind - seam + 1.0
            at[k], at[edges + k] = ahead, behind
            through = gap[k] + wraps[k]  # lines
            for lines, first_at in ((through, ahead), (count - through, edge[k])):
                balance += sign * (lines * (turn - first_at) - lines * (lines - 1) / 2)
        mean[i] = full * count + inside * (count / turn)
        # the count at phase 0, as in `even_statistics`
        now = full * count + int(np.floor((inside * count - balance) / turn + 0.5))
        sort_by_buckets(at, 2 * edges, order, starts)
        here, total = 0.0, 0.0
        for j in range(pieces):
            end = at[order[j]] if j < 2 * edges else 1.0
            width[j], level[j] = end - here, now
            total += g[now] * (end - here)
            here = end
            if j < 2 * edges:
                rank[order[j]] = j
                now += 1 - 2 * (order[j] % 2) if order[j] < edges else 0
        for k in range(edges):
            at[k] = edge[k] / turn
        sort_by_buckets(at, edges, order, starts)
        lowest, highest = NO_LEVEL, 0
        first, last = 0, pieces  # range of the changed pieces
        started, ended, passed = 0, 0, 0
        while True:
            while ended < started:
                k = order[ended]
                if wraps[k]:
                    total += _raise(level, width, 0, rank[k] + 1, 1 - 2 * (k % 2), g)
                    first, last = 0, max(last, rank[k] + 1)
                ended += 1
            while started < edges and gap[order[started]] <= passed:
                k = order[started]
                start, end_at = rank[edges + k] + 1, pieces if wraps[k] else rank[k] + 1
                total += _raise(level, width, start, end_at, 1 - 2 * (k % 2), g)
                first, last = min(first, start), max(last, end_at)
                started += 1
            if passed == count - 1:
                break
            for j in range(first, last):
                if width[j] > TIE:
                    lowest, highest = min(lowest, level[j]), max(highest, level[j])
            after = passed + 1 if ended < started else (gap[order[started]] if started < edges else count - 1)
            mean_g[i] += total * (after - passed)
            passed, first, last = after, pieces, 0
        here = 0.0
        for j in range(pieces):
            part = min(here + width[j], seam) - here
            if part > 0.0:
                mean_g[i] += g[level[j]] * part
            if part > TIE:
                lowest, highest = min(lowest, level[j]), max(highest, level[j])
            here += width[j]
        mean_g[i] /= turn
        least[i], most[i] = lowest, highest
    return mean_g, mean, least, most, need
