"""Foreign bags: ROS 1, ROS 2 sqlite3 and ROS 2 MCAP, custom message types included.

A value inside a bag is `TOPIC[:FIELD]`, FIELD a dotted path such as `laserScan` or `position[0]`. sqlite3 bags of older
ROS 2 releases lack message definitions: only types that come with ROS 2 can be read.
Unusable input raises RecordingError.
"""

from __future__ import annotations

import dataclasses
import json
import math
import re
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from scanwright.design.errors import RecordingError, suggest
from scanwright.firmware_io.foreign import foreign, foreign_items
from scanwright.firmware_io.recording import ros_messages
from scanwright.firmware_io.recording.mcap_chunks import profile_of, read_note, unchunked_messages

NOTE_TOPIC = "/scanwright/note"  # latched text, JSON
_STEP = re.compile(r"(\w+)(?:\[(\d+)\])?")
_SEQUENCES = (list, tuple, np.ndarray)
_SUFFIXES = (".bag", ".mcap", ".db3")
_NUMBERS = ("a float", "a int", ros_messages.QUATERNION)
_MOST_USES = 3  # of a topic
_COPIED = {ros_messages.IMU: "--imu", "nav_msgs/msg/Odometry": "--poses", "geometry_msgs/msg/PoseStamped": "--poses"}


@dataclass(frozen=True, slots=True)
class Source:
    """Topic of a value in a bag, and its path inside the message ("": the message itself)."""

    topic: str
    field: str

    def __str__(self) -> str:
        return f"{self.topic}:{self.field}" if self.field else self.topic


@dataclass(frozen=True, slots=True, eq=False)
class Message:
    """One decoded message."""

    topic: str
    receive_ns: int  # log time
    body: Any


def parse_source(text: str) -> Source:
    """Read `TOPIC[:FIELD]`."""
    topic, _, field = text.partition(":")
    if not topic:
        raise RecordingError(f"'{text}': write TOPIC or TOPIC:FIELD, for example /slice:laserScan")
    if field and not all(_STEP.fullmatch(step) for step in field.split(".")):
        raise RecordingError(f"'{text}': '{field}' is not a path of fields such as state.position[0]")
    return Source(topic, field)


class Bag:
    """An open bag; made by `open_bag`."""

    def __init__(self, path: Path, reader: AnyReader) -> None:
        self.path = path
        self._reader = reader

    @property
    def topics(self) -> Mapping[str, str]:
        """Message type of each topic."""
        return {connection.topic: connection.msgtype for connection in self._reader.connections}

    def note(self) -> dict[str, str]:
        """Return the note of a recording, or of a bag exported from one; empty for others."""
        if self.path.suffix == ".mcap" and self.path.is_file() and (note := read_note(self.path)):
            return note
        what = f"{self.path}: {NOTE_TOPIC}: not the note of a recording"
        for message in self.messages({NOTE_TOPIC}) if self.topics.get(NOTE_TOPIC) == ros_messages.TEXT else ():
            note = foreign(what, json.loads, message.body.data)
            if not isinstance(note, dict):
                raise RecordingError(f"{what}: {message.body.data[:40]}")
            return note
        return {}

    def check(self, topics: set[str]) -> None:
        """Raise RecordingError if the bag lacks one of these topics or its type."""
        missing = [f"no topic '{name}'{suggest(name, self.topics)}" for name in sorted(topics - self.topics.keys())]
        if missing:
            raise RecordingError(f"{self.path}: {'; '.join(missing)}")
        for topic in sorted(topics):
            if self.topics[topic] not in self._reader.typestore.types:
                raise RecordingError(
                    f"{self.path}: {topic}: the bag does not hold the definition of {self.topics[topic]}, and ROS 2 "
                    "does not come with it; record it again as MCAP, which holds definitions"
                )

    def lines(self) -> list[str]:
        """Return a line for each topic: type, count, rate and the options that can use it."""
        rows = []
        for topic, kind in sorted(self.topics.items()):
            count = sum(each.msgcount for each in self._reader.connections if each.topic == topic)
            rate_hz = 1e9 * count / max(self._reader.duration, 1)
            uses = list[str]()
            with suppress(RecordingError):  # a type that cannot be decoded has no use
                uses = _uses(topic, next(self.messages({topic})).body) if count else []
            rows.append((topic, kind, f"{count:,}", f"{rate_hz:.1f} Hz", " or ".join(uses)))
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)][:4]
        return ["  ".join([*map(str.ljust, row, widths), row[4]]).rstrip() for row in rows]

    def messages(self, topics: set[str]) -> Iterator[Message]:
        """Yield the decoded messages of these topics in the order of recording."""
        self.check(topics)
        connections = [connection for connection in self._reader.connections if connection.topic in topics]
        raw_messages: Iterable[tuple[Any, int, bytes]] = self._reader.messages(connections=connections)
        if self.path.suffix == ".mcap" and (unchunked := unchunked_messages(self.path, topics)) is not None:
            by_topic = {connection.topic: connection for connection in connections}
            raw_messages = [(by_topic[topic], log_ns, data) for log_ns, topic, data in unchunked]
        for connection, receive_ns, raw in foreign_items(f"{self.path}: damaged bag", raw_messages):
            what = f"{self.path}: {connection.topic}: a message that is not a {connection.msgtype}"
            body = foreign(what, self._reader.deserialize, raw, connection.msgtype)
            yield Message(connection.topic, receive_ns, body)


@contextmanager
def open_bag(path: Path, *more: Path) -> Iterator[Bag]:
    """Open a `.bag`, `.mcap` or `.db3` file, a folder with one, or the parts of a split bag."""
    paths = [_bag_file(part) for part in (path, *more)]
    reader = foreign(_unreadable(path), AnyReader, paths, default_typestore=get_typestore(Stores.ROS2_JAZZY))
    foreign(_unreadable(path), reader.open)
    try:
        yield Bag(path, reader)
    finally:
        reader.close()


def topic_lines(paths: Sequence[Path]) -> list[str]:
    """Return the topics of a bag with type, count, rate and the options that can use them; raises as `open_bag`."""
    with open_bag(*paths) as bag:
        return bag.lines() or ["no topic"]


def _uses(topic: str, body: Any) -> list[str]:
    """Return options of `import` for a topic with such messages."""
    kind, uses = _kind(body), list[str]()
    if kind in (ros_messages.LASER_SCAN, ros_messages.MULTI_ECHO):
        return [f"--scan {topic}"]
    if kind == ros_messages.JOINT_STATE:
        return [f"--angle {topic}:{name}" for name in body.name[:_MOST_USES]]
    if kind == ros_messages.TRANSFORMS:
        frames = dict.fromkeys((each.header.frame_id, each.child_frame_id) for each in body.transforms)
        return [f"--angle {topic}:{parent}:{child}" for parent, child in list(frames)[:_MOST_USES]]
    if kind in _COPIED:
        return [f"--also {topic}, for assemble {_COPIED[kind]} {topic}"]
    for name in _fields(body):
        value = getattr(body, name)
        if _kind(value) in (ros_messages.LASER_SCAN, ros_messages.MULTI_ECHO):
            uses.append(f"--scan {topic}:{name}")
        elif _kind(value) in _NUMBERS or (isinstance(value, np.ndarray) and 0 < value.size <= _MOST_USES):
            item = "[0]" if isinstance(value, np.ndarray) else ""
            uses.append(f"--angle {topic}" if name == "data" and not item else f"--angle {topic}:{name}{item}")
    return uses


def _bag_file(path: Path) -> Path:
    """Return the path for the reader; RecordingError if it is not a bag."""
    if not path.exists():
        raise RecordingError(
            f"{path}: no such bag: a ROS 1 bag is a file .bag, a ROS 2 bag a file or a folder with metadata.yaml"
        )
    if path.is_dir() and not (path / "metadata.yaml").is_file():
        inside = sorted(part for part in path.iterdir() if part.suffix in _SUFFIXES)
        if len(inside) != 1:
            names = f"name one of {', '.join(part.name for part in inside)}" if inside else "no bag in it either"
            raise RecordingError(f"{path}: a ROS 2 bag folder has a metadata.yaml, this one has none: {names}")
        return _bag_file(inside[0])
    if path.is_file() and path.suffix not in _SUFFIXES:
        raise RecordingError(f"{path}: not a bag: '{path.suffix}' is none of {', '.join(_SUFFIXES)}")
    if path.is_file() and path.stat().st_size == 0:
        raise RecordingError(f"{path}: the file is empty")
    if path.suffix == ".bag":
        with foreign(_unreadable(path), path.open, "rb") as stream:
            if stream.read(7) != b"#ROSBAG":
                raise RecordingError(f"{path}: not a ROS 1 bag: it does not begin with #ROSBAG")
    for database in sorted(path.glob("*.db3")) if path.is_dir() else [path] * (path.suffix == ".db3"):
        if fault := foreign(_unreadable(path), _database_fault, database):
            raise RecordingError(f"{path}: damaged bag: {fault}")
    if path.suffix == ".mcap" and profile_of(path) == "ros1":
        raise RecordingError(f"{path}: holds ROS 1 messages: name the .bag that it was converted from")
    return path


def _database_fault(path: Path) -> str:
    """Return the fault of a database, or "": SQLite from 3.46 on reads the rest of a cut one without an error."""
    with closing(sqlite3.connect(f"{path.resolve().as_uri()}?immutable=1", uri=True)) as database:
        (verdict,) = database.execute("PRAGMA quick_check(1)").fetchone()
    return "" if verdict == "ok" else " ".join(verdict.split())


def _unreadable(path: Path) -> str:
    hints = {
        ".bag": " (`rosbag reindex` restores a bag that was cut off)",
        ".mcap": " (`scanwright repair` saves the intact part of a bag that was cut off)",
    }
    return f"{path}: unreadable bag{hints.get(path.suffix, '')}"


def value_at(body: Any, source: Source, bag: Path) -> tuple[Any, int]:
    """Return the value at `source` in a message, and the stamp [ns] of the nearest header around it (0: none)."""
    value, stamp_ns = body, _stamp(body)
    for step in source.field.split(".") if source.field else []:
        name, index = _STEP.fullmatch(step).groups()  # type: ignore[union-attr]  # parse_source has checked it
        known = _fields(value)
        if name not in known:
            raise RecordingError(f"{bag}: {source.topic}: no field '{name}' in {_kind(value)}{suggest(name, known)}")
        value = getattr(value, name)
        if index is not None:
            if not isinstance(value, _SEQUENCES):
                raise RecordingError(f"{bag}: {source.topic}: no {name}[{index}]: '{name}' is {_kind(value)}")
            if int(index) >= len(value):
                raise RecordingError(f"{bag}: {source.topic}: no {name}[{index}]: '{name}' holds {len(value)} values")
            value = value[int(index)]
        stamp_ns = _stamp(value) or stamp_ns
    return value, stamp_ns


def laser_scan_at(body: Any, source: Source, bag: Path, echo: str = "first") -> tuple[Any, int]:
    """Return the LaserScan at `source` and its stamp [ns] (0: none); of all echoes the first."""
    value, stamp_ns = value_at(body, source, bag)
    if _kind(value) == ros_messages.MULTI_ECHO:
        return ros_messages.single_echo(value, echo), stamp_ns
    if _kind(value) != ros_messages.LASER_SCAN:
        scans = [
            f"{source.topic}:{name}" for name in _fields(body) if _kind(getattr(body, name)) == ros_messages.LASER_SCAN
        ]
        hint = f"; did you mean '{scans[0]}'?" if scans else ""
        raise RecordingError(f"{bag}: {source} is {_kind(value)}, not a LaserScan{hint}")
    return value, stamp_ns


def scan_fault(laser_scan: Any) -> str:
    """Return the reason why a LaserScan is unusable, or ""."""
    if not len(laser_scan.ranges):
        return "empty_scan"
    if not (math.isfinite(laser_scan.angle_min) and math.isfinite(laser_scan.angle_increment)):
        return "scan_without_bearings"
    if not 0 <= laser_scan.time_increment < 1:
        return "scan_with_impossible_time_increment"
    return ""


def numbers_at(body: Any, source: Source, bag: Path) -> tuple[tuple[float, ...], int]:
    """Return the number at `source`, or the x y z w of a quaternion, and its stamp [ns] (0: none).

    Default field: the only joint of a JointState, `data` of std_msgs. A field can be a joint name; a JointState without
    it, as of another publisher, has no numbers.
    """
    if not source.field:
        if _kind(body) == ros_messages.JOINT_STATE:
            if len(body.name) > 1:
                example = f"{source.topic}:{body.name[-1]}"
                joints = ", ".join(body.name)
                raise RecordingError(f"{bag}: {source.topic}: joints {joints}: name one, such as {example}")
            source = Source(source.topic, body.name[0] if len(body.name) else "position[0]")
        else:
            source = Source(source.topic, "data" if "data" in _fields(body) else "")
    if _kind(body) == ros_messages.JOINT_STATE and _joint(source.field, body):
        names = list(body.name)
        if source.field not in names or names.index(source.field) >= len(body.position):
            return (), 0
        source = Source(source.topic, f"position[{names.index(source.field)}]")
    value, stamp_ns = value_at(body, source, bag)
    if _kind(value) == ros_messages.QUATERNION:
        return (float(value.x), float(value.y), float(value.z), float(value.w)), stamp_ns
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        path = f"{source}." if source.field else f"{source.topic}:"
        numbers = [f"{path}{name}" for name in _fields(value) if _kind(getattr(value, name)) in _NUMBERS]
        hint = f"; did you mean '{numbers[0]}'?" if numbers else "; name one number in it, for example position[0]"
        raise RecordingError(f"{bag}: {source} is {_kind(value)}, not a number{hint}")
    return (float(value),), stamp_ns


def _joint(field: str, body: Any) -> bool:
    """Whether a path is a joint name and not a field of a JointState."""
    return field in body.name or ("[" not in field and "." not in field and field not in _fields(body))


def _fields(value: Any) -> list[str]:
    if not dataclasses.is_dataclass(value):
        return []
    return [field.name for field in dataclasses.fields(value) if field.name != "__msgtype__"]


def _kind(value: Any) -> str:
    """Return the name of the type for messages."""
    if dataclasses.is_dataclass(value):
        message: Any = value  # every message class of rosbags has a __msgtype__
        return str(message.__msgtype__)
    if isinstance(value, _SEQUENCES):
        return f"a sequence of {len(value)}"
    return f"a {type(value).__name__}"


def _stamp(value: Any) -> int:
    if "header" not in _fields(value) or "stamp" not in _fields(value.header):
        return 0
    return ros_messages.stamp_ns(value.header.stamp)
