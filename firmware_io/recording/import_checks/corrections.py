"""Corrections of an imported bag; invalid values raise RecordingError."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Literal

from scanwright.design.errors import RecordingError
from scanwright.firmware_io.echo import Echo

_COUNTS = re.compile(r"(\d{1,12}(?:\.\d+)?)/turn")


def radians_per(angle_unit: str) -> float:
    """Return the radians of one unit of an angle: `deg`, `rad`, or counts such as `4096/turn`."""
    if angle_unit in ("deg", "rad"):
        return math.pi / 180 if angle_unit == "deg" else 1.0
    counts = _COUNTS.fullmatch(angle_unit)
    if counts is None or not float(counts[1]):
        raise RecordingError(f"angle_unit '{angle_unit}': write deg or rad, or counts such as 4096/turn")
    return 2 * math.pi / float(counts[1])


def read_time_increment(text: str) -> float | Literal["auto"]:
    """Read a time increment: seconds, or `auto`."""
    try:
        return "auto" if text == "auto" else float(text)
    except ValueError as error:
        raise RecordingError(f"time_increment = '{text}': write seconds, or auto") from error


@dataclass(frozen=True, slots=True)
class Corrections:
    """Corrections applied by the import.

    Attributes:
        angle_scale: turns of the axis per turn of the angle; negative reverses, 0.75 is a gear.
        angle_zero: angle at joint position 0, in its unit; subtracted before scaling.
        time_increment: seconds between two beams; "auto" is the step's part of a mirror turn.
        stamp: beam of the stamp of a scan; receipt uses no stamps.
        bearings: limits spreads the beams from angle_min to angle_max.
        scan_offset_s: added to the times of the scans.
        no_return_from_m: ranges from this one on are no returns.
        echo: ranges of a MultiEchoLaserScan: first, last, strongest or all.
        drop_outliers: drop angles far off both neighbours.
    """

    angle_scale: float = 1.0
    angle_zero: float = 0.0
    time_increment: float | Literal["auto"] | None = None
    stamp: Literal["first", "last", "receipt"] = "first"
    bearings: Literal["increment", "limits"] = "increment"
    scan_offset_s: float = 0.0
    no_return_from_m: float | None = None
    echo: Echo = "first"
    drop_outliers: bool = False

    def __post_init__(self) -> None:
        if not (math.isfinite(self.angle_scale) and self.angle_scale):
            raise RecordingError(f"angle_scale = {self.angle_scale}: must be finite and not 0")
        for name in ("angle_zero", "scan_offset_s"):
            if not math.isfinite(value := getattr(self, name)):
                raise RecordingError(f"{name} = {value}: must be finite")
        if isinstance(self.time_increment, float | int) and not 0 <= self.time_increment < 1:
            raise RecordingError(f"time_increment = {self.time_increment}: allowed 0 to 1 s")
        if self.no_return_from_m is not None and not 0 < self.no_return_from_m < math.inf:
            raise RecordingError(f"no_return_from_m = {self.no_return_from_m}: must be above 0 and finite")
