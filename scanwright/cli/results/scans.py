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
    """A scan, or its plan."""

    devices: Devices  # lidar and servo
    angles: Path  # file of the angle set
    duration_s: float  # time of the recording
    recording: ScanSummary | None = None  # what was recorded; null with `--dry-run`
    cloud: AssembleSummary | None = None  # the point cloud; null with `--dry-run`


@dataclass(slots=True)
class Repaired(RepairSummary):
    """A repaired recording."""

    out: Path = Path()  # the new file; not written if the recording is intact
