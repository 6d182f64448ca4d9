"""Records of the `--json` output of `scan` and `repair`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from scanwright.cli.results.of_commands import Devices
from scanwright.firmware_io.assembly.assemble import AssembleSummary
from scanwright.firmware_io.recording.repair.survey import RepairSummary
from scanwright.firmware_io.scan.scan_end import ScanSummary


@dataclass(frozen=True, slots=True)
class ScanResult:
    """A scan, or its plan.

    Attributes:
        devices: lidar and servo.
        angles: file of the angle set.
        duration_s: time of the recording.
        recording: what was recorded; null with `--dry-run`.
        cloud: the point cloud; null with `--dry-run`.
    """

    devices: Devices
    angles: Path
    duration_s: float
    recording: ScanSummary | None = None
    cloud: AssembleSummary | None = None


@dataclass(slots=True)
class Repaired(RepairSummary):
    """A repaired recording.

    Attributes:
        out: the new file; not written if the recording is intact.
    """

    out: Path = Path()
