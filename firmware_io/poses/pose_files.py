"""Reading of platform poses (TUM, CSV) and gyro rates (CSV) from files or topics; errors raise RecordingError."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64
from numpy import ndarray
from scipy.spatial.transform import Rotation

from scanwright.design.errors import RecordingError, suggest
from scanwright.firmware_io.foreign import foreign
from scanwright.firmware_io.poses.gyro import Gyro
from scanwright.firmware_io.poses.trajectory import Trajectory, trajectory_of
from scanwright.firmware_io.recording import ros_messages
from scanwright.firmware_io.recording.mcap_chunks import read_messages, read_topics
from scanwright.firmware_io.recording.ros_messages import TRANSFORMS
from scanwright.firmware_io.tables import Row, csv_rows, lines_of, row_of

_COLUMNS = {
    "x": {"x", "tx", "px", "p_x", "pos_x", "position_x", "p_rs_r_x"},
    "y": {"y", "ty", "py", "p_y", "pos_y", "position_y", "p_rs_r_y"},
    "z": {"z", "tz", "pz", "p_z", "pos_z", "position_z", "p_rs_r_z"},
    "qx": {"qx", "q_x", "q_rs_x", "orientation_x"},
    "qy": {"qy", "q_y", "q_rs_y", "orientation_y"},
    "qz": {"qz", "q_z", "q_rs_z", "orientation_z"},
    "qw": {"qw", "q_w", "q_rs_w", "orientation_w"},
}


def load_trajectory(spec: str, recording: Path) -> Trajectory:
    """Read the poses of a file or topic.

    Args:
        spec: a file, `.csv` with a header or TUM (`t x y z qx qy qz qw` in each line, s and m); or
            TOPIC[:PARENT:CHILD] of the recording, with frames if the topic has several (/tf).
        recording: with the topic.
    """
    path = Path(spec)
    if path.is_file():
        rows = list(csv_rows(path, _COLUMNS) if path.suffix == ".csv" else _tum(path))
        return _trajectory(spec, rows)
    topic, *frames = spec.split(":")
    topics = read_topics(recording)
    if topic not in topics:
        known = {name for name, kind in topics.items() if kind in _POSES}
        raise RecordingError(
            f"poses {spec}: neither a file nor a topic of {recording} with poses"
            f"{suggest(topic, known) if known else ', which has none'}"
        )
    if topics[topic] not in _POSES:
        raise RecordingError(f"{recording}: {topic} is {topics[topic]}; poses are {', '.join(sorted(_POSES))}")
    if len(frames) not in (0, 2):
        raise RecordingError(f"poses {spec}: write TOPIC or TOPIC:PARENT:CHILD")
    seen: set[tuple[str, str]] = set()
    by_time = dict(sorted(_topic(recording, topic, topics[topic], tuple(frames), seen)))
    platform = frames[1] if frames else next(iter(seen), ("", ""))[1]
    return _trajectory(f"{recording}: {topic}", list(by_time.items()), platform)


def _trajectory(what: str, rows: list[Row], platform: str = "") -> Trajectory:
    try:
        return trajectory_of([time_ns for time_ns, _ in rows], [row for _, row in rows], platform)
    except RecordingError as error:
        raise RecordingError(f"{what}: {error}") from error


def _tum(path: Path) -> Iterator[Row]:
    for number, line in enumerate(lines_of(path), 1):
        if line.strip() and not line.lstrip().startswith("#"):
            words = line.split()
            if len(words) != 8:
                raise RecordingError(f"{path}:{number}: {len(words)} numbers; a TUM line is t x y z qx qy qz qw")
            yield row_of(path, number, words[0], 9, words[1:])


_TRANSFORM = "geometry_msgs/msg/TransformStamped"
_POSES = {TRANSFORMS, _TRANSFORM, "nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped"}
"""Types of messages with poses."""


def _poses_in(message: Any, kind: str) -> list[tuple[Any, str, Any, Any]]:
    """Return header, child frame ("" if unknown), translation and rotation of each pose in a message."""
    if kind == TRANSFORMS:
        return [pose for transform in message.transforms for pose in _poses_in(transform, _TRANSFORM)]
    child = getattr(message, "child_frame_id", "")
    if kind == _TRANSFORM:
        return [(message.header, child, message.transform.translation, message.transform.rotation)]
    pose = getattr(message.pose, "pose", message.pose)  # an odometry's has a covariance around it
    return [(message.header, child, pose.position, pose.orientation)]


def _topic(
    recording: Path, topic: str, kind: str, frames: tuple[str, ...], seen: set[tuple[str, str]]
) -> Iterator[Row]:
    """Yield the poses of a pair of frames; add all pairs of the topic to `seen`."""
    for _, data in read_messages(recording, {topic}):
        message = foreign(f"{recording}: a message of {topic}", ros_messages.decode_message, data, kind)
        for header, child, p, q in _poses_in(message, kind):
            pair = (header.frame_id.lstrip("/"), child.lstrip("/"))
            seen.add(pair)
            if not frames and len(seen) > 1:
                names = sorted(f"{topic}:{parent}:{child}" for parent, child in seen)
                raise RecordingError(
                    f"{recording}: {topic} holds several frames; name one such as {names[0]}, {names[1]}"
                )
            if frames in ((), pair):
                yield ros_messages.stamp_ns(header.stamp), (p.x, p.y, p.z, q.x, q.y, q.z, q.w)
    if frames and frames not in seen:
        pairs = {f"{parent}:{child}" for parent, child in seen}
        raise RecordingError(f"{recording}: {topic} has no pose {':'.join(frames)}{suggest(':'.join(frames), pairs)}")


STATIC = "/tf_static"
_RATES = {
    f"w{axis}": {f"w{axis}", f"gyro_{axis}", f"w_rs_s_{axis}", f"angular_velocity_{axis}", f"omega_{axis}"}
    for axis in "xyz"
}


def load_gyro(spec: str, recording: Path) -> Gyro:
    """Read the rates of a `.csv` file (time, wx wy wz [rad/s]), or of a `sensor_msgs/Imu` topic of the recording."""
    path = Path(spec)
    if path.is_file():
        return _sorted(spec, list(csv_rows(path, _RATES)), "")
    topics = read_topics(recording)
    if topics.get(spec) != ros_messages.IMU:
        known = {name for name, kind in topics.items() if kind == ros_messages.IMU}
        is_what = (
            f"{topics[spec]}, not {ros_messages.IMU}"
            if spec in topics
            else f"neither a file nor a topic of {recording}"
        )
        raise RecordingError(f"imu {spec}: {is_what}{suggest(spec, known) if known else ', which has no Imu'}")
    rows: list[tuple[int, tuple[float, ...]]] = []
    frames: set[str] = set()
    for _, data in read_messages(recording, {spec}):
        message = foreign(f"{recording}: a message of {spec}", ros_messages.decode_message, data, ros_messages.IMU)
        if message.angular_velocity_covariance[0] == -1:  # REP 145: not measured
            raise RecordingError(f"{recording}: {spec}: this IMU measures no rate of turn")
        rate = message.angular_velocity
        rows.append((ros_messages.stamp_ns(message.header.stamp), (rate.x, rate.y, rate.z)))
        frames.add(message.header.frame_id.lstrip("/"))
    if len(frames) > 1:
        raise RecordingError(f"{recording}: {spec} holds several IMUs: {', '.join(sorted(frames))}")
    return _sorted(f"{recording}: {spec}", rows, next(iter(frames), ""))


def imu_mount(
    rpy_deg: tuple[float, float, float] | None, gyro: Gyro, platform: str, recording: Path
) -> Float64[ndarray, "3 3"]:
    """Return the orientation of an IMU on the platform: `R_platform_imu`.

    `rpy_deg`: roll, pitch and yaw about fixed axes of the platform; None for that of the frames, which /tf_static of
    the recording connects. `platform`: frame of the poses.
    """
    if rpy_deg is not None:
        if not all(map(math.isfinite, rpy_deg)):
            raise RecordingError(f"imu_rpy_deg = {rpy_deg}: must be three finite numbers")
        return Rotation.from_euler("xyz", rpy_deg, degrees=True).as_matrix()
    if gyro.frame and gyro.frame == platform:
        return np.eye(3)
    hint = "pass its orientation on the platform as imu_rpy_deg"
    if not gyro.frame or not platform:
        frame_name = "the IMU's frame" if platform else "the frame that the poses are of"
        raise RecordingError(
            f"imu: {frame_name} has no name, so the orientation of the IMU on the platform is unknown: {hint}"
        )
    R = _path(_static(recording), platform, gyro.frame)
    if R is None:
        raise RecordingError(f"imu: no frames of {STATIC} join '{platform}' (the poses) and '{gyro.frame}': {hint}")
    return R.as_matrix()


def _sorted(what: str, rows: list[tuple[int, Any]], frame: str) -> Gyro:
    time_ns = np.array([when for when, _ in rows], np.int64)
    rate_rad_s = np.array([rate for _, rate in rows], float).reshape(-1, 3)
    finite = np.isfinite(rate_rad_s).all(axis=1)
    one_per_time, first = np.unique(time_ns[finite], return_index=True)
    try:
        return Gyro(one_per_time, rate_rad_s[finite][first], frame, time_ns.size - one_per_time.size)
    except RecordingError as error:
        raise RecordingError(f"{what}: {error}") from error


def _static(recording: Path) -> dict[str, dict[str, Rotation]]:
    """Return parent -> child -> `R_parent_child` of fixed frames, and the inverse."""
    topics: dict[str, dict[str, Rotation]] = {}
    if read_topics(recording).get(STATIC) != ros_messages.TRANSFORMS:
        return topics
    for _, data in read_messages(recording, {STATIC}):
        what = f"{recording}: a message of {STATIC}"
        message = foreign(what, ros_messages.decode_message, data, ros_messages.TRANSFORMS)
        for entry in message.transforms:
            q = entry.transform.rotation
            parent, child = entry.header.frame_id.lstrip("/"), entry.child_frame_id.lstrip("/")
            R = foreign(f"{recording}: {STATIC}: {child}", Rotation.from_quat, [q.x, q.y, q.z, q.w])
            topics.setdefault(parent, {})[child] = R
            topics.setdefault(child, {})[parent] = R.inv()
    return topics


def _path(frames: dict[str, dict[str, Rotation]], begin: str, end: str) -> Rotation | None:
    """Return `R_begin_end` along the frames between; None if they are not connected."""
    reached = {begin: Rotation.identity()}
    waiting = deque([begin])
    while waiting:
        at = waiting.popleft()
        for name, R in frames.get(at, {}).items():
            if name not in reached:
                reached[name] = reached[at] * R
                waiting.append(name)
    return reached.get(end)
