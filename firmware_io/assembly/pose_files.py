"""Platform poses from a file (TUM, CSV) or from a topic of the recording."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterator, Sequence
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Any

from design.errors import RecordingError, suggest
from firmware_io.assembly.trajectory import Trajectory, trajectory_of
from firmware_io.foreign import foreign
from firmware_io.recording import ros_messages
from firmware_io.recording.mcap_chunks import read_messages, read_topics

_Row = tuple[int, Sequence[float]]  # time [ns]; x y z qx qy qz qw
_UNITS = re.compile(r"\s*\[.*?\]\s*$")
_COLUMNS = {
    "x": {"x", "tx", "px", "p_x", "pos_x", "position_x", "p_rs_r_x"},
    "y": {"y", "ty", "py", "p_y", "pos_y", "position_y", "p_rs_r_y"},
    "z": {"z", "tz", "pz", "p_z", "pos_z", "position_z", "p_rs_r_z"},
    "qx": {"qx", "q_x", "q_rs_x", "orientation_x"},
    "qy": {"qy", "q_y", "q_rs_y", "orientation_y"},
    "qz": {"qz", "q_z", "q_rs_z", "orientation_z"},
    "qw": {"qw", "q_w", "q_rs_w", "orientation_w"},
}
_EVER_NS = 2**63
_TIME_DIGITS = 20  # a decimal may have a million more, and an int of it as many
_SECONDS = {"t", "time", "time_s", "timestamp", "timestamp_s", "stamp"}
_NANOSECONDS = {"time_ns", "timestamp_ns", "stamp_ns"}


def load_trajectory(spec: str, recording: Path) -> Trajectory:
    """Read the poses that `spec` names.

    Args:
        spec: a file, `.csv` with a header or else TUM (`t x y z qx qy qz qw` in each line, s and m); or
            TOPIC[:PARENT:CHILD] of the recording, the frames where the topic has several (/tf).
        recording: where topics are.

    Raises:
        RecordingError: there is no such file or topic, or it does not hold poses.
    """
    path = Path(spec)
    if path.is_file():
        rows = list(_csv(path) if path.suffix == ".csv" else _tum(path))
        return _trajectory(spec, rows)
    topic, *frames = spec.split(":")
    found = read_topics(recording)
    if topic not in found:
        known = {name for name, kind in found.items() if kind in _POSES}
        raise RecordingError(
            f"poses {spec}: neither a file nor a topic of {recording} with poses"
            f"{suggest(topic, known) if known else ', which has none'}"
        )
    if found[topic] not in _POSES:
        raise RecordingError(f"{recording}: {topic} is {found[topic]}; poses are {', '.join(sorted(_POSES))}")
    if len(frames) not in (0, 2):
        raise RecordingError(f"poses {spec}: write TOPIC or TOPIC:PARENT:CHILD")
    by_time = dict(sorted(_topic(recording, topic, found[topic], tuple(frames))))
    return _trajectory(f"{recording}: {topic}", list(by_time.items()))


def _trajectory(what: str, rows: list[_Row]) -> Trajectory:
    try:
        return trajectory_of([time_ns for time_ns, _ in rows], [row for _, row in rows])
    except RecordingError as error:
        raise RecordingError(f"{what}: {error}") from error


def _tum(path: Path) -> Iterator[_Row]:
    for number, line in enumerate(_lines(path), 1):
        if line.strip() and not line.lstrip().startswith("#"):
            words = line.split()
            if len(words) != 8:
                raise RecordingError(f"{path}:{number}: {len(words)} numbers; a TUM line is t x y z qx qy qz qw")
            yield _row(path, number, words[0], 9, words[1:])


def _csv(path: Path) -> Iterator[_Row]:
    lines = csv.reader(_lines(path))
    header = [word.strip().lstrip("#").strip().lower() for word in next(lines, [])]
    names = [_UNITS.sub("", word) for word in header]
    columns = [_column(path, names, name, known) for name, known in _COLUMNS.items()]
    when = _column(path, names, "time", _SECONDS | _NANOSECONDS)
    places = 0 if names[when] in _NANOSECONDS or "[ns]" in header[when] else 9
    for number, words in enumerate(lines, 2):
        if words:
            if len(words) < len(names):
                raise RecordingError(f"{path}:{number}: {len(words)} values, the header names {len(names)}")
            yield _row(path, number, words[when], places, [words[column] for column in columns])


def _column(path: Path, names: list[str], name: str, known: set[str]) -> int:
    found = [column for column, heading in enumerate(names) if heading in known]
    if len(found) != 1:
        raise RecordingError(
            f"{path}: {len(found)} columns for {name}: the first line names one of {', '.join(sorted(known))}"
        )
    return found[0]


def _row(path: Path, number: int, time: str, places: int, values: list[str]) -> _Row:
    try:
        # a float64 rounds the seconds of today to 256 ns
        when = Decimal(time)
        if not when.is_finite():
            raise ValueError
        if when.adjusted() > _TIME_DIGITS or abs(when.scaleb(places)) >= _EVER_NS:
            raise RecordingError(f"{path}:{number}: time {time[:40]}: a number of nanoseconds below 2^63")
        return int(when.scaleb(places).to_integral_value()), [float(value) for value in values]
    except (InvalidOperation, ValueError, OverflowError) as error:
        raise RecordingError(f"{path}:{number}: not a line of numbers: {time}, {', '.join(values)}") from error


def _lines(path: Path) -> list[str]:
    return foreign(f"{path}: cannot read the poses", path.read_text, encoding="utf-8").splitlines()


def _of_tf(message: Any) -> Iterator[tuple[Any, str, Any, Any]]:
    for one in message.transforms:
        yield from _of_transform(one)


def _of_transform(message: Any) -> Iterator[tuple[Any, str, Any, Any]]:
    yield message.header, message.child_frame_id, message.transform.translation, message.transform.rotation


def _of_odometry(message: Any) -> Iterator[tuple[Any, str, Any, Any]]:
    pose = message.pose.pose
    yield message.header, message.child_frame_id, pose.position, pose.orientation


def _of_pose(message: Any) -> Iterator[tuple[Any, str, Any, Any]]:
    yield message.header, "", message.pose.position, message.pose.orientation


_POSES: dict[str, Callable[[Any], Iterator[tuple[Any, str, Any, Any]]]] = {
    "tf2_msgs/msg/TFMessage": _of_tf,
    "geometry_msgs/msg/TransformStamped": _of_transform,
    "nav_msgs/msg/Odometry": _of_odometry,
    "geometry_msgs/msg/PoseStamped": _of_pose,
}
"""Message type -> header, child frame, translation and rotation of each pose in a message."""


def _topic(recording: Path, topic: str, kind: str, frames: tuple[str, ...]) -> Iterator[_Row]:
    seen: set[tuple[str, str]] = set()
    for _, data in read_messages(recording, {topic}):
        message = foreign(f"{recording}: a message of {topic}", ros_messages.decode_message, data, kind)
        for header, child, p, q in _POSES[kind](message):
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
