"""Count of evenly spaced telegrams as a clock; it distinguishes late telegrams from lost ones."""

from __future__ import annotations

import math

from scanwright.firmware_io.lidar.arrival_line import ArrivalLine
from scanwright.firmware_io.lidar.lms2xx.protocol import LmsScan

_RATE_MAX = 1e-2  # of its motor [assumed]
_GRAIN_NS = 3e5  # jitter of its telegrams [assumed]
_PAUSE = 5  # telegrams that fit in the 4095 bytes of a terminal (Linux, n_tty.c), so none is lost


class TelegramCount:
    """Numbers telegrams since the stream began; `arrivals` converts their count to host time."""

    def __init__(self, period_ns: float, telegram_ns: int, patience: int) -> None:
        """`patience`: further telegrams after which a late one is numbered as following lost ones."""
        self.lost = 0  # missing telegrams between those received
        self._period_ns, self._telegram_ns, self._patience = period_ns, telegram_ns, patience
        self.pause_s = _PAUSE * max(period_ns, telegram_ns) / 1e9  # longest pause of the reader without `resume`
        self._begin(0)

    def resume(self) -> None:
        """Restart at the next telegram, before which an unknown number was lost."""
        self._begin(self.arrivals.arrives_ns(self._number * self._period_ns) if self._number else self._ended_ns)

    def _begin(self, ended_ns: int) -> None:
        """Start a new line; `ended_ns`: arrival of the last telegram before a loss, 0 without a loss."""
        self.arrivals = ArrivalLine(smallest_delay_ns=self._telegram_ns, rate_max=_RATE_MAX, grain_ns=_GRAIN_NS)
        self._pending: list[tuple[LmsScan, int]] = []
        self._number, self._ended_ns = 0, ended_ns

    def add(self, scan: LmsScan, arrival_ns: int) -> list[tuple[LmsScan, float, int]]:
        """Return the scans numbered by now, each with the sensor time of its end [ns] and its arrival."""
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
        """Return the numbers of the pending telegrams; gaps are lost ones.

        The line gives the number that fits an arrival. A late telegram with others close behind seems to follow lost
        ones. No telegram is early, so the smallest number that a later one allows is right.
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
