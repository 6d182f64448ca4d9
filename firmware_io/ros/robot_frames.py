"""Frames of a calibrated scanner for robots: URDF, static transforms, and a description of the changes.

A calibration changes one frame, `laser` in `rot`; `servo` in `world` is added, so that a robot without the URDF has the
complete chain:


    world --servo_mount, fixed--> servo --spin_joint, about z--> rot --laser_mount, fixed--> laser
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from scanwright.design import frames
from scanwright.design.angles import AngleSet
from scanwright.design.arrays import Array, Pose
from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import atomic_write
from scanwright.design.files.text_files import read_text
from scanwright.firmware_io.foreign import foreign

URDF = "scanner.urdf"
_RANGE_M = 10.0  # at which the effect of a calibration is stated


@dataclass(frozen=True, slots=True, eq=False)
class FixedFrame:
    """A frame that is fixed in its parent."""

    joint: str  # name in the URDF
    parent: str
    child: str
    T_parent_child: Pose  # shape (4, 4), m

    @property
    def xyz(self) -> str:
        """Position [m] for URDF and launch files."""
        return _row(self.T_parent_child[:3, 3])

    @property
    def rpy(self) -> str:
        """Roll, pitch and yaw [rad] for URDF and launch files."""
        return _row(frames.roll_pitch_yaw(self.T_parent_child[:3, :3]))

    def command(self) -> str:
        """Return the command of ROS 2 that publishes it."""
        names = ("x", "y", "z", "roll", "pitch", "yaw")
        values = " ".join(f"--{name} {x}" for name, x in zip(names, f"{self.xyz} {self.rpy}".split(), strict=True))
        ends = f"--frame-id {self.parent} --child-frame-id {self.child}"
        return f"ros2 run tf2_ros static_transform_publisher {values} {ends}"

    def launch_parameters(self) -> str:
        """Format the frame as parameters of a launch file."""
        return f"{self.joint}_xyz:='{self.xyz}' {self.joint}_rpy:='{self.rpy}'"


def fixed_frames(angles: AngleSet) -> tuple[FixedFrame, FixedFrame]:
    """Return the frames of servo and laser of a scanner."""
    return (
        FixedFrame("servo_mount", "world", "servo", angles.T_world_rot(0.0)),
        FixedFrame("laser_mount", "rot", "laser", angles.T_rot_laser()),
    )


def what_changed(before: AngleSet, after: AngleSet) -> list[str]:
    """Describe the changes of the frames by a calibration."""
    from scipy.spatial.transform import Rotation

    T_before, T_after = before.T_rot_laser(), after.T_rot_laser()
    leans_rad = Rotation.from_matrix(T_after[:3, :3] @ T_before[:3, :3].T).as_rotvec()
    shift_m = T_after[:3, 3] - T_before[:3, 3]
    angle_rad, moved_m = float(np.linalg.norm(leans_rad)), float(np.linalg.norm(shift_m))
    sd = None if after.covariance is None else np.sqrt(np.diag(after.covariance))
    lean_sd = "" if sd is None else f" (sigma {math.degrees(math.hypot(*sd[:2])):.2g})"
    shift_sd = "" if sd is None else f" (sigma {1e3 * math.hypot(*sd[2:]):.2g})"
    lean_deg, shift_mm = np.degrees(leans_rad[:2]), 1e3 * shift_m[:2]
    most_mm = 1e3 * (2 * _RANGE_M * math.sin(angle_rad / 2) + moved_m)
    return [
        f"lidar tilt: {math.degrees(angle_rad):.3f} deg{lean_sd} from the {before.source}: "
        f"{lean_deg[0]:+.3f} about x, {lean_deg[1]:+.3f} about y of the rotation frame",
        f"optical centre: {1e3 * moved_m:.2f} mm{shift_sd} from the {before.source}: "
        f"{shift_mm[0]:+.2f} along x, {shift_mm[1]:+.2f} along y of the rotation frame",
        f"effect at {_RANGE_M:g} m: up to {most_mm:.1f} mm",
    ]


def with_frames(urdf: str, angles: AngleSet, what: str) -> ElementTree.Element:
    """Parse the URDF of a build and replace its frames with those of an angle set.

    Raises:
        RecordingError: it is not a URDF, or not of a build; `what` names it.
    """
    builder = ElementTree.TreeBuilder(insert_comments=True)
    try:
        robot = ElementTree.fromstring(urdf, ElementTree.XMLParser(target=builder))
    except ElementTree.ParseError as error:
        raise RecordingError(f"{what}: no URDF: {error}") from error
    for frame in fixed_frames(angles):
        origin = robot.find(f"joint[@name='{frame.joint}']/origin")
        if origin is None:
            raise RecordingError(f"{what}: no joint '{frame.joint}' with an origin: is this the URDF of a build?")
        origin.set("xyz", frame.xyz)
        origin.set("rpy", frame.rpy)
    return robot


def write_calibrated_urdf(designed: Path, out: Path, angles: AngleSet) -> None:
    """Write the URDF of a build with calibrated frames and adapted paths of meshes; raises as `with_frames`."""
    robot = with_frames(read_urdf(designed), angles, str(designed))
    for mesh in robot.iter("mesh"):
        name = mesh.get("filename", "")
        if "://" not in name and not Path(name).is_absolute():
            mesh.set("filename", Path(os.path.relpath(designed.parent / name, out.parent)).as_posix())
    text = ElementTree.tostring(robot, encoding="unicode", xml_declaration=False)
    with atomic_write(out, RecordingError) as part:
        part.write_text(f'<?xml version="1.0"?>\n{text}\n', encoding="utf-8")


def description(folder: Path, angles: AngleSet) -> str | None:
    """Return the URDF of a build folder with the frames of an angle set and URIs of meshes; None without a URDF."""
    path = folder / URDF
    if not path.is_file():
        return None
    robot = with_frames(read_urdf(path), angles, str(path))
    for mesh in robot.iter("mesh"):
        name = mesh.get("filename", "")
        if "://" not in name:
            mesh.set("filename", (path.parent / name).resolve().as_uri())
    return ElementTree.tostring(robot, encoding="unicode")


def read_urdf(path: Path) -> str:
    """Return the text of a URDF; RecordingError if it cannot be read."""
    return foreign(f"{path}: cannot read", read_text, path)


def calibrated_urdf_place(out: Path) -> Path:
    """Return the path of the URDF of an angle set: scanner.calibrated.urdf of angles.calibrated.json."""
    return out.with_name(out.stem.replace("angles", "scanner", 1) + ".urdf")


def _row(values: Array | tuple[float, ...]) -> str:
    return " ".join(f"{round(float(value), 12) + 0.0:.12g}" for value in values)
