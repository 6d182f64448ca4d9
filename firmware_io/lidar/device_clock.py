"""Offset and rate of a sensor's clock, from its timestamps and their arrivals.

1. `stamp_line` finds the start of each turn between two ticks: stamps are whole milliseconds, turns nearly even.
2. `arrival_line` gives rate and offset: packets can be late, never early.
3. The declared smallest delay from timestamp to last byte is subtracted; arrivals cannot show it.
4. A time synchronisation before the scans bounds the result.

Sensor time is milliseconds, host time is `time.monotonic_ns()`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from scanwright.design.errors import DeviceError
from scanwright.firmware_io.lidar.arrival_line import QUARTZ_RATE, ArrivalLine
from scanwright.firmware_io.lidar.tick_line import StampLine

STAMP_WRAP_MS = 1 << 24  # SCIP 2.0, p. 12

TICK_NS = 1e6 / math.sqrt(12)  # standard deviation of rounding to a millisecond


@dataclass(frozen=True, slots=True)
class ScanMoment:
    """A sensor time on the host's clock."""

    time_ns: int  # host time
    uncertainty_ns: int  # standard uncertainty; the declared smallest delay counts as exact


@dataclass(frozen=True, slots=True)
class Exchange:
    """One request for the sensor's time, and its reply."""

    sent_ns: int
    stamp_ms: int  # sensor time in the reply
    answered_ns: int


@dataclass(frozen=True, slots=True)
class TimeSync:
    """Host time `host_ns` of sensor time `stamp_ms`, at most `half_width_ns` off."""

    stamp_ms: int
    host_ns: int
    half_width_ns: int


def synchronised(exchanges: Sequence[Exchange]) -> TimeSync:
    """Return the offset that all exchanges allow, or raise DeviceError; a reply of n ms means [n, n + 1) ms."""
    first = exchanges[0].stamp_ms
    since_ms = [exchange.stamp_ms - first for exchange in exchanges]
    low = max(e.sent_ns - (ms + 1) * 1_000_000 for e, ms in zip(exchanges, since_ms, strict=True))
    high = min(e.answered_ns - ms * 1_000_000 for e, ms in zip(exchanges, since_ms, strict=True))
    drift_ns = round(QUARTZ_RATE * max(e.answered_ns - exchanges[0].sent_ns for e in exchanges))
    if low > high + drift_ns:
        raise DeviceError("time synchronisation: the replies contradict each other; the sensor's clock restarted")
    return TimeSync(first, (low + high) // 2, max(high - low, 0) // 2 + drift_ns)


class StampCounter:
    """Unwraps timestamps of a counter that overflows."""

    def __init__(self, wrap: int = STAMP_WRAP_MS, per_ms: int = 1) -> None:
        """`wrap`: number of values of the counter; `per_ms`: ticks per millisecond."""
        self.restarts = 0  # of the sensor's clock; stamps across a restart do not compare
        self._wrap, self._per_ms = wrap, per_ms
        self._last: tuple[int, int] | None = None

    def unwrap(self, stamp: int, arrival_ns: int) -> int:
        """Return the ticks since the sensor's clock was 0; the host's clock counts the wraps in a pause."""
        if self._last is None:
            self._last = (stamp, arrival_ns)
            return stamp
        last, last_ns = self._last
        step = (stamp - last) % self._wrap
        elapsed = (arrival_ns - last_ns) * self._per_ms // 1_000_000
        step += self._wrap * max(round((elapsed - step) / self._wrap), 0)
        if step > elapsed + 60_000 * self._per_ms:  # no buffer holds a minute: the sensor's clock restarted
            self.restart()
            return self.unwrap(stamp, arrival_ns)
        self._last = (last + step, arrival_ns)
        return last + step

    def restart(self) -> None:
        """Count a restart of the sensor's clock before the next stamp."""
        if self._last is not None:
            self.restarts += 1
            self._last = None


class DeviceClock:
    """Host times of consecutive scans of one sensor, in constant memory."""

    _origin_ms: float | None  # first stamp
    _sync: TimeSync | None

    def __init__(self, scan_period_s: float, *, smallest_delay_ns: int, first_beam_ns: int = 0) -> None:
        """Start without scans.

        Args:
            scan_period_s: time between two scans, within 1 %.
            smallest_delay_ns: from the timestamp to the arrival of an undelayed scan's last byte.
            first_beam_ns: from the timestamp to the first beam, whose time is returned.
        """
        self._period_ms = scan_period_s * 1e3
        self._delay_ns = smallest_delay_ns
        self._first_beam_ns = first_beam_ns
        self._restarts = 0
        self._reset()

    def synchronise(self, sync: TimeSync) -> None:
        """Bound the results by a time synchronisation, until the sensor's clock restarts."""
        self._sync = sync

    def update(self, stamp_ms: float, arrival_ns: int, restarts: int = 0) -> ScanMoment:
        """Return the host time of a scan's first beam.

        Args:
            stamp_ms: unwrapped stamp, later than the last one.
            arrival_ns: host time of its last byte.
            restarts: restarts of the sensor's clock so far; a new one resets this clock.
        """
        if restarts != self._restarts:
            self._restarts = restarts
            self._reset()
        self._origin_ms = stamp_ms if self._origin_ms is None else self._origin_ms
        since_ms, fits = stamp_ms - self._origin_ms, self._stamps.fits
        turn = self._stamps.add(since_ms)
        turn_ns = self._turn_ns(turn)
        if fits != self._stamps.fits:  # a new line changes the times of earlier turns
            self._arrivals.retime(lambda number: self._turn_ns(number) if number >= self._stamps.first_turn else None)
        self._arrivals.add(turn_ns, arrival_ns, turn)
        time_ns, uncertainty_ns = self._arrivals.host_ns(turn_ns), self._arrivals.uncertainty_ns
        if self._sync is not None:
            sync_ns, half_ns = self._allowed(self._sync, stamp_ms, turn_ns / 1e6 - since_ms)
            time_ns = min(max(time_ns, sync_ns - half_ns), sync_ns + half_ns)
            uncertainty_ns = min(uncertainty_ns, half_ns)
        return ScanMoment(time_ns + self._first_beam_ns, uncertainty_ns)

    def _reset(self) -> None:
        self._origin_ms = self._sync = None
        self._stamps = StampLine(self._period_ms)
        self._arrivals = ArrivalLine(
            smallest_delay_ns=self._delay_ns,
            rate_max=QUARTZ_RATE,
            grain_ns=TICK_NS,
            spacing_ns=self._period_ms * 1e6,
        )

    def _turn_ns(self, turn: int) -> float:
        return self._stamps.time_ms(turn) * 1e6

    def _allowed(self, sync: TimeSync, stamp_ms: float, between_ms: float) -> tuple[int, int]:
        """Return the host time of a turn by the synchronisation, and the bound of its error [ns]."""
        since_ms = stamp_ms - sync.stamp_ms + between_ms
        half_ns = sync.half_width_ns + 500_000 + abs(since_ms) * QUARTZ_RATE * 1e6
        return sync.host_ns + round(since_ms * 1e6), round(half_ns)
