"""Did the platform stand still, and the scene? A calibration takes both for granted, and both leave traces.

A platform that has moved by h(t) along a surface's normal shows the surface lower by h, as a dent of that spot would,
but growing with time and the same over all surfaces. So drift and turning at constant rates are six more parameters,
whose normal equations follow from those of the bulges, tile by tile. Somebody who walks leaves a trace of another kind:
both sides of the fan look from one point, so what one of them sees in a direction the other one must see there too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from numpy import ndarray
from scipy.stats import chi2

from design.arrays import Floats
from firmware_io.calibration.model import LAG, Mount, ReturnedBeams, beam_rays
from firmware_io.calibration.solve import WIDTH, Grouping, covariance, reduced, step
from firmware_io.calibration.tiles import FlatTiles

_U = WIDTH - 2
_RATES = 6
_CHANCE = 1e-6
_CELL_RAD = np.radians(3.0)
_LOOKS = 3  # beams of the other side around a direction: fewer may all have missed something slim
_BEFORE_M = 0.25  # people are farther than that from the walls that they hide
_SLANTED = 0.1  # of the range: floors run away below the lidar
_RESIDUAL = 1.5  # times the noise within small patches
_MANY = 3e-4  # share of beams; a scene that stands still leaves none


@dataclass(frozen=True, slots=True, eq=False)
class Drift:
    """How a platform seems to have moved while it was scanning, in the frame of the axis that stands still.

    Attributes:
        recording: number of the recording.
        velocity_m_s: shape (3,).
        turn_rad_s: shape (3,).
        chi2: squared sigmas of all six.
    """

    recording: int
    velocity_m_s: Float64[ndarray, " 3"]
    turn_rad_s: Float64[ndarray, " 3"]
    chi2: float

    @property
    def sure(self) -> bool:
        """Whether noise alone would hardly ever show so much."""
        return bool(self.chi2 > chi2.isf(_CHANCE, _RATES))


def drifts(
    mount: Mount,
    x: Float64[ndarray, " parameters"],
    tiles: FlatTiles,
    grouping: Grouping,
    normal: Float64[ndarray, "tiles width width"],
    free: Int64[ndarray, " free"],
    bulge_m: float,
    scale: float,
) -> tuple[Drift, ...]:
    """How the platform seems to have moved in each recording, at rates that did not change.

    Args:
        mount: where the laser sits.
        x: what was found.
        tiles: the flat looks.
        grouping: their surfaces.
        normal: the sums that `x` was found from.
        free: parameters that were found.
        bulge_m: standard deviation of the walls from planes.
        scale: by how much the variance of the ranges exceeds that of the tiles.
    """
    middle = tiles.middle.late_by(x[LAG[0]])
    origin, direction = beam_rays(mount, x, middle)
    point = origin + (middle.range_m + x[4])[:, None] * direction
    plane = grouping.q[np.maximum(grouping.surface, 0)]
    plane = plane / np.linalg.norm(plane, axis=1)[:, None]
    found = []
    for k in np.unique(middle.recording).tolist():
        mine = (middle.recording == k) & (grouping.surface >= 0)
        time_s = (middle.time_ns - middle.time_ns[mine].min()) / 1e9
        time_s = np.where(mine, time_s - time_s[mine].max() / 2, 0.0)
        # The scene seems to move the other way; p that turns moves by w x p
        rise = -time_s[:, None] * np.hstack([plane, np.cross(point, plane)])
        part = reduced(_with(normal, rise), grouping, np.append(free, WIDTH + np.arange(_RATES)), bulge_m)
        rates, spread = step(part)[0], scale * covariance(part)[-_RATES:, -_RATES:]
        known = np.isfinite(np.diag(spread))
        rate = np.where(known, rates[-_RATES:], 0.0)
        square = rate[known] @ np.linalg.solve(spread[np.ix_(known, known)], rate[known])
        found.append(Drift(k, rate[:3], rate[3:], float(square)))
    return tuple(found)


def contradicted_share(
    mount: Mount, x: Float64[ndarray, " parameters"], beams: ReturnedBeams, side: Int64[ndarray, " beams"]
) -> float:
    """Share of the beams that end clearly before all that the other side of the fan saw around their direction."""
    now = beams.under(x)
    _, direction = beam_rays(mount, x, now)
    rows, columns = round(np.pi / _CELL_RAD), round(2 * np.pi / _CELL_RAD)
    row = np.minimum(rows * np.arccos(np.clip(direction[:, 2], -1, 1)) / np.pi, rows - 1).astype(np.int64)
    # Cells of one height, the fewer of them the nearer the axis
    wide = np.maximum(columns * np.sin((row + 0.5) * np.pi / rows), 4).astype(np.int64)
    turn = np.arctan2(direction[:, 1], direction[:, 0]) / (2 * np.pi) % 1
    nearest = np.full((2, beams.place.max() + 1, rows + 2, columns + 2), np.inf)
    looks = np.zeros(nearest.shape, np.int64)
    for up in (-1, 0, 1):
        other = np.clip(row + up, 0, rows - 1)
        across = np.maximum(columns * np.sin((other + 0.5) * np.pi / rows), 4).astype(np.int64)
        for aside in (-1, 0, 1):
            cell = (side, beams.place, other, ((turn * across).astype(np.int64) + aside) % across)
            np.minimum.at(nearest, cell, beams.range_m)
            if not up and not aside:
                np.add.at(looks, cell, 1)
    mine = (1 - side, beams.place, row, (turn * wide).astype(np.int64) % wide)
    seen = looks[mine] >= _LOOKS
    before = seen & (beams.range_m < (1 - _SLANTED) * nearest[mine] - _BEFORE_M)
    return float(before.sum() / max(int(seen.sum()), 1))


def warnings(found: tuple[Drift, ...], contradicted: float, residual_m: float, noise_m: float) -> list[str]:
    """What a person should know of it, one line each."""
    said = []
    for drift in found:
        if drift.sure:
            mm_s, deg_s = 1e3 * np.linalg.norm(drift.velocity_m_s), np.degrees(np.linalg.norm(drift.turn_rad_s))
            said.append(
                f"the platform moved during recording {drift.recording + 1}, by about {mm_s:.2g} mm/s and "
                f"{deg_s:.2g} deg/s: do not trust this calibration; scan again with the scanner held still"
            )
    if contradicted > _MANY:
        said.append(
            f"{100 * contradicted:.2g} % of the beams end before what the other side of the fan saw there: somebody "
            "walked, or something was moved"
        )
    if residual_m > _RESIDUAL * noise_m:
        said.append(
            f"the ranges are off by {1e3 * residual_m:.1f} mm, their noise is {1e3 * noise_m:.1f} mm: something moved, "
            "or the scanner has an error that no parameter here stands for"
        )
    return said


def _with(normal: Floats, rise: Floats) -> Floats:
    """Normal equations with further parameters that raise each tile by `rise` of them, shape (m, k)."""
    across = normal[:, _U, :, None] * rise[:, None, :]
    corner = normal[:, _U, _U, None, None] * rise[:, :, None] * rise[:, None, :]
    return np.concatenate(
        [np.concatenate([normal, across], axis=2), np.concatenate([np.swapaxes(across, 1, 2), corner], axis=2)], axis=1
    )
