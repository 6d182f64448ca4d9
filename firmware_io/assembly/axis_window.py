"""Axis angle of a stream: the newest samples of the servo, and the curve through them.

The curve is that of `axis_curve`, fitted to a few seconds. The end of a spline is less accurate than its middle, so a
beam waits for samples after it: the look-ahead, which limits the distance of knots. If the axis turns so uniformly that
a knot every second would suffice, the curve averages fewer samples and is noisier than that of an entire recording.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from typing import Any

import numpy as np

from scanwright.firmware_io.assembly.axis_curve import smooth
from scanwright.firmware_io.samples import AxisCurve, JointLog, straight

HISTORY_NS = 4_000_000_000  # duration of the fitted samples: a dozen knots for cross-validation
_MOST_SAMPLES = 20_000  # 5 kHz for that time
_AT_LEAST = 0.75  # smallest part of the look-ahead after a beam; the rest is the validity of a curve
_CHOOSE_NS = 1_000_000_000  # between two choices of the distance of knots
_NO_CURVE = AxisCurve(np.array([-(2**62), -(2**62) + 1]), np.zeros((1, 4)))  # before all times


class NewestValues:
    """The newest values of a stream, in the order of their times."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._time_ns: list[int] = []
        self._values: list[Any] = []

    @property
    def last_ns(self) -> int:
        """Time of the newest value; before all times if there is none."""
        return self._time_ns[-1] if self._time_ns else -(2**62)

    def add(self, time_ns: int, value: Any) -> None:
        """Add a value, which must be later than the last one."""
        self._time_ns.append(time_ns)
        self._values.append(value)

    def forget(self, before_ns: int) -> None:
        """Drop the values before a time, except for the last of them."""
        first = max(bisect_right(self._time_ns, before_ns) - 1, len(self._time_ns) - self._most)
        if first > 0:
            del self._time_ns[:first], self._values[:first]

    def around(self, first_ns: int, last_ns: int) -> tuple[list[int], list[Any]]:
        """Return times and values from the last one before a time to the first one after another."""
        near = slice(max(bisect_left(self._time_ns, first_ns) - 1, 0), bisect_right(self._time_ns, last_ns) + 1)
        return self._time_ns[near], self._values[near]


class AxisWindow(NewestValues):
    """The newest angles of one joint."""

    def __init__(self, look_ahead_s: float) -> None:
        """`look_ahead_s`: 0 for linear interpolation."""
        super().__init__(_MOST_SAMPLES)
        self._look_ahead_s = look_ahead_s
        self._curve: AxisCurve | None = None
        self._error_rad = math.nan
        self._serves_until_ns = self._fitted_ns = self._chosen_ns = -(2**62)
        self._per_knot: float | None = None

    def curve(self, first_ns: int, last_ns: int) -> tuple[AxisCurve, float]:
        """Return the angle between two times, and its rms error [rad], NaN for linear interpolation.

        The angle is NaN without samples; the error is valid for times followed by the look-ahead.
        """
        if not self._time_ns:
            return _NO_CURVE, math.nan
        if self._look_ahead_s and last_ns > self._serves_until_ns and self.last_ns > self._fitted_ns:
            self._fit()
        if self._curve is not None:
            return self._curve, self._error_rad
        time_ns, position_rad = self.around(first_ns, last_ns)
        if not time_ns:
            return _NO_CURVE, math.nan
        return straight(JointLog(np.array(time_ns), np.array(position_rad))), math.nan

    def _fit(self) -> None:
        behind_s = _AT_LEAST * self._look_ahead_s
        log = JointLog(np.array(self._time_ns), np.array(self._values))
        if self.last_ns - self._chosen_ns > _CHOOSE_NS:
            self._per_knot = None
        fitted = smooth(log, longest_knot_s=behind_s, per_knot=self._per_knot)
        if self._per_knot is None:
            self._chosen_ns = self.last_ns
        self._fitted_ns = self.last_ns
        self._serves_until_ns = self.last_ns - round(behind_s * 1e9)
        if isinstance(fitted, str):
            self._curve, self._error_rad, self._per_knot = None, math.nan, None
        else:
            self._curve, self._error_rad, self._per_knot = fitted.curve, fitted.error_rad, fitted.per_knot
