"""Motion of the servo during one full scan: spin, sweep back and forth, or stop and go.

A task contains one of these records, the angle set repeats it, and the program that drives the servo uses it.
Joint angles are those of `spin_joint`, 0 where the index marks meet.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, Strict, model_validator

from scanwright.design.arrays import Array
from scanwright.design.files.record import Record

SHORTEST_S, LONGEST_S = 1e-3, 600.0  # of a turn, far outside of what servos do
NARROWEST_SWEEP_DEG = 0.1  # about one step of a servo's encoder


class Spin(Record):
    """Continuous rotation at constant speed."""

    mode: Literal["spin"] = Field(default="spin", description="turn continuously")
    period_s: float = Field(strict=True, ge=SHORTEST_S, le=LONGEST_S, description="time of one full turn of the servo")

    @property
    def duration_s(self) -> float:
        """Time of one full scan."""
        return self.period_s


class Shortest(Record):
    """Spin as fast as the limits of the task allow, `period_s = "shortest"` in its file."""

    mode: Literal["shortest"] = Field(default="shortest", description="spin, as fast as the limits allow")
    longest_s: float = Field(
        default=60.0, strict=True, ge=SHORTEST_S, le=LONGEST_S, description="longest period of the search"
    )

    @property
    def duration_s(self) -> float:
        """Longest time of one full scan."""
        return self.longest_s


class Sweep(Record):
    """Motion from one limit to the other and back: accelerate, cruise, brake, equally in both directions."""

    mode: Literal["sweep"] = Field(default="sweep", description="back and forth between two angles")
    limits_deg: tuple[Annotated[float, Strict()], Annotated[float, Strict()]] = Field(
        description="its two ends; 0 is where the index marks meet"
    )
    period_s: float = Field(strict=True, ge=SHORTEST_S, le=LONGEST_S, description="time out and back")
    profile: Literal["trapezoid"] = Field(default="trapezoid", description="accelerate, cruise, brake")
    accel_deg_s2: float = Field(default=720.0, strict=True, gt=0, description="of acceleration and braking")

    @model_validator(mode="after")
    def _can_be_done(self) -> Sweep:
        lower, upper = self.limits_deg
        if not lower < upper:
            raise ValueError(f"limits_deg = {[lower, upper]}: the first must be below the second")
        if not -180 <= lower < upper <= 180:
            raise ValueError(f"limits_deg = {[lower, upper]}: must be within -180 .. 180")
        if upper - lower < NARROWEST_SWEEP_DEG:
            raise ValueError(f"limits_deg = {[lower, upper]}: a sweep is {NARROWEST_SWEEP_DEG:g} deg wide at least")
        least = 2 * np.sqrt((upper - lower) / self.accel_deg_s2)
        if self.period_s / 2 < least * (1 - 1e-12):
            raise ValueError(
                f"period_s = {self.period_s:g}: {upper - lower:g} deg out and back at accel_deg_s2 = "
                f"{self.accel_deg_s2:g} take {2 * least:.3g} s at least"
            )
        return self

    @property
    def duration_s(self) -> float:
        """Time of one full scan."""
        return self.period_s

    @property
    def cruise_deg_s(self) -> float:
        """Speed between acceleration and braking: `v (T / 2 - v / a) = range`."""
        half, a = self.period_s / 2, self.accel_deg_s2
        span = self.limits_deg[1] - self.limits_deg[0]
        # the smaller root, written so that a short range in a long time does not cancel
        return float(2 * span / (half + np.sqrt(max(half * half - 4 * span / a, 0.0))))

    @property
    def ramp_s(self) -> float:
        """Time of acceleration, and of braking."""
        return self.cruise_deg_s / self.accel_deg_s2

    def angle_rad(self, time_s: ArrayLike) -> Array:
        """Return the joint angle [rad] at times since the start at the lower limit; it repeats after `period_s`."""
        half = self.period_s / 2
        phase = np.mod(np.asarray(time_s, dtype=float), self.period_s)
        t = np.where(phase <= half, phase, self.period_s - phase)
        v, a, ramp = self.cruise_deg_s, self.accel_deg_s2, self.ramp_s
        lower, upper = self.limits_deg
        cruising = lower + v * (t - ramp / 2)
        degrees = np.where(t < ramp, lower + a * t * t / 2, cruising)
        return np.asarray(np.radians(np.where(t > half - ramp, upper - a * (half - t) ** 2 / 2, degrees)))

    def time_s(self, angle_rad: ArrayLike) -> Array:
        """Return the time [s] at which the first half of the sweep passes joint angles, clipped to the limits."""
        half = self.period_s / 2
        v, a, ramp = self.cruise_deg_s, self.accel_deg_s2, self.ramp_s
        lower, upper = self.limits_deg
        degrees = np.clip(np.degrees(np.asarray(angle_rad, dtype=float)), lower, upper)
        done, left = degrees - lower, upper - degrees
        slow = a * ramp * ramp / 2
        cruising = ramp / 2 + done / v if v > 0 else np.full_like(degrees, half / 2)
        times = np.where(done < slow, np.sqrt(2 * done / a), cruising)
        return np.where(left < slow, half - np.sqrt(2 * left / a), times)


class StopAndGo(Record):
    """Stop at evenly spaced angles of a full turn to measure: no de-skew needed."""

    mode: Literal["stop_and_go"] = Field(default="stop_and_go", description="stop while the lidar measures")
    stops: int = Field(strict=True, ge=1, le=100_000, description="in one full turn")
    dwell_s: float = Field(strict=True, ge=SHORTEST_S, le=LONGEST_S, description="time of measuring at each stop")
    move_s: float = Field(
        default=0.2, strict=True, ge=SHORTEST_S, le=LONGEST_S, description="from one stop to the next"
    )

    @property
    def duration_s(self) -> float:
        """Time of one full scan."""
        return self.stops * (self.dwell_s + self.move_s)


Motion = Annotated[Spin | Sweep | StopAndGo, Field(discriminator="mode")]
