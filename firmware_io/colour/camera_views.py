"""Images of a camera, with poses."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from scanwright.design.angles import AngleSet
from scanwright.design.arrays import Pose
from scanwright.design.camera import Camera
from scanwright.design.errors import RecordingError
from scanwright.design.files.text_files import read_text
from scanwright.firmware_io.assembly.axis_curve import axis_curve
from scanwright.firmware_io.foreign import foreign
from scanwright.firmware_io.poses.trajectory import Trajectory
from scanwright.firmware_io.recording.recording import Recording
from scanwright.firmware_io.samples import AxisCurve, straight


@dataclass(frozen=True, slots=True, eq=False)
class CameraView:
    """One image and the pose of its camera."""

    file: Path  # of the image
    T_cloud_camera: Pose  # shape (4, 4)


def load_views(
    camera: Camera,
    folder: Path,
    angles: AngleSet,
    recording: Recording,
    poses: Trajectory | None = None,
    lag_s: float = 0.0,
) -> list[CameraView]:
    """Return the images of a camera with their poses; those on a moving platform require `poses`.

    `camera.images`, relative to `folder`, is an image, or a CSV file with the columns file and time_ns (since 1970, on
    the clock of the recording) or joint_deg, required for a moving camera. `lag_s`: delay of the joint log's stamps.

    Raises:
        RecordingError: an image does not exist, or its pose is unknown.
    """
    listed = folder / camera.images
    shots = list(_listed(listed)) if listed.suffix.lower() == ".csv" else [_Shot(listed)]
    if not shots:
        raise RecordingError(f"{listed}: no image in it")
    curve = straight(recording.joint_log) if recording.at_rest else axis_curve(recording.joint_log, at_rest=False)[0]
    views = []
    for shot in shots:
        with opened(shot.file, camera):  # report a faulty image early
            pass
        T_cloud_world = np.eye(4)
        if poses is not None:
            if shot.time_ns is None:
                raise RecordingError(f"{listed}: {shot.file.name}: on a moving platform every image needs a time_ns")
            T_cloud_world = poses.T_map_world(np.array([shot.time_ns]))[0]
        T = T_cloud_world @ _T_world_frame(camera, angles, shot, curve, lag_s) @ camera.T_frame_camera()
        if not np.isfinite(T).all():
            raise RecordingError(f"{listed}: {shot.file.name}: its time_ns lies outside of the recording")
        views.append(CameraView(shot.file, T))
    return views


@dataclass(frozen=True, slots=True)
class _Shot:
    file: Path
    time_ns: int | None = None
    joint_rad: float | None = None


def _listed(path: Path) -> Iterator[_Shot]:
    table = csv.DictReader(foreign(f"{path}: cannot read", read_text, path).splitlines(), skipinitialspace=True)
    try:
        names = table.fieldnames or []
        if "file" not in names or not {"time_ns", "joint_deg"} & set(names):
            available = ", ".join(names) or "nothing"
            raise RecordingError(f"{path}: columns {available}: one is `file`, another `time_ns` or `joint_deg`")
        for number, row in enumerate(table, 2):
            time_ns = int(row["time_ns"]) if "time_ns" in names else None
            joint_rad = float(np.radians(float(row["joint_deg"]))) if "joint_deg" in names else None
            if not row["file"]:
                raise RecordingError(f"{path}:{number}: no file named")
            yield _Shot(path.parent / row["file"], time_ns, joint_rad)
    except RecordingError:
        raise
    except (ValueError, TypeError) as error:
        raise RecordingError(f"{path}: not a number: {error}; time_ns is whole nanoseconds since 1970") from error


def _T_world_frame(camera: Camera, angles: AngleSet, shot: _Shot, curve: AxisCurve, lag_s: float) -> Pose:
    if camera.frame == "world":
        return np.eye(4)
    joint_rad = shot.joint_rad
    if joint_rad is None:
        if shot.time_ns is None:
            raise RecordingError(
                f"{shot.file}: camera.frame = '{camera.frame}' turns: list the images in a CSV file, each with its "
                "time_ns or joint_deg"
            )
        joint_rad = float(curve.angle_at(np.array([shot.time_ns + round(lag_s * 1e9)], np.int64))[0])
    return angles.T_world_rot(joint_rad) if camera.frame == "rot" else angles.T_world_laser(joint_rad)


@contextmanager
def opened(path: Path, camera: Camera) -> Iterator[Image.Image]:
    """Open an image and check its size; its pixels are read later."""
    try:
        with Image.open(path) as image:
            if image.size != camera.size_px:
                width, height = image.size
                raise RecordingError(
                    f"{path}: {width} x {height} pixels, camera.size_px = {list(camera.size_px)}: a calibration fits "
                    "one size"
                )
            yield image
    except RecordingError:
        raise
    except (OSError, ValueError) as error:  # pillow's own are OSErrors
        raise RecordingError(f"{path}: cannot read the image: {getattr(error, 'strerror', None) or error}") from error
