"""Surfaces: tiles that lie in one plane, as near as the present knowledge of the scanner allows.

The largest surface first: the plane that most beams agree with takes its tiles, and so on until what is left is in
too few looks to say anything. A surface may be a whole wall, or one board that two sides of the fan see.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float64
from numpy import ndarray

from design.arrays import Floats, Ints
from design.errors import RecordingError
from firmware_io.calibration.model import Mount, beam_rays
from firmware_io.calibration.solve import Grouping
from firmware_io.calibration.tiles import FlatTiles, normals

_SEEDS = 24
_REFITS = 15  # a plane grows from its seed to the ends of its wall
_MISFIT = 4.0  # standard deviations of a mean of squares
_GRAZING = 0.08  # cosine: to a plane it grazes, a beam is near everywhere
_SPOT_M = 1.0  # walls keep their height over their plane about as far as this
_NEAREST_M = 0.1  # a plane this near the axis has no usable form q . p = 1
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
    done = np.zeros(weight.size, bool)
    planes: list[Floats] = []
    rng = np.random.default_rng(0)
    free = np.flatnonzero(tiles.normal_sd_rad < vague_rad)
    while free.size >= _FEWEST:
        seeds = rng.choice(free, min(_SEEDS, free.size), replace=False, p=weight[free] / weight[free].sum())
        height = np.sum(normal[seeds] * point[seeds], axis=1)
        fits = np.abs(normal[seeds] @ point[free].T - height[:, None]) < near_m
        fits &= (normal[seeds] @ normal[free].T > limit[free]) & (place[seeds][:, None] == place[free])
        best = int(np.argmax(fits @ weight[free]))
        members = free[fits[best]]
        alone = seeds[fits.sum(axis=1) < _FEWEST]
        for _ in range(_REFITS):
            if members.size < _FEWEST:
                break
            n, c = _plane(point[members], normal[members], weight[members])
            mine = (np.abs(point[free] @ n - c) < near_m) & (normal[free] @ n > limit[free])
            mine &= (np.abs(direction[free] @ n) > _GRAZING) & (place[free] == place[seeds[best]])
            if np.array_equal(free[mine], members):
                break
            members = free[mine]
        if members.size < _FEWEST:
            alone = np.append(alone, seeds[best])
        else:
            if abs(c) > _NEAREST_M:
                surface[members] = len(planes)
                planes.append(n / c)
            alone = np.append(alone, members)
        done[alone] = True
        free = free[~done[free]]
    if not planes:
        raise RecordingError("no flat patches lie in one plane: a calibration needs walls, floors or other planes")
    cells = np.floor(point / _SPOT_M).astype(np.int64)
    _, spot = np.unique(np.column_stack([surface, cells]), axis=0, return_inverse=True)
    return Grouping(surface, spot.ravel(), np.array(planes))


def _plane(
    point: Float64[ndarray, "n 3"], normal: Float64[ndarray, "n 3"], weight: Float64[ndarray, " n"]
) -> tuple[Floats, float]:
    """Plane through weighted points; few of them lean on their normals."""
    mean = weight @ point / weight.sum()
    spread = point - mean
    values, vectors = np.linalg.eigh((spread * weight[:, None]).T @ spread)
    n = vectors[:, 0]
    if values[1] < 1e-2 * values[2]:  # in a row: any plane through the row fits
        n = weight @ normal
        n /= np.linalg.norm(n)
    n = n if weight @ (normal @ n) > 0 else -n
    return n, float(n @ mean)


def without_misfits(grouping: Grouping, misfit: Floats, beams: Ints) -> Grouping:
    """The same surfaces without the tiles that scatter about them more than chance allows.

    Args:
        grouping: the surfaces.
        misfit: of each tile, mean squared residual in units of its variance, shape (m,).
        beams: of each tile, shape (m,).
    """
    chance = 1 + _MISFIT * np.sqrt(2 / np.maximum(beams, 1))
    return replace(grouping, surface=np.where(misfit < chance, grouping.surface, -1))


def seen_twice(tiles: FlatTiles, grouping: Grouping) -> Ints:
    """Tiles whose spot both sides of the fan see."""
    used = grouping.used
    spots, inverse = np.unique(grouping.spot[used], return_inverse=True)
    looks = np.zeros((spots.size, 2), bool)
    looks[inverse, tiles.side[used]] = True
    both = looks[:, 0] & looks[:, 1]
    return used[both[inverse]]
