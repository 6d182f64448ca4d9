"""A sensor's clock on the host's: offset and rate from what the sensor stamped and when it arrived.

A packet can be late, never early: among the arrivals only the earliest say anything about the clocks. The way is

1. stamps are whole milliseconds, turns are nearly even: `stamp_line` finds where between two ticks a turn began (a
   constant part of a tick may stay unknown, and does no harm: the offset takes it up);
2. the straight line below all arrivals of the last 100 seconds, as close to them as it goes, gives rate and offset:
   it is that edge of their lower convex hull which spans the middle (one arrival a second is kept, the earliest);
3. where even the earliest arrivals of the last seconds lie above that line by more than chance, the line is lifted
   (a rate that changed);
4. the declared smallest delay, from the moment that a stamp means to the last byte of an undelayed packet, is taken
   off: from arrivals alone no one can tell it from the offset;
5. a time synchronisation before the scans (question and answer: both bounds) keeps the result within what it allows.

Sensor time is milliseconds, host time is `time.monotonic_ns()`.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from scanwright.design.errors import DeviceError
from scanwright.firmware_io.lidar.tick_line import StampLine, half_hull, middle_slope

STAMP_WRAP_MS = 1 << 24  # SCIP 2.0, p. 12

_RATE_MAX = 2e-4  # quartz is better than 100 ppm, and there are two of them
_RATE_USUAL = 5e-5  # [assumed] of two quartzes
_BUCKETS = 100  # seconds that the line looks back: longer averages better, shorter follows a warming quartz
_NEAR = 320  # arrivals among which the earliest must touch the line
_CHANCE = 2.0  # times the earliness that is usual among so many arrivals
_GRAIN_NS = 1e6 / math.sqrt(12)  # standard deviation of a tick, which may stay unknown


@dataclass(frozen=True, slots=True)
class ScanMoment:
    """A sensor time on the host's clock.

    Attributes:
        time_ns: host time.
        uncertainty_ns: standard uncertainty; the declared smallest delay counts as exact.
    """

    time_ns: int
    uncertainty_ns: int


@dataclass(frozen=True, slots=True)
class Exchange:
    """One question for the sensor's time: when it was asked, what the sensor answered, when the answer was there."""

    sent_ns: int
    stamp_ms: int
    answered_ns: int


@dataclass(frozen=True, slots=True)
class TimeSync:
    """At sensor time `stamp_ms` the host's clock stood at `host_ns`, give or take `half_width_ns` (a bound)."""

    stamp_ms: int
    host_ns: int
    half_width_ns: int


def synchronised(exchanges: Sequence[Exchange]) -> TimeSync:
    """The offset that all exchanges (of a second or so) allow.

    An answer of n milliseconds means that the sensor's clock stood within [n, n + 1) at some time between question and
    answer.

    Raises:
        DeviceError: no offset agrees with all of them: the sensor's clock began anew in between.
    """
    first = exchanges[0].stamp_ms
    since_ms = [exchange.stamp_ms - first for exchange in exchanges]
    low = max(e.sent_ns - (ms + 1) * 1_000_000 for e, ms in zip(exchanges, since_ms, strict=True))
    high = min(e.answered_ns - ms * 1_000_000 for e, ms in zip(exchanges, since_ms, strict=True))
    drift_ns = round(_RATE_MAX * max(e.answered_ns - exchanges[0].sent_ns for e in exchanges))
    if low > high + drift_ns:
        raise DeviceError("time synchronisation: the answers contradict each other; the sensor's clock began anew")
    return TimeSync(first, (low + high) // 2, max(high - low, 0) // 2 + drift_ns)


class StampCounter:
    """Unwraps the stamps of a counter of few bits.

    Attributes:
        restarts: how often the sensor's clock began anew; stamps compare within one only.
    """

    def __init__(self, wrap: int = STAMP_WRAP_MS, per_ms: int = 1) -> None:
        """Nothing was stamped yet.

        Args:
            wrap: the stamp that is 0 again.
            per_ms: ticks in a millisecond.
        """
        self.restarts = 0
        self._wrap, self._per_ms = wrap, per_ms
        self._last: tuple[int, int] | None = None

    def unwrap(self, stamp: int, arrival_ns: int) -> int:
        """Ticks since the sensor's clock was last 0; a pause of several wraps is told by the host's clock."""
        if self._last is None:
            self._last = (stamp, arrival_ns)
            return stamp
        last, last_ns = self._last
        step = (stamp - last) % self._wrap
        elapsed = (arrival_ns - last_ns) * self._per_ms // 1_000_000
        step += self._wrap * max(round((elapsed - step) / self._wrap), 0)
        if step > elapsed + 60_000 * self._per_ms:  # nothing waits a minute in a buffer: the sensor began anew
            self.restart()
            return self.unwrap(stamp, arrival_ns)
        self._last = (last + step, arrival_ns)
        return last + step

    def restart(self) -> None:
        """What comes next may be from a new life of the sensor's clock."""
        if self._last is not None:
            self.restarts += 1
            self._last = None


@dataclass(frozen=True, slots=True)
class _Early:
    """An arrival: number and sensor time of its turn, and by how much more host than sensor time had passed."""

    turn: int
    turn_ms: float
    late_ns: float

    def above(self, slope: float) -> float:
        """Beyond a line through 0."""
        return self.late_ns - slope * self.turn_ms


class DeviceClock:
    """Host times of the scans of one sensor, one after the other, in constant memory."""

    def __init__(
        self, scan_period_s: float, *, smallest_delay_ns: int, first_beam_ns: int = 0, fine: bool = False
    ) -> None:
        """Nothing is known yet.

        Args:
            scan_period_s: between two scans, to one part in a hundred.
            smallest_delay_ns: from the moment that a stamp means to the arrival of an undelayed scan's last byte.
            first_beam_ns: from that moment to the first beam, which the results are times of.
            fine: stamps have parts of a millisecond, finer than turns are even: they are taken as they are. The
                uncertainty allows for a tick all the same.
        """
        self._period_ms = scan_period_s * 1e3
        self._delay_ns = smallest_delay_ns
        self._first_beam_ns = first_beam_ns
        self._fine = fine
        self._restarts = 0
        self._sync: TimeSync | None = None
        self._begin_anew()

    def synchronise(self, sync: TimeSync) -> None:
        """Keep the results within what a time synchronisation in this life of the sensor's clock allows."""
        self._sync = sync

    def update(self, stamp_ms: float, arrival_ns: int, restarts: int = 0) -> ScanMoment:
        """Host time of a scan's first beam.

        Args:
            stamp_ms: unwrapped stamp, later than the last one.
            arrival_ns: when its last byte came.
            restarts: lives of the sensor's clock before this one; a new one forgets all that was learned.
        """
        if restarts != self._restarts:
            self._restarts = restarts
            self._sync = None
            self._begin_anew()
        if self._count == 0:
            self._origin = (stamp_ms, arrival_ns)
        since_ms = stamp_ms - self._origin[0]
        self._count += 1
        turn = self._count if self._fine else self._stamps.add(since_ms)
        turn_ms = since_ms if self._fine else self._stamps.time_ms(turn)
        # What is left after the nominal rate is small: floats hold it to a nanosecond.
        late_ns = arrival_ns - self._origin[1] - turn_ms * 1e6
        self._learn(turn, turn_ms, late_ns)
        line_ns = self._offset_ns + self._slope * turn_ms
        self._late_ns += (late_ns - line_ns - self._late_ns) * max(1 / self._count, 1e-3)
        chance_ns = self._late_ns / min(self._count, _NEAR)
        line_ns += max(self._near_ns - _CHANCE * chance_ns, 0.0)
        time_ns = self._origin[1] + round(turn_ms * 1e6 + line_ns) - self._delay_ns
        uncertainty_ns = math.hypot(chance_ns, self._reach_ns, _GRAIN_NS)
        if self._sync is not None:
            sync_ns, half_ns = self._allowed(self._sync, stamp_ms, turn_ms - since_ms)
            time_ns = min(max(time_ns, sync_ns - half_ns), sync_ns + half_ns)
            uncertainty_ns = min(uncertainty_ns, half_ns)
        return ScanMoment(time_ns + self._first_beam_ns, round(uncertainty_ns))

    def _begin_anew(self) -> None:
        self._count = 0
        self._origin = (0.0, 0)
        self._stamps = StampLine(self._period_ms)
        self._fits = 0
        self._earliest: deque[_Early] = deque(maxlen=_BUCKETS)
        self._bucket_ms = -math.inf
        self._slope = 0.0  # host nanoseconds per sensor millisecond, beyond 1e6
        self._offset_ns = 0.0
        self._reach_ns = 0.0  # what the slope's uncertainty does to the end of the line
        self._near_ns = 0.0  # by how much the last seconds stay above the line
        self._late_ns = 0.0

    def _learn(self, turn: int, turn_ms: float, late_ns: float) -> None:
        """Keep the earliest arrival of each second, and the line below them."""
        if self._fits != self._stamps.fits:  # the same arrivals, their turns told anew
            self._fits = self._stamps.fits
            self._earliest = deque((self._refitted(early) for early in self._earliest), _BUCKETS)
        elif turn_ms - self._bucket_ms < 1e3 and late_ns - self._slope * turn_ms >= self._earliest[-1].above(
            self._slope
        ):
            return
        here = _Early(turn, turn_ms, late_ns)
        if turn_ms - self._bucket_ms >= 1e3:
            self._bucket_ms = turn_ms
            self._earliest.append(here)
        elif here.above(self._slope) < self._earliest[-1].above(self._slope):
            self._earliest[-1] = here
        slope = middle_slope(half_hull([(early.turn_ms, early.late_ns) for early in self._earliest], 1))
        # Few arrivals tell the rate less well than the usual quality of quartzes does. Two of them hold the line, some
        # half of the span apart, each late by the mean over half of all: that is their rate's uncertainty.
        span_ms = max(turn_ms - self._earliest[0].turn_ms, self._period_ms)
        unsure = 12 * self._late_ns * self._period_ms / span_ms**2
        usual = _RATE_USUAL * 1e6
        slope /= 1 + (unsure / usual) ** 2
        self._reach_ns = span_ms / 2 * unsure * usual / math.hypot(unsure, usual)
        self._slope = min(max(slope, -_RATE_MAX * 1e6), _RATE_MAX * 1e6)
        above_ns = [early.above(self._slope) for early in self._earliest]
        self._offset_ns = min(above_ns)
        near = max(round(_NEAR * self._period_ms / 1e3), 1)
        self._near_ns = min(above_ns[-near:]) - self._offset_ns

    def _refitted(self, early: _Early) -> _Early:
        """An arrival, with the time of its turn by the present line where that holds for it."""
        if early.turn < self._stamps.first_turn:
            return early
        turn_ms = self._stamps.time_ms(early.turn)
        return _Early(early.turn, turn_ms, early.late_ns + (early.turn_ms - turn_ms) * 1e6)

    def _allowed(self, sync: TimeSync, stamp_ms: float, between_ms: float) -> tuple[int, int]:
        """Host time of a turn by the synchronisation, and how far it may be off."""
        since_ms = stamp_ms - sync.stamp_ms + between_ms
        half_ns = sync.half_width_ns + 500_000 + abs(since_ms) * _RATE_MAX * 1e6
        return sync.host_ns + round(since_ms * 1e6), round(half_ns)
