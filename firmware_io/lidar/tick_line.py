"""Start of turns, finer than the ticks of their timestamps. Time is in ticks (milliseconds) since any origin.

A stamp is the last tick before the start of a turn, and turns are nearly even. So the starts lie on a line over the
number of the turn that passes within the tick of every stamp; the middle one of these lines is used, half a tick above
the minimax fit. It spans as many of the last seconds as one line fits. If stamps jitter by more than a tick, a
least-squares line is used.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

Point = tuple[float, float]
_BLOCK_MS = 1e3  # dropped together
_BLOCKS = 100  # 100 s: a beat of turns and ticks takes up to a minute
_FEWEST = 3  # blocks
_SLACK_MS = 0.02  # variation of the duration of turns


class StampLine:
    """Line through the stamps between two restarts of a sensor's clock, in constant memory."""

    def __init__(self, period_ms: float) -> None:
        """`period_ms`: duration of a turn, within 1 %."""
        self.first_turn = 0  # oldest turn of the line
        self.fits = 0  # number of changes of the line
        self._turn = -1
        self._stamp_ms = -period_ms
        self._slope_ms = period_ms
        self._start_ms = 0.5  # of turn 0
        self._blocks: deque[list[Point]] = deque(maxlen=_BLOCKS)
        self._block_ends_ms = -np.inf
        self._new_blocks = 0

    def add(self, stamp_ms: float) -> int:
        """Return the number of the turn with this stamp, which is later than the last one."""
        self._turn += max(round((stamp_ms - self._stamp_ms) / self._slope_ms), 1)
        self._stamp_ms = stamp_ms
        missed_ms = self.time_ms(self._turn) - stamp_ms
        if stamp_ms >= self._block_ends_ms:
            if self._blocks:
                block = self._blocks[-1]
                self._blocks[-1] = sorted({*half_hull(block, 1), *half_hull(block, -1)})
            self._blocks.append([])
            self._block_ends_ms = stamp_ms + _BLOCK_MS
            self._new_blocks += 1
        self._blocks[-1].append((float(self._turn), stamp_ms))
        grown = self._new_blocks > len(self._blocks) // 10  # stamps within the tick improve only a short line
        if grown or not -_SLACK_MS < missed_ms < 1 + _SLACK_MS:
            self._fit()
        return self._turn

    def time_ms(self, turn: int) -> float:
        """Return the start of a turn on the line."""
        return self._start_ms + self._slope_ms * turn

    def _fit(self) -> None:
        self.fits += 1
        self._new_blocks = 0
        points = [point for block in self._blocks for point in block]
        if len(points) < 3:
            self._start_ms = self._stamp_ms + 0.5 - self._slope_ms * self._turn
            return
        while True:
            slope_ms, low_ms, high_ms = _narrowest(points)
            if high_ms - low_ms <= 1 + 2 * _SLACK_MS:
                break
            if len(self._blocks) <= _FEWEST:
                turn, stamp_ms = np.array(points).T
                slope_ms, low_ms = np.polyfit(turn, stamp_ms, 1)
                high_ms = low_ms
                break
            for _ in range(max(len(self._blocks) // 8, 1)):
                self._blocks.popleft()
            points = [point for block in self._blocks for point in block]
        self.first_turn = round(points[0][0])
        self._slope_ms, self._start_ms = float(slope_ms), float(low_ms + high_ms) / 2 + 0.5


def half_hull(points: Sequence[Point], side: int) -> list[Point]:
    """Return the lower (side 1) or upper (-1) convex hull of points sorted by x."""
    hull: list[Point] = []
    for x, y in points:
        while len(hull) > 1:
            (x0, y0), (x1, y1) = hull[-2:]
            if side * ((x1 - x0) * (y - y0) - (y1 - y0) * (x - x0)) > 0:
                break
            hull.pop()
        hull.append((x, y))
    return hull


def middle_slope(below: Sequence[Point]) -> float:
    """Return the slope of the edge over the middle: the line below the points with the least area to them."""
    middle = (below[0][0] + below[-1][0]) / 2
    for (x0, y0), (x1, y1) in pairwise(below):
        if x0 < x1 and middle <= x1:
            return (y1 - y0) / (x1 - x0)
    return 0.0


def _narrowest(points: list[Point]) -> tuple[float, float, float]:
    """Return slope and intercepts of the edges of the lowest strip around all points; one edge is an edge of a hull."""
    below, above = np.array(half_hull(points, 1)), np.array(half_hull(points, -1))
    slopes = np.concatenate([np.diff(side[:, 1]) / np.diff(side[:, 0]) for side in (below, above)])
    low = (below[:, 1] - slopes[:, None] * below[:, 0]).min(axis=1)
    high = (above[:, 1] - slopes[:, None] * above[:, 0]).max(axis=1)
    best = int(np.argmin(high - low))
    return float(slopes[best]), float(low[best]), float(high[best])
