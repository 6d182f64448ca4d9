"""`scanwright calibrate`: recordings of static scenes and an angle set become the calibrated angle set."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scanwright.design.angles import AngleSet
from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import atomic_write, check_place
from scanwright.design.progress import Progress, no_progress
from scanwright.firmware_io.assembly.assemble import about_sensor
from scanwright.firmware_io.assembly.own_body import OwnBody
from scanwright.firmware_io.calibration.entropy import witness
from scanwright.firmware_io.calibration.estimate import Estimate, estimate
from scanwright.firmware_io.calibration.model import Mount, gather, start_vector
from scanwright.firmware_io.calibration.report import calibration_report, lines
from scanwright.firmware_io.calibration.tiles import fan_side
from scanwright.firmware_io.recording.recording import open_recording


@dataclass(frozen=True, slots=True)
class Calibration:
    """Result of a calibration.

    Attributes:
        angles: calibrated.
        record: content of the report file.
        out: file of the angle set, written if the result is not `faulty`.
        frames: effect on a robot's frames, one sentence each.
    """

    angles: AngleSet
    record: dict[str, Any]
    out: Path
    frames: tuple[str, ...] = ()

    @property
    def faulty(self) -> bool:
        """Whether the platform moved, or the cloud became worse."""
        return bool(self.record["faults"])

    def lines(self, in_full: bool = False) -> list[str]:
        """Format the result; the commands that publish the frames only `in_full`."""
        if self.faulty:
            wrote = [f"did not write {self.out}, as the result is wrong; wrote {report_path(self.out)}"]
        else:
            wrote = [f"wrote {self.out} and {report_path(self.out).name}"]
        frames = self.frames if in_full else [line for line in self.frames if not line.startswith((" ", "as "))]
        return [*lines(self.record), *wrote, *frames]


def calibrate_recordings(
    recordings: Sequence[Path],
    angles: AngleSet,
    out: Path,
    *,
    one_place: bool = False,
    own_body: OwnBody | None = None,
    progress: Progress = no_progress,
) -> Calibration:
    """Write the calibrated angle set to `out`, unless the result is faulty, and the record to `report_path(out)`.

    The arguments are those of `scanwright.calibrate`; the search starts at the delta and lever arm of `angles`.

    Raises:
        RecordingError: a recording is unreadable, or they do not show the mounting errors; nothing is written.
    """
    check_place(out, RecordingError)
    if out.suffix != ".json":
        raise RecordingError(f"{out}: an angle set is JSON; name it {out.with_suffix('.json').name}")
    for k, recording in enumerate(recordings):
        if recording.resolve() in [other.resolve() for other in recordings[:k]]:
            raise RecordingError(f"{recording}: given twice; the same beams would count as independent")
    progress("reading recordings")
    gamma_rot_rad = math.radians(angles.angles_deg.gamma_rot)
    opened = [open_recording(path) for path in recordings]
    beams, left_out = gather(opened, one_place=one_place, own_body=own_body, gamma_rot_rad=gamma_rot_rad)
    mount, start = Mount.of(angles), start_vector(angles)
    remarks = sorted({line for each in opened for line in about_sensor(each, angles.sensor)})
    sensor = [line.removeprefix("warning: ") for line in remarks if line.startswith("warning: ")]
    progress(f"calibrating from {beams.range_m.size:,} beams (the first run compiles the numerics)")
    try:
        result = estimate(beams, mount, start)
    except RecordingError as error:
        named = ", ".join(str(path) for path in recordings)
        raise RecordingError(f"{named}: {'. '.join([str(error), *sensor])}") from error
    progress("comparing with the entropy of the cloud")
    seen = witness(mount, beams, fan_side(beams, mount), start, result.x, result.noise_m)
    record = {
        "recordings": [path.name for path in recordings],
        "left_out": left_out,
        **calibration_report(result, start, mount, beams, seen),
    }
    record["notes"] += sensor
    calibration = Calibration(calibrated(angles, result), record, out)
    with atomic_write(report_path(out), RecordingError) as part:
        part.write_text(json.dumps(record, indent=2, allow_nan=False) + "\n", encoding="utf-8")
        if not calibration.faulty:
            with atomic_write(out, RecordingError) as angles_part:
                angles_part.write_text(calibration.angles.to_json(), encoding="utf-8")
    return calibration


def report_path(out: Path) -> Path:
    """Return the path of the report of an angle set: angles.calibrated.report.json of angles.calibrated.json."""
    return out.with_suffix(".report.json")


def calibrated(angles: AngleSet, result: Estimate) -> AngleSet:
    """Return the angle set with the estimated mounting errors and their covariance (rad and m)."""
    x = result.x
    offset_mm = np.round(x[2:4] * 1e3, 5)
    return angles.model_copy(
        update={
            "source": "calibration",
            "delta_rotvec_rot_deg": tuple(np.round(np.degrees(x[0:2]), 7).tolist()),
            "t_rot_laser_mm": (*offset_mm.tolist(), angles.t_rot_laser_mm[2]),
            "covariance": tuple(tuple(row) for row in result.covariance[:4, :4].tolist()),
        }
    )
