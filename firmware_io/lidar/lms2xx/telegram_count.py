"""Telegrams that follow each other evenly: their count is the clock, and tells late ones from lost ones."""

from __future__ import annotations

import math

from scanwright.firmware_io.lidar.arrival_line import ArrivalLine
from scanwright.firmware_io.lidar.lms2xx.protocol import LmsScan

_RATE_MAX = 1e-2  # of its motor [assumed]
_GRAIN_NS = 3e5  # that its telegrams wander [assumed]
_PAUSE = 5  # telegrams, for which there is room in the 4095 bytes of a terminal (Linux, n_tty.c): none is lost


class TelegramCount:
    """Which telegram each one is since the stream began.

    Attributes:
        arrivals: the sensor's time, told by the count, on the host's clock.
        lost: missing telegrams between those received.
        pause_s: of the reader, after which the count cannot be trusted: it needs `resume`.
    """

    def __init__(self, period_ns: float, telegram_ns: int, patience: int) -> None:
        """`patience`: telegrams after which a late one is taken to follow lost ones."""
        self.lost = 0
        self._period_ns, self._telegram_ns, self._patience = period_ns, telegram_ns, patience
        self.pause_s = _PAUSE * max(period_ns, telegram_ns) / 1e9
        self._begin(0)

    def resume(self) -> None:
        """What comes next has just arrived, and an unknown number of telegrams before it was lost."""
        self._begin(self.arrivals.arrives_ns(self._number * self._period_ns) if self._number else self._ended_ns)

    def _begin(self, ended_ns: int) -> None:
        """A new line; `ended_ns` is the arrival of the last telegram before, 0 if nothing is missing before it."""
        self.arrivals = ArrivalLine(smallest_delay_ns=self._telegram_ns, rate_max=_RATE_MAX, grain_ns=_GRAIN_NS)
        self._pending: list[tuple[LmsScan, int]] = []
        self._number, self._ended_ns = 0, ended_ns

    def add(self, scan: LmsScan, arrival_ns: int) -> list[tuple[LmsScan, float, int]]:
        """The scans that are known by now, each with the sensor's time of its end [ns] and its arrival."""
        self._pending.append((scan, arrival_ns))
        numbers = self._numbers()
        if numbers[-1] > self._number + len(numbers) and len(numbers) < self._patience:
            return []
        if not self._number and self._ended_ns:
            self.lost += max(round((arrival_ns - self._ended_ns) / self._period_ns) - 1, 0)
        known = []
        for number, (pending, came_ns) in zip(numbers, self._pending, strict=True):
            self.lost += number - self._number - 1
            self._number = number
            self.arrivals.add(number * self._period_ns, came_ns)
            known.append((pending, number * self._period_ns, came_ns))
        self._pending = []
        return known

    def _numbers(self) -> list[int]:
        """Return the numbers of the held telegrams; gaps are lost ones.

        The line gives the number that fits an arrival. A late telegram with others close behind looks as if some were
        lost before it. None comes early, so the smallest number that a later one allows is right.
        """
        least = [self._number + 1 + k for k in range(len(self._pending))]
        if not self._number:
            return least
        numbers: list[int] = []
        above = math.inf
        for at_least, (_, came_ns) in zip(reversed(least), reversed(self._pending), strict=True):
            late_ns = came_ns - self._telegram_ns - self.arrivals.host_ns(at_least * self._period_ns)
            above = min(above - 1, at_least + max(round(late_ns / self._period_ns), 0))
            numbers.append(int(above))
        return numbers[::-1]
