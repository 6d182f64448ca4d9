"""Compiled: what a ball counts while the start phase of the turn goes by; see `design.density.spin`.

The unit of azimuth is the step between two lines. The count rises where a line enters the window of a beam and falls
where it leaves; line k does so k steps behind line 0.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numba import njit
from numpy import ndarray

from scanwright.design.arrays import Array, Ints
from scanwright.design.sphere.shell_sort import sort_indices

TIE = 1e-9  # of a gap: steps this close are one, what is between them is rounding
NO_LEVEL = 1 << 62


@njit(cache=True, nogil=True, error_model="numpy")
def half_width(sin_t: float, cos_t: float, sin_b: float, cos_b: float, sin_ball: float, cos_ball: float) -> float:
    """Azimuth half-width of the ball about polar angle t on the circle t_b; pi is all of it, -1 none of it.

    Sines and cosines are those of half the angles: `sin((ball - (t - t_b)) / 2) sin((ball + (t - t_b)) / 2)` keeps
    full precision where t is close to t_b and where both are close to a pole, and an arcsine is all that each pair of
    polar angles costs.
    """
    apart, along = sin_t * cos_b - cos_t * sin_b, cos_t * cos_b + sin_t * sin_b
    across = (sin_ball * along - cos_ball * apart) * (sin_ball * along + cos_ball * apart)
    if across < 0.0:
        return -1.0
    around = 4 * sin_t * cos_t * sin_b * cos_b
    if across >= around:
        return np.pi
    return 2.0 * np.arcsin(np.sqrt(across / around))


def meetings(
    polar_rad: Float[ndarray, " n"], beam_polar_rad: Float[ndarray, " beams"], ball_rad: float
) -> tuple[Ints, Array, Array, Array]:
    """What the kernels take of polar angles about an axis, those of the beams, in order, and the ball.

    Returned are the first beam that may be within the ball and the first one behind, (2, n), and sine and cosine of
    half the polar angles, (2, n), of half those of the beams, (2, beams), and of half the ball, (2,).
    """
    ends = np.searchsorted(beam_polar_rad, np.stack([polar_rad - ball_rad - 1e-9, polar_rad + ball_rad + 1e-9]))
    return ends, halves(polar_rad), halves(beam_polar_rad), halves(ball_rad)


def halves(angle_rad: Array | float) -> Array:
    """Sine and cosine of half of angles (n,), shape (2, n)."""
    half = np.asarray(angle_rad) / 2
    return np.stack([np.sin(half), np.cos(half)])


@njit(cache=True, nogil=True, error_model="numpy")
def mean_counts(ends: Ints, polar: Array, beams: Array, ball: Array) -> Array:
    """Mean share of a turn in which each beam is within the ball, summed over the beams, (polar angles,)."""
    out = np.zeros(polar.shape[1])
    for i in range(len(out)):
        for b in range(ends[0, i], ends[1, i]):
            half = half_width(polar[0, i], polar[1, i], beams[0, b], beams[1, b], ball[0], ball[1])
            if half > 0.0:
                out[i] += half / np.pi
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def sort_by_buckets(at: Array, n: int, order: Array, starts: Array) -> None:
    """Indices that sort the first n places, 0 to 1: spread evenly as they are, twice as fast as by comparing."""
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
def windows_at(
    i: int, ends: Ints, polar: Array, beams: Array, ball: Array, beam_steps: Array, turn: float, edges: Array
) -> tuple[int, int]:
    """Where line 0 enters the windows of the beams at a polar angle and leaves them, by turns, in `edges` [steps].

    `beam_steps` are the azimuths of the beams. The edges are not brought back to one turn. Returned: their number, and
    how many beams see all lines, for which there are none. With sines and cosines of two polar angles, (4, n), the
    windows are the narrower ones: a half-width has one maximum over the polar angle, so no window between the two
    angles is narrower.
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
def even_zones(
    ends: Ints, polar: Array, beams: Array, ball: Array, beam_steps: Array, count: int, g: Array
) -> tuple[Array, Array, Array, Array, Ints]:
    """Statistics over the start phase if all gaps between lines are equal: one gap represents all.

    Returned are means of g and of the count, lowest and highest count, and the entries of g that each polar angle needs
    at most, (polar angles,) each. Where g has fewer, the statistics are left 0.
    """
    n = polar.shape[1]
    mean_g, mean, least, most = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    need = np.zeros(n, np.int64)
    at = np.empty(2 * len(beam_steps))
    order, starts = np.empty(len(at), np.int64), np.empty(len(at) + 1, np.int64)
    for i in range(n):
        edges, full = windows_at(i, ends, polar, beams, ball, beam_steps, count, at)
        inside, balance = 0.0, 0.0
        for k in range(0, edges, 2):
            inside += at[k + 1] - at[k]
            at[k], at[k + 1] = at[k] - np.floor(at[k]), at[k + 1] - np.floor(at[k + 1])
            balance += at[k] - at[k + 1]
        need[i] = full * count + int(inside) + edges + 2
        if need[i] > len(g):
            continue
        mean[i] = full * count + inside
        # what the mean count leaves when all steps are done is open from the start, whatever ties with what
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
    """Change the count on some pieces of a gap; returned is what the sum of g over the gap changes by."""
    change = 0.0
    for j in range(first, last):
        change += width[j] * (g[level[j] + by] - g[level[j]])
        level[j] += by
    return change


@njit(cache=True, nogil=True, error_model="numpy")
def seam_zones(
    ends: Ints, polar: Array, beams: Array, ball: Array, beam_steps: Array, turn: float, g: Array
) -> tuple[Array, Array, Array, Array, Ints]:
    """The same if the last gap is shorter than a step; `turn` is the number of steps in a turn, no whole one.

    In each gap an edge makes one step: ahead of it in the turn where the lines come through the seam, behind it later
    in the gap by what the seam lacks of a whole step. So when the walk passes an edge the count changes on one arc of
    the gap, which may go on at the start of the next one, and stays what it was on the rest.
    """
    n = polar.shape[1]
    mean_g, mean, least, most = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    need = np.zeros(n, np.int64)
    count = int(np.ceil(turn))
    seam = turn - (count - 1)
    size = 4 * len(beam_steps)
    edge, at, gap, goes_on = np.empty(size), np.empty(size), np.empty(size, np.int64), np.empty(size, np.bool_)
    order, rank, starts = np.empty(size, np.int64), np.empty(size, np.int64), np.empty(size + 1, np.int64)
    width, level = np.empty(size + 1), np.empty(size + 1, np.int64)
    for i in range(n):
        edges, full = windows_at(i, ends, polar, beams, ball, beam_steps, turn, edge)
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
            goes_on[k] = behind >= seam
            ahead = behind - seam if goes_on[k] else behind - seam + 1.0
            at[k], at[edges + k] = ahead, behind
            through = gap[k] + goes_on[k]  # lines
            for lines, first_at in ((through, ahead), (count - through, edge[k])):
                balance += sign * (lines * (turn - first_at) - lines * (lines - 1) / 2)
        mean[i] = full * count + inside * (count / turn)
        # what the mean count leaves when all steps are done is open from the start, whatever ties with what
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
        first, last = 0, pieces  # that have changed
        started, ended, walked = 0, 0, 0
        while True:
            while ended < started:
                k = order[ended]
                if goes_on[k]:
                    total += _raise(level, width, 0, rank[k] + 1, 1 - 2 * (k % 2), g)
                    first, last = 0, max(last, rank[k] + 1)
                ended += 1
            while started < edges and gap[order[started]] <= walked:
                k = order[started]
                start, end_at = rank[edges + k] + 1, pieces if goes_on[k] else rank[k] + 1
                total += _raise(level, width, start, end_at, 1 - 2 * (k % 2), g)
                first, last = min(first, start), max(last, end_at)
                started += 1
            if walked == count - 1:
                break
            for j in range(first, last):
                if width[j] > TIE:
                    lowest, highest = min(lowest, level[j]), max(highest, level[j])
            after = walked + 1 if ended < started else (gap[order[started]] if started < edges else count - 1)
            mean_g[i] += total * (after - walked)
            walked, first, last = after, pieces, 0
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
