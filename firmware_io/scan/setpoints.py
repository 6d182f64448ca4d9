"""Orders to the servo, and their times, for the motion of an angle set.

Beams are de-skewed with the measured angle, so the servo only has to come near the motion: it moves from goal to goal
at a rate, with the ramps of its own control loop.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import cycle

from scanwright.design.motion import Motion, Spin, Sweep

_LEAD_S = 0.5  # to come to rest after the way to the start


@dataclass(frozen=True, slots=True)
class Move:
    """One order to the servo."""

    at_s: float  # when, since the course began
    goal_rad: float  # where to, inf for turning without end
    rate_rad_s: float  # how fast


def course(motion: Motion, from_rad: float) -> tuple[float, Iterator[Move]]:
    """When the motion proper begins [s], and the moves, without end; `from_rad` is where the servo stands."""
    if isinstance(motion, Spin):
        return 0.0, iter([Move(0.0, math.inf, 2 * math.pi / motion.period_s)])
    if isinstance(motion, Sweep):
        goals_rad = [math.radians(limit) for limit in motion.limits_deg]
        rate_rad_s, slot_s, ahead_s = math.radians(motion.cruise_deg_s), motion.period_s / 2, motion.period_s / 2
    else:
        goals_rad = [2 * math.pi * stop / motion.stops - math.pi for stop in range(motion.stops)]
        # four fifths of the time for the way, the rest to come to rest
        rate_rad_s = 2 * math.pi / motion.stops / (0.8 * motion.move_s)
        slot_s, ahead_s = motion.dwell_s + motion.move_s, motion.move_s
    begin_s = abs(goals_rad[0] - from_rad) / rate_rad_s + _LEAD_S
    return begin_s, _to_and_fro(goals_rad, rate_rad_s, begin_s, slot_s, ahead_s)


def _to_and_fro(
    goals_rad: list[float], rate_rad_s: float, begin_s: float, slot_s: float, ahead_s: float
) -> Iterator[Move]:
    """Each goal has its slot, and is ordered `ahead_s` before that begins; out, back, out, without end.

    The one at either end counts for the way there and for the way back, so stops there have two slots, while a sweep
    (two goals, ordered a whole slot ahead) has one.
    """
    yield Move(0.0, goals_rad[0], rate_rad_s)
    there_and_back = [*goals_rad, *reversed(goals_rad)] if ahead_s < slot_s else goals_rad
    for slot, goal_rad in enumerate(cycle(there_and_back)):
        if slot:
            yield Move(begin_s + slot * slot_s - ahead_s, goal_rad, rate_rad_s)
