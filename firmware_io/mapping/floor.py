"""Detection of the floor of a levelled cloud; RecordingError without a floor."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64
from numpy import ndarray

from scanwright.design.errors import RecordingError

_CELL_M = 0.25  # narrower than free floor between furniture
_THICK_M = 0.1  # of one level: three sigmas of the noisiest sensor in both directions, and a carpet
_LEAST_M2 = 1.0  # smaller levels are tables
_MOST_BELOW = 0.05  # fraction of the points below a floor, by reflections
_MOST_TILT_RAD = math.radians(1.0)  # a wall of 0.1 m, six metres away
_GIVE_IT = "pass its height as floor_m"


def find_floor(points_m: Float64[ndarray, "n 3"], below_m: float = math.inf) -> float:
    """Return the height of the floor.

    Each square of 0.25 m has a lowest point. The level of most of these is the floor, if it has an area (a horizontal
    scan plane has only lines), and if almost no points are below it (unlike a ceiling).

    Args:
        points_m: shape (n, 3), finite, z up.
        below_m: upper bound of the floor, such as the height of the scanner.
    """
    squares = np.floor(points_m[:, :2] / _CELL_M).astype(np.int64)
    order = np.lexsort((points_m[:, 2], squares[:, 1], squares[:, 0]))
    first = np.r_[True, (np.diff(squares[order], axis=0) != 0).any(axis=1)] if order.size else np.zeros(0, bool)
    lowest = order[first]
    lowest = lowest[points_m[lowest, 2] < below_m]
    if not lowest.size:
        raise RecordingError(f"floor: no point lies below the scanner: {_GIVE_IT}")
    height_m = np.sort(points_m[lowest, 2])
    counts = np.searchsorted(height_m, height_m + _THICK_M, side="right") - np.arange(height_m.size)
    low_m = float(height_m[np.argmax(counts)])
    on_level = lowest[np.abs(points_m[lowest, 2] - low_m - _THICK_M / 2) <= _THICK_M / 2]
    level = {(int(x), int(y)) for x, y in squares[on_level]}  # count squares with four neighbours
    inner = sum({(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)} <= level for x, y in level)
    area_m2 = inner * _CELL_M**2
    if area_m2 < _LEAST_M2:
        raise RecordingError(
            f"floor: what lies lowest shares no level: {area_m2:.2g} m2 at z = {low_m:z.2f} m, {_LEAST_M2:g} m2 at "
            f"least: {_GIVE_IT}"
        )
    if (below := float(np.mean(points_m[:, 2] < low_m - _THICK_M))) > _MOST_BELOW:
        raise RecordingError(
            f"floor: {below:.0%} of the points lie below the widest level, z = {low_m:z.2f} m, which is no floor then: "
            f"{_GIVE_IT}"
        )
    layer = points_m[np.abs(points_m[:, 2] - np.median(points_m[on_level, 2])) <= _THICK_M / 2]
    middle_m = layer.mean(axis=0)
    slope, *_ = np.linalg.lstsq((layer - middle_m)[:, :2], layer[:, 2] - middle_m[2], rcond=None)
    if (tilt_rad := math.atan(math.hypot(*slope))) > _MOST_TILT_RAD:
        raise RecordingError(
            f"floor: tilted by {math.degrees(tilt_rad):.1f} deg, at most {math.degrees(_MOST_TILT_RAD):g}: level the "
            f"cloud, or {_GIVE_IT}"
        )
    return float(np.median(layer[:, 2]))
