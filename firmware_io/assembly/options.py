"""Options of `assemble`, for the command, the Python interface and the assembly."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from scanwright.design.errors import RecordingError
from scanwright.firmware_io.echo import Echo

if TYPE_CHECKING:
    from scanwright.design.task.task import LoadedTask

Per = Literal["recording", "turn", "half"]
COLUMNS = ("intensity", "time_s", "joint_rad", "ring")  # columns of a cloud in addition to x y z


@dataclass(frozen=True, slots=True)
class AssembleOptions:
    """Options of an assembly.

    Attributes:
        organised: keep one row per beam; NaN if there is no point.
        lag_s: delay of the joint angles.
        per: one cloud per recording, turn or half turn; each direction of a sweep is a turn.
        poses: platform poses: TUM or CSV file, or TOPIC[:PARENT:CHILD] of the recording.
        imu: gyro between poses: CSV file (wx wy wz), or topic of sensor_msgs/Imu.
        imu_rpy_deg: roll, pitch, yaw of the IMU on the platform; else from /tf_static.
        smooth: smooth the encoder steps of the joint angles; else interpolate linearly.
        columns: those of `COLUMNS` that are written; time_s counts from the first beam, ring is the index of the beam.
        camera: colour points with the images of this task's [camera].
        min_range_m: drop shorter beams.
        max_range_m: drop longer beams.
        echo: of each ray of a multi-echo scan: first, last, strongest or all that the recording has.
        edges_deg: drop mixed pixels whose neighbours lie within this grazing angle; 8 is usual.
        outliers: drop isolated points beyond this many standard deviations; 2 is usual.
        voxel_m: keep one point per voxel of this edge.
        normals: add normals nx ny nz that face the scanner.

    Raises:
        RecordingError: a number is out of bounds.
    """

    organised: bool = False
    lag_s: float = 0.0
    per: Per = "recording"
    poses: str | None = None
    imu: str | None = None
    imu_rpy_deg: tuple[float, float, float] | None = None
    smooth: bool = True
    columns: tuple[str, ...] = COLUMNS
    camera: LoadedTask | Path | str | None = None
    min_range_m: float = 0.0
    max_range_m: float = math.inf
    echo: Echo = "all"
    edges_deg: float | None = None
    outliers: float | None = None
    voxel_m: float | None = None
    normals: bool = False

    def __post_init__(self) -> None:
        low, high = self.min_range_m, self.max_range_m
        if not 0 <= low < high:
            raise RecordingError(f"min_range_m = {low}, max_range_m = {high}: allowed 0 <= minimum < maximum")
        if self.edges_deg is not None and not 0 < self.edges_deg < 45:
            raise RecordingError(f"edges_deg = {self.edges_deg}: must be above 0 and below 45; 8 is usual")
        for name in ("outliers", "voxel_m"):
            if (value := getattr(self, name)) is not None and not 0 < value < math.inf:
                raise RecordingError(f"{name} = {value}: must be above 0 and finite")

    @property
    def thins(self) -> bool:
        """Whether points can be dropped after the assembly."""
        return self.outliers is not None or self.voxel_m is not None


DEFAULT = AssembleOptions()
