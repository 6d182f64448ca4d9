"""Estimation of the errors, coarse to fine, first with one beam per tile, then with all beams."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float64
from numpy import ndarray
from numpy.typing import NDArray

from scanwright.design.arrays import Floats, Ints
from scanwright.firmware_io.calibration.edges import clear_of_edges
from scanwright.firmware_io.calibration.model import (
    BACKLASH,
    COUNT,
    LAG,
    MOUNT,
    Mount,
    ReturnedBeams,
    beam_rays,
)
from scanwright.firmware_io.calibration.observable import Choice, check_fan, choose_observable, several_speeds, spectrum
from scanwright.firmware_io.calibration.scene_motion.drift import Drift, drifts
from scanwright.firmware_io.calibration.solve import (
    Grouping,
    bulge_m,
    covariance,
    misfits,
    moved_by_last,
    reduced,
    step,
    sums,
)
from scanwright.firmware_io.calibration.surfaces import group, without_misfits
from scanwright.firmware_io.calibration.tiles import FlatTiles, flat_tiles

# largest distance [m] and angle [deg] of tiles of one surface; the first pair allows an error of 5 deg at 7 m
_WIDE = ((0.6, 12.0), (0.4, 8.0), (0.25, 5.0), (0.12, 3.0))
_NARROW = ((0.12, 3.0), (0.06, 2.0), (0.03, 1.0), (0.03, 1.0))
_STEPS = 4  # of Gauss-Newton
_LAST_STEPS = 2  # with all beams, and again without those near edges
_TRUST = 0.1  # times `near`: standard deviation of tiles about planes that are wrong by up to `near`
_ROUNDS = 2  # of grouping, with all beams
_VAGUE_DEG, _LAST_VAGUE_DEG = 15.0, 45.0  # the last one is wide, as misfits are then rejected by beams
_LAST_NOISES, _LAST_M, _LAST_DEG = 2.5, 0.02, 1.0  # last grouping: noise, unevenness of walls


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """Result of an estimation."""

    x: Float64[ndarray, " parameters"]  # parameters, fixed ones unchanged, shape (COUNT,)
    choice: Choice  # free and fixed parameters
    covariance: Float64[ndarray, "free free"]  # of the free ones, by noise and a fixed backlash, shape (k, k)
    spectrum: Float64[ndarray, " free"]  # singular values of their information, in units of their limits, shape (k,)
    tiles: FlatTiles
    grouping: Grouping  # surfaces of the tiles
    clear: Bool[ndarray, " beams"]  # which beams of the tiles were used, shape (n,)
    noise_m: float  # standard deviation of a range
    bulge_m: float  # standard deviation of the walls from planes; 0 if below the noise
    drifts: tuple[Drift, ...]  # apparent motion of the platform in each recording


def estimate(beams: ReturnedBeams, mount: Mount, start: Float64[ndarray, " parameters"]) -> Estimate:
    """Estimate the scanner's errors; RecordingError if the recordings do not show the mounting errors."""
    check_fan(mount)
    tiles = flat_tiles(beams, mount, start)
    # Offsets of centimetres are not observable with wide groups, and would absorb other errors.
    free = np.array(MOUNT[:2] + (LAG if several_speeds(beams) else ()))
    x = start
    for near_m, turn_deg in _WIDE:
        x, grouping, normal = _coarse(tiles, mount, x, free, near_m, turn_deg)
    x, grouping, normal = _coarse(tiles, mount, x, np.union1d(free, MOUNT), *_WIDE[-1])
    choice = choose_observable(beams, tiles, grouping, normal, mount.backlash_rad)
    for near_m, turn_deg in _NARROW:
        x, grouping, normal = _coarse(tiles, mount, x, choice.free, near_m, turn_deg)
    last_m = max(_LAST_NOISES * tiles.noise_m, _LAST_M)
    for _ in range(_ROUNDS):
        choice = choose_observable(beams, tiles, grouping, normal, mount.backlash_rad)
        fixed = np.setdiff1d(np.arange(COUNT), choice.free)
        x[fixed] = start[fixed]
        grouping = group(tiles, mount, x, last_m, *np.radians([_LAST_DEG, _LAST_VAGUE_DEG]))
        on_surface = grouping.surface[tiles.tile] >= 0
        x, grouping, _, _, bulge = _refined(tiles, mount, x, choice.free, grouping, on_surface)
        clear = clear_of_edges(mount, x, tiles, grouping, bulge)
        x, grouping, normal, count, bulge = _refined(tiles, mount, x, choice.free, grouping, clear)
    part = reduced(normal, grouping, choice.free, bulge)
    scale = float(np.average(misfits(normal, count)[grouping.used], weights=count[grouping.used]))
    return Estimate(
        x=x,
        choice=choice,
        covariance=scale * covariance(part)
        + _of_fixed_backlash(normal, grouping, choice.free, bulge, mount.backlash_rad),
        spectrum=spectrum(part, choice.free),
        tiles=tiles,
        grouping=grouping,
        clear=clear,
        noise_m=tiles.noise_m * float(np.sqrt(scale)),
        bulge_m=bulge,
        drifts=drifts(mount, x, tiles, grouping, normal, choice.free, bulge, scale),
    )


def _of_fixed_backlash(normal: Floats, grouping: Grouping, free: Ints, bulge: float, backlash_rad: float) -> Floats:
    """Return the covariance by a backlash fixed at 0 that may be up to that of the gear, shape (k, k)."""
    if BACKLASH[0] in free:
        return np.zeros((free.size, free.size))
    moved = moved_by_last(reduced(normal, grouping, np.append(free, BACKLASH), bulge)) * backlash_rad
    return np.outer(moved, moved)


def _refined(
    tiles: FlatTiles, mount: Mount, x: Floats, free: Ints, grouping: Grouping, which: NDArray[np.bool_]
) -> tuple[Floats, Grouping, Floats, Ints, float]:
    """Solve with some beams of the tiles; drop tiles without beams, and those that do not fit.

    Returns:
        Parameters, grouping, sums, the number of beams of each tile, and the unevenness of the walls [m].
    """
    own, tile = tiles.beams.select(which), tiles.tile[which]
    weight = 1 / tiles.variance_m2[tile]
    count = np.bincount(tile, minlength=tiles.count.size)
    grouping = replace(grouping, surface=np.where(count > 0, grouping.surface, -1))
    bulge = 0.0
    for _ in range(_LAST_STEPS):
        x, grouping, normal = _iterated(mount, x, free, grouping, own, tile, weight, bulge)
        grouping = without_misfits(grouping, misfits(normal, count), count)
        bulge = bulge_m(normal, grouping)
    return x, grouping, normal, count, bulge


def _coarse(
    tiles: FlatTiles, mount: Mount, x: Floats, free: Ints, near_m: float, turn_deg: float
) -> tuple[Floats, Grouping, Floats]:
    """Group, then solve with one beam per tile; the returned sums approximate those of all beams."""
    grouping = group(tiles, mount, x, near_m, *np.radians([turn_deg, _VAGUE_DEG]))
    on = grouping.surface >= 0
    variance = tiles.variance_m2 / tiles.count
    plane = grouping.planes
    slant = np.sum(plane * beam_rays(mount, x, tiles.middle.under(x))[1], axis=1) / np.linalg.norm(plane, axis=1)
    weight = 1 / (variance + (_TRUST * near_m / slant) ** 2)[on]
    own, tile = tiles.middle.select(on), np.flatnonzero(on)
    for _ in range(_STEPS):
        x, grouping, _ = _iterated(mount, x, free, grouping, own, tile, weight, 0.0)
    normal = sums(mount, x, own.under(x), tile, 1 / variance[on], grouping.planes)
    return x, grouping, normal


def _iterated(
    mount: Mount,
    x: Floats,
    free: Ints,
    grouping: Grouping,
    beams: ReturnedBeams,
    tile: Ints,
    weight: Floats,
    bulge: float,
) -> tuple[Floats, Grouping, Floats]:
    """Do one Gauss-Newton step; return its sums."""
    normal = sums(mount, x, beams.under(x), tile, weight, grouping.planes)
    dx, dq = step(reduced(normal, grouping, free, bulge))
    x = x.copy()
    x[free] += dx
    return x, replace(grouping, q=grouping.q + dq), normal
