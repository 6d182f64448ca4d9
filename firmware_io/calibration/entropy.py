"""An independent witness: how crisp the cloud is, by its Renyi quadratic entropy between the two sides of the fan.

    H = -ln mean_ij exp(-|p_i - p_j|^2 / 4 s^2),    i seen by one side, j by the other

No tiles, no planes, no rejection: a cloud whose two halves fall on each other is crisp, whatever its surfaces are.
The weight of a point is the area that it covers, so that near surfaces do not drown far ones, nor those about the axis,
where beams crowd, the rest: r^2 dOmega is r^2 times the beam's change along the fan towards the axis, db, and
dpsi (for a fan that holds the axis: times the sine of the angle to it). The kernel is at least as wide as half the
spacing of the points: a narrower one sees their grid, and takes a mount that lays the grids of both sides on each other
for the crisper one.

A sum over pairs of a sample is known as well as the sample is large: what each point adds to the change of the entropy
says how well (W. Hoeffding, "A Class of Statistics with Asymptotically Normal Distribution", 1948).
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
_REACH = 4.0  # widths: pairs farther apart add nothing
_SPACINGS = 0.5  # of the points, in a scan or from scan to scan, in a kernel: of their grid exp(-10) is left
_SURE = 3.0  # sampling errors: less is no change
_LEAST = 0.01  # nats: walls thicker by 1 %, which no one can see
_PROBE = 3.0  # how far to either side of the result to look, in limits of each parameter


@dataclass(frozen=True, slots=True)
class Witness:
    """The entropy of a calibration; lower is crisper.

    Attributes:
        minima: where the entropy's own minimum lies from the result, for each mounting error [SI]; None where the two
            sides see too little in common for it to have one.
    """

    width_m: float  # of the kernel
    before: float  # entropy with the parameters it began with
    after: float  # with those that were found
    change_sd: float  # sampling error of `after - before`
    minima: dict[str, float | None]

    @property
    def less_crisp(self) -> bool:
        """Whether the cloud has become visibly less crisp, and by more than another sample of its points would."""
        return self.after - self.before > max(_LEAST, _SURE * self.change_sd)


def witness(
    mount: Mount,
    beams: ReturnedBeams,
    side: Int64[ndarray, " beams"],
    start: Float64[ndarray, " parameters"],
    estimated: Float64[ndarray, " parameters"],
    noise_m: float,
) -> Witness:
    """Ask the entropy before, after, and around the result."""
    rng = np.random.default_rng(0)
    halves = [np.flatnonzero(side == k) for k in (0, 1)]
    sample = np.concatenate([rng.choice(half, min(half.size, _SAMPLE), replace=False) for half in halves])
    few, one = beams.select(sample), side[sample] == 0

    # The same weights for all, or their own change would pass for one of the cloud
    weight = _areas(mount, estimated, few)
    range_m, scans = float(np.average(few.range_m, weights=weight)), Scans.of(beams)
    width_m = max(3 * noise_m, 0.03, _SPACINGS * range_m * max(scans.gap_rad, scans.step_rad))

    def crispness(x: Floats) -> _Crispness:
        late = few.under(x)
        origin, direction = beam_rays(mount, x, late)
        return _between(origin + (late.range_m + x[4])[:, None] * direction, weight, one, width_m)

    before, after = crispness(start), crispness(estimated)
    around = {PARAMETERS[k].name: _minimum(lambda x: crispness(x).entropy, estimated, k, after.entropy) for k in MOUNT}
    spread = (after.share - before.share) * after.weight
    return Witness(width_m, before.entropy, after.entropy, float(np.linalg.norm(spread)), around)


def _areas(mount: Mount, x: Floats, beams: ReturnedBeams) -> Float64[ndarray, " beams"]:
    """The area across each beam that it covers, up to a common factor, shape (n,)."""
    forward, left = mount.plane(x)[0][2]
    climb = np.abs(left * np.cos(beams.bearing_rad) - forward * np.sin(beams.bearing_rad))
    return beams.range_m**2 * climb * (np.ones(climb.size) if stood_still(beams) else np.abs(beams.speed_rad_s))


def _minimum(entropy: Callable[[Floats], float], x: Floats, k: int, here: float) -> float | None:
    """Vertex of the parabola through three entropies, None if the middle one is not the lowest."""
    step = _PROBE * PARAMETERS[k].limit
    shift = np.zeros(x.size)
    shift[k] = step
    low, high = entropy(x - shift), entropy(x + shift)
    bend = low - 2 * here + high
    return 0.5 * step * (low - high) / bend if min(low, high) > here else None


@dataclass(frozen=True, slots=True, eq=False)
class _Crispness:
    """Entropy; of each point its weight among those of its side, and its share: 1 if all were alike, shape (n,)."""

    entropy: float
    weight: Floats
    share: Floats


def _between(
    point: Float64[ndarray, "n 3"], weight: Float64[ndarray, " n"], one: Bool[ndarray, " n"], width_m: float
) -> _Crispness:
    """Entropy of the pairs across."""
    weight = weight / np.where(one, weight[one].sum(), weight[~one].sum())
    trees = [cKDTree(point[half]) for half in (one, ~one)]
    pairs = trees[0].sparse_distance_matrix(trees[1], _REACH * width_m, output_type="ndarray")
    i, j = pairs["i"], pairs["j"]
    near = np.exp(-(pairs["v"] ** 2) / (4 * width_m**2))
    share = np.empty(len(one))
    share[one] = np.bincount(i, near * weight[~one][j], trees[0].n)
    share[~one] = np.bincount(j, near * weight[one][i], trees[1].n)
    total = max(float(share[one] @ weight[one]), 1e-300)
    return _Crispness(-float(np.log(total)), weight, share / total)
