"""How late the angles are against the scans, from one sweep there and back.

In a static scene, one beam at one axis angle sees one range, on the way there and on the way back. If the
joint log is late by some time, both ways are shifted against each other by twice the way the axis turns in it. The
cost of an assumed lag is the mean difference of the two range images, each difference capped: at an edge of the scene
ranges jump, and beyond the cap a difference says nothing about time.

How good it is: about a seventh of the step between the assumed lags; what leaving out one part of the fan after the
other changes (the jackknife's standard deviation); and, where the motor stops during each scan, half the time between
two scans, over which the cost hardly changes.

What it cannot see: mounting angles, lever arm and sign of the axis (they move both ways alike, and enter nowhere
here); backlash (the two ways differ by a constant angle, which at one speed looks the same as a lag: half the
backlash divided by the speed is added to it); the stamps' offset against any other clock; and, where the axis turns
one way only, anything at all.
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
_NOISE_RAD = np.radians(1.0)  # turning back by less is noise or backlash, not the way back
_LAGS_S = np.linspace(-1.0, 1.0, 41)  # delays of drivers and networks, in steps of 50 ms; the minimum is refined
_VAGUE_S = 0.25  # a delay known worse than this is not used
_BLOCKS = 8  # of the fan: neighbouring beams see the same things
_CELLS = 600  # over the common angles; on 60 degrees a tenth of a degree, about one step between scans


@dataclass(frozen=True, slots=True, eq=False)
class LagCurve:
    """Cost of each assumed lag."""

    lag_s: Float64[ndarray, " lags"]  # assumed lags, shape (k,); positive where the joint log's stamps are late
    cost_m: Float64[ndarray, " lags"]  # mean capped difference of the ranges seen on both ways, shape (k,)
    best_s: float  # the minimum, refined from its two neighbours
    sd_s: float  # its standard deviation; infinite for a single beam


@dataclass(frozen=True, slots=True)
class Lag:
    """How late the angles of a recording are."""

    late_s: float  # positive where the joint log's stamps are late
    sd_s: float  # its standard deviation, of which backlash is no part
    speed_rad_s: float  # mean speed of the axis; half of any backlash, divided by it, is inside `late_s`


def find_lag(recording: Recording) -> Lag:
    """How late the angles of a recording are, by up to a second.

    Raises:
        RecordingError: its axis does not turn there and back, or its scene shows less than a quarter of a second.
    """
    curve = lag_curve(recording.scans(), recording.joint_log, _LAGS_S)
    still_s = float(np.median(np.diff(recording.stamp_ns))) / 2e9 if recording.at_rest else 0.0
    sd_s = float(np.hypot(curve.sd_s, still_s))
    if sd_s > _VAGUE_S or curve.best_s in (_LAGS_S[0], _LAGS_S[-1]):
        raise RecordingError(f"{recording.path}: the scene does not tell how late the angles are")
    log = recording.joint_log
    first_ns, _, last_ns = _there_and_back(log)
    positions = log.position_rad[(log.time_ns >= first_ns) & (log.time_ns <= last_ns)]
    return Lag(curve.best_s, sd_s, float(np.abs(np.diff(positions)).sum()) / (last_ns - first_ns) * 1e9)


def lag_curve(scans: Iterable[Scan], joint_log: JointLog, lag_s: Float64[ndarray, " lags"]) -> LagCurve:
    """Compare the way there and the way back under each assumed lag.

    The scans of the sweep are held in memory (it needs both ways at once).

    Args:
        scans: scans with one number of beams.
        joint_log: servo angles.
        lag_s: assumed lags, increasing and evenly spaced, shape (k,), k >= 3.

    Raises:
        RecordingError: the axis does not turn there and back, or both ways have no angle in common.
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
        raise RecordingError("the way there and the way back see no angle in common, so the lag cannot be measured")
    cost_m = capped_m.sum(axis=1) / compared.sum(axis=1)
    sd_s = float(np.hypot(_jackknife(lag_s, capped_m, compared), (lag_s[1] - lag_s[0]) / 7))
    return LagCurve(np.asarray(lag_s, float), cost_m, _minimum(lag_s, cost_m), sd_s)


def _jackknife(lag_s: Floats, capped_m: Floats, compared: Floats) -> float:
    """Standard deviation of the best lag, from leaving out one block of neighbouring beams after the other.

    Args:
        lag_s: shape (k,).
        capped_m: sum of each beam's capped differences under each lag, shape (k, beams).
        compared: how many they are, shape (k, beams).
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
    """Begin, turning point and end [ns] of the sweep around the angle furthest from the first one."""
    position = np.abs(log.position_rad - log.position_rad[0])
    turn = int(np.argmax(position))
    before, after = position[turn::-1], position[turn:]
    steps_before, steps_after = _monotone(before), _monotone(after)
    if position[turn] < _NOISE_RAD or position[turn] - after[steps_after] < _NOISE_RAD:
        raise RecordingError("the axis does not turn there and back: the lag can only be measured with both directions")
    return int(log.time_ns[turn - steps_before]), int(log.time_ns[turn]), int(log.time_ns[turn + steps_after])


def _monotone(falling: Floats) -> int:
    """Index of the lowest value before the series climbs again by more than noise."""
    climbs = falling - np.minimum.accumulate(falling) > _NOISE_RAD
    end = int(np.argmax(climbs)) if climbs.any() else falling.size
    return int(np.argmin(falling[:end]))


def _differences(
    joint_rad: Float64[ndarray, "scans beams"],
    range_m: Float64[ndarray, "scans beams"],
    there: Bool[ndarray, "scans beams"],
    back: Bool[ndarray, "scans beams"],
) -> tuple[Floats, Floats]:
    """Sum and number of each beam's capped differences between two range images (beams x angle cells)."""
    if not (there.any() and back.any()):
        return np.zeros(range_m.shape[1]), np.zeros(range_m.shape[1])
    low = max(np.nanmin(joint_rad[there]), np.nanmin(joint_rad[back]))
    high = min(np.nanmax(joint_rad[there]), np.nanmax(joint_rad[back]))
    cells = np.linspace(low, high, _CELLS)
    images = [_range_image(joint_rad, range_m, direction, cells) for direction in (there, back)]
    both = np.minimum(np.abs(images[0] - images[1]), _CAP_M)
    return np.nansum(both, axis=1), np.isfinite(both).sum(axis=1).astype(float)


def _range_image(joint_rad: Floats, range_m: Floats, direction: Mask, cells: Floats) -> Floats:
    """Range of each beam at each angle cell, straight between neighbouring scans, shape (beams, cells)."""
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
    # Mean absolute differences make a V, not a parabola: two lines of one steepness through the three points.
    steepness = max(left, right) - middle
    shift = 0.5 * (left - right) / steepness if steepness > 0 else 0.0
    return float(lag_s[k] + shift * (lag_s[k + 1] - lag_s[k]))
