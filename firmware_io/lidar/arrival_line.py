"""Line that maps sensor time to host time, fitted below arrivals, which can be late but never early.

It is the edge of their lower convex hull that spans the middle of the last seconds.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

from scanwright.firmware_io.lidar.tick_line import half_hull, middle_slope

QUARTZ_RATE = 2e-4  # each of the two quartzes is better than 100 ppm

_BUCKET_NS, _BUCKETS = 200_000_000, 300  # a minute: longer averages better, shorter follows a warming quartz
_EVEN_BUCKET_NS, _EVEN_BUCKETS = 1_000_000_000, 100  # of packets whose spacing is known
_FEWEST = 3  # buckets that determine a rate
_NEAR = 320  # arrivals among which the earliest must touch the line
_CHANCE = 2.0  # times the usual gap between the line and the earliest of as many arrivals
_USUAL = 0.25  # usual rate error as a part of the largest one [assumed]
_BEHIND_NS = 50_000_000  # longer than a busy computer delays all arrivals of two buckets, shorter than a mirror turn


class ArrivalLine:
    """Conversion from sensor time to host time, in constant memory."""

    def __init__(
        self, *, smallest_delay_ns: int, rate_max: float, grain_ns: float, spacing_ns: float | None = None
    ) -> None:
        """Start without arrivals.

        Args:
            smallest_delay_ns: from the sensor time of a packet to its undelayed arrival, which arrivals cannot show.
            rate_max: largest relative rate error of the sensor's clock.
            grain_ns: standard uncertainty of the sensor times.
            spacing_ns: time between packets, if even. The rate is then weighed against the usual one, and the line is
                lifted to the last arrivals if all of them lie above it.
        """
        self._delay_ns, self._rate_max, self._grain_ns = smallest_delay_ns, rate_max, grain_ns
        self._spacing_ns = spacing_ns
        self._every_ns = _BUCKET_NS if spacing_ns is None else _EVEN_BUCKET_NS
        buckets = _BUCKETS if spacing_ns is None else _EVEN_BUCKETS
        self._earliest: deque[tuple[float, float, int]] = deque(maxlen=buckets)  # sensor time, lateness, number
        self._origin = (0.0, 0)
        self._bucket_ns = -math.inf
        self._slope = self._offset_ns = self._late_ns = self._newest_ns = self._reach_ns = self._near_ns = 0.0
        self._count = 0

    def add(self, sensor_ns: float, arrival_ns: int, number: int = 0) -> None:
        """Add the arrival of a packet that was complete at `sensor_ns`; `number` identifies it for `retime`."""
        if not self._count:
            self._origin = (sensor_ns, arrival_ns)
        self._count += 1
        since_ns = self._newest_ns = sensor_ns - self._origin[0]
        here = (since_ns, arrival_ns - self._origin[1] - since_ns, number)
        if since_ns - self._bucket_ns >= self._every_ns:
            self._bucket_ns = since_ns
            self._earliest.append(here)
            self._fit()
        elif self._above(here) < self._above(self._earliest[-1]):
            self._earliest[-1] = here
            self._fit()
        above_ns = self._above(here) - self._offset_ns
        self._late_ns += (above_ns - self._late_ns) * max(1 / self._count, 1e-3)

    def retime(self, sensor_ns: Callable[[int], float | None]) -> None:
        """Replace sensor times, by packet number, with better ones; None keeps a time."""
        for k, (since_ns, late_ns, number) in enumerate(self._earliest):
            if (better := sensor_ns(number)) is not None:
                now_ns = better - self._origin[0]
                self._earliest[k] = now_ns, late_ns + since_ns - now_ns, number
        if self._earliest:
            self._fit()

    def host_ns(self, sensor_ns: float) -> int:
        """Return the host time of a sensor time."""
        return self.arrives_ns(sensor_ns) - self._delay_ns

    def arrives_ns(self, sensor_ns: float) -> int:
        """Return the undelayed arrival time of a packet that was complete at a sensor time."""
        lift_ns = max(self._near_ns - _CHANCE * self._chance_ns, 0.0)
        return self._origin[1] + round((sensor_ns - self._origin[0]) * self.rate + self._offset_ns + lift_ns)

    @property
    def uncertainty_ns(self) -> int:
        """Standard uncertainty of the newest times; the declared smallest delay counts as exact."""
        reach_ns = self._reach_ns
        if self._spacing_ns is None:
            span_ns = max(self._newest_ns - self._earliest[0][0], _BUCKET_NS) if self._earliest else _BUCKET_NS
            # two arrivals, about half the span apart, fix the line; few determine the rate no better than the bound
            reach_ns = self._rate_max * span_ns / 2
            if len(self._earliest) >= _FEWEST:
                reach_ns = min(reach_ns, 2 * self._late_ns / len(self._earliest))
        return round(math.hypot(self._chance_ns, reach_ns, self._grain_ns))

    @property
    def rate(self) -> float:
        """Host seconds per sensor second."""
        return 1 + self._slope

    @property
    def is_behind(self) -> bool:
        """Whether even the earliest of the last arrivals are so late that the sensor's time must have jumped."""
        last = list(self._earliest)[-2:]
        return min(map(self._above, last)) - self._offset_ns > _BEHIND_NS if last else False

    @property
    def _chance_ns(self) -> float:
        return self._late_ns / min(max(self._count, 1), _NEAR)

    def _above(self, arrival: tuple[float, float, int]) -> float:
        return arrival[1] - self._slope * arrival[0]

    def _fit(self) -> None:
        enough = self._spacing_ns is not None or len(self._earliest) >= _FEWEST
        points = [(since_ns, late_ns) for since_ns, late_ns, _ in self._earliest]
        slope = middle_slope(half_hull(points, 1)) if enough else 0.0
        if self._spacing_ns is not None:
            # Two arrivals, about half the span apart, fix the line; each is late by the mean over half of all. The
            # rate is weighed against the usual quality of quartzes, which is better than few arrivals.
            span_ns = max(self._newest_ns - points[0][0], self._spacing_ns)
            unsure, usual = 12 * self._late_ns * self._spacing_ns / span_ns**2, _USUAL * self._rate_max
            slope /= 1 + (unsure / usual) ** 2
            self._reach_ns = span_ns / 2 * unsure * usual / math.hypot(unsure, usual)
        self._slope = min(max(slope, -self._rate_max), self._rate_max)
        above_ns = [self._above(arrival) for arrival in self._earliest]
        self._offset_ns = min(above_ns)
        if self._spacing_ns is not None:
            near = max(round(_NEAR * self._spacing_ns / self._every_ns), 1)
            self._near_ns = min(above_ns[-near:]) - self._offset_ns
