"""The angle set: the one record that joins optimiser, parts and acquisition.

Files carry degrees and millimetres; the methods return radians and metres. The chain of
frames (`docs/conventions.md`, Frames):

    T_world_laser(gamma) = T_world_rot(gamma) @ T_rot_laser
    T_world_rot(gamma)   = [Rx(alpha_rot) Ry(beta_rot) Rz(gamma + gamma_rot) | t_world_rot]
    T_rot_laser          = [exp(delta) Rz(gamma_laser) Ry(beta_laser) Rx(alpha_laser) | t_rot_laser]

where gamma is the joint position. `delta` and `t_rot_laser` are zero by design; a calibration can observe their
x and y. Rotation about the axis and translation along it are gauges.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from numpy.typing import ArrayLike
from pydantic import Field, ValidationError

from scanwright.design import frames
from scanwright.design.arrays import Pose, Rotation, Vector
from scanwright.design.errors import MissingFileError, TaskError
from scanwright.design.files.faults import format_validation_error
from scanwright.design.files.record import Record
from scanwright.design.files.text_files import read_text_of
from scanwright.design.motion import Motion

STANDARD_DEG = {"rolling": (0.0, 90.0, 0.0, -90.0), "pitching": (-90.0, 0.0, 90.0, 0.0)}
"""(alpha_rot, beta_rot, alpha_laser, beta_laser) of the standard alignments: R_world_laser is Rx or Ry(gamma)."""


def angles_words(angles_deg: Iterable[float]) -> str:
    """Return angles as they are shown to people, `(0, 90, 0, -90)`."""
    return "(" + ", ".join(f"{angle:g}" for angle in angles_deg) + ")"


Degrees = Annotated[float, Field(ge=-360, le=360)]
Millimetres = Annotated[float, Field(ge=-1e6, le=1e6)]


CALIBRATED: Final = "angles.calibrated.json"
"""The calibrated angle set of a build folder, next to its `angles.json`."""


class Angles(Record):
    """The six angles of the paper in degrees; the two gammas are 0 by design."""

    alpha_rot: Degrees
    beta_rot: Degrees
    gamma_rot: Degrees = 0.0
    alpha_laser: Degrees
    beta_laser: Degrees
    gamma_laser: Degrees = 0.0


class AngleSet(Record):
    """One scanner's angles, as designed or as calibrated. `angles.json` is this record."""

    schema_id: Literal["scanwright/angles/1"] = Field(default="scanwright/angles/1", alias="schema")
    task: str
    task_sha256: str | None = None
    source: Literal["design", "calibration"] = "design"
    angles_deg: Angles
    delta_rotvec_rot_deg: tuple[Degrees, Degrees] = (0.0, 0.0)
    t_rot_laser_mm: tuple[Millimetres, Millimetres, Millimetres] = (0.0, 0.0, 0.0)
    t_world_rot_mm: tuple[Millimetres, Millimetres, Millimetres] = (0.0, 0.0, 0.0)
    sensor: str
    servo: str
    slip_ring: str | None = None
    motion: Motion | None = None
    J: float | None = None
    J_error: float | None = None
    covariance: tuple[tuple[float, float, float, float], ...] | None = Field(default=None, min_length=4, max_length=4)
    versions: dict[str, str] = Field(default_factory=dict)

    def R_rot_laser(self) -> Rotation:
        """Orientation of the laser in the rotation frame, calibration included, shape (3, 3)."""
        a = self.angles_deg
        designed = frames.R_rot_laser(*np.radians([a.alpha_laser, a.beta_laser, a.gamma_laser]))
        return frames.rotvec_to_matrix(np.radians([*self.delta_rotvec_rot_deg, 0.0])) @ designed

    def T_rot_laser(self) -> Pose:
        """Pose of the laser in the rotation frame [m], shape (4, 4)."""
        return frames.rigid(self.R_rot_laser(), np.array(self.t_rot_laser_mm) / 1000)

    def T_world_rot(self, joint_rad: ArrayLike) -> Float[ndarray, "*k 4 4"]:
        """Pose of the turning rotation frame in the world [m] at joint positions [rad], shape (..., 4, 4)."""
        a = self.angles_deg
        gamma = np.asarray(joint_rad, dtype=float) + np.radians(a.gamma_rot)
        R = frames.R_world_rot(np.radians(a.alpha_rot), np.radians(a.beta_rot), gamma)
        return frames.rigid(R, np.array(self.t_world_rot_mm) / 1000)

    def T_world_laser(self, joint_rad: ArrayLike) -> Float[ndarray, "*k 4 4"]:
        """Pose of the laser in the world [m] at joint positions [rad], shape (..., 4, 4)."""
        return self.T_world_rot(joint_rad) @ self.T_rot_laser()

    def axis_world(self) -> Vector:
        """Unit vector of the rotation axis in the world, shape (3,)."""
        return self.T_world_rot(0.0)[:3, 2]

    def to_json(self) -> str:
        """The text of `angles.json`: keys in the order of the record, one trailing line feed."""
        return json.dumps(self.model_dump(by_alias=True), indent=2) + "\n"


def load_angles(path: str | Path) -> AngleSet:
    """Read `angles.json`: text and booleans are not accepted as numbers, and the key `schema` is required.

    Raises:
        MissingFileError: there is no such file.
        TaskError: the file cannot be read, is not JSON, or is not an angle set.

    Example:
        >>> import scanwright as sw
        >>> sw.load_angles("angles.json").source
        'design'
    """
    path = Path(path)
    if path.is_dir():
        within = path / "angles.json"
        advice = f": name {within}" if within.is_file() else " without an angles.json, not an angle set"
        raise TaskError(f"{path}: this is a folder{advice}")
    if path.suffix == ".toml":
        remedy = f"use the angles.json of its build folder (`scanwright build {path}`)"
        if not path.exists():
            raise MissingFileError(f"{path}: no such file; if it is a task, {remedy}")
        raise TaskError(f"{path}: this is a task: {remedy}")
    try:
        angles = AngleSet.model_validate_json(read_text_of(path, "the angle set"), strict=True)
    except ValidationError as error:
        raise TaskError(format_validation_error(error, path, AngleSet)) from error
    if "schema_id" not in angles.model_fields_set:
        raise TaskError(f'{path}: schema: this key is required: "scanwright/angles/1"')
    return angles


@dataclass(frozen=True, slots=True)
class AnglesInUse:
    """The angle set that the scanner of a build folder runs with."""

    path: Path  # its file
    angles: AngleSet  # its contents
    description: str  # which one it is, and why


def angles_in_use(folder: Path) -> AnglesInUse:
    """Return `angles.calibrated.json` of a build folder if it is of the folder's own mount, else `angles.json`.

    Raises:
        TaskError: there is no angle set, or one of the two files is not an angle set.
    """
    path, calibrated = folder / "angles.json", folder / CALIBRATED
    designed = load_angles(path)
    if not calibrated.is_file():
        return AnglesInUse(path, designed, f"frames as designed, {path}")
    angles = load_angles(calibrated)
    mounts = [(one.angles_deg, one.t_world_rot_mm, one.sensor) for one in (designed, angles)]
    if mounts[0] != mounts[1]:
        return AnglesInUse(path, designed, f"frames as designed: {calibrated} is of another mount than {path.name}")
    return AnglesInUse(calibrated, angles, f"frames as calibrated, {calibrated}")
