"""Files of the poses of clouds: TUM lines (`time x y z qx qy qz qw`, s and m), and a table of their covariances.

Unusable input raises RecordingError.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float64
from numpy import ndarray

from scanwright.design.arrays import Pose
from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import atomic_write
from scanwright.design.files.text_files import read_text
from scanwright.firmware_io.clouds.cloud import Cloud, pose_matrix, pose_numbers
from scanwright.firmware_io.foreign import foreign, of_file

_AXES = ("rx", "ry", "rz", "x", "y", "z")


def write_poses(path: Path, names: Sequence[str], clouds: Sequence[Cloud], T_world: Float64[ndarray, "n 4 4"]) -> None:
    """Write one line for each cloud, in order; its time is the cloud's start, or its number if that is unknown."""
    lines = ["# time x y z qx qy qz qw"]
    for number, (name, cloud, T) in enumerate(zip(names, clouds, T_world, strict=True)):
        time = str(number) if cloud.start_ns is None else f"{cloud.start_ns // 10**9}.{cloud.start_ns % 10**9:09d}"
        lines += [f"# {name}", f"{time} " + " ".join(f"{value:.9f}" for value in pose_numbers(T))]
    with atomic_write(path, RecordingError) as part:
        part.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_covariances(path: Path, names: Sequence[str], covariance: Float64[ndarray, "n 6 6"]) -> None:
    """Write the upper triangle for each cloud, for a small motion (rotation vector w [rad], translation v [m]).

    It is in the frame of the cloud, on the right of its pose: T + (w, v) = (R exp(w), t + R v).
    """
    upper = [(i, j) for i in range(6) for j in range(i, 6)]
    lines = [",".join(["cloud", *(f"{_AXES[i]}_{_AXES[j]}" for i, j in upper)])]
    for name, matrix in zip(names, covariance, strict=True):
        lines.append(",".join([name, *(f"{matrix[i, j]:.6e}" for i, j in upper)]))
    with atomic_write(path, RecordingError) as part:
        part.write_text("\n".join(lines) + "\n", encoding="utf-8")


def cloud_names(clouds: Sequence[tuple[Path, int]]) -> list[str]:
    """Return unique names of clouds from their files and the number of clouds in each."""
    names = []
    for path, count in clouds:
        names += [path.stem] if count == 1 else [f"{path.stem}_{k}" for k in range(1, count + 1)]
    if len(set(names)) < len(names):
        return [f"{number}_{name}" for number, name in enumerate(names, 1)]
    return names


def read_poses(path: Path, names: Sequence[str]) -> list[Pose]:
    """Read one TUM line for each cloud: by the names in the comments above the lines, else in the clouds' order."""
    text = foreign(f"{path}: cannot read", read_text, path)
    lines, notes = [], []
    above = ""
    for line in map(str.strip, text.splitlines()):
        if line and not line.startswith("#"):
            lines.append(line)
            notes.append(above)
        above = line[1:].strip() if line.startswith("#") and "qw" not in line.split() else ""
    if len(lines) != len(names):
        raise RecordingError(f"{path}: {len(lines)} poses for {len(names)} clouds; one line for each, in their order")
    rows = foreign(f"{path}: a line is time x y z qx qy qz qw", np.loadtxt, lines, ndmin=2)
    if rows.shape != (len(names), 8) or not np.isfinite(rows).all():
        raise RecordingError(f"{path}: a line is time x y z qx qy qz qw, all numbers")
    if all(notes):
        if sorted(notes) != sorted(names):
            raise RecordingError(
                f"{path}: its comments name {', '.join(notes)}, the clouds are {', '.join(names)}: "
                "leave the comments out if the order is the same"
            )
        rows = rows[[notes.index(name) for name in names]]
    with of_file(path):
        return [pose_matrix(row[1:]) for row in rows]
