"""Surfaces: tiles in one plane, within the present errors of the scanner.

The largest surface is first: the plane with most beams gets its tiles, and so on until too few tiles remain. A surface
can be an entire wall, or a board that both sides of the scan plane see.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float64
from numba import njit
from numpy import ndarray

from scanwright.design.arrays import Array, Floats, Ints, Mask
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.calibration.model import Mount, beam_rays
from scanwright.firmware_io.calibration.solve import Grouping
from scanwright.firmware_io.calibration.tiles import FlatTiles, normals

_SAMPLE = 200  # tiles, which suffice to rank planes by size
_REFITS = 15  # to grow a plane from its seed to the ends of its wall
_MISFIT = 4.0  # standard deviations of a mean of squares
_GRAZING = 0.08  # cosine, below which a beam is near the plane everywhere
_SPOT_M = 1.0  # correlation length of the unevenness of walls
_NEAREST_M = 0.1  # to the axis; the form q . p = 1 fails nearer
_NO_PLANE = "no flat patches lie in one plane: a calibration needs walls, floors or other planes, densely scanned"
_FEWEST = 3  # tiles: two views of one place and one more, or three places


def group(
    tiles: FlatTiles, mount: Mount, x: Float64[ndarray, " parameters"], near_m: float, turn_rad: float, vague_rad: float
) -> Grouping:
    """Group tiles that are within `near_m` and `turn_rad` (beyond their noise) of one plane.

    Tiles with a normal less certain than `vague_rad` are dropped: they would join any plane. RecordingError if no tiles
    share a plane.
    """
    origin, direction = beam_rays(mount, x, tiles.middle.under(x))
    point = origin + (tiles.middle.range_m + x[4])[:, None] * direction
    normal = normals(tiles, mount, x)
    weight = tiles.count.astype(float)
    limit = np.cos(turn_rad + 2.5 * tiles.normal_sd_rad)
    place = tiles.middle.place
    surface = np.full(weight.size, -1)
    planes: list[Floats] = []
    rng = np.random.default_rng(0)
    left = tiles.normal_sd_rad < vague_rad
    seeds = np.flatnonzero(left)
    if not seeds.size:
        raise RecordingError(_NO_PLANE)
    some = rng.choice(seeds, min(_SAMPLE, seeds.size), replace=False, p=weight[seeds] / weight[seeds].sum())
    height = np.sum(normal * point, axis=1)
    agree = np.abs(normal[seeds] @ point[some].T - height[seeds, None]) < near_m
    agree &= (normal[seeds] @ normal[some].T > limit[some]) & (place[seeds, None] == place[some])
    for seed in seeds[np.argsort(-agree.sum(axis=1), kind="stable")]:
        if not left[seed]:
            continue
        n, c, mine = _grown(seed, left, place, point, normal, direction, weight, limit, near_m)
        left[seed] = False
        if np.count_nonzero(mine) < _FEWEST:
            continue
        if abs(c) > _NEAREST_M:
            surface[mine] = len(planes)
            planes.append(n / c)
        left &= ~mine
    if not planes:
        raise RecordingError(_NO_PLANE)
    cells = np.floor(point / _SPOT_M).astype(np.int64)
    _, spot = np.unique(np.column_stack([surface, cells]), axis=0, return_inverse=True)
    return Grouping(surface, spot.ravel(), np.array(planes))


@njit(cache=True, nogil=True)
def _grown(
    seed: int,
    left: Mask,
    place: Ints,
    point: Array,
    normal: Array,
    direction: Array,
    weight: Array,
    limit: Array,
    near_m: float,
) -> tuple[Array, float, Mask]:
    """Grow the plane n . p = c from a tile to the ends of its wall; return it and the remaining tiles in it."""
    n, c = normal[seed].copy(), _dot(normal[seed], point[seed])
    mine = np.zeros(left.size, np.bool_)
    for _ in range(_REFITS):
        count, same = 0, True
        for i in range(left.size):
            inside = (
                left[i]
                and place[i] == place[seed]
                and abs(_dot(n, point[i]) - c) < near_m
                and _dot(n, normal[i]) > limit[i]
                and abs(_dot(n, direction[i])) > _GRAZING
            )
            count += inside
            same &= inside == mine[i]
            mine[i] = inside
        if count < _FEWEST or same:
            break
        n, c = _plane(mine, point, normal, weight)
    return n, c, mine


@njit(inline="always")
def _dot(a: Array, b: Array) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, nogil=True)
def _plane(mine: Mask, point: Array, normal: Array, weight: Array) -> tuple[Array, float]:
    """Fit a plane to the marked points, with their normals if they are in a row.

    In loops, as products and means of arrays would take three seconds to compile.
    """
    total, mean, n, spread = 0.0, np.zeros(3), np.zeros(3), np.zeros((3, 3))
    for i in range(mine.size):
        if mine[i]:
            total += weight[i]
            for k in range(3):
                mean[k] += weight[i] * point[i, k]
                n[k] += weight[i] * normal[i, k]
    for k in range(3):
        mean[k] /= total
    for i in range(mine.size):
        if mine[i]:
            for k in range(3):
                for other in range(3):
                    spread[k, other] += weight[i] * (point[i, k] - mean[k]) * (point[i, other] - mean[other])
    values, vectors = np.linalg.eigh(spread)
    length = np.sqrt(_dot(n, n))
    if values[1] < 1e-2 * values[2]:  # in a row
        for k in range(3):
            n[k] /= length
    else:
        sign = 1.0 if _dot(vectors[:, 0], n) > 0 else -1.0
        for k in range(3):
            n[k] = sign * vectors[k, 0]
    return n, _dot(n, mean)


def without_misfits(grouping: Grouping, misfit: Floats, beams: Ints) -> Grouping:
    """Drop the tiles whose mean squared residual `misfit`, in units of its variance, is significantly above 1."""
    chance = 1 + _MISFIT * np.sqrt(2 / np.maximum(beams, 1))
    return replace(grouping, surface=np.where(misfit < chance, grouping.surface, -1))


def seen_twice(tiles: FlatTiles, grouping: Grouping) -> Ints:
    """Return the tiles whose spot both sides of the scan plane see."""
    used = grouping.used
    spots, inverse = np.unique(grouping.spot[used], return_inverse=True)
    sides = np.zeros((spots.size, 2), bool)
    sides[inverse, tiles.side[used]] = True
    both = sides[:, 0] & sides[:, 1]
    return used[both[inverse]]
