"""How late the angles are against the scans, from one sweep there and back.

In a scene that stands still, one beam at one axis angle sees one range, on the way there and on the way back. If the
joint log is late by some time, both ways are shifted against each other by twice the way the axis turns in it. The
cost of an assumed lag is the mean difference of the two range images, each difference capped: at an edge of the scene
ranges jump, and beyond the cap a difference says nothing about time.

How good it is: about a seventh of the step between the assumed lags, and, where the motor stops during each scan, half
the time between two scans, over which the cost hardly changes.

What it cannot see: mounting angles, lever arm and sign of the axis (they move both ways alike, and enter nowhere
here); backlash (the two ways differ by a constant angle, which at one speed looks the same as a lag: half the
backlash divided by the speed is added to it); the stamps' offset against any other clock; and, where the axis turns
one way only, anything at all.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from design.errors import RecordingError
from firmware_io.samples import Floats, JointLog, Scan

Mask = NDArray[np.bool_]

_CAP_M = 0.05  # a few times the noise of 2D lidars (10 to 30 mm), far below the depth of edges
_NOISE_RAD = np.radians(1.0)  # turning back by less is noise or backlash, not the way back
_CELLS = 600  # over the common angles; on 60 degrees a tenth of a degree, about one step between scans


@dataclass(frozen=True, slots=True, eq=False)
class LagCurve:
    """Cost of each assumed lag.

    Attributes:
        lag_s: assumed lags, shape (k,); positive where the joint log's stamps are late.
        cost_m: mean capped difference of the ranges seen on both ways, shape (k,).
        best_s: the minimum, refined from its two neighbours.
    """

    lag_s: Floats
    cost_m: Floats
    best_s: float


def lag_curve(scans: Iterable[Scan], joint_log: JointLog, lag_s: Floats) -> LagCurve:
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
    cost_m = []
    for lag in lag_s:
        logged_ns = time_ns + round(lag * 1e9)
        joint_rad = joint_log.angle_at(logged_ns.ravel()).reshape(logged_ns.shape)
        there = (logged_ns >= first_ns) & (logged_ns <= turn_ns)
        back = (logged_ns > turn_ns) & (logged_ns <= last_ns)
        cost_m.append(_difference(joint_rad, range_m.astype(float), there, back))
    cost = np.array(cost_m)
    if not np.isfinite(cost).all():
        raise RecordingError("the way there and the way back see no angle in common: no lag can be told")
    return LagCurve(np.asarray(lag_s, float), cost, _minimum(np.asarray(lag_s, float), cost))


def _there_and_back(log: JointLog) -> tuple[int, int, int]:
    """Begin, turning point and end [ns] of the sweep around the angle furthest from the first one."""
    position = np.abs(log.position_rad - log.position_rad[0])
    turn = int(np.argmax(position))
    before, after = position[turn::-1], position[turn:]
    steps_before, steps_after = _monotone(before), _monotone(after)
    if position[turn] < _NOISE_RAD or position[turn] - after[steps_after] < _NOISE_RAD:
        raise RecordingError("the axis does not turn there and back: without both directions no lag can be told")
    return int(log.time_ns[turn - steps_before]), int(log.time_ns[turn]), int(log.time_ns[turn + steps_after])


def _monotone(falling: Floats) -> int:
    """Index of the lowest value before the series climbs again by more than noise."""
    climbs = falling - np.minimum.accumulate(falling) > _NOISE_RAD
    end = int(np.argmax(climbs)) if climbs.any() else falling.size
    return int(np.argmin(falling[:end]))


def _difference(joint_rad: Floats, range_m: Floats, there: Mask, back: Mask) -> float:
    """Mean capped difference of two range images (beams x angle cells); NaN where they share nothing."""
    if not (there.any() and back.any()):
        return float("nan")
    low = max(np.nanmin(joint_rad[there]), np.nanmin(joint_rad[back]))
    high = min(np.nanmax(joint_rad[there]), np.nanmax(joint_rad[back]))
    cells = np.linspace(low, high, _CELLS)
    images = [_range_image(joint_rad, range_m, way, cells) for way in (there, back)]
    both = np.abs(images[0] - images[1])
    both = both[np.isfinite(both)]
    return float(np.minimum(both, _CAP_M).mean()) if both.size else float("nan")


def _range_image(joint_rad: Floats, range_m: Floats, way: Mask, cells: Floats) -> Floats:
    """Range of each beam at each angle cell, straight between neighbouring scans, shape (beams, cells)."""
    image = np.full((range_m.shape[1], cells.size), np.nan)
    for beam in range(range_m.shape[1]):
        use = way[:, beam]
        angle, distance = joint_rad[use, beam], range_m[use, beam]
        order = np.argsort(angle, kind="stable")
        if order.size:
            image[beam] = np.interp(cells, angle[order], distance[order], left=np.nan, right=np.nan)
    return image


def _minimum(lag_s: Floats, cost: Floats) -> float:
    k = int(np.argmin(cost))
    if k in (0, cost.size - 1):
        return float(lag_s[k])
    left, middle, right = cost[k - 1 : k + 2]
    # Mean absolute differences make a V, not a parabola: two lines of one steepness through the three points.
    steepness = max(left, right) - middle
    shift = 0.5 * (left - right) / steepness if steepness > 0 else 0.0
    return float(lag_s[k] + shift * (lag_s[k + 1] - lag_s[k]))
