"""Encoding and decoding of ROS 2 messages in CDR; `rosbags` has the message definitions of the ROS 2 releases."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from itertools import groupby
from types import SimpleNamespace
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from numpy.typing import DTypeLike, NDArray
from rosbags.typesys import Stores, get_typestore

from scanwright.design.arrays import Bytes, Floats, Pose, Times
from scanwright.firmware_io.clouds.cloud import pose_numbers
from scanwright.firmware_io.samples import Block, Scan, blocks, chosen_echo

LASER_SCAN = "sensor_msgs/msg/LaserScan"
MULTI_ECHO = "sensor_msgs/msg/MultiEchoLaserScan"
QUATERNION = "geometry_msgs/msg/Quaternion"
JOINT_STATE = "sensor_msgs/msg/JointState"
POINT_CLOUD = "sensor_msgs/msg/PointCloud2"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
IMU = "sensor_msgs/msg/Imu"
TEXT = "std_msgs/msg/String"
POINT_FIELD_TYPES = {"<f8": 8, "<f4": 7, "<u4": 6, "<u2": 4}
"""`sensor_msgs/PointField`: FLOAT64, FLOAT32, UINT32, UINT16."""
LASER_FRAME = "laser"
SPIN_JOINT = "spin_joint"
_BEAM = np.dtype([("bearing", "<f8"), ("offset", "<u4")])
_BEAM_FIELDS = [("bearing", 0, POINT_FIELD_TYPES["<f8"]), ("offset", 8, POINT_FIELD_TYPES["<u4"])]
Beams = tuple[Floats, Times]
"""Bearings [rad] and times after the stamp [ns] of the beams of a scan, shape (n,) each."""


@cache
def _store() -> Any:
    return get_typestore(Stores.ROS2_JAZZY)


def definition(message_type: str) -> str:
    """Return the text of a message type with all nested types, for a `ros2msg` schema of MCAP."""
    text: str = _store().generate_msgdef(message_type, ros_version=2)[0]
    return text


def encode_scan(scan: Scan) -> bytes:
    """Encode a `sensor_msgs/msg/LaserScan`."""
    beams = scan.range_m.size
    message = _store().types[LASER_SCAN](
        header=_header(scan.stamp_ns, LASER_FRAME),
        angle_min=scan.angle_min_rad,
        angle_max=scan.angle_min_rad + scan.angle_increment_rad * max(beams - 1, 0),
        angle_increment=scan.angle_increment_rad,
        time_increment=scan.time_increment_s,
        scan_time=scan.scan_time_s,
        range_min=scan.range_min_m,
        range_max=scan.range_max_m,
        ranges=np.ascontiguousarray(scan.range_m, np.float32),
        intensities=np.ascontiguousarray(scan.intensity, np.float32),
    )
    return bytes(_store().serialize_cdr(message, LASER_SCAN))


def decode_scan(data: bytes) -> Scan:
    """Decode any LaserScan."""
    message = decode_message(data, LASER_SCAN)
    return scan_from_message(message, stamp_ns(message.header.stamp))


def scan_from_message(message: Any, first_beam_ns: int) -> Scan:
    """Convert a decoded LaserScan of any ROS version; intensities are dropped if their number differs."""
    ranges = np.asarray(message.ranges, np.float32)
    intensities = np.asarray(message.intensities, np.float32)
    return Scan(
        stamp_ns=first_beam_ns,
        angle_min_rad=float(message.angle_min),
        angle_increment_rad=float(message.angle_increment),
        time_increment_s=float(message.time_increment),
        scan_time_s=float(message.scan_time),
        range_min_m=float(message.range_min),
        range_max_m=float(message.range_max),
        range_m=ranges,
        intensity=intensities if intensities.size == ranges.size else np.empty(0, np.float32),
    )


def echo_arrays(message: Any) -> tuple[Float[ndarray, "rays echoes"], Float[ndarray, "rays echoes"]]:
    """Return ranges [m] and intensities of a MultiEchoLaserScan; rays with fewer echoes end with inf and 0."""
    most = max((len(ray.echoes) for ray in message.ranges), default=0)
    range_m = np.full((len(message.ranges), max(most, 1)), np.inf, np.float32)
    intensity = np.zeros(range_m.shape, np.float32)
    for k, ray in enumerate(message.ranges):
        range_m[k, : len(ray.echoes)] = ray.echoes
        if k < len(message.intensities) and len(message.intensities[k].echoes) == len(ray.echoes):
            intensity[k, : len(ray.echoes)] = message.intensities[k].echoes
    return range_m, intensity


def single_echo(message: Any, echo: str) -> Any:
    """Convert a MultiEchoLaserScan to a LaserScan of its first, last or strongest echoes.

    With `all` it has the first ones, and `echo_arrays` as a further field `echoes`.
    """
    range_m, intensity = echo_arrays(message)
    which = chosen_echo(range_m, intensity, echo)[:, np.newaxis]
    fields = {name: getattr(message, name) for name in message.__dataclass_fields__ if name != "__msgtype__"}
    fields["ranges"] = np.take_along_axis(range_m, which, 1)[:, 0]
    lit = np.take_along_axis(intensity, which, 1)[:, 0]
    fields["intensities"] = lit if len(message.intensities) else lit[:0]
    if echo == "all":
        fields["echoes"] = range_m, intensity
    return SimpleNamespace(**fields)


def encode_joint(time_ns: int, position_rad: float) -> bytes:
    """Encode a `sensor_msgs/msg/JointState` of the spin joint."""
    message = _store().types[JOINT_STATE](
        header=_header(time_ns, ""),
        name=[SPIN_JOINT],
        position=np.array([position_rad]),
        velocity=np.empty(0),
        effort=np.empty(0),
    )
    return bytes(_store().serialize_cdr(message, JOINT_STATE))


def encode_points(rows: NDArray[np.void], frame: str, time_ns: int) -> bytes:
    """Encode a `sensor_msgs/msg/PointCloud2` of a structured array, shape (points,) or (height, width)."""
    height, width = np.atleast_2d(rows).shape
    types = _store().types
    fields = [
        types["sensor_msgs/msg/PointField"](
            name=name, offset=place[1], datatype=POINT_FIELD_TYPES[place[0].str], count=1
        )
        for name, place in (rows.dtype.fields or {}).items()
    ]
    message = types[POINT_CLOUD](
        header=_header(time_ns, frame),
        height=height,
        width=width,
        fields=fields,
        is_bigendian=False,
        point_step=rows.dtype.itemsize,
        row_step=rows.dtype.itemsize * width,
        data=np.frombuffer(rows.tobytes(), np.uint8),
        is_dense=False,
    )
    return bytes(_store().serialize_cdr(message, POINT_CLOUD))


def encode_beams(scan: Scan) -> bytes:
    """Encode the bearings and times of the beams of a scan as a `sensor_msgs/msg/PointCloud2`."""
    rows = np.zeros(scan.range_m.size, _BEAM)
    rows["bearing"], rows["offset"] = scan.bearing_rad, scan.time_ns - scan.stamp_ns
    return encode_points(rows, LASER_FRAME, scan.stamp_ns)


def decode_beams(data: bytes) -> tuple[int, Beams]:
    """Return stamp [ns] and beams of a message of `encode_beams`; ValueError if it has other fields."""
    return beams_in(decode_message(data, POINT_CLOUD))


def beams_in(message: Any) -> tuple[int, Beams]:
    """Return stamp [ns] and beams of a decoded message; raises as `decode_beams`."""
    if [(field.name, field.offset, field.datatype) for field in message.fields] != _BEAM_FIELDS:
        raise ValueError("rows that are no beams")
    rows = np.frombuffer(message.data.tobytes(), _BEAM)
    return stamp_ns(message.header.stamp), (rows["bearing"].astype(np.float64), rows["offset"].astype(np.int64))


def encode_transforms(poses: Iterable[tuple[str, str, Pose]], time_ns: int) -> bytes:
    """Encode a `tf2_msgs/msg/TFMessage` of parent, child and `T_parent_child`, shape (4, 4)."""
    types = _store().types
    shared = []
    for parent, child, T in poses:
        x, y, z, qx, qy, qz, qw = pose_numbers(T).tolist()
        transform = types["geometry_msgs/msg/Transform"](
            translation=types["geometry_msgs/msg/Vector3"](x=x, y=y, z=z),
            rotation=types["geometry_msgs/msg/Quaternion"](x=qx, y=qy, z=qz, w=qw),
        )
        shared.append(
            types["geometry_msgs/msg/TransformStamped"](
                header=_header(time_ns, parent), child_frame_id=child, transform=transform
            )
        )
    return bytes(_store().serialize_cdr(types[TRANSFORMS](transforms=shared), TRANSFORMS))


def encode_text(text: str) -> bytes:
    """Encode a `std_msgs/msg/String`."""
    return bytes(_store().serialize_cdr(_store().types[TEXT](data=text), TEXT))


def decode_joint(data: bytes) -> tuple[int, float]:
    """Return time [ns] and position [rad] of the spin joint in a JointState; NaN without it."""
    message = decode_message(data, JOINT_STATE)
    positions = dict(zip(message.name, message.position.tolist(), strict=False))
    return stamp_ns(message.header.stamp), positions.get(SPIN_JOINT, math.nan)


def decode_message(data: bytes, message_type: str) -> Any:
    """Decode a message of any type of ROS 2."""
    return _store().deserialize_cdr(data, message_type)


def encode_message(message: object, message_type: str) -> bytes:
    """Encode a decoded message of any ROS version."""
    return bytes(_store().serialize_cdr(message, message_type))


def stamp_ns(stamp: Any) -> int:
    """Return a ROS time as integer nanoseconds."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def _header(time_ns: int, frame_id: str) -> Any:
    seconds, nanoseconds = divmod(time_ns, 1_000_000_000)
    stamp = _store().types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)
    return _store().types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame_id)


_LITTLE_ENDIAN = 1  # second byte of a message
_STAMP = slice(4, 12)  # of any message with a header
_TIME = np.dtype([("sec", "<i4"), ("nanosec", "<u4")])
_POSITION = slice(-16, -8)  # of a message of `encode_joint`, before two empty sequences


def blocks_in(messages: Sequence[bytes]) -> Iterator[Block]:
    """Yield blocks of LaserScan messages in CDR with one layout, as views; an exception for other messages.

    One message of a block is decoded; the others have the same length, and the same bytes between their numbers.
    """
    for (length, order), run in groupby(messages, lambda data: (len(data), data[1])):
        listed = list(run)
        if order != _LITTLE_ENDIAN or length % 4:  # of other recorders; slower
            yield from blocks(map(decode_scan, listed))
            continue
        rows = np.frombuffer(b"".join(listed), np.uint8).reshape(len(listed), length)
        while len(rows):
            message = decode_message(listed[-len(rows)], LASER_SCAN)
            lit = slice(length - 4 * message.intensities.size, length)
            ranges = slice(lit.start - 4 - 4 * message.ranges.size, lit.start - 4)
            # before the ranges are seven numbers, whose largest bearing is redundant and whose time between scans may
            # vary, and the number of ranges
            begin = ranges.start - 32
            shared = (
                slice(_STAMP.stop, begin + 4),
                slice(begin + 8, begin + 16),
                slice(begin + 20, ranges.start),
                slice(ranges.stop, lit.start),
            )
            differs = np.any([(rows[:, place] != rows[0, place]).any(axis=1) for place in shared], axis=0)
            alike, rows = np.split(rows, [int(np.argmax(differs)) or len(rows)])
            first = scan_from_message(message, stamp_ns(message.header.stamp))
            intensity = _numbers(alike, lit, "<f4")[:, : first.intensity.size]
            yield Block(first, _times(alike), _numbers(alike, ranges, "<f4"), intensity)


def joints_in(messages: Sequence[bytes]) -> tuple[Times, Floats]:
    """Return times [ns] and positions [rad] of the spin joint, NaN if absent; an exception for other messages."""
    own = np.frombuffer(encode_joint(0, 0.0), np.uint8)
    if all(len(data) == own.size for data in messages):
        rows = np.frombuffer(b"".join(messages), np.uint8).reshape(-1, own.size)
        fixed = np.ones(own.size, bool)
        fixed[_STAMP] = fixed[_POSITION] = False
        if (rows[:, fixed] == own[fixed]).all():
            return _times(rows), _numbers(rows, _POSITION, "<f8")[:, 0]
    pairs = [decode_joint(data) for data in messages]
    return np.array([time_ns for time_ns, _ in pairs], np.int64), np.array([angle for _, angle in pairs])


def _numbers(rows: Bytes, place: slice, kind: DTypeLike) -> np.ndarray[Any, Any]:
    return rows[:, place].view(kind)


def _times(rows: Bytes) -> Times:
    stamp = _numbers(rows, _STAMP, _TIME)[:, 0]
    return stamp["sec"].astype(np.int64) * 1_000_000_000 + stamp["nanosec"]
