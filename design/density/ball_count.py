"""Exact counts of beams within balls, for any set of beams, by a grid on the sphere.

Beams are sorted into rows of the polar angle and, within a row, by azimuth cell. The candidates of a ball are then one
or two contiguous ranges of memory per row.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int, Int64
from numba import njit
from numpy import ndarray

from scanwright.design.arrays import Array
from scanwright.design.concurrency.parallel import in_chunks

MOST_ROWS = 1440
CELLS_PER_BALL = 3  # rows and cells across a ball radius: a compromise between tested beams and memory ranges


def ball_count(
    beams: Float[ndarray, "beams 3"], directions: Float[ndarray, "n 3"], ball_rad: float
) -> Int[ndarray, " n"]:
    """Return the number of `beams` within the angle `ball_rad` (0 to pi) of each direction; all are unit vectors."""
    rows = int(min(MOST_ROWS, max(1, np.pi * CELLS_PER_BALL / ball_rad)))
    columns = _columns(rows)
    starts = np.concatenate([[0], np.cumsum(columns)])
    parts = in_chunks(lambda chunk: _cells(beams[chunk], rows, columns, starts), len(beams), smallest=4096)
    sorted_beams, offsets = _sorted(beams, np.concatenate(parts), starts[-1])
    counts = in_chunks(
        lambda chunk: _count(sorted_beams, offsets, directions[chunk], ball_rad, rows, columns, starts),
        len(directions),
        smallest=256,
    )
    return np.concatenate(counts)


def _columns(rows: int) -> Int64[ndarray, " {rows}"]:
    """Return the number of azimuth cells of each row; a cell is about as wide as the row is high."""
    middle = (np.arange(rows) + 0.5) * np.pi / rows
    return np.maximum(1, (2 * rows * np.sin(middle)).astype(np.int64))


@njit(cache=True, nogil=True, error_model="numpy")
def _cells(beams: Array, rows: int, columns: Array, starts: Array) -> Array:
    out = np.empty(len(beams), np.int64)
    for i in range(len(beams)):
        x, y, z = beams[i, 0], beams[i, 1], beams[i, 2]
        r = min(rows - 1, int(np.arctan2(np.sqrt(x * x + y * y), z) * rows / np.pi))
        c = int((np.arctan2(y, x) / (2 * np.pi) + 0.5) * columns[r])
        out[i] = starts[r] + min(c, columns[r] - 1)
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _sorted(beams: Array, cells: Array, count: int) -> tuple[Array, Array]:
    """Return the beams in the order of their cells, shape (3, beams), and the index of the first beam of each cell."""
    offsets = np.zeros(count + 1, np.int64)
    for i in range(len(cells)):
        offsets[cells[i] + 1] += 1
    for c in range(count):
        offsets[c + 1] += offsets[c]
    place = offsets[:-1].copy()
    out = np.empty((3, len(cells)))
    for i in range(len(cells)):
        k = place[cells[i]]
        place[cells[i]] += 1
        out[0, k], out[1, k], out[2, k] = beams[i, 0], beams[i, 1], beams[i, 2]
    return out, offsets


@njit(cache=True, nogil=True, error_model="numpy")
def _count(
    beams: Array, offsets: Array, directions: Array, ball: float, rows: int, columns: Array, starts: Array
) -> Array:
    out = np.zeros(len(directions), np.int64)
    chord = 4 * np.sin(ball / 2) ** 2
    height = np.pi / rows
    slack = 1e-9  # a beam on the edge of a cell can be rounded to the other side
    for i in range(len(directions)):
        x, y, z = directions[i, 0], directions[i, 1], directions[i, 2]
        t = np.arctan2(np.sqrt(x * x + y * y), z)
        p = np.arctan2(y, x) / (2 * np.pi) + 0.5
        first = max(0, int((t - ball - slack) / height))
        last = min(rows - 1, int((t + ball + slack) / height))
        total = 0
        for r in range(first, last + 1):
            n = columns[r]
            width = _widest(t, ball, r * height, (r + 1) * height) + slack
            a = int(np.floor((p - width / (2 * np.pi)) * n))
            b = int(np.floor((p + width / (2 * np.pi)) * n))
            base = starts[r]
            if b - a + 1 >= n:
                total += _within(beams, offsets[base], offsets[base + n], x, y, z, chord)
                continue
            a %= n
            b %= n
            if a <= b:
                total += _within(beams, offsets[base + a], offsets[base + b + 1], x, y, z, chord)
            else:
                total += _within(beams, offsets[base], offsets[base + b + 1], x, y, z, chord)
                total += _within(beams, offsets[base + a], offsets[base + n], x, y, z, chord)
        out[i] = total
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _widest(t: float, ball: float, low: float, high: float) -> float:
    """Return the largest azimuth distance from the centre of a ball at polar angle t to its rim, within low .. high."""
    if t - ball <= 0.0 or t + ball >= np.pi:
        return np.pi
    widest = np.arccos(np.cos(t) / np.cos(ball)) if ball < 0.5 * np.pi else low
    at = min(max(widest, low), high)
    c = (np.cos(ball) - np.cos(t) * np.cos(at)) / max(np.sin(t) * np.sin(at), 1e-300)
    return np.arccos(min(1.0, max(-1.0, c)))


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _within(beams: Array, first: int, last: int, x: float, y: float, z: float, chord: float) -> int:
    n = 0
    for k in range(first, last):
        dx, dy, dz = beams[0, k] - x, beams[1, k] - y, beams[2, k] - z
        if dx * dx + dy * dy + dz * dz <= chord:
            n += 1
    return n
