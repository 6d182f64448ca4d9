"""Corrections of other people's recordings: chosen by a person, offered by the checks, applied by the import."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from scanwright.design.arrays import Floats
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.samples import Scan

Echo = Literal["first", "last", "strongest"]
_COUNTS = re.compile(r"(\d{1,12}(?:\.\d+)?)/turn")


def radians_per(angle_unit: str) -> float:
    """Return the radians of one unit of an angle: `deg`, `rad`, or counts such as `4096/turn`.

    Raises:
        RecordingError: it is no such unit.
    """
    if angle_unit in ("deg", "rad"):
        return math.pi / 180 if angle_unit == "deg" else 1.0
    counts = _COUNTS.fullmatch(angle_unit)
    if counts is None or not float(counts[1]):
        raise RecordingError(f"angle_unit '{angle_unit}': write deg or rad, or counts such as 4096/turn")
    return 2 * math.pi / float(counts[1])


@dataclass(frozen=True, slots=True)
class Corrections:
    """What the import changes in a recording.

    Attributes:
        angle_scale: turns of the axis for one turn of the angle: negative for the other sense, 0.75 behind a gear.
        angle_zero: angle at joint position 0, in the unit of the angle.
        time_increment: seconds from beam to beam; "auto" computes it from the step and the time of a mirror turn; None
            keeps the one of the header.
        stamp: moment of a scan that its stamp means: its first beam, its last beam, or nothing ("receipt": times of
            receipt are used for scans and angles).
        bearings: "limits" spreads the beams from angle_min to angle_max; "increment" keeps the step of the header.
        scan_offset_s: added to the times of the scans, for a clock that is slow.
        no_return_from_m: ranges from this one on are no returns; None keeps all ranges.
        echo: which echo of a MultiEchoLaserScan becomes the range.
        drop_outliers: drop angles that do not lie between their neighbours.

    Raises:
        RecordingError: a number is out of bounds.
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

    def joint_rad(self, angle: Floats, unit_rad: float) -> Floats:
        """Return joint positions of angles in the order of their times, turns counted, shape (n,).

        Args:
            angle: in its unit.
            unit_rad: radians of that unit.
        """
        return self.angle_scale * np.unwrap((angle - self.angle_zero) * unit_rad)

    def scan(self, scan: Scan, time_increment_s: float | None, limits_rad: tuple[float, float]) -> Scan:
        """Return a scan with the corrections of its header and ranges.

        Args:
            scan: as received.
            time_increment_s: to use; None for that of the scan.
            limits_rad: angle_min and angle_max of its header.
        """
        if time_increment_s is not None:
            scan = replace(scan, time_increment_s=time_increment_s)
        if self.bearings == "limits" and scan.range_m.size > 1:
            scan = replace(scan, angle_increment_rad=(limits_rad[1] - limits_rad[0]) / (scan.range_m.size - 1))
        if self.no_return_from_m is not None:
            far = scan.range_m >= np.float32(self.no_return_from_m)
            scan = replace(scan, range_m=np.where(far, np.float32(np.inf), scan.range_m))
        return scan
