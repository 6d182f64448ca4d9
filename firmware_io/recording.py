"""The project's recording: an MCAP file of ROS 2 messages that Foxglove and every ROS 2 reader opens.

    /scan          sensor_msgs/msg/LaserScan    stamp = first beam; the rest as the sensor gave it
    /joint_states  sensor_msgs/msg/JointState   `spin_joint`, radians, unwrapped

`log_time` is the stamp. A metadata record named `scanwright` says where the recording comes from.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

import numpy as np
from mcap.reader import SeekingReader
from mcap.summary import Summary
from mcap.writer import Writer
from numpy.typing import NDArray

from design.errors import RecordingError, suggest
from firmware_io import ros
from firmware_io.files import foreign, foreign_items, whole_file
from firmware_io.samples import JointLog, Scan

SCAN_TOPIC = "/scan"
JOINT_TOPIC = "/joint_states"
_MAGIC = b"\x89MCAP"
_TYPES = {SCAN_TOPIC: ros.LASER_SCAN, JOINT_TOPIC: ros.JOINT_STATE}


class RecordingWriter:
    """Writes a recording; use it in a `with` statement. The file appears under its name only when that ends well.

    Write scans and joint samples in the order of their times, so that replaying needs no sorting.

    Raises:
        RecordingError: the file cannot be written, or a time is one that ROS cannot hold (before 1970, after 2038).
    """

    def __init__(self, path: Path, note: Mapping[str, str]) -> None:
        """`note` is kept with the recording: where it comes from, in words."""
        self._path = path
        self._note = dict(note)
        self._stack = ExitStack()

    def __enter__(self) -> RecordingWriter:
        with ExitStack() as stack:
            part = stack.enter_context(whole_file(self._path))
            stream = stack.enter_context(foreign(f"{self._path}: cannot write", part.open, "wb"))
            self._writer = Writer(stream)
            self._writer.start(profile="ros2", library="scanwright")
            self._writer.add_metadata("scanwright", self._note)
            self._channels = {topic: self._channel(topic) for topic in _TYPES}
            stack.push(self._finish)
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.__exit__(kind, error, trace)

    def scan(self, scan: Scan) -> None:
        """Append one scan."""
        self._check(scan.stamp_ns)
        self._add(SCAN_TOPIC, scan.stamp_ns, ros.encode_scan(scan))

    def joint(self, time_ns: int, position_rad: float) -> None:
        """Append one sample of the spin joint."""
        self._check(time_ns)
        self._add(JOINT_TOPIC, time_ns, ros.encode_joint(time_ns, position_rad))

    def _finish(
        self, kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        if kind is None:
            self._writer.finish()  # type: ignore[no-untyped-call]

    def _channel(self, topic: str) -> int:
        schema = self._writer.register_schema(_TYPES[topic], "ros2msg", ros.definition(_TYPES[topic]).encode())
        return self._writer.register_channel(topic, "cdr", schema)

    def _check(self, time_ns: int) -> None:
        if not 0 <= time_ns < 2**31 * 1_000_000_000:
            raise RecordingError(f"{self._path}: time {time_ns} ns does not fit a ROS time (1970 to 2038)")

    def _add(self, topic: str, time_ns: int, data: bytes) -> None:
        self._writer.add_message(self._channels[topic], log_time=time_ns, publish_time=time_ns, data=data)


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """What one pass over a recording tells; the scans themselves stay in the file.

    Attributes:
        path: the file.
        joint_log: every sample of the spin joint.
        beams: shape (scans,), number of beams in each scan.
        has_intensity: whether any scan carries intensities.
        start_ns: time of the first beam of the first scan.
    """

    path: Path
    joint_log: JointLog
    beams: NDArray[np.int64]
    has_intensity: bool
    start_ns: int

    def scans(self) -> Iterator[Scan]:
        """The scans in the order of their times, one at a time."""
        for data in _messages(self.path, SCAN_TOPIC):
            yield _decoded_scan(self.path, data)


def open_recording(path: Path) -> Recording:
    """Read the joint log and the outline of the scans.

    Raises:
        RecordingError: the file is missing, cut off, not MCAP, not of our topics and types, or empty.
    """
    _check_topics(path)
    times: list[int] = []
    positions: list[float] = []
    for data in _messages(path, JOINT_TOPIC):
        time_ns, position_rad = foreign(f"{path}: a message of {JOINT_TOPIC}", ros.decode_joint, data)
        if np.isnan(position_rad):
            raise RecordingError(f"{path}: {JOINT_TOPIC}: a message without a position of '{ros.SPIN_JOINT}'")
        times.append(time_ns)
        positions.append(position_rad)
    if not times:
        raise RecordingError(f"{path}: {JOINT_TOPIC} has no message: the servo's angle is not known")
    beams: list[int] = []
    start_ns, has_intensity = 0, False
    for data in _messages(path, SCAN_TOPIC):
        scan = _decoded_scan(path, data)
        start_ns = scan.stamp_ns if not beams else start_ns
        has_intensity |= bool(scan.intensity.size)
        beams.append(scan.range_m.size)
    if not beams:
        raise RecordingError(f"{path}: {SCAN_TOPIC} has no message: there is nothing to assemble")
    log = _sorted_log(path, times, positions)
    return Recording(path, log, np.array(beams), has_intensity, start_ns)


def _sorted_log(path: Path, times: list[int], positions: list[float]) -> JointLog:
    order = np.argsort(np.array(times, np.int64), kind="stable")
    try:
        return JointLog(np.array(times, np.int64)[order], np.array(positions)[order])
    except RecordingError as error:
        raise RecordingError(f"{path}: {JOINT_TOPIC}: {error}") from error


def _summary(stream: BinaryIO) -> Summary | None:
    return SeekingReader(stream).get_summary()


def _check_topics(path: Path) -> None:
    what = f"{path}: the recording was cut off (`mcap recover` mends it)"
    if not path.is_file():
        raise RecordingError(f"{path}: {'this is a folder, not a recording' if path.is_dir() else 'no such file'}")
    with foreign(f"{path}: cannot read", path.open, "rb") as stream:
        if stream.read(len(_MAGIC)) != _MAGIC:
            raise RecordingError(f"{path}: not an MCAP file; `scanwright import` converts bags")
        stream.seek(0)
        summary = foreign(what, _summary, stream)
    if summary is None:
        raise RecordingError(what)
    found = {channel.topic: summary.schemas[channel.schema_id].name for channel in summary.channels.values()}
    for topic, message_type in _TYPES.items():
        if topic not in found:
            raise RecordingError(f"{path}: no topic {topic}{suggest(topic, found)} (`scanwright import` converts bags)")
        if found[topic] != message_type:
            raise RecordingError(f"{path}: {topic} is {found[topic]}, not {message_type}")


def _messages(path: Path, topic: str) -> Iterator[bytes]:
    with foreign(f"{path}: cannot read", path.open, "rb") as stream:
        # In log time order on purpose: asked for file order, mcap 1.6 queues every chunk of the file before it yields.
        found = SeekingReader(stream, validate_crcs=True).iter_messages(topics=[topic], log_time_order=True)
        for _, _, message in foreign_items(f"{path}: {topic}", found):
            yield message.data


def _decoded_scan(path: Path, data: bytes) -> Scan:
    return foreign(f"{path}: a message of {SCAN_TOPIC}", ros.decode_scan, data)
