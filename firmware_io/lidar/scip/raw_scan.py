"""Scan of a SCIP lidar before its conversion to host time."""

from __future__ import annotations

from dataclasses import dataclass

from jaxtyping import Float32
from numpy import ndarray

from scanwright.firmware_io.lidar.scip.parameters import Parameters
from scanwright.firmware_io.samples import Scan


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RawScan:
    """One scan as received."""

    stamp_ms: int  # sensor time, unwrapped
    restarts: int  # of the sensor's clock since the lidar was opened; stamps across a restart do not compare
    arrival_ns: int  # time.monotonic_ns() of the last byte
    first_step: int  # step of the first value
    cluster: int  # steps per value
    range_m: Float32[ndarray, " n"]  # shape (n,), NaN without a return
    intensity: Float32[ndarray, " m"]  # shape (n,), or (0,) if not measured


def to_laser_scan(raw: RawScan, of: Parameters, stamp_ns: int) -> Scan:
    """Convert a raw scan whose first step has the time `stamp_ns`."""
    middle = (raw.cluster - 1) / 2
    return Scan(
        stamp_ns=stamp_ns + round(middle * of.step_s * 1e9),
        angle_min_rad=(raw.first_step + middle - of.front_step) * of.step_rad,
        angle_increment_rad=raw.cluster * of.step_rad,
        time_increment_s=raw.cluster * of.step_s,
        scan_time_s=of.scan_period_s,
        range_min_m=of.range_min_mm / 1e3,
        range_max_m=of.range_max_mm / 1e3,
        range_m=raw.range_m,
        intensity=raw.intensity,
    )
