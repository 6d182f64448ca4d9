"""Independent check of a calibration: map sharpness by the Renyi quadratic entropy between the sides of the scan plane.

    H = -ln mean_ij exp(-|p_i - p_j|^2 / 4 s^2),    i seen by one side, j by the other

It needs no tiles, planes or rejection: a cloud is sharp if its two halves coincide, for any surfaces.
The weight of a point is the area that it covers, so that neither near surfaces nor those about the axis dominate:
r^2 dOmega is r^2 times the beam's change along the scan plane towards the axis, db, and dpsi (for a scan plane that
contains the axis: times the sine of the angle to it). The kernel is at least as wide as half the spacing of the points:
a narrower one would prefer a mount that aligns the grids of both sides.
The sampling error of a sum over pairs follows from the contribution of each point (W. Hoeffding, "A Class of Statistics
with Asymptotically Normal Distribution", 1948).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64
from numpy import ndarray
from scipy.spatial import cKDTree

from scanwright.design.arrays import Floats
from scanwright.firmware_io.calibration.model import MOUNT, PARAMETERS, Mount, ReturnedBeams, beam_rays
from scanwright.firmware_io.calibration.observable import stood_still
from scanwright.firmware_io.calibration.scans import Scans

_SAMPLE = 15_000  # points of each side
_REACH = 4.0  # widths, beyond which pairs add nothing
_SPACINGS = 0.5  # kernel width in spacings of points, in a scan or between scans: exp(-10) of their grid remains
_SURE = 3.0  # sampling errors of a significant change
_LEAST = 0.01  # nats: walls thicker by 1 %, which is invisible
_PROBE = 3.0  # distance of the probes from the result, in limits of each parameter


@dataclass(frozen=True, slots=True)
class Witness:
    """Entropy of a calibration; lower is sharper."""

    width_m: float  # of the kernel
    before: float  # entropy with the initial parameters
    after: float  # with the estimated ones
    change_sd: float  # sampling error of `after - before`
    minima: dict[str, float | None]  # minimum relative to the result for each mounting error [SI]; None without one

    @property
    def less_crisp(self) -> bool:
        """Whether the cloud is visibly and significantly less sharp."""
        return self.after - self.before > max(_LEAST, _SURE * self.change_sd)


def witness(
    mount: Mount,
    beams: ReturnedBeams,
    side: Int64[ndarray, " beams"],
    start: Float64[ndarray, " parameters"],
    estimated: Float64[ndarray, " parameters"],
    noise_m: float,
) -> Witness:
    """Compute the entropy before, after, and around the result."""
    rng = np.random.default_rng(0)
    halves = [np.flatnonzero(side == k) for k in (0, 1)]
    sample = np.concatenate([rng.choice(half, min(half.size, _SAMPLE), replace=False) for half in halves])
    few, first = beams.select(sample), side[sample] == 0

    # The same weights for all parameters, so that only the cloud changes
    weight = _areas(mount, estimated, few)
    range_m, scans = float(np.average(few.range_m, weights=weight)), Scans.of(beams)
    width_m = max(3 * noise_m, 0.03, _SPACINGS * range_m * max(scans.gap_rad, scans.step_rad))

    def sharpness(x: Floats) -> tuple[float, Floats]:
        late = few.under(x)
        origin, direction = beam_rays(mount, x, late)
        return _between(origin + (late.range_m + x[4])[:, None] * direction, weight, first, width_m)

    (before, part_before), (after, part_after) = sharpness(start), sharpness(estimated)
    around = {PARAMETERS[k].name: _minimum(lambda x: sharpness(x)[0], estimated, k, after) for k in MOUNT}
    return Witness(width_m, before, after, float(np.linalg.norm(part_after - part_before)), around)


def _areas(mount: Mount, x: Floats, beams: ReturnedBeams) -> Float64[ndarray, " beams"]:
    """Return the area that each beam covers, except for a common factor, shape (n,)."""
    forward, left = mount.plane(x)[0][2]
    climb = np.abs(left * np.cos(beams.bearing_rad) - forward * np.sin(beams.bearing_rad))
    return beams.range_m**2 * climb * (np.ones(climb.size) if stood_still(beams) else np.abs(beams.speed_rad_s))


def _minimum(entropy: Callable[[Floats], float], x: Floats, k: int, here: float) -> float | None:
    """Return the vertex of the parabola through three entropies, None if the middle one is not the lowest."""
    step = _PROBE * PARAMETERS[k].limit
    shift = np.zeros(x.size)
    shift[k] = step
    low, high = entropy(x - shift), entropy(x + shift)
    bend = low - 2 * here + high
    return 0.5 * step * (low - high) / bend if min(low, high) > here else None


def _between(
    point: Float64[ndarray, "n 3"], weight: Float64[ndarray, " n"], first: Bool[ndarray, " n"], width_m: float
) -> tuple[float, Floats]:
    """Return the entropy, and the part of each point in its sum, relative to that sum, shape (n,)."""
    weight = weight / np.where(first, weight[first].sum(), weight[~first].sum())
    trees = [cKDTree(point[half]) for half in (first, ~first)]
    pairs = trees[0].sparse_distance_matrix(trees[1], _REACH * width_m, output_type="ndarray")
    i, j = pairs["i"], pairs["j"]
    near = np.exp(-(pairs["v"] ** 2) / (4 * width_m**2))
    share = np.empty(len(first))
    share[first] = np.bincount(i, near * weight[~first][j], trees[0].n)
    share[~first] = np.bincount(j, near * weight[first][i], trees[1].n)
    total = max(float(share[first] @ weight[first]), 1e-300)
    return -float(np.log(total)), weight * share / total
