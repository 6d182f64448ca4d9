"""Point cloud of any format, and lines of text for properties without a field; errors raise RecordingError."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Float64, Int64
from numpy import ndarray
from numpy.typing import NDArray

from scanwright.design import frames
from scanwright.design.arrays import Pose
from scanwright.design.errors import RecordingError

Column = NDArray[Any]

COLUMN_TYPES = {"intensity": "<f4", "time_s": "<f8", "joint_rad": "<f8", "ring": "<u2"} | dict.fromkeys(
    ("red", "green", "blue", "alpha"), "|u1"
)
"""Types of the columns of assembled clouds. Others keep the type of their file."""
_OTHER_LETTERS = re.compile(r"[^A-Za-z0-9_.-]")
_NORM_ERROR = 1e-2  # of a quaternion printed with three digits
_ORTHONORMAL_ERROR = 1e-3  # of such a matrix
_COLUMN_KINDS = {"f4", "f8", *(f"{kind}{size}" for kind in "iu" for size in (1, 2, 4, 8))}
_EVER_NS = 2**63  # an int64 ends there, in 2262
_FARTHEST_M = 1e9  # maps in the Earth's coordinates lie 6.4e6 m from its centre


@dataclass(frozen=True, slots=True, eq=False)
class Cloud:
    """Points of one scan position; row i of each column belongs to point i. Invalid values raise RecordingError.

    Attributes:
        points_m: float32 or float64, in the frame of the cloud; NaN without a return.
        columns: further scalars by name, shape (n,) each.
        shape: rows and columns of an organised cloud, row by row; (1, n) of a flat one.
        T_world_cloud: pose of the cloud, shape (4, 4).
        start_ns: time of `time_s` = 0 since 1970, if known.
    """

    points_m: Float[ndarray, "n 3"]
    columns: Mapping[str, Column] = field(default_factory=dict)
    shape: tuple[int, int] = (1, 0)
    T_world_cloud: Pose = field(default_factory=lambda: np.eye(4))
    start_ns: int | None = None

    def __post_init__(self) -> None:
        n = len(self.points_m) if self.points_m.ndim else 0
        if self.points_m.shape != (n, 3) or self.points_m.dtype.kind != "f":
            raise RecordingError(f"points of shape {self.points_m.shape}, {self.points_m.dtype}: (n, 3), float")
        far = np.isfinite(self.points_m) & (np.abs(self.points_m) > _FARTHEST_M)
        if far.any():
            row = int(np.argmax(far.any(axis=1)))
            raise RecordingError(f"row {row + 1}: a point at {self.points_m[row]} m: at most {_FARTHEST_M:g} from 0")
        for name, column in self.columns.items():
            if column.shape != (n,) or column.dtype.kind + str(column.dtype.itemsize) not in _COLUMN_KINDS:
                raise RecordingError(
                    f"column {name}: shape {column.shape}, {column.dtype}: {n} whole numbers, float32 or float64"
                )
        if min(self.shape) < 0 or self.shape[0] * self.shape[1] != n:
            object.__setattr__(self, "shape", (1, n))
        check_pose(self.T_world_cloud)
        if self.start_ns is not None and not -_EVER_NS <= self.start_ns < _EVER_NS:
            raise RecordingError(f"time_s 0 is {self.start_ns} ns: below {_EVER_NS}")

    @property
    def organised(self) -> bool:
        """Whether rows and columns have a meaning."""
        return self.shape[0] > 1

    @property
    def valid(self) -> Bool[ndarray, " n"]:
        """Rows that are a point, shape (n,)."""
        return np.isfinite(self.points_m).all(axis=1)

    def flat(self) -> Cloud:
        """Return the cloud without rows and columns, and without rows that are not a point."""
        valid = self.valid
        if valid.all():
            return Cloud(self.points_m, self.columns, (1, len(valid)), self.T_world_cloud, self.start_ns)
        return self.select(np.flatnonzero(valid))

    def select(self, rows: Int64[ndarray, " kept"]) -> Cloud:
        """Return some of the rows as a flat cloud."""
        columns = {name: column[rows] for name, column in self.columns.items()}
        return Cloud(self.points_m[rows], columns, (1, len(rows)), self.T_world_cloud, self.start_ns)

    @property
    def placed(self) -> bool:
        """Whether the cloud has a pose other than the identity."""
        return not np.array_equal(self.T_world_cloud, np.eye(4))


def check_pose(T: Pose) -> None:
    """Raise RecordingError if a matrix is not a pose."""
    if T.shape != (4, 4) or T.dtype.kind != "f" or not np.isfinite(T).all():
        raise RecordingError(f"pose: shape {T.shape}, {T.dtype}: 4 x 4 finite numbers")
    R = T[:3, :3]
    off = float(np.abs(R @ R.T - np.eye(3)).max())
    if off > _ORTHONORMAL_ERROR or np.linalg.det(R) < 0 or not np.array_equal(T[3], [0, 0, 0, 1]):
        raise RecordingError(
            f"pose: its rotation is off orthonormal by {off:.3g} at determinant {np.linalg.det(R):.3g}, its last row "
            f"is {T[3]}: at most {_ORTHONORMAL_ERROR:g}, 1 and [0 0 0 1]"
        )


def as_type(values: Column, kind: np.dtype[Any] | str) -> Column:
    """Convert values to a type that can represent them; only fractions are rounded, and only to floats."""
    kind = np.dtype(kind)
    with np.errstate(all="ignore"):
        converted = values.astype(kind)
        if kind.kind == "f":
            fits = np.isfinite(converted) | ~np.isfinite(values) if values.dtype.kind == "f" else np.isfinite(converted)
        else:
            # compare value and sign, since no integer type can represent all others
            fits = (converted == values) & ((converted < 0) == (values < 0))
    if not fits.all():
        raise RecordingError(f"{values[np.argmin(fits)]} does not fit {kind.name}")
    return converted


def cloud_rows(cloud: Cloud) -> NDArray[np.void]:
    """Return a structured array, little endian: x y z, then the columns, with names for headers."""
    real = "<f4" if cloud.points_m.dtype == np.float32 else "<f8"
    kinds = [(axis, real) for axis in "xyz"]
    names = {name: _OTHER_LETTERS.sub("_", name) for name in cloud.columns}  # LAS and E57 have spaces and colons
    kinds += [(names[name], column.dtype.newbyteorder("<").str) for name, column in cloud.columns.items()]
    rows = np.empty(len(cloud.points_m), kinds)
    for k, axis in enumerate("xyz"):
        rows[axis] = cloud.points_m[:, k]
    for name, column in cloud.columns.items():
        rows[names[name]] = column
    return rows


def cloud_from_rows(rows: NDArray[np.void], lines: Iterable[str]) -> Cloud:
    """Return the cloud of a structured array with x y z, and of the lines of its header."""
    names = rows.dtype.names or ()
    if not {*"xyz"} <= set(names):
        raise RecordingError(f"the columns are {' '.join(names)}; a cloud has x y z")
    real = np.float32 if all(rows.dtype[axis].str[1:] == "f4" for axis in "xyz") else np.float64
    points_m: NDArray[np.floating] = np.stack([rows[axis] for axis in "xyz"], axis=1).astype(real)
    columns = {name: rows[name].astype(rows.dtype[name].newbyteorder("=")) for name in names if name not in "xyz"}
    return with_header(Cloud(points_m, columns), lines)


def headlines(cloud: Cloud) -> list[str]:
    """Format shape, pose and start for the comments of a file."""
    height, width = cloud.shape
    lines = [f"width {width}", f"height {height}"] if cloud.organised else []
    if cloud.placed:
        lines.append("pose " + " ".join(repr(float(value)) for value in pose_numbers(cloud.T_world_cloud)))
    if cloud.start_ns is not None:
        lines.append(f"time_s 0 is {cloud.start_ns} ns")
    return lines


def with_header(cloud: Cloud, lines: Iterable[str]) -> Cloud:
    """Return the cloud with the properties in lines of `headlines`."""
    shape, T, start_ns = list(cloud.shape), cloud.T_world_cloud, cloud.start_ns
    for line in lines:
        match line.split():
            case ["width", count] if count.isdigit():
                shape[1] = int(count)
            case ["height", count] if count.isdigit():
                shape[0] = int(count)
            case ["pose", *numbers] if len(numbers) == 7:
                T = pose_matrix(_numbers(line, numbers))
            case ["time_s", "0", "is", count, "ns"] if re.fullmatch(r"-?\d+", count):
                start_ns = int(count)
    return Cloud(cloud.points_m, cloud.columns, (shape[0], shape[1]), T, start_ns)


def _numbers(line: str, words: Iterable[str]) -> list[float]:
    try:
        return [float(word) for word in words]
    except ValueError as error:
        raise RecordingError(f"'{line}': not numbers") from error


def pose_numbers(T: Pose) -> Float64[ndarray, " 7"]:
    """Return position and quaternion of a pose: x y z qx qy qz qw."""
    from scipy.spatial.transform import Rotation

    return np.concatenate([T[:3, 3], Rotation.from_matrix(T[:3, :3]).as_quat(canonical=True)])


def pose_matrix(numbers: Iterable[float]) -> Pose:
    """Return the pose of `pose_numbers`."""
    from scipy.spatial.transform import Rotation

    x, y, z, *quaternion = numbers
    length = math.hypot(*quaternion)
    if not np.isfinite([x, y, z, length]).all() or abs(length - 1) > _NORM_ERROR:
        raise RecordingError(
            f"pose at ({x:g}, {y:g}, {z:g}) with a quaternion of length {length:.4g}: finite, and of length 1"
        )
    return frames.rigid(Rotation.from_quat(quaternion).as_matrix(), [x, y, z])


def colour_bytes(values: Column) -> Column:
    """Convert integer colours up to 255 or 65535 to bytes."""
    return (values // 257 if values.max(initial=0) > 255 else values).astype(np.uint8)
