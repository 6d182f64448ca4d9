"""Time offset of the angles relative to the scans, from one sweep in both directions.

In a static scene, a beam at one axis angle has one range, in both directions. A delay of the joint log shifts both
directions against each other by twice the rotation in that time. The cost of an assumed offset is the mean difference
of the two range images, each difference capped, since ranges jump at edges of the scene.
Uncertainty: about a seventh of the step between assumed offsets; the jackknife's standard deviation over parts of the
scan plane; and, if the motor stops during each scan, half the time between two scans.
Not observable: mounting angles, lever arm and sign of the axis (the same in both directions); backlash (a constant
angle between both directions, at one speed equivalent to an offset of half the backlash divided by the speed); the
offset of the stamps from any other clock; and anything at all with a single direction.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64
from numpy import ndarray

from scanwright.design.arrays import Floats, Mask
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.recording.recording import Recording
from scanwright.firmware_io.samples import JointLog, Scan

_CAP_M = 0.05  # a few times the noise of 2D lidars (10 to 30 mm), far below the depth of edges
_NOISE_RAD = np.radians(1.0)  # smaller reversals are noise or backlash
_LAGS_S = np.linspace(-1.0, 1.0, 41)  # delays of drivers and networks, in steps of 50 ms; the minimum is refined
_VAGUE_S = 0.25  # largest standard deviation of a usable offset
_BLOCKS = 8  # of the scan plane, as neighbouring beams are correlated
_CELLS = 600  # over the common angles: 0.1 deg of 60 deg, about one step between scans


@dataclass(frozen=True, slots=True, eq=False)
class LagCurve:
    """Cost of each assumed lag."""

    lag_s: Float64[ndarray, " lags"]  # assumed lags, shape (k,); positive if the joint log's stamps are late
    cost_m: Float64[ndarray, " lags"]  # mean capped difference of the ranges of both directions, shape (k,)
    best_s: float  # minimum, refined by its two neighbours
    sd_s: float  # its standard deviation; infinite for a single beam


@dataclass(frozen=True, slots=True)
class Lag:
    """Time offset of the angles of a recording."""

    late_s: float  # positive if the joint log's stamps are late
    sd_s: float  # its standard deviation, without backlash
    speed_rad_s: float  # mean speed of the axis; `late_s` includes half of any backlash divided by it


def find_lag(recording: Recording) -> Lag:
    """Estimate the time offset of the angles, up to a second.

    Raises:
        RecordingError: the axis does not turn in both directions, or the standard deviation exceeds 0.25 s.
    """
    curve = lag_curve(recording.scans(), recording.joint_log, _LAGS_S)
    still_s = float(np.median(np.diff(recording.stamp_ns))) / 2e9 if recording.at_rest else 0.0
    sd_s = float(np.hypot(curve.sd_s, still_s))
    if sd_s > _VAGUE_S or curve.best_s in (_LAGS_S[0], _LAGS_S[-1]):
        raise RecordingError(f"{recording.path}: the lag of the angles cannot be measured in this scene")
    log = recording.joint_log
    first_ns, _, last_ns = _there_and_back(log)
    positions = log.position_rad[(log.time_ns >= first_ns) & (log.time_ns <= last_ns)]
    return Lag(curve.best_s, sd_s, float(np.abs(np.diff(positions)).sum()) / (last_ns - first_ns) * 1e9)


def lag_curve(scans: Iterable[Scan], joint_log: JointLog, lag_s: Float64[ndarray, " lags"]) -> LagCurve:
    """Compare both directions with each assumed lag; all scans of the sweep are in memory.

    Args:
        scans: scans with a constant number of beams.
        joint_log: servo angles.
        lag_s: assumed lags, increasing and evenly spaced, shape (k,), k >= 3.

    Raises:
        RecordingError: the axis does not turn in both directions, or these have no angle in common.
    """
    listed = [scan for scan in scans if scan.range_m.size]
    if len({scan.range_m.size for scan in listed}) != 1:
        raise RecordingError("the lag needs scans that all have the same number of beams")
    first_ns, turn_ns, last_ns = _there_and_back(joint_log)
    time_ns = np.stack([scan.time_ns for scan in listed])
    range_m = np.stack([np.where(np.isfinite(s.range_m) & (s.range_m > 0), s.range_m, np.nan) for s in listed])
    capped_m, compared = np.zeros((2, lag_s.size, range_m.shape[1]))
    for k, lag in enumerate(lag_s):
        logged_ns = time_ns + round(lag * 1e9)
        joint_rad = joint_log.angle_at(logged_ns.ravel()).reshape(logged_ns.shape)
        there = (logged_ns >= first_ns) & (logged_ns <= turn_ns)
        back = (logged_ns > turn_ns) & (logged_ns <= last_ns)
        capped_m[k], compared[k] = _differences(joint_rad, range_m.astype(float), there, back)
    if not compared.any(axis=1).all():
        raise RecordingError("the turns there and back have no angle in common, so the lag cannot be measured")
    cost_m = capped_m.sum(axis=1) / compared.sum(axis=1)
    sd_s = float(np.hypot(_jackknife(lag_s, capped_m, compared), (lag_s[1] - lag_s[0]) / 7))
    return LagCurve(np.asarray(lag_s, float), cost_m, _minimum(lag_s, cost_m), sd_s)


def _jackknife(lag_s: Floats, capped_m: Floats, compared: Floats) -> float:
    """Return the standard deviation of the best lag, by the jackknife over blocks of neighbouring beams.

    `capped_m`, `compared`: sum and number of each beam's capped differences, shape (k, beams).
    """
    blocks = [block for block in np.array_split(np.flatnonzero(compared.any(axis=0)), _BLOCKS) if block.size]
    if len(blocks) < 2:
        return float("inf")
    without = []
    for block in blocks:
        counted = np.maximum(compared.sum(axis=1) - compared[:, block].sum(axis=1), 1)
        without.append(_minimum(lag_s, (capped_m.sum(axis=1) - capped_m[:, block].sum(axis=1)) / counted))
    return float(np.std(without) * np.sqrt(len(blocks) - 1))


def _there_and_back(log: JointLog) -> tuple[int, int, int]:
    """Return begin, turning point and end [ns] of the sweep around the angle furthest from the first one."""
    position = np.abs(log.position_rad - log.position_rad[0])
    turn = int(np.argmax(position))
    before, after = position[turn::-1], position[turn:]
    steps_before, steps_after = _monotone(before), _monotone(after)
    if position[turn] < _NOISE_RAD or position[turn] - after[steps_after] < _NOISE_RAD:
        raise RecordingError("the axis does not turn there and back: the lag can only be measured with both directions")
    return int(log.time_ns[turn - steps_before]), int(log.time_ns[turn]), int(log.time_ns[turn + steps_after])


def _monotone(falling: Floats) -> int:
    """Return the index of the lowest value before the series increases by more than noise."""
    climbs = falling - np.minimum.accumulate(falling) > _NOISE_RAD
    end = int(np.argmax(climbs)) if climbs.any() else falling.size
    return int(np.argmin(falling[:end]))


def _differences(
    joint_rad: Float64[ndarray, "scans beams"],
    range_m: Float64[ndarray, "scans beams"],
    there: Bool[ndarray, "scans beams"],
    back: Bool[ndarray, "scans beams"],
) -> tuple[Floats, Floats]:
    """Return sum and number of each beam's capped differences between two range images (beams x angle cells)."""
    if not (there.any() and back.any()):
        return np.zeros(range_m.shape[1]), np.zeros(range_m.shape[1])
    low = max(np.nanmin(joint_rad[there]), np.nanmin(joint_rad[back]))
    high = min(np.nanmax(joint_rad[there]), np.nanmax(joint_rad[back]))
    cells = np.linspace(low, high, _CELLS)
    images = [_range_image(joint_rad, range_m, direction, cells) for direction in (there, back)]
    both = np.minimum(np.abs(images[0] - images[1]), _CAP_M)
    return np.nansum(both, axis=1), np.isfinite(both).sum(axis=1).astype(float)


def _range_image(joint_rad: Floats, range_m: Floats, direction: Mask, cells: Floats) -> Floats:
    """Return the range of each beam at each angle cell by linear interpolation, shape (beams, cells)."""
    image = np.full((range_m.shape[1], cells.size), np.nan)
    for beam in range(range_m.shape[1]):
        use = direction[:, beam]
        angle, distance = joint_rad[use, beam], range_m[use, beam]
        order = np.argsort(angle, kind="stable")
        if order.size:
            image[beam] = np.interp(cells, angle[order], distance[order], left=np.nan, right=np.nan)
    return image


def _minimum(lag_s: Float64[ndarray, " lags"], cost: Float64[ndarray, " lags"]) -> float:
    k = int(np.argmin(cost))
    if k in (0, cost.size - 1):
        return float(lag_s[k])
    left, middle, right = cost[k - 1 : k + 2]
    # Mean absolute differences form a V, not a parabola: two lines of equal steepness through the three points.
    steepness = max(left, right) - middle
    shift = 0.5 * (left - right) / steepness if steepness > 0 else 0.0
    return float(lag_s[k] + shift * (lag_s[k + 1] - lag_s[k]))
