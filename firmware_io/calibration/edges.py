"""Beams near edges, whose surface is ambiguous.

A tile that extends slightly over an edge is as flat as its neighbours, and its beams on the other side bias its plane;
more beams reduce the noise, but not this bias. So beams are dropped by geometry, independent of noise, if another
surface is within `_APART` standard deviations of theirs. Beams further over the edge are outliers, dropped by `_OUT`.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float64
from numba import njit
from numpy import ndarray

from scanwright.design.arrays import Floats, Ints
from scanwright.firmware_io.calibration.model import Mount, beam_rays
from scanwright.firmware_io.calibration.solve import Grouping
from scanwright.firmware_io.calibration.tiles import FlatTiles

_APART = 6.0  # standard deviations of a plane, above noise
_OUT = 4.0  # includes 2 % of the beams that are 6 off, and drops 1 of 16,000 correct ones
_ACROSS = np.cos(np.radians(10.0))  # surfaces with a smaller angle are parts of one
_REACH_M = 1.0  # from a tile's middle to the edge of its surface


def clear_of_edges(
    mount: Mount, x: Float64[ndarray, " parameters"], tiles: FlatTiles, grouping: Grouping, bulge_m: float
) -> Bool[ndarray, " beams"]:
    """Return which beams are certainly on the surface of their tile, shape (n,); False without a surface."""
    tile = tiles.tile
    surface = grouping.surface[tile]
    on = np.flatnonzero(surface >= 0)
    tile, surface, beams = tile[on], surface[on], tiles.beams.select(on).under(x)
    origin, direction = beam_rays(mount, x, beams)
    length = np.linalg.norm(grouping.q, axis=1)
    slant = np.sum(grouping.q[surface] * direction, axis=1)
    met_m = (1 - np.sum(grouping.q[surface] * origin, axis=1)) / slant
    sd_m = np.sqrt(tiles.variance_m2[tile] + (bulge_m * length[surface] / slant) ** 2)
    clear = np.abs(beams.range_m + x[4] - met_m) < _OUT * sd_m
    low_m, high_m, place = _boxes(mount, x, tiles, grouping)
    clear &= ~_crossed(
        origin, direction, met_m, surface, grouping.q, grouping.q / length[:, None], place, low_m, high_m, _APART * sd_m
    )
    complete = np.zeros(tiles.tile.size, bool)
    complete[on] = clear
    return complete


def _boxes(
    mount: Mount, x: Float64[ndarray, " parameters"], tiles: FlatTiles, grouping: Grouping
) -> tuple[Floats, Floats, Ints]:
    """Return the bounding box of each surface, shapes (s, 3) and (s, 3), and the place of its scanner, shape (s,)."""
    used = grouping.used
    middle = tiles.middle.select(used).under(x)
    origin, direction = beam_rays(mount, x, middle)
    point = origin + (middle.range_m + x[4])[:, None] * direction
    surface = grouping.surface[used]
    low_m, high_m = np.full(grouping.q.shape, np.inf), np.full(grouping.q.shape, -np.inf)
    np.minimum.at(low_m, surface, point - _REACH_M)
    np.maximum.at(high_m, surface, point + _REACH_M)
    place = np.full(len(grouping.q), -1)
    place[surface] = middle.place
    return low_m, high_m, place


@njit(cache=True, nogil=True)
def _crossed(origin, direction, met_m, surface, q, normal, place, low_m, high_m, close_m):  # type: ignore[no-untyped-def]
    out = np.zeros(met_m.size, np.bool_)
    for i in range(met_m.size):
        s = surface[i]
        x, y, z = origin[i]
        u, v, w = direction[i]
        px, py, pz = x + met_m[i] * u, y + met_m[i] * v, z + met_m[i] * w
        for t in range(len(q)):
            if t == s or place[t] != place[s]:
                continue
            if not (
                low_m[t, 0] < px < high_m[t, 0] and low_m[t, 1] < py < high_m[t, 1] and low_m[t, 2] < pz < high_m[t, 2]
            ):
                continue
            a, b, c = q[t]
            # |r_t - r_s| < close, without a division, as beams may be parallel to the other plane
            slant = a * u + b * v + c * w
            if abs(1.0 - (a * px + b * py + c * pz)) >= close_m[i] * abs(slant):
                continue
            if abs(normal[s, 0] * normal[t, 0] + normal[s, 1] * normal[t, 1] + normal[s, 2] * normal[t, 2]) > _ACROSS:
                continue
            out[i] = True
            break
    return out
