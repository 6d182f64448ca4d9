"""Stream of scans grouped to turns of the axis, as by `assemble --per turn`.

A turn ends after a further 360 deg, or at a reversal; a scan belongs to the turn of its first beam. A reversal is
detected a degree later, and the scans of that degree begin the next turn.
"""

from __future__ import annotations

import math

from scanwright.firmware_io.assembly.streaming import ScanPoints

BACK_RAD = math.radians(1.0)  # smaller reversals are noise or backlash
MOST_BEAMS = 10_000_000  # of a turn, which ends earlier if the axis is at rest


class Turns:
    """Groups placed scans; each is returned once."""

    def __init__(self) -> None:
        self._lines: list[ScanPoints] = []
        self._beams = 0
        self._sense = 0
        self._begin_rad = self._extreme_rad = math.nan
        self._extreme = 0  # index of the scan at the extreme angle

    def push(self, line: ScanPoints) -> list[list[ScanPoints]]:
        """Add a scan, and return the turns that it ends."""
        done = []
        joint_rad = float(line.joint_rad[0]) if line.joint_rad.size else math.nan
        if not math.isnan(joint_rad):
            if self._sense and (self._extreme_rad - joint_rad) * self._sense > BACK_RAD:
                done.append(self._cut(self._extreme + 1, self._extreme_rad))
                self._sense = -self._sense
            if math.isnan(self._begin_rad):
                self._begin_rad = self._extreme_rad = joint_rad
            turn_rad, turned_rad = 2 * math.pi, abs(joint_rad - self._begin_rad)
            if turned_rad >= turn_rad:
                turns = math.copysign(turn_rad * (turned_rad // turn_rad), joint_rad - self._begin_rad)
                done.append(self._cut(len(self._lines), self._begin_rad + turns))
            ahead_rad = joint_rad - self._extreme_rad
            if not self._sense and abs(ahead_rad) > BACK_RAD:
                self._sense = 1 if ahead_rad > 0 else -1
            if self._sense and ahead_rad * self._sense >= 0:
                self._extreme, self._extreme_rad = len(self._lines), joint_rad
        if self._lines and self._beams + line.scan.range_m.size > MOST_BEAMS:
            done.append(self._cut(len(self._lines), self._begin_rad))
        self._lines.append(line)
        self._beams += line.scan.range_m.size
        return [turn for turn in done if turn]

    def finish(self) -> list[list[ScanPoints]]:
        """Return the incomplete turn."""
        turn = self._cut(len(self._lines), math.nan)
        return [turn] if turn else []

    def _cut(self, count: int, begin_rad: float) -> list[ScanPoints]:
        """Return the first `count` scans; the others begin a turn at an angle."""
        turn, self._lines = self._lines[:count], self._lines[count:]
        self._beams = sum(line.scan.range_m.size for line in self._lines)
        self._begin_rad, self._extreme = begin_rad, len(self._lines) - 1
        return turn
