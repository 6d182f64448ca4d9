"""A sensor's even clock on the host's, from packets that can be late and never early.

The straight line below all arrivals of the last seconds, as close to them as it goes, gives rate and offset: it is that
edge of their lower convex hull which spans the middle. `device_clock` is the same for stamps of whole turns in
milliseconds; here the sensor's time comes in nanoseconds, packet after packet.
"""

from __future__ import annotations

import math
from collections import deque

from scanwright.firmware_io.lidar.tick_line import half_hull, middle_slope

_BUCKET_NS = 200_000_000  # of which the earliest arrival is kept
_BUCKETS = 300  # a minute of them: longer averages better, shorter follows a warming quartz
_FEWEST = 3  # buckets that tell a rate
_NEAR = 320  # arrivals among which the earliest must touch the line
_BEHIND_NS = 50_000_000  # longer than a busy computer delays all arrivals of two buckets, shorter than a lidar's turn


class ArrivalLine:
    """Host times of a sensor's, in constant memory."""

    def __init__(self, *, smallest_delay_ns: int, rate_max: float, grain_ns: float) -> None:
        """Nothing is known yet.

        Args:
            smallest_delay_ns: from the sensor's time of a packet to its arrival, undelayed: arrivals alone cannot tell.
            rate_max: how far the sensor's seconds may differ from the host's.
            grain_ns: standard deviation of what may stay unknown of the sensor's own times.
        """
        self._delay_ns, self._rate_max, self._grain_ns = smallest_delay_ns, rate_max, grain_ns
        self._earliest: deque[tuple[float, float]] = deque(maxlen=_BUCKETS)  # sensor time, lateness
        self._origin = (0.0, 0)
        self._bucket_ns = -math.inf
        self._slope = self._offset_ns = self._late_ns = self._newest_ns = 0.0
        self._count = 0

    def add(self, sensor_ns: float, arrival_ns: int) -> None:
        """A packet that was whole at `sensor_ns`, later than the last one, has come."""
        if not self._count:
            self._origin = (sensor_ns, arrival_ns)
        self._count += 1
        since_ns = self._newest_ns = sensor_ns - self._origin[0]
        late_ns = arrival_ns - self._origin[1] - since_ns
        if since_ns - self._bucket_ns >= _BUCKET_NS:
            self._bucket_ns = since_ns
            self._earliest.append((since_ns, late_ns))
            self._fit()
        elif self._above((since_ns, late_ns)) < self._above(self._earliest[-1]):
            self._earliest[-1] = (since_ns, late_ns)
            self._fit()
        above_ns = self._above((since_ns, late_ns)) - self._offset_ns
        self._late_ns += (above_ns - self._late_ns) * max(1 / self._count, 1e-3)

    def host_ns(self, sensor_ns: float) -> int:
        """Host time of a sensor time."""
        return self.arrives_ns(sensor_ns) - self._delay_ns

    def arrives_ns(self, sensor_ns: float) -> int:
        """When what was whole at a sensor time arrives, if nothing holds it up."""
        since_ns = sensor_ns - self._origin[0]
        return self._origin[1] + round(since_ns * self.rate + self._offset_ns)

    @property
    def uncertainty_ns(self) -> int:
        """Standard uncertainty of the newest times; the declared smallest delay counts as exact."""
        chance_ns = self._late_ns / min(max(self._count, 1), _NEAR)
        span_ns = max(self._newest_ns - self._earliest[0][0], _BUCKET_NS) if self._earliest else _BUCKET_NS
        # two arrivals hold the line, some half of the span apart; few of them tell the rate no better than the bound
        reach_ns = self._rate_max * span_ns / 2
        if len(self._earliest) >= _FEWEST:
            reach_ns = min(reach_ns, 2 * self._late_ns / len(self._earliest))
        return round(math.hypot(chance_ns, reach_ns, self._grain_ns))

    @property
    def rate(self) -> float:
        """Host seconds per sensor's second."""
        return 1 + self._slope

    @property
    def is_behind(self) -> bool:
        """Whether even the earliest of the last arrivals are so late that the sensor's time must have jumped."""
        last = list(self._earliest)[-2:]
        return min(map(self._above, last)) - self._offset_ns > _BEHIND_NS if last else False

    def _above(self, arrival: tuple[float, float]) -> float:
        return arrival[1] - self._slope * arrival[0]

    def _fit(self) -> None:
        points = list(self._earliest)
        slope = middle_slope(half_hull(points, 1)) if len(points) >= _FEWEST else 0.0
        self._slope = min(max(slope, -self._rate_max), self._rate_max)
        self._offset_ns = min(self._above(point) for point in points)
