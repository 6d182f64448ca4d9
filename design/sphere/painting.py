"""Compiled kernels: value of painted regions at directions, and mean value along circles (`design.sphere.regions`)."""

from __future__ import annotations

import numpy as np
from numba import njit

from scanwright.design.arrays import Array, Mask
from scanwright.design.sphere.shell_sort import sort_indices

ALL, BAND, CONE, MAP, POLYGON = 0.0, 1.0, 2.0, 3.0, 4.0
"""Kinds of rows."""

VALUE = 13  # column of the value: a row is the kind of a region, twelve parameters and its value
COLUMNS = VALUE + 1

EDGE = 1e-12  # edges are inclusive: a direction whose cosine is this close to that of an edge lies on it
CELL_EDGE = 1e-9  # of a map cell: a direction this close to the next cell belongs to the next cell


@njit(cache=True, nogil=True, error_model="numpy")
def _value(x: float, y: float, z: float, rows: Array, tables: Array, background: float) -> float:
    """Return the value of the last painted region that contains the direction."""
    for i in range(rows.shape[0] - 1, -1, -1):
        if _holds(x, y, z, rows[i]):
            return rows[i, VALUE] * _of_cell(x, y, z, rows[i], tables)
    return background


@njit(cache=True, nogil=True, error_model="numpy")
def _holds(x: float, y: float, z: float, row: Array) -> bool:
    """Return whether a region contains the direction; edges are inclusive."""
    if row[0] == CONE:
        return x * row[1] + y * row[2] + z * row[3] >= row[4] - EDGE
    if row[0] == BAND:
        if not row[1] - EDGE <= z <= row[2] + EDGE:
            return False
        return x * row[3] + y * row[4] >= row[5] * np.sqrt(x * x + y * y) - EDGE
    if row[0] == POLYGON:
        for k in range(1, VALUE, 3):
            if x * row[k] + y * row[k + 1] + z * row[k + 2] < -EDGE:
                return False
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _of_cell(x: float, y: float, z: float, row: Array, tables: Array) -> float:
    """Return the entry of a map at the direction; 1 for any other region."""
    if row[0] != MAP:
        return 1.0
    across = np.sqrt(x * x + y * y)
    theta = np.arctan2(across, z)
    phi = np.arctan2(y, x) if across > EDGE else 0.0
    height, width = int(row[2]), int(row[3])
    r = min(int(theta / np.pi * height + CELL_EDGE), height - 1)
    c = int((phi % (2 * np.pi)) / (2 * np.pi) * width + CELL_EDGE) % width
    return tables[int(row[1]), r, c]


@njit(cache=True, nogil=True, error_model="numpy")
def _masked(x: float, y: float, z: float, rows: Array, tables: Array) -> bool:
    """Return whether any mask hides the direction; a table hides directions with a value above 0."""
    for i in range(rows.shape[0]):  # noqa: SIM110 - numba compiles no generator
        if _holds(x, y, z, rows[i]) and _of_cell(x, y, z, rows[i], tables) > 0.0:
            return True
    return False


@njit(cache=True, nogil=True, error_model="numpy")
def masked_at(directions: Array, rows: Array, tables: Array) -> Mask:
    """Return whether any mask hides each direction, shape (n,)."""
    out = np.empty(directions.shape[0], np.bool_)
    for i in range(directions.shape[0]):
        out[i] = _masked(directions[i, 0], directions[i, 1], directions[i, 2], rows, tables)
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def summed_over(directions: Array, rows: Array, tables: Array, of_rows: Array) -> Array:
    """Return, for each direction, the sum of `of_rows` over the rows with a value above 0 there, shape (n,)."""
    out = np.zeros(directions.shape[0])
    for i in range(directions.shape[0]):
        x, y, z = directions[i, 0], directions[i, 1], directions[i, 2]
        for k in range(rows.shape[0]):
            if _holds(x, y, z, rows[k]) and _of_cell(x, y, z, rows[k], tables) > 0.0:
                out[i] += of_rows[k]
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def values_at(directions: Array, rows: Array, tables: Array, background: float) -> Array:
    """Return the value of the last painted region that contains each direction, shape (n,)."""
    out = np.empty(directions.shape[0])
    for i in range(directions.shape[0]):
        out[i] = _value(directions[i, 0], directions[i, 1], directions[i, 2], rows, tables, background)
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _dot(a: Array, b: Array) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, nogil=True, error_model="numpy")
def circle_means(
    frames: Array,
    polar: Array,
    within: Array,
    planes: Array,
    weight_rows: Array,
    weight_tables: Array,
    mask_rows: Array,
    mask_tables: Array,
    background: float,
) -> tuple[Array, Array]:
    """Return mean weight (0 if masked) and unmasked share of each circle about the z axis of each frame.

    Both have shape (frames, circles), and are 0 for circles outside the polar angles `within`, shape (frames, 2).
    """
    weights = np.zeros((len(frames), len(polar)))
    shares = np.zeros((len(frames), len(polar)))
    cuts = np.empty(2 * len(planes) + 1)
    order = np.empty(len(cuts), np.int64)
    azimuth, across, along = np.empty(len(planes)), np.empty(len(planes)), np.empty(len(planes))
    for f in range(len(frames)):
        frame = frames[f]
        for k in range(len(planes)):
            a, b, along[k] = _dot(planes[k], frame[0]), _dot(planes[k], frame[1]), _dot(planes[k], frame[2])
            azimuth[k], across[k] = np.arctan2(b, a), np.sqrt(a * a + b * b)
        for i in range(len(polar)):
            if not within[f, 0] <= polar[i] <= within[f, 1]:
                continue
            st, ct = np.sin(polar[i]), np.cos(polar[i])
            n = 0
            for k in range(len(planes)):
                c, r = planes[k, 3] - ct * along[k], st * across[k]
                if r > abs(c):
                    half = np.arccos(c / r)
                    first, last = azimuth[k] - half, azimuth[k] + half  # within -2 pi .. 2 pi
                    cuts[n] = first if first >= 0.0 else first + 2 * np.pi
                    cuts[n + 1] = last if last >= 0.0 else last + 2 * np.pi
                    n += 2
            if n == 0:
                cuts[0] = 0.0
                n = 1
            for j in range(n):
                order[j] = j
            sort_indices(cuts, order, n, n)
            weight, share = 0.0, 0.0
            for j in range(n):
                before = cuts[order[j]]
                after = cuts[order[j + 1]] if j + 1 < n else cuts[order[0]] + 2 * np.pi
                arc = after - before
                if arc <= 0.0:
                    continue
                p = 0.5 * (before + after)
                u, v = st * np.cos(p), st * np.sin(p)
                x = u * frame[0, 0] + v * frame[1, 0] + ct * frame[2, 0]
                y = u * frame[0, 1] + v * frame[1, 1] + ct * frame[2, 1]
                z = u * frame[0, 2] + v * frame[1, 2] + ct * frame[2, 2]
                if _masked(x, y, z, mask_rows, mask_tables):
                    continue
                share += arc
                weight += arc * _value(x, y, z, weight_rows, weight_tables, background)
            weights[f, i] = weight / (2 * np.pi)
            shares[f, i] = share / (2 * np.pi)
    return weights, shares
