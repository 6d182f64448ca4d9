"""Density of one full scan: beams within a ball about a direction. Closed form, exact counts, and the ball search.

With unlimited rotation at constant speed the density is zonal about the axis: all that a scan-plane setting decides
is the polar angle t_b and the azimuth p_b of each beam in the rotation frame. At polar angle t beam b meets the ball
of radius rho within the azimuth half-width `delta_b`,

    cos(rho) = cos(t) cos(t_b) + sin(t) sin(t_b) cos(delta_b),

so it adds as many counts at azimuth p as lines lie in [p - p_b - delta_b, p - p_b + delta_b], and
`count * delta_b / pi` in the mean over the start phase of the turn (docs/definitions.md, Density).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numba import njit
from numpy import ndarray
from scipy.spatial import cKDTree

from design.arrays import Array
from design.concurrency.parallel import in_chunks
from design.density.beams import ScanLines

TIE = 1e-9  # of a gap: steps this close are one, what is between them is rounding
CROWD = 32  # places in one bucket, above which sorting within it would cost more than sorting all
EXACT_TURN = 1e-9  # relative gap difference below which the last gap counts as a full one


@dataclass(frozen=True, slots=True)
class Zones:
    """What is seen at polar angles t about the axis; every array has shape (len(t),).

    Attributes:
        mean_g: mean over the start phase of g of the true count.
        mean: mean count.
        least: lowest count at any phase.
        most: highest count at any phase; 0 is blind.
    """

    mean_g: Float[ndarray, " n"]
    mean: Float[ndarray, " n"]
    least: Float[ndarray, " n"]
    most: Float[ndarray, " n"]


def mean_count(
    polar_rad: Float[ndarray, " n"], beam_polar_rad: Float[ndarray, " beams"], lines: ScanLines, ball_rad: float
) -> Float[ndarray, " n"]:
    """Mean over the start phase of the beams within a ball at polar angles t, in closed form, shape (len(t),)."""
    beams = np.sort(beam_polar_rad)
    parts = in_chunks(lambda chunk: _mean_counts(polar_rad[chunk], beams, ball_rad), len(polar_rad))
    return lines.repeats * lines.count * np.concatenate(parts)


def zones(
    polar_rad: Float[ndarray, " n"],
    beam_polar_rad: Float[ndarray, " beams"],
    beam_azimuth_rad: Float[ndarray, " beams"],
    lines: ScanLines,
    ball_rad: float,
    g: Float[ndarray, " counts"],
) -> Zones:
    """Exact statistics over the start phase at polar angles t.

    The count changes by one where a line enters or leaves a beam's window. Between the lines the same steps come
    again, at most once broken by the seam of the turn, so one sorted list of steps serves every gap.

    Args:
        polar_rad: polar angles t about the axis, shape (n,).
        beam_polar_rad: polar angle of each beam in the rotation frame, shape (beams,).
        beam_azimuth_rad: azimuth of each beam in the rotation frame, shape (beams,).
        lines: scan lines of the turn.
        ball_rad: ball radius.
        g: value of g for every number of measured lines 0, 1, .. lines * beams, each with all its repeats.
    """
    order = np.argsort(beam_polar_rad, kind="stable")
    polar_b, azimuth_b = beam_polar_rad[order], beam_azimuth_rad[order] % (2 * np.pi)
    parts = in_chunks(
        lambda chunk: _zones(polar_rad[chunk], polar_b, azimuth_b, lines.count, lines.step_rad, ball_rad, g),
        len(polar_rad),
        smallest=128,
    )
    mean_g, mean, least, most = (np.concatenate([part[i] for part in parts]) for i in range(4))
    return Zones(mean_g, lines.repeats * mean, lines.repeats * least, lines.repeats * most)


def count_at(
    polar_rad: float,
    azimuth_rad: float,
    beam_polar_rad: Float[ndarray, " beams"],
    beam_azimuth_rad: Float[ndarray, " beams"],
    lines: ScanLines,
    ball_rad: float,
) -> int:
    """Beams within the ball about one direction of the rotation frame, first line at azimuth 0: floor and ceil."""
    half = _half_widths(polar_rad, beam_polar_rad, ball_rad)
    seen = half >= 0
    first = (azimuth_rad - beam_azimuth_rad[seen] - half[seen]) % (2 * np.pi)
    last = first + 2 * half[seen]
    top = lines.count - 1
    before_seam = np.minimum(np.floor(last / lines.step_rad), top) - np.ceil(first / lines.step_rad) + 1
    behind_seam = np.minimum(np.floor((last - 2 * np.pi) / lines.step_rad), top) + 1
    counts = np.maximum(before_seam, 0) + np.maximum(behind_seam, 0)
    return int(np.where(half[seen] >= np.pi, lines.count, counts).sum())


def ball_search(
    beams: Float[ndarray, "beams 3"], directions: Float[ndarray, "n 3"], ball_rad: float
) -> Int[ndarray, " n"]:
    """Beams within `ball_rad` of each direction, the paper's section 4.2: slow, obvious, the oracle of all else.

    Args:
        beams: unit vectors, shape (beams, 3).
        directions: unit vectors, shape (n, 3).
        ball_rad: angle on the sphere.

    Returns:
        Counts, shape (n,).
    """
    chord = 2 * np.sin(ball_rad / 2)
    return cKDTree(beams).query_ball_point(directions, chord, return_length=True, workers=-1)


def _half_widths(t: float, beam_polar: Float[ndarray, " beams"], ball_rad: float) -> Float[ndarray, " beams"]:
    """delta_b at polar angle t; -1 where the ball never meets the beam."""
    return np.array([half_width(t, b, ball_rad) for b in beam_polar])


@njit(cache=True, nogil=True)
def half_width(t: float, t_b: float, ball: float) -> float:
    """Azimuth half-width of the ball about polar angle t on the circle t_b; pi is all of it, -1 none of it.

    The haversine form keeps full precision where t is close to t_b and where both are close to a pole.
    """
    across = np.sin(0.5 * (ball - (t - t_b))) * np.sin(0.5 * (ball + (t - t_b)))
    if across < 0.0:
        return -1.0
    around = np.sin(t) * np.sin(t_b)
    if across >= around:
        return np.pi
    return 2.0 * np.arcsin(np.sqrt(across / around))


@njit(cache=True, nogil=True)
def _mean_counts(polar: Array, beam_polar: Array, ball: float) -> Array:
    out = np.zeros(len(polar))
    for i in range(len(polar)):
        first = np.searchsorted(beam_polar, polar[i] - ball - 1e-9)
        for b in range(first, len(beam_polar)):
            if beam_polar[b] > polar[i] + ball + 1e-9:
                break
            half = half_width(polar[i], beam_polar[b], ball)
            if half > 0.0:
                out[i] += half / np.pi
    return out


@njit(cache=True, nogil=True)
def sort_by_buckets(at: Array, n: int, step: float, order: Array, starts: Array) -> None:
    """Indices that sort the first n places within a step: spread evenly as they are, twice as fast as by comparing."""
    starts[: n + 1] = 0
    for k in range(n):
        starts[min(int(at[k] * (n / step)), n - 1) + 1] += 1
    if starts[: n + 1].max() > CROWD:
        order[:n] = np.argsort(at[:n])
        return
    for b in range(n):
        starts[b + 1] += starts[b]
    for k in range(n):
        b = min(int(at[k] * (n / step)), n - 1)
        order[starts[b]] = k
        starts[b] += 1
    for i in range(1, n):
        k = order[i]
        j = i - 1
        while j >= 0 and at[order[j]] > at[k]:
            order[j + 1] = order[j]
            j -= 1
        order[j + 1] = k


@njit(cache=True, nogil=True)
def _zones(
    polar: Array, beam_polar: Array, beam_azimuth: Array, count: int, step: float, ball: float, g: Array
) -> tuple[Array, Array, Array, Array]:
    """Walk the start phase once around per polar angle; see `zones`."""
    n = len(polar)
    mean_g, mean, least, most = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    turn = 2 * np.pi
    last_gap = turn - (count - 1) * step
    regular = abs(last_gap - step) < EXACT_TURN * step  # every gap is alike: one stands for all
    gaps = 1 if regular else count
    size = 4 * len(beam_polar)
    at, rise, low, high = np.empty(size), np.empty(size, np.int64), np.empty(size, np.int64), np.empty(size, np.int64)
    order, starts = np.empty(size, np.int64), np.empty(size + 1, np.int64)
    for i in range(n):
        t = polar[i]
        level = 0
        steps = 0
        first = np.searchsorted(beam_polar, t - ball - 1e-9)
        for b in range(first, len(beam_polar)):
            if beam_polar[b] > t + ball + 1e-9:
                break
            half = half_width(t, beam_polar[b], ball)
            if half < 0.0:
                continue
            if half >= np.pi:
                level += count
                mean[i] += count
                continue
            mean[i] += count * half / np.pi
            balance = 2 * half * count / turn
            for side in range(2):
                # the window of line 0 opens at p_b - delta_b and closes at p_b + delta_b, that of line k k steps on
                edge = beam_azimuth[b] + (2 * side - 1) * half  # from -pi to 3 pi: no division is needed
                edge += turn if edge < 0.0 else (-turn if edge >= turn else 0.0)
                sign = 1 - 2 * side
                gap = int(edge / step)
                if regular:
                    at[steps], rise[steps], low[steps], high[steps] = edge - gap * step, sign, 0, 0
                    balance -= sign * count * (1 - at[steps] / step) * (step / turn)
                    steps += 1
                    continue
                # lines before the turn is full: gaps from that of the edge on; then they come round again, on a grid
                # that is shifted by the short gap
                passed = min(count, int(np.ceil((turn - edge) / step - 1e-12)))
                for lines, start in ((passed, edge), (count - passed, max(edge + passed * step - turn, 0.0))):
                    if lines == 0:
                        continue
                    gap = int(start / step)
                    at[steps], rise[steps] = start - gap * step, sign
                    low[steps], high[steps] = gap, gap + lines - 1
                    balance -= sign * (lines * (turn - start) - step * lines * (lines - 1) / 2) / turn
                    steps += 1
            # what the mean count leaves when all steps are done is open from the start, whatever ties with what
            level += int(np.round(balance))
        sort_by_buckets(at, steps, step, order, starts)
        lowest, highest = level, level
        total = 0.0
        gap_index = 0
        while gap_index < gaps:
            width = step if regular else min(step, turn - gap_index * step)
            here, before, sum_before = 0.0, level, total
            same_until = gaps
            for k in order[:steps]:
                if low[k] > gap_index:
                    same_until = min(same_until, low[k])
                elif high[k] >= gap_index:
                    same_until = min(same_until, high[k] + 1)
                    if at[k] < width:
                        if at[k] > here:
                            total += g[level] * (at[k] - here)
                            if at[k] - here > TIE * step:
                                lowest, highest = min(lowest, level), max(highest, level)
                            here = at[k]
                        level += rise[k]
            total += g[level] * (width - here)
            if width - here > TIE * step:
                lowest, highest = min(lowest, level), max(highest, level)
            gap_index += 1
            # the gaps that follow with the same steps, and no more open than before, are this one again
            again = min(same_until, gaps - 1) - gap_index
            if level == before and again > 0:
                total += again * (total - sum_before)
                gap_index += again
        mean_g[i] = total / (step if regular else turn)
        least[i], most[i] = lowest, highest
    return mean_g, mean, least, most
