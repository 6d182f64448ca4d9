"""Tiles: flat parts of the scene in small windows of bearing and joint angle.

Beams are assigned to tiles by bearing and joint angle, not by their points: so neither noise nor a wrong mounting
changes the tile of a beam, and a tile is one view of one place, in one pass of the axis. Windows with an edge are split
into four until they are flat or too small.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int64
from numpy import ndarray

from scanwright.design.arrays import Floats, Ints
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.assembly.turns import turning_points
from scanwright.firmware_io.calibration.model import Mount, ReturnedBeams, axis_angle, beam_rays

_WINDOWS_RAD = tuple(np.radians([6.0, 3.0, 1.5]))
_LEAST = 12  # beams in a tile: three define a plane, the others check it
_FEWEST = 50  # windows, whose median roughness is the noise
_ROUGHEST = 1.5  # times the noise; far or dark surfaces are noisier, edges far rougher
_STEEPEST = np.cos(np.radians(84.0))  # grazing views beyond are dominated by roughness and beam width


@dataclass(frozen=True, slots=True, eq=False)
class FlatTiles:
    """Flat tiles, with their beams sorted by tile."""

    beams: ReturnedBeams  # beams of all tiles
    start: Int64[ndarray, " bounds"]  # index of each tile's first beam, shape (m + 1,)
    middle: ReturnedBeams  # one beam per tile through its middle, its range by the tile's plane, shape (m,)
    normal_laser: Float64[ndarray, "tiles 3"]  # normal of the tile in the laser frame, towards the laser, shape (m, 3)
    normal_sd_rad: Float64[ndarray, " tiles"]  # its standard deviation, shape (m,)
    rms_m: Float64[ndarray, " tiles"]  # of the beams' ranges about the tile's plane, shape (m,)
    side: Int64[ndarray, " tiles"]  # side of the scan plane, 0 or 1, shape (m,)
    noise_m: float  # standard deviation of a range: median of the tiles
    dropped: int  # beams in no tile

    @property
    def count(self) -> Int64[ndarray, " tiles"]:
        """Beams in each tile, shape (m,)."""
        return np.diff(self.start)

    @property
    def variance_m2(self) -> Float64[ndarray, " tiles"]:
        """Variance of a range in each tile, shape (m,): the common noise, or more in a rougher tile."""
        chance = 1 + 3 * np.sqrt(2 / np.maximum(self.count - 3, 1))
        return self.noise_m**2 + np.maximum(self.rms_m**2 - chance * self.noise_m**2, 0.0)

    @property
    def tile(self) -> Int64[ndarray, " beams"]:
        """Tile of each beam, shape (n,)."""
        return np.repeat(np.arange(self.count.size), self.count)


def flat_tiles(beams: ReturnedBeams, mount: Mount, x: Float64[ndarray, " parameters"]) -> FlatTiles:
    """Assign all beams to flat tiles; RecordingError without a flat window."""
    side, turned_back = fan_side(beams, mount), _turned_back(beams)
    noise_m = _noise(beams, side, turned_back, mount, x)
    left = np.arange(beams.range_m.size)
    parts = []
    for window_rad in _WINDOWS_RAD:
        order, start = _windows(beams, side, turned_back, left, window_rad)
        q, information, rms_m, cosine = _fit(beams.select(order), start, mount, x)
        count = np.diff(start)
        roughest = _ROUGHEST + 2.5 / np.sqrt(2 * np.maximum(count - 3, 1))
        flat = (rms_m < noise_m * roughest) & (cosine > _STEEPEST)
        rows = np.repeat(flat, count)
        parts.append((order[rows], count[flat], q[flat], information[flat], rms_m[flat]))
        left = order[~rows]
        if not left.size:
            break
    index, count, q, information, rms_m = (np.concatenate(column) for column in zip(*parts, strict=True))
    if not index.size:
        raise RecordingError("no flat surface is in sight: a calibration needs walls, floors or other planes")
    start = np.append(0, np.cumsum(count))
    own = beams.select(index)
    middle = _middle(own, start, mount, x, q)
    length = np.linalg.norm(q, axis=1)
    sd = noise_m * np.sqrt(np.linalg.eigvalsh(np.linalg.inv(information))[:, -1]) / length
    normal = -_turned(q / length[:, None], -axis_angle(x, middle.joint_rad, middle.direction))
    columns = mount.plane(x)[0]
    R = np.column_stack([columns, np.cross(columns[:, 0], columns[:, 1])])
    return FlatTiles(own, start, middle, normal @ R, sd, rms_m, side[index][start[:-1]], noise_m, left.size)


def normals(tiles: FlatTiles, mount: Mount, x: Float64[ndarray, " parameters"]) -> Float64[ndarray, "tiles 3"]:
    """Return the normal of each tile in the fixed frame of the axis, shape (m, 3)."""
    columns = mount.plane(x)[0]
    R = np.column_stack([columns, np.cross(columns[:, 0], columns[:, 1])])
    return _turned(tiles.normal_laser @ R.T, axis_angle(x, tiles.middle.under(x).joint_rad, tiles.middle.direction))


def fan_side(beams: ReturnedBeams, mount: Mount) -> Int64[ndarray, " beams"]:
    """Return 0 or 1 by the side of each beam of the bearing closest to the axis, shape (n,)."""
    toward = mount.designed[2, :2]
    bearing_rad = np.arctan2(toward[1], toward[0])
    return (np.sin(beams.bearing_rad - bearing_rad) > 0).astype(np.int64)


def _windows(beams: ReturnedBeams, side: Ints, turned_back: Ints, which: Ints, window_rad: float) -> tuple[Ints, Ints]:
    """Return the beams sorted by window, and the index of the first one of each window."""
    mine = beams.select(which)
    keys = (
        mine.recording,
        turned_back[which],
        side[which],
        np.floor(mine.bearing_rad / window_rad).astype(np.int64),
        np.floor(mine.joint_rad / window_rad).astype(np.int64),  # counts turns: one pass of the axis per window
    )
    key = np.zeros(which.size, np.int64)
    for part in keys:
        part = part - part.min()
        key = key * (int(part.max()) + 1) + part
    order = np.argsort(key, kind="stable")
    return which[order], np.append(np.flatnonzero(np.diff(key[order], prepend=-1)), which.size)


def _turned_back(beams: ReturnedBeams) -> Int64[ndarray, " beams"]:
    """Return the number of reversals of the axis before each beam, shape (n,)."""
    back = np.zeros(beams.time_ns.size, np.int64)
    for k, curve in enumerate(beams.curves):
        mine = beams.recording == k
        back[mine] = np.searchsorted(curve.knot_ns[turning_points(curve.angle_at(curve.knot_ns))], beams.time_ns[mine])
    return back


def _fit(beams: ReturnedBeams, start: Ints, mount: Mount, x: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Fit the plane q . p = 1 of each window by weighted least squares, as 1/r is linear in q.

    Returns:
        q, its information, the rms of the ranges (infinite without a plane), and the mean cosine to the plane's normal.
    """
    origin, direction = beam_rays(mount, x, beams)
    range_m = beams.range_m + x[4]
    first, count = start[:-1], np.diff(start)
    window = np.repeat(np.arange(count.size), count)
    weight = (np.add.reduceat(range_m, first) / count)[window] ** 2  # converts a difference of 1/r to one of r
    row = weight[:, None] * (direction + origin / range_m[:, None])
    information = np.add.reduceat(row[:, :, None] * row[:, None, :], first)
    right = np.add.reduceat(row * (weight / range_m)[:, None], first)
    enough = (count >= _LEAST) & (np.linalg.cond(information) < 1e12)
    information = np.where(enough[:, None, None], information, np.eye(3))
    q = np.linalg.solve(information, right[..., None])[..., 0]
    slant = np.sum(q[window] * direction, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        off = range_m - (1 - np.sum(q[window] * origin, axis=1)) / slant
        rms_m = np.sqrt(np.add.reduceat(off**2, first) / np.maximum(count - 3, 1))
        cosine = np.abs(np.add.reduceat(slant, first)) / count / np.linalg.norm(q, axis=1)
    return q, information, np.where(enough, rms_m, np.inf), cosine


def _noise(beams: ReturnedBeams, side: Ints, turned_back: Ints, mount: Mount, x: Floats) -> float:
    """Return the median roughness of the smallest windows with enough beams."""
    everything = np.arange(beams.range_m.size)
    for window_rad in reversed(_WINDOWS_RAD):
        order, start = _windows(beams, side, turned_back, everything, window_rad)
        rough = _fit(beams.select(order), start, mount, x)[2]
        rough = rough[np.isfinite(rough)]
        if rough.size >= _FEWEST:
            return max(float(np.median(rough)), 1e-6)
    widest = np.degrees(_WINDOWS_RAD[0])
    raise RecordingError(
        f"fewer than {_FEWEST} windows of {widest:.0f} x {widest:.0f} deg hold {_LEAST} beams: the scan is too coarse, "
        "or too short, to find flat surfaces; turn the axis more slowly or scan longer"
    )


def _middle(beams: ReturnedBeams, start: Ints, mount: Mount, x: Floats, q: Floats) -> ReturnedBeams:
    """Return one beam through the middle of each tile."""
    first, count = start[:-1], np.diff(start)

    def mean(column: Floats) -> Floats:
        return np.add.reduceat(column, first) / count

    origin_ns = int(beams.time_ns[0])
    middle = ReturnedBeams(
        range_m=mean(beams.range_m),
        bearing_rad=mean(beams.bearing_rad),
        joint_rad=mean(beams.joint_rad),
        speed_rad_s=mean(beams.speed_rad_s),
        recording=beams.recording[first],
        place=beams.place[first],
        time_ns=origin_ns + mean((beams.time_ns - origin_ns).astype(float)).astype(np.int64),
        curves=beams.curves,
    )
    origin, direction = beam_rays(mount, x, middle)
    range_m = (1 - np.sum(q * origin, axis=1)) / np.sum(q * direction, axis=1) - x[4]
    return replace(middle, range_m=range_m)


def _turned(vectors: Float64[ndarray, "n 3"], angle_rad: Float64[ndarray, " n"]) -> Float64[ndarray, "n 3"]:
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    a, b = vectors[:, 0], vectors[:, 1]
    return np.column_stack([cos * a - sin * b, sin * a + cos * b, vectors[:, 2]])
