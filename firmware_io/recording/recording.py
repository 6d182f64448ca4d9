"""Recording: an MCAP file of ROS 2 messages.

    /scan          sensor_msgs/msg/LaserScan    stamp = first beam; the rest as sent by the sensor
    /joint_states  sensor_msgs/msg/JointState   `spin_joint`, radians, unwrapped
    /scan_beams    sensor_msgs/msg/PointCloud2  of a sensor with varying speed, before its /scan and with the same
                                                stamp, a row per beam: `bearing` [rad, float64], `offset` [ns, uint32]

With a /scan_beams, the even grid of /scan is an approximation for other readers: only its first and last bearing and
time are exact. `log_time` is the stamp. A metadata record named `scanwright` contains the origin of the recording.
Unusable input raises RecordingError.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Int64
from mcap.writer import Writer
from numpy import ndarray

from scanwright.design.arrays import Floats, Times
from scanwright.design.errors import RecordingError, suggest
from scanwright.design.files.atomic_file import atomic_write
from scanwright.firmware_io.foreign import foreign
from scanwright.firmware_io.recording import ros_messages
from scanwright.firmware_io.recording.arrays import RecordingArrays, arrays_of
from scanwright.firmware_io.recording.mcap_chunks import (
    NOTE,
    TimedChunks,
    read_messages,
    read_note,
    read_topics,
    rests_in_scans,
)
from scanwright.firmware_io.recording.ros_messages import Beams, blocks_in, joints_in
from scanwright.firmware_io.samples import Block, JointLog, Scan, blocks

SCAN_TOPIC = "/scan"
JOINT_TOPIC = "/joint_states"
BEAMS_TOPIC = "/scan_beams"
_AT_ONCE = 256  # messages in memory
_BLOCK = 128  # scans, at most
_TYPES = {SCAN_TOPIC: ros_messages.LASER_SCAN, JOINT_TOPIC: ros_messages.JOINT_STATE}


class MessageWriter:
    """Writer of scans and joint samples to an open stream, in the order of their times.

    RecordingError if a time does not fit a ROS time (before 1970, after 2038).
    """

    def __init__(
        self,
        stream: Any,
        path: Path,
        note: Mapping[str, str],
        attached: Mapping[str, str],
        writer: type[Writer] = TimedChunks,
    ) -> None:
        """Begin a recording.

        Args:
            stream: has `write`, `tell` and `flush`.
            path: for errors.
            note: origin of the recording.
            attached: files, name -> text.
            writer: `TimedChunks`, or a plain one if only `flush` ends chunks.
        """
        self._path = path
        self._writer = writer(stream)
        self._writer.start(profile="ros2", library="scanwright")
        self._writer.add_metadata(NOTE, dict(note))
        for name, text in attached.items():
            self._writer.add_attachment(0, 0, name, f"text/{Path(name).suffix[1:]}", text.encode())
        self._channels = {topic: self._channel(topic, message_type) for topic, message_type in _TYPES.items()}

    def scan(self, scan: Scan) -> None:
        """Append one scan."""
        self._check(scan.stamp_ns)
        if scan.beam_bearing_rad is not None:
            if BEAMS_TOPIC not in self._channels:
                self._channels[BEAMS_TOPIC] = self._channel(BEAMS_TOPIC, ros_messages.POINT_CLOUD)
            self._add(BEAMS_TOPIC, scan.stamp_ns, ros_messages.encode_beams(scan))
        self._add(SCAN_TOPIC, scan.stamp_ns, ros_messages.encode_scan(scan))

    def joint(self, time_ns: int, position_rad: float) -> None:
        """Append one sample of the spin joint."""
        self._check(time_ns)
        self._add(JOINT_TOPIC, time_ns, ros_messages.encode_joint(time_ns, position_rad))

    def other(self, topic: str, message_type: str, time_ns: int, message: object) -> None:
        """Append a message of another topic, of a type of ROS 2."""
        self._check(time_ns)
        if topic not in self._channels:
            what = f"{self._path}: {topic}: {message_type} is no type that comes with ROS 2"
            self._channels[topic] = foreign(what, self._channel, topic, message_type)
        what = f"{self._path}: {topic}: a message that is no {message_type}"
        self._add(topic, time_ns, foreign(what, ros_messages.encode_message, message, message_type))

    def flush(self) -> None:
        """Write all messages so far to the stream as a chunk."""
        self._writer.flush()  # type: ignore[no-untyped-call]

    def finish(self) -> None:
        """Write the index, but do not close the stream."""
        self._writer.finish()  # type: ignore[no-untyped-call]

    def _channel(self, topic: str, message_type: str) -> int:
        schema = self._writer.register_schema(message_type, "ros2msg", ros_messages.definition(message_type).encode())
        return self._writer.register_channel(topic, "cdr", schema)

    def _check(self, time_ns: int) -> None:
        if not 0 <= time_ns < 2**31 * 1_000_000_000:
            raise RecordingError(f"{self._path}: time {time_ns} ns does not fit a ROS time (1970 to 2038)")

    def _add(self, topic: str, time_ns: int, data: bytes) -> None:
        self._writer.add_message(self._channels[topic], log_time=time_ns, publish_time=time_ns, data=data)


@contextmanager
def recording_writer(path: Path, note: Mapping[str, str]) -> Iterator[MessageWriter]:
    """Write a recording with a note of its origin; the file gets its name after the body ends without an error."""
    with atomic_write(path, RecordingError) as part, foreign(f"{path}: cannot write", part.open, "wb") as stream:
        messages = MessageWriter(stream, path, note, {})
        yield messages
        messages.finish()


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """An open recording; its scans stay in the file.

    Attributes:
        path: of the file.
        joint_log: all samples of the spin joint.
        beams: number of beams of each scan.
        stamp_ns: time of the first beam of each scan.
        has_intensity: of any scan.
        at_rest: whether the motor rested during each scan (`scanwright import --hold`).
    """

    path: Path
    joint_log: JointLog
    beams: Int64[ndarray, " scans"]
    stamp_ns: Int64[ndarray, " scans"]
    has_intensity: bool
    at_rest: bool

    @property
    def start_ns(self) -> int:
        """Time of the first beam of the first scan."""
        return int(self.stamp_ns[0])

    def scans(self) -> Iterator[Scan]:
        """Yield the scans in the order of their times."""
        beams: tuple[int, Beams] | None = None
        for topic, data in read_messages(self.path, {SCAN_TOPIC, BEAMS_TOPIC}):
            if topic == BEAMS_TOPIC:
                beams = foreign(f"{self.path}: a message of {BEAMS_TOPIC}", ros_messages.decode_beams, data)
                continue
            scan = foreign(f"{self.path}: a message of {SCAN_TOPIC}", ros_messages.decode_scan, data)
            if beams is not None and beams[0] == scan.stamp_ns:
                scan = replace(scan, beam_bearing_rad=beams[1][0], beam_offset_ns=beams[1][1])
            yield scan

    def blocks(self) -> Iterator[Block]:
        """Yield the same scans in blocks, ten times faster if they have one layout."""
        if BEAMS_TOPIC in read_topics(self.path):
            yield from blocks(self.scans(), _BLOCK)
            return
        messages = (data for _, data in read_messages(self.path, {SCAN_TOPIC}, summed=False))
        while some := list(islice(messages, _BLOCK)):
            for block in foreign(f"{self.path}: a message of {SCAN_TOPIC}", list[Block], blocks_in(some)):
                range_m, intensity = np.ascontiguousarray(block.range_m), np.ascontiguousarray(block.intensity)
                yield replace(block, range_m=range_m, intensity=intensity)

    def arrays(self) -> RecordingArrays:
        """Read the entire recording."""
        return arrays_of(list(self.scans()), self.joint_log)


def open_recording(path: Path) -> Recording:
    """Read the joint log and the outlines of the scans.

    Raises:
        RecordingError: the file is missing, cut off, not MCAP, empty, or has other topics or types.
    """
    _check_topics(path)
    logs: list[tuple[Times, Floats]] = []
    stamps: list[Times] = []
    beams: list[int] = []
    has_intensity = False
    messages = read_messages(path, set(_TYPES))
    while some := list(islice(messages, _AT_ONCE)):
        joints = [data for topic, data in some if topic == JOINT_TOPIC]
        logs.append(foreign(f"{path}: a message of {JOINT_TOPIC}", joints_in, joints))
        scans = blocks_in([data for topic, data in some if topic == SCAN_TOPIC])
        for block in foreign(f"{path}: a message of {SCAN_TOPIC}", list[Block], scans):
            has_intensity |= block.intensity.size > 0
            stamps.append(block.stamp_ns)
            beams += [block.range_m.shape[1]] * block.stamp_ns.size
    time_ns = np.concatenate([part for part, _ in logs] or [np.empty(0, np.int64)])
    position_rad = np.concatenate([part for _, part in logs] or [np.empty(0)])
    if not time_ns.size:
        raise RecordingError(f"{path}: {JOINT_TOPIC} has no message: the servo's angle is not known")
    if not beams:
        raise RecordingError(f"{path}: {SCAN_TOPIC} has no message: there is nothing to assemble")
    return Recording(
        path=path,
        joint_log=_sorted_log(path, time_ns, position_rad),
        beams=np.array(beams),
        stamp_ns=np.concatenate(stamps),
        has_intensity=has_intensity,
        at_rest=rests_in_scans(read_note(path)),
    )


def _sorted_log(path: Path, time_ns: Times, position_rad: Floats) -> JointLog:
    if np.isnan(position_rad).any():
        raise RecordingError(f"{path}: {JOINT_TOPIC}: a message without a position of '{ros_messages.SPIN_JOINT}'")
    order = np.argsort(time_ns, kind="stable")
    try:
        return JointLog(time_ns[order], position_rad[order])
    except RecordingError as error:
        raise RecordingError(f"{path}: {JOINT_TOPIC}: {error}") from error


def _check_topics(path: Path) -> None:
    types = read_topics(path)
    for topic, message_type in _TYPES.items():
        if topic not in types:
            raise RecordingError(f"{path}: no topic {topic}{suggest(topic, types)} (`scanwright import` converts bags)")
        if types[topic] != message_type:
            raise RecordingError(f"{path}: {topic} is {types[topic]}, not {message_type}")
