"""Times of the turns of the axis."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from jaxtyping import Float64, Int64
from numpy import ndarray

from scanwright.firmware_io.samples import JointLog

_NOISE_RAD = np.radians(1.0)  # turning back by less is noise or backlash


def turn_starts(log: JointLog, begin_ns: int, turn_rad: float) -> Int64[ndarray, " turns"]:
    """Return the times at which the axis has turned by a further `turn_rad`, or reverses, increasing.

    The first turn begins at `begin_ns`, and each direction of a sweep at its turning point: a full scan of a sweep has
    two turns, which see the same directions.
    """
    begin_ns = int(np.clip(begin_ns, log.time_ns[0], log.time_ns[-1]))
    later = log.time_ns > begin_ns
    time_ns = np.append(begin_ns, log.time_ns[later])
    position = np.append(log.angle_at(np.array([begin_ns])), log.position_rad[later])
    back = turning_points(position)
    starts = [time_ns[back]]
    for first, last in pairwise([0, *back, position.size - 1]):
        turned = np.maximum.accumulate(np.abs(position[first : last + 1] - position[first]))
        ends_rad = np.arange(turn_rad, turned[-1], turn_rad)
        since_ns = np.interp(ends_rad, turned, (time_ns[first : last + 1] - time_ns[first]).astype(float))
        starts.append(time_ns[first] + np.rint(since_ns).astype(np.int64))
    return np.unique(np.concatenate(starts))


def turning_points(position_rad: Float64[ndarray, " n"]) -> list[int]:
    """Return the indices of the extremes from which the axis reverses by more than noise."""
    turning: list[int] = []
    sense, extreme, extreme_rad = 0, 0, float(position_rad[0])
    for i, here_rad in enumerate(position_rad.tolist()):
        ahead_rad = (here_rad - extreme_rad) * (sense or 1)
        if sense and ahead_rad >= 0:
            extreme, extreme_rad = i, here_rad
        elif ahead_rad < -_NOISE_RAD or (not sense and ahead_rad > _NOISE_RAD):
            if sense:
                turning.append(extreme)
            sense = -sense or (1 if ahead_rad > 0 else -1)
            extreme, extreme_rad = i, here_rad
    return turning
