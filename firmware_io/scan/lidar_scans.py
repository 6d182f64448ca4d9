"""Scans of a lidar, across disconnections, and the settling of its clock.

If the lidar falls silent, its cable may be torn, so the servo stops and holds at once. If the sensor is back within ten
seconds, the scan continues, up to nine times in ten minutes. A fault reported by the sensor ends it.
"""

from __future__ import annotations

import time
from collections import deque

from scanwright.design.errors import DeviceError, DeviceFaultError
from scanwright.firmware_io.lidar.lidar import LidarDriver, TimedScan
from scanwright.firmware_io.samples import Scan
from scanwright.firmware_io.scan.axis_thread import AxisThread
from scanwright.firmware_io.scan.live_feed import Reporter

CLOCK_GOOD_NS = 500_000  # 0.03 deg at 60 deg/s, a third of an encoder's step
_CLOCK_LEAST_S = 3.0  # three one-second buckets give a rate
_CLOCK_PATIENCE_S = 10.0  # more does not help on a busy computer
_AWAY_S = 10.0  # to plug it in again, and for its start
_MOST_LOST, _LOST_WITHIN_S = 10, 600.0  # a loose plug or a weak supply
_SERVO_UNKNOWN = "the servo did not confirm that it stopped: check it, and cut its power if it turns"


class LidarScans:
    """Source of scans with host times that reconnects a lost sensor."""

    def __init__(self, lidar: LidarDriver, reporter: Reporter) -> None:
        self.lidar = lidar
        self.axis: AxisThread | None = None  # stops while the sensor is away; None before the servo turns
        self.clock_ns = 0  # standard uncertainty of the last scan's time
        self.away = 0  # number of disconnections
        self._warned = ""
        self._reporter = reporter
        self._lost_s: deque[float] = deque(maxlen=_MOST_LOST)

    def next(self) -> Scan:
        """Return the next scan, after a reconnection if needed; DeviceError if it or the servo fails."""
        try:
            timed = self.lidar.read()
        except DeviceFaultError:
            raise
        except DeviceError as error:
            servo_state = ""
            if self.axis is not None:
                stopped = self.axis.stop()
                servo_state = "the servo has answered that it holds, " if stopped else f"{_SERVO_UNKNOWN}, "
            self._lost_s.append(time.monotonic())
            since_s = self._lost_s[-1] - self._lost_s[0]
            if len(self._lost_s) == _MOST_LOST and since_s < _LOST_WITHIN_S:
                lost = f"lost {_MOST_LOST} times in {since_s:.0f} s: replace its cable, or its supply is too weak"
                raise DeviceError(f"{error}; {servo_state}{lost}") from error
            self._reporter.warn(f"{error}; {servo_state}waiting {_AWAY_S:g} s for the lidar to come back")
            self.away += 1
            timed = self._read_again()
            if self.axis is not None:
                self.axis.go()
        self.clock_ns = timed.uncertainty_ns
        if timed.warning and timed.warning != self._warned:
            self._reporter.warn(f"{self.lidar.model}: {timed.warning}")
            self._warned = timed.warning
        return timed.scan

    def _read_again(self) -> TimedScan:
        deadline_s = time.monotonic() + _AWAY_S
        while True:
            self.lidar.reconnect(max(deadline_s - time.monotonic(), 0.0))
            try:
                return self.lidar.read()
            except DeviceError:  # a sensor that just got its power replies before it measures
                if time.monotonic() > deadline_s:
                    raise


def settle_clock(scans: LidarScans, reporter: Reporter) -> None:
    """Read scans until the sensor's clock is known, at most `_CLOCK_PATIENCE_S`."""
    reporter.step("estimating the sensor's clock")
    began_s = time.monotonic()
    while (waited_s := time.monotonic() - began_s) < _CLOCK_LEAST_S or scans.clock_ns > CLOCK_GOOD_NS:
        scans.next()
        if waited_s > _CLOCK_PATIENCE_S:
            uncertainty_ms = scans.clock_ns / 1e6
            reporter.warn(f"timestamp uncertainty: {uncertainty_ms:.1f} ms; is this computer busy?")
            return
