"""Reading of platform poses from a file (TUM, CSV) or a topic; unusable input raises RecordingError."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from scanwright.design.errors import RecordingError, suggest
from scanwright.firmware_io.foreign import foreign
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
