"""Surfaces: tiles that lie in one plane, as near as the present knowledge of the scanner allows.

The largest surface first: the plane that most beams agree with takes its tiles, and so on until what is left is in
too few looks to say anything. A surface may be a whole wall, or one board that two sides of the fan see.
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

_SAMPLE = 200  # tiles: so many tell which planes are the largest
_REFITS = 15  # a plane grows from its seed to the ends of its wall
_MISFIT = 4.0  # standard deviations of a mean of squares
_GRAZING = 0.08  # cosine: to a plane it grazes, a beam is near everywhere
_SPOT_M = 1.0  # walls keep their height over their plane about as far as this
_NEAREST_M = 0.1  # a plane this near the axis has no usable form q . p = 1
_NO_PLANE = "no flat patches lie in one plane: a calibration needs walls, floors or other planes, densely scanned"
_FEWEST = 3  # tiles: two looks at one place and one more, or three places


def group(
    tiles: FlatTiles, mount: Mount, x: Float64[ndarray, " parameters"], near_m: float, turn_rad: float, vague_rad: float
) -> Grouping:
    """Put tiles together that are within `near_m` and `turn_rad` (beyond their own noise) of one plane.

    Tiles that know their normal worse than `vague_rad` are left alone: they would join any plane that they touch.

    Raises:
        RecordingError: no tiles share a plane.
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
    """The plane n . p = c that grows from a tile to the ends of its wall, and which tiles that are left lie in it."""
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
    """Plane through those of weighted points that are marked; few of them lean on their normals.

    In loops: products and means of whole arrays would take three seconds to compile.
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
    if values[1] < 1e-2 * values[2]:  # in a row: any plane through the row fits
        for k in range(3):
            n[k] /= length
    else:
        sign = 1.0 if _dot(vectors[:, 0], n) > 0 else -1.0
        for k in range(3):
            n[k] = sign * vectors[k, 0]
    return n, _dot(n, mean)


def without_misfits(grouping: Grouping, misfit: Floats, beams: Ints) -> Grouping:
    """The same surfaces without the tiles that scatter about them more than chance allows.

    `misfit` is the mean squared residual of each tile in units of its variance, `beams` their number, shape (m,) each.
    """
    chance = 1 + _MISFIT * np.sqrt(2 / np.maximum(beams, 1))
    return replace(grouping, surface=np.where(misfit < chance, grouping.surface, -1))


def seen_twice(tiles: FlatTiles, grouping: Grouping) -> Ints:
    """Tiles whose spot both sides of the fan see."""
    used = grouping.used
    spots, inverse = np.unique(grouping.spot[used], return_inverse=True)
    sides = np.zeros((spots.size, 2), bool)
    sides[inverse, tiles.side[used]] = True
    both = sides[:, 0] & sides[:, 1]
    return used[both[inverse]]
