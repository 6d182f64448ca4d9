"""Timed commands to the servo for the motion of an angle set.

Beams are de-skewed with the measured angle, so the servo only approximates the motion: it moves from goal to goal at a
rate, with the ramps of its control loop.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import cycle

from scanwright.design.motion import Motion, Spin, Sweep

_LEAD_S = 0.5  # to come to rest at the start


@dataclass(frozen=True, slots=True)
class Move:
    """One command to the servo."""

    at_s: float  # since the first command
    goal_rad: float  # inf for continuous rotation
    rate_rad_s: float


def course(motion: Motion, from_rad: float) -> tuple[float, Iterator[Move]]:
    """Return the start of the motion [s] and its endless moves, for a servo at `from_rad`."""
    if isinstance(motion, Spin):
        return 0.0, iter([Move(0.0, math.inf, 2 * math.pi / motion.period_s)])
    if isinstance(motion, Sweep):
        goals_rad = [math.radians(limit) for limit in motion.limits_deg]
        rate_rad_s, slot_s, ahead_s = math.radians(motion.cruise_deg_s), motion.period_s / 2, motion.period_s / 2
    else:
        goals_rad = [2 * math.pi * stop / motion.stops - math.pi for stop in range(motion.stops)]
        # four fifths of the time to move, the rest to come to rest
        rate_rad_s = 2 * math.pi / motion.stops / (0.8 * motion.move_s)
        slot_s, ahead_s = motion.dwell_s + motion.move_s, motion.move_s
    begin_s = abs(goals_rad[0] - from_rad) / rate_rad_s + _LEAD_S
    return begin_s, _back_and_forth(goals_rad, rate_rad_s, begin_s, slot_s, ahead_s)


def _back_and_forth(
    goals_rad: list[float], rate_rad_s: float, begin_s: float, slot_s: float, ahead_s: float
) -> Iterator[Move]:
    """Yield the goals back and forth; each has a slot, and is commanded `ahead_s` before that.

    A stop at either end belongs to both directions and has two slots; a sweep (two goals, commanded an entire slot
    ahead) has one.
    """
    yield Move(0.0, goals_rad[0], rate_rad_s)
    there_and_back = [*goals_rad, *reversed(goals_rad)] if ahead_s < slot_s else goals_rad
    for slot, goal_rad in enumerate(cycle(there_and_back)):
        if slot:
            yield Move(begin_s + slot * slot_s - ahead_s, goal_rad, rate_rad_s)
