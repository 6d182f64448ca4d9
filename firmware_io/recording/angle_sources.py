"""Source of the axis angle in a foreign recording: number in messages, pair of frames in `/tf`, or table; unit checks.

Unusable input raises RecordingError.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial.transform import Rotation

from scanwright.design.arrays import Floats, Times
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.recording import ros_messages
from scanwright.firmware_io.recording.bags import Source, numbers_at
from scanwright.firmware_io.recording.import_checks.headers import AT_M
from scanwright.firmware_io.samples import JointLog
from scanwright.firmware_io.tables import csv_rows

ANGLES = {"angle", "angle_deg", "angle_rad", "position", "position_rad"}
ACROSS_RAD = math.radians(0.5)  # largest tilt of the axis
MOST_ANGLE = 1e9  # years of turns
STILL_RAD = math.radians(1.0)  # smaller rotations determine no axis
WRAP, WRAP_LEAST, WRAP_ERROR = 5.0, 3.0, 0.05  # of a wrap: times the median step, smallest step, relative error
FEWEST_COUNTS = 512  # of an encoder turn; fewer are probably degrees
FASTEST_RPM = 120.0  # the fastest servo of the catalogue turns at 103 rpm without load
SWEEP_RAD = 4 * math.pi  # two turns: cables of a sweeping axis allow less
BACK_RAD = 1.0  # more than the reverse motion of a spinning axis
LEAST_RAD = math.radians(7.0)  # about 2 pi deg: a turn in rad read as deg


@dataclass(frozen=True, slots=True)
class FrameSource:
    """The angle between two frames of a topic of transforms."""

    topic: str
    parent: str
    child: str

    def __str__(self) -> str:
        return f"{self.topic}:{self.parent}:{self.child}"


def is_table(text: str) -> bool:
    """Whether an angle source is a table, `FILE.csv[:COLUMN]`."""
    return Path(text.partition(":")[0]).suffix == ".csv"


def parse_frames(text: str) -> FrameSource | None:
    """Read `TOPIC:PARENT:CHILD`; None for another format."""
    parts = text.split(":")
    return FrameSource(*parts) if len(parts) == 3 and all(parts) else None


def angles_in(body: Any, source: Source | FrameSource, bag: Path) -> list[tuple[tuple[float, ...], int]]:
    """Return values and stamps [ns] (0: none) of a message: a number, or the quaternion x y z w of a pair of frames."""
    if isinstance(source, Source):
        numbers, stamp_ns = numbers_at(body, source, bag)
        return [(numbers, stamp_ns)] if numbers else []
    if getattr(body, "__msgtype__", "") != ros_messages.TRANSFORMS:
        raise RecordingError(f"{bag}: {source}: {source.topic} holds no transforms; write TOPIC or TOPIC:FIELD")
    values: list[tuple[tuple[float, ...], int]] = []
    for entry in body.transforms:
        if (entry.header.frame_id.lstrip("/"), entry.child_frame_id.lstrip("/")) == (source.parent, source.child):
            q = entry.transform.rotation
            values.append(((q.x, q.y, q.z, q.w), ros_messages.stamp_ns(entry.header.stamp)))
    return values


def turned_rad(quaternions: Float[ndarray, "n 4"], source: FrameSource | Source) -> tuple[Floats, str]:
    """Return the rotation of a frame about its axis, shape (n,), and a note for the user.

    Zero is where the frames agree, if they ever do, or the first quaternion. `source`: for errors.
    """
    turned = Rotation.from_quat(quaternions)
    since = (turned[0].inv() * turned).as_quat()
    _, _, axes = np.linalg.svd(since[:, :3], full_matrices=False)
    axis = axes[0] * np.sign(axes[0][np.argmax(np.abs(axes[0]))])
    sine = since[:, :3] @ axis
    angle = 2 * np.arctan2(sine, since[:, 3])
    if np.ptp(np.unwrap(angle)) < STILL_RAD:
        raise RecordingError(f"{source}: the frames do not turn against each other")
    across = 2 * np.arcsin(np.clip(np.linalg.norm(since[:, :3] - sine[:, None] * axis, axis=1), 0, 1))
    if across.max() > ACROSS_RAD:
        raise RecordingError(
            f"{source}: the frames turn about more than one axis, up to {math.degrees(across.max()):.1f} deg across it"
        )
    first = turned[0].as_quat()
    if np.linalg.norm(first[:3] - (first[:3] @ axis) * axis) < math.sin(ACROSS_RAD / 2):
        return angle + 2 * np.arctan2(first[:3] @ axis, first[3]), ""
    named = ", ".join(f"{part:z.3f}" for part in axis)
    return angle, f"{source}: angles count from the first one, about its axis ({named})"


def read_table(text: str) -> tuple[Times, Floats]:
    """Return times [ns] and angles, shape (n,) each, of `FILE.csv[:COLUMN]`, whose first line names its columns."""
    name, _, column = text.partition(":")
    path = Path(name)
    rows = list(csv_rows(path, {"angle": {column.lower()} if column else ANGLES}))
    if not rows:
        raise RecordingError(f"{path}: no line with an angle")
    time_ns, angle = np.array([when for when, _ in rows], np.int64), np.array([value for _, (value,) in rows])
    if not (possible := np.abs(angle) <= MOST_ANGLE).all():
        raise RecordingError(f"{path}: row {np.argmin(possible) + 1}: an angle of at most {MOST_ANGLE:g}")
    return time_ns, angle


def unit_doubts(time_ns: Times, angle: Floats, log: JointLog, angle_unit: str) -> Iterator[tuple[str, str]]:
    """Yield evidence for another unit (wraps, speed, range, integers) and a hint; `log`: `angle` unwrapped."""
    counts = _counts_of_turn(angle)
    if counts and angle_unit in ("deg", "rad"):
        yield f"angles are integers from 0 to nearly {counts}: is the unit {counts}/turn?", _unit(f"{counts}/turn")
        return
    if angle_unit not in ("deg", "rad"):
        return
    other = "deg" if angle_unit == "rad" else "rad"
    for doubt in _unlikely_motion(time_ns, angle, log, angle_unit):
        yield doubt, _unit(other)
    if np.any(angle != np.round(angle)):
        return
    if angle_unit == "rad":
        yield "every angle is a whole number of radians: is the unit deg?", _unit(other)
    else:
        yield (
            "every angle is a whole number of degrees, as a commanded angle is: the rounding alone moves points by up "
            f"to {1000 * AT_M * math.radians(0.5):.0f} mm at {AT_M:g} m, in addition to the delay from command to "
            "motion",
            "publish the measured angle, with its fractions of a degree",
        )


def _unit(name: str) -> str:
    return f"if so, angle_unit = {name}"


def _counts_of_turn(angle: Floats) -> int:
    """Return the counts of an encoder turn if angles are integers from 0 to a power of two; 0 otherwise."""
    if angle.min() < 0 or np.any(angle != np.round(angle)):
        return 0
    counts = 2 ** math.ceil(math.log2(max(float(angle.max()), 1.0)))
    return counts if counts >= FEWEST_COUNTS and angle.max() > (1 - WRAP_ERROR) * counts else 0


def _unlikely_motion(time_ns: Times, angle: Floats, log: JointLog, angle_unit: str) -> Iterator[str]:
    step = np.abs(np.diff(angle[np.argsort(time_ns, kind="stable")]))
    usual = float(np.median(step)) if step.size else 0.0
    wraps = step[step > max(WRAP * usual, WRAP_LEAST)]
    other, turn = ("deg", 360.0) if angle_unit == "rad" else ("rad", 2 * math.pi)
    if wraps.size and abs((float(np.median(wraps)) + usual) / turn - 1) < WRAP_ERROR:
        yield f"angles jump by {np.median(wraps):.4g}, a whole turn in {other}: is the unit {other}?"
        return
    moved_rad, seconds = np.abs(np.diff(log.position_rad)), np.diff(log.time_ns) / 1e9
    span_rad, back_rad = float(np.ptp(log.position_rad)), _return_rad(log.position_rad)
    fastest_rpm = float(np.median(moved_rad / seconds)) / (2 * math.pi) * 60 if seconds.size else 0.0
    if angle_unit == "rad" and fastest_rpm > FASTEST_RPM:
        yield f"the axis turns at {fastest_rpm:.0f} rpm, faster than any servo: is the unit deg?"
    elif angle_unit == "rad" and span_rad > SWEEP_RAD and back_rad > BACK_RAD:
        yield f"the axis goes to and fro over {span_rad / (2 * math.pi):.1f} turns: is the unit deg?"
    elif angle_unit == "deg" and 0 < span_rad < LEAST_RAD:
        yield f"the axis moves over {math.degrees(span_rad):.2g} deg only: is the unit rad?"


def _return_rad(position_rad: Floats) -> float:
    """Return the largest motion against the overall direction of the axis; 0 if empty."""
    if not position_rad.size:
        return 0.0
    onward = position_rad if position_rad[-1] >= position_rad[0] else -position_rad
    return float(np.max(np.maximum.accumulate(onward) - onward))
