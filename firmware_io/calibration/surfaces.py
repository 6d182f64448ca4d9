"""Surfaces: tiles in one plane, within the present errors of the scanner.

The largest surface is first: the plane with most beams gets its tiles, and so on until too few tiles remain. A surface
can be an entire wall, or a board that both sides of the scan plane see.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float64
from numpy import ndarray

from scanwright.design.arrays import Floats, Ints, Mask
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
        if mine.size < _FEWEST:
            continue
        if abs(c) > _NEAREST_M:
            surface[mine] = len(planes)
            planes.append(n / c)
        left[mine] = False
    if not planes:
        raise RecordingError(_NO_PLANE)
    cells = np.floor(point / _SPOT_M).astype(np.int64)
    _, spot = np.unique(np.column_stack([surface, cells]), axis=0, return_inverse=True)
    return Grouping(surface, spot.ravel(), np.array(planes))


def _grown(
    seed: int,
    left: Mask,
    place: Ints,
    point: Floats,
    normal: Floats,
    direction: Floats,
    weight: Floats,
    limit: Floats,
    near_m: float,
) -> tuple[Floats, float, Ints]:
    """Grow the plane n . p = c from a tile to the ends of its wall; return it and the remaining tiles in it."""
    near = np.flatnonzero(left & (place == place[seed]))
    points, normals, directions, limits = point[near], normal[near], direction[near], limit[near]
    n, c, mine = normal[seed], float(normal[seed] @ point[seed]), near[:0]
    for _ in range(_REFITS):
        inside = (np.abs(points @ n - c) < near_m) & (normals @ n > limits) & (np.abs(directions @ n) > _GRAZING)
        before, mine = mine, near[inside]
        if mine.size < _FEWEST or np.array_equal(mine, before):
            break
        n, c = _plane(points[inside], normals[inside], weight[mine])
    return n, c, mine


def _plane(points: Floats, normals: Floats, weight: Floats) -> tuple[Floats, float]:
    """Fit the plane n . p = c to points, with their mean normal if they are in a row."""
    mean, n = np.average(points, axis=0, weights=weight), weight @ normals
    off = points - mean
    values, vectors = np.linalg.eigh((off * weight[:, None]).T @ off)
    if values[1] < 1e-2 * values[2]:  # in a row
        n = n / np.linalg.norm(n)
    else:
        n = vectors[:, 0] * (1.0 if vectors[:, 0] @ n > 0 else -1.0)
    return n, float(n @ mean)


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
