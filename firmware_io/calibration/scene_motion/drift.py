"""Detection of motion of the platform during a recording.

A motion by h(t) along a surface's normal shows the surface lower by h, as a dent would, but increasing with time and
the same for all surfaces. So constant rates of translation and rotation are six more parameters, whose normal equations
follow from those of the bulges of tiles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from numpy import ndarray
from scipy.stats import chi2

from scanwright.design.arrays import Floats
from scanwright.firmware_io.calibration.model import LAG, Mount, beam_rays
from scanwright.firmware_io.calibration.solve import WIDTH, Grouping, covariance, reduced, step
from scanwright.firmware_io.calibration.tiles import FlatTiles

_U = WIDTH - 2
_RATES = 6  # three of translation, three of rotation
_CHANCE = 1e-6  # of a false warning in a recording at rest


@dataclass(frozen=True, slots=True, eq=False)
class Drift:
    """Apparent motion of the platform, in the fixed frame of the axis."""

    recording: int  # number of the recording
    velocity_m_s: Float64[ndarray, " 3"]  # shape (3,)
    turn_rad_s: Float64[ndarray, " 3"]  # shape (3,)
    chi2: float  # squared sigmas of all six

    @property
    def sure(self) -> bool:
        """Whether the motion is significant."""
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
    """Estimate the apparent motion of the platform in each recording, at constant rates.

    `scale`: variance of the ranges relative to that of the tiles; the others as in `Estimate`.
    """
    middle = tiles.middle.late_by(x[LAG[0]])
    origin, direction = beam_rays(mount, x, middle)
    point = origin + (middle.range_m + x[4])[:, None] * direction
    plane = grouping.planes / np.linalg.norm(grouping.planes, axis=1)[:, None]
    results = []
    for k in np.unique(middle.recording).tolist():
        mine = (middle.recording == k) & (grouping.surface >= 0)
        time_s = (middle.time_ns - middle.time_ns[mine].min()) / 1e9
        time_s = np.where(mine, time_s - time_s[mine].max() / 2, 0.0)
        # the scene appears to move in the opposite direction; a rotation w moves p by w x p
        rise = -time_s[:, None] * np.hstack([plane, np.cross(point, plane)])
        part = reduced(_with(normal, rise), grouping, np.append(free, WIDTH + np.arange(_RATES)), bulge_m)
        rates, spread = step(part)[0], scale * covariance(part)[-_RATES:, -_RATES:]
        known = np.isfinite(np.diag(spread))
        rate = np.where(known, rates[-_RATES:], 0.0)
        square = rate[known] @ np.linalg.solve(spread[np.ix_(known, known)], rate[known])
        results.append(Drift(k, rate[:3], rate[3:], float(square)))
    return tuple(results)


def _with(normal: Floats, rise: Floats) -> Floats:
    """Append parameters to normal equations that raise each tile by `rise` per unit, shape (m, k)."""
    across = normal[:, _U, :, None] * rise[:, None, :]
    corner = normal[:, _U, _U, None, None] * rise[:, :, None] * rise[:, None, :]
    return np.concatenate(
        [np.concatenate([normal, across], axis=2), np.concatenate([np.swapaxes(across, 1, 2), corner], axis=2)], axis=1
    )
