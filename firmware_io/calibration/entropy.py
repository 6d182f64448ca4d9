"""An independent witness: how crisp the cloud is, by its Renyi quadratic entropy between the two sides of the fan.

    H = -ln mean_ij exp(-|p_i - p_j|^2 / 4 s^2),    i seen by one side, j by the other

No tiles, no planes, no rejection: a cloud whose two halves fall on each other is crisp, whatever its surfaces are.
Each point weighs the area that it stands for, so that near surfaces do not drown far ones.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64
from numpy import ndarray
from scipy.spatial import cKDTree

from design.arrays import Floats
from firmware_io.calibration.model import MOUNT, PARAMETERS, Mount, ReturnedBeams, beam_rays

_SAMPLE = 15_000  # points of each side
_RADII = 10  # rings in which pairs are counted
_PROBE = 3.0  # how far to either side of the result to look, in limits of each parameter


@dataclass(frozen=True, slots=True)
class Witness:
    """What the entropy says about a calibration; lower is crisper.

    Attributes:
        width_m: of the kernel.
        before: entropy with the parameters it began with.
        after: with those that were found.
        minima: where the entropy's own minimum lies from the result, for each mounting error [SI]; None where the
            two sides see too little in common for it to have one.
    """

    width_m: float
    before: float
    after: float
    minima: dict[str, float | None]


def witness(
    mount: Mount,
    beams: ReturnedBeams,
    side: Int64[ndarray, " beams"],
    start: Float64[ndarray, " parameters"],
    found: Float64[ndarray, " parameters"],
    noise_m: float,
) -> Witness:
    """Ask the entropy before, after, and around the result."""
    rng = np.random.default_rng(0)
    width_m = max(3 * noise_m, 0.03)
    halves = [np.flatnonzero(side == k) for k in (0, 1)]
    sample = np.concatenate([rng.choice(half, min(half.size, _SAMPLE), replace=False) for half in halves])
    few, one = beams.taken(sample), side[sample] == 0

    def entropy(x: Floats) -> float:
        late = few.under(x)
        origin, direction = beam_rays(mount, x, late)
        point = origin + (late.range_m + x[4])[:, None] * direction
        return _between(point, late.range_m**2, one, width_m)

    after = entropy(found)
    return Witness(
        width_m, entropy(start), after, {PARAMETERS[k].name: _minimum(entropy, found, k, after) for k in MOUNT}
    )


def _minimum(entropy: Callable[[Floats], float], x: Floats, k: int, here: float) -> float | None:
    """Vertex of the parabola through three entropies, None where the middle one is not the lowest."""
    step = _PROBE * PARAMETERS[k].limit
    shift = np.zeros(x.size)
    shift[k] = step
    low, high = entropy(x - shift), entropy(x + shift)
    bend = low - 2 * here + high
    return 0.5 * step * (low - high) / bend if min(low, high) > here else None


def _between(
    point: Float64[ndarray, "n 3"], weight: Float64[ndarray, " n"], one: Bool[ndarray, " n"], width_m: float
) -> float:
    """Entropy of the pairs across: pairs are counted in rings, which for a Gaussian is as good as one by one."""
    edges = np.linspace(0, 4 * width_m, _RADII + 1)[1:]
    trees = [cKDTree(point[half]) for half in (one, ~one)]
    weights = (weight[one] / weight[one].sum(), weight[~one] / weight[~one].sum())
    counted = trees[0].count_neighbors(trees[1], edges, weights=weights)
    rings = np.diff(counted, prepend=0.0)
    middle = edges - edges[0] / 2
    return float(-np.log(max(rings @ np.exp(-(middle**2) / (4 * width_m**2)), 1e-300)))
