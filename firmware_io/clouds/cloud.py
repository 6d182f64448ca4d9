"""A cloud as all formats see it, and the lines of text that carry what a format has no field for."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float, Float64
from numpy import ndarray
from numpy.typing import NDArray

from design import frames
from design.arrays import Pose

Column = NDArray[Any]

COLUMN_TYPES = {"intensity": "<f4", "time_s": "<f8", "joint_rad": "<f8", "ring": "<u4"} | dict.fromkeys(
    ("red", "green", "blue", "alpha"), "|u1"
)
"""What the columns of our own clouds hold. Others keep the type of their file."""


@dataclass(frozen=True, slots=True, eq=False)
class Cloud:
    """Points as one stand of one scanner saw them; row i of every column belongs to point i.

    Attributes:
        points_m: shape (n, 3), float32 or float64, in the frame of the cloud; NaN where nothing came back.
        columns: further scalars by name, shape (n,) each; ours are `COLUMN_TYPES`.
        shape: rows and columns of an organised cloud, row by row; (1, n) of a flat one.
        T_world_cloud: where the cloud stands, shape (4, 4).
        start_ns: moment of `time_s` = 0 since 1970, where it is known.
    """

    points_m: Float[ndarray, "n 3"]
    columns: Mapping[str, Column] = field(default_factory=dict)
    shape: tuple[int, int] = (1, 0)
    T_world_cloud: Pose = field(default_factory=lambda: np.eye(4))
    start_ns: int | None = None

    def __post_init__(self) -> None:
        n = len(self.points_m)
        if self.points_m.shape != (n, 3) or any(column.shape != (n,) for column in self.columns.values()):
            raise ValueError("points are (n, 3) and columns (n,)")
        if self.shape[0] * self.shape[1] != n:
            object.__setattr__(self, "shape", (1, n))

    @property
    def organised(self) -> bool:
        """Whether rows and columns have a meaning."""
        return self.shape[0] > 1

    @property
    def placed(self) -> bool:
        """Whether the cloud has a pose of its own."""
        return not np.array_equal(self.T_world_cloud, np.eye(4))


def cloud_rows(cloud: Cloud) -> NDArray[np.void]:
    """The cloud as one structured array, little endian: x y z, then its columns."""
    real = "<f4" if cloud.points_m.dtype == np.float32 else "<f8"
    kinds = [(axis, real) for axis in "xyz"]
    kinds += [(name, column.dtype.newbyteorder("<").str) for name, column in cloud.columns.items()]
    rows = np.empty(len(cloud.points_m), kinds)
    for k, axis in enumerate("xyz"):
        rows[axis] = cloud.points_m[:, k]
    for name, column in cloud.columns.items():
        rows[name] = column
    return rows


def cloud_from_rows(rows: NDArray[np.void], lines: Iterable[str]) -> Cloud:
    """The cloud of a structured array with x y z, and of what the lines of its header tell."""
    names = rows.dtype.names or ()
    real = np.float32 if all(rows.dtype[axis].itemsize == 4 for axis in "xyz") else np.float64
    points_m: NDArray[np.floating] = np.stack([rows[axis] for axis in "xyz"], axis=1).astype(real)
    return told(Cloud(points_m, {name: np.array(rows[name]) for name in names if name not in "xyz"}), lines)


def headlines(cloud: Cloud) -> list[str]:
    """Shape, pose and start in words, for the comments of a file."""
    height, width = cloud.shape
    lines = [f"width {width}", f"height {height}"] if cloud.organised else []
    if cloud.placed:
        lines.append("pose " + " ".join(repr(float(value)) for value in pose_numbers(cloud.T_world_cloud)))
    if cloud.start_ns is not None:
        lines.append(f"time_s 0 is {cloud.start_ns} ns")
    return lines


def told(cloud: Cloud, lines: Iterable[str]) -> Cloud:
    """The cloud with what `headlines` wrote."""
    shape, T, start_ns = list(cloud.shape), cloud.T_world_cloud, cloud.start_ns
    for line in lines:
        match line.split():
            case ["width", count] if count.isdigit():
                shape[1] = int(count)
            case ["height", count] if count.isdigit():
                shape[0] = int(count)
            case ["pose", *numbers] if len(numbers) == 7:
                T = pose_matrix([float(number) for number in numbers])
            case ["time_s", "0", "is", count, "ns"] if re.fullmatch(r"-?\d+", count):
                start_ns = int(count)
    return Cloud(cloud.points_m, cloud.columns, (shape[0], shape[1]), T, start_ns)


def pose_numbers(T: Pose) -> Float64[ndarray, " 7"]:
    """Position and quaternion: x y z qx qy qz qw."""
    from scipy.spatial.transform import Rotation

    return np.concatenate([T[:3, 3], Rotation.from_matrix(T[:3, :3]).as_quat(canonical=True)])


def pose_matrix(numbers: Iterable[float]) -> Pose:
    """Inverse of `pose_numbers`; the quaternion may have any length but zero."""
    from scipy.spatial.transform import Rotation

    x, y, z, *quaternion = numbers
    return frames.rigid(Rotation.from_quat(quaternion).as_matrix(), [x, y, z])


def colour_bytes(values: Column) -> Column:
    """Colours as bytes, of whole numbers up to 255 or to 65535."""
    return (values // 257 if values.max(initial=0) > 255 else values).astype(np.uint8)
