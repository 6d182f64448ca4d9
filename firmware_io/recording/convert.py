"""Conversion of clouds to other formats, and of recordings to bags."""

from __future__ import annotations

import dataclasses
import json
import shutil
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import atomic_write, check_place
from scanwright.firmware_io.clouds.formats import check_target, read_clouds, stream, write_clouds
from scanwright.firmware_io.clouds.text import decimal_points
from scanwright.firmware_io.foreign import foreign
from scanwright.firmware_io.recording.bags import NOTE_TOPIC, Bag, Message, open_bag
from scanwright.firmware_io.recording.ros_messages import TEXT


@dataclass(frozen=True, slots=True)
class Converted:
    """Result of a conversion.

    Attributes:
        files: written files or folder.
        rows: of the clouds; None for a recording.
        messages: topic -> number; None for a cloud.
        notes: data that the format cannot store, one sentence each.
    """

    files: tuple[Path, ...]
    rows: int | None
    messages: dict[str, int] | None
    notes: tuple[str, ...]

    def lines(self) -> list[str]:
        """Format the result."""
        rows = f"{self.rows:,} rows" if self.rows is not None else ""
        messages = ", ".join(f"{count:,} of {topic}" for topic, count in (self.messages or {}).items())
        return [
            *(f"note: {note}" for note in self.notes),
            f"wrote {rows or messages} to {', '.join(map(str, self.files))}",
        ]


def convert(source: Path, target: Path, *, organised: bool = False, decimal_comma: bool = False) -> Converted:
    """Convert a cloud to another format, or a recording to a bag.

    Large clouds without rows and columns are converted in parts, in bounded memory.

    Args:
        source: a cloud, or a recording (`.mcap`).
        target: a cloud; or a bag, `.bag` for ROS 1, otherwise a new folder for ROS 2.
        organised: keep the rows without a point of an organised cloud, also in formats that do not define them.
        decimal_comma: the source is text with decimal commas.

    Raises:
        InstallError: a format requires the extra `clouds`, which is not installed.
        RecordingError: `source` is unreadable, its format is unknown, or `target` cannot be written.
    """
    if source.suffix == ".mcap":
        exported = export_bag(source, target)
        unknown = tuple(f"dropped {topic}: this ROS has no {kind}" for topic, kind in exported.unknown.items())
        return Converted((target,), None, exported.written, unknown)
    check_target(target)
    unread: list[str] = []
    with decimal_points(source) if decimal_comma else nullcontext(source) as readable:
        wrote = None if organised else stream(readable, target)
        if wrote is None:
            clouds, unread = read_clouds(readable)
            wrote = write_clouds(target, clouds, organised=organised)
    notes = (note.replace(str(readable), str(source)) for note in (*unread, *wrote.notes))
    return Converted(wrote.paths, wrote.rows, None, tuple(notes))


_VERSION: Final = 8  # of the metadata of ROS 2 bags, for Humble and later
_FOREVER: Final = QosTime(9223372036, 854775807)
_LATCHED: Final = Qos(
    history=QosHistory.KEEP_LAST,
    depth=1,
    reliability=QosReliability.RELIABLE,
    durability=QosDurability.TRANSIENT_LOCAL,
    deadline=_FOREVER,
    lifespan=_FOREVER,
    liveliness=QosLiveliness.AUTOMATIC,
    liveliness_lease_duration=_FOREVER,
    avoid_ros_namespace_conventions=False,
)


@dataclasses.dataclass(frozen=True, slots=True)
class Exported:
    """Result of an export."""

    written: dict[str, int]  # topic -> number of messages
    unknown: dict[str, str]  # topic -> type that ROS does not have


def export_bag(recording: Path, out: Path) -> Exported:
    """Write all messages of a recording as a bag, with their log times, and its note as a topic.

    Args:
        recording: MCAP.
        out: `.bag` for ROS 1 (Noetic's types), or the name of a folder for ROS 2 (Humble's types, sqlite3).

    Raises:
        RecordingError: the recording is unreadable, or the bag cannot be written; nothing is left.
    """
    if out.suffix not in ("", ".bag"):
        raise RecordingError(
            f"{out}: a recording becomes a ROS 1 bag (name it {out.with_suffix('.bag').name}) or a ROS 2 bag, which is "
            f"a folder ({out.stem})"
        )
    if out.suffix == ".bag":
        with atomic_write(out, RecordingError) as part:
            return foreign(f"{out}: cannot write", _ros1, recording, part)
    if out.exists():
        raise RecordingError(f"{out}: exists; a ROS 2 bag is a new folder")
    check_place(out, RecordingError)
    try:
        return foreign(f"{out}: cannot write", _ros2, recording, out)
    except BaseException:
        shutil.rmtree(out, ignore_errors=True)
        raise


def _ros1(recording: Path, part: Path) -> Exported:
    store = get_typestore(Stores.ROS1_NOETIC)
    with open_bag(recording) as bag, foreign(f"{part}: cannot write", Writer1, part) as writer:
        return _copied(bag, writer, store, store.serialize_ros1, {"latching": 1})


def _ros2(recording: Path, out: Path) -> Exported:
    store = get_typestore(Stores.ROS2_HUMBLE)
    bag_out = foreign(f"{out}: cannot write", Writer2, out, version=_VERSION, storage_plugin=StoragePlugin.SQLITE3)
    with open_bag(recording) as bag, bag_out as writer:
        return _copied(bag, writer, store, store.serialize_cdr, {"offered_qos_profiles": [_LATCHED]})


def _copied(
    bag: Bag, writer: Any, store: Typestore, serialize: Callable[[Any, str], Any], latched: Mapping[str, Any]
) -> Exported:
    """Copy all messages of a recording; `latched` are the options of a latched topic."""
    known = {topic: kind for topic, kind in bag.topics.items() if kind in store.types}
    unknown = {topic: kind for topic, kind in bag.topics.items() if topic not in known}
    note_topic = {NOTE_TOPIC: TEXT} if bag.note() else {}
    connections = {
        topic: writer.add_connection(topic, kind, typestore=store, **(latched if topic == NOTE_TOPIC else {}))
        for topic, kind in (note_topic | known).items()
    }
    written: Counter[str] = Counter()
    for message in _noted(bag, set(known), store):
        connection = connections[message.topic]
        writer.write(connection, message.receive_ns, serialize(_of_store(message.body, store), connection.msgtype))
        written[message.topic] += 1
    return Exported(dict(written), unknown)


def _noted(bag: Bag, topics: set[str], store: Typestore) -> Iterator[Message]:
    """Yield the note at the time of the first message, unless it is one of them, and then the messages."""
    note = {} if NOTE_TOPIC in topics else bag.note()
    for k, message in enumerate(bag.messages(topics)):
        if note and k == 0:
            text: Any = store.types[TEXT]
            yield Message(NOTE_TOPIC, message.receive_ns, text(data=json.dumps(note, sort_keys=True)))
        yield message


def _of_store(value: Any, store: Typestore) -> Any:
    """Convert a message to the classes of the store; fields that only these have (`seq` of ROS 1) are 0."""
    if dataclasses.is_dataclass(value):
        message: Any = value
        kind: Any = store.types[message.__msgtype__]
        names = [field.name for field in dataclasses.fields(kind) if field.name != "__msgtype__"]
        return kind(**{name: _of_store(getattr(value, name, 0), store) for name in names})
    if isinstance(value, list):
        return [_of_store(item, store) for item in value]
    return value
