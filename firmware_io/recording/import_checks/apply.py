"""Apply corrections to scans."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scanwright.firmware_io.recording.import_checks.corrections import Corrections
from scanwright.firmware_io.samples import Scan


def corrected_scan(
    scan: Scan, corrections: Corrections, time_increment_s: float | None, limits_rad: tuple[float, float]
) -> Scan:
    """Return a scan with its header corrected.

    `time_increment_s` None leaves that of the scan; `limits_rad` are angle_min and angle_max of its header.
    """
    if time_increment_s is not None:
        scan = replace(scan, time_increment_s=time_increment_s)
    if corrections.bearings == "limits" and scan.range_m.size > 1:
        scan = replace(scan, angle_increment_rad=(limits_rad[1] - limits_rad[0]) / (scan.range_m.size - 1))
    return scan


def without_far(scan: Scan, corrections: Corrections) -> Scan:
    """Return a scan without the ranges that mean no return."""
    if corrections.no_return_from_m is None:
        return scan
    far = scan.range_m >= np.float32(corrections.no_return_from_m)
    return replace(scan, range_m=np.where(far, np.float32(np.inf), scan.range_m))
