"""Scans and joint samples as ROS 2 messages: pure bytes -> value functions for the two types that we record.

And value -> bytes for what is made of them: points, frames, the description of the scanner.

The layout is CDR as ROS 2 writes it; `rosbags` holds the message definitions of the ROS 2 releases.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable
from functools import cache
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_typestore

from scanwright.design.arrays import Float32s, Floats, Pose, Times
from scanwright.firmware_io.clouds.cloud import pose_numbers
from scanwright.firmware_io.samples import Scan, chosen_echo

LASER_SCAN = "sensor_msgs/msg/LaserScan"
MULTI_ECHO = "sensor_msgs/msg/MultiEchoLaserScan"
QUATERNION = "geometry_msgs/msg/Quaternion"
JOINT_STATE = "sensor_msgs/msg/JointState"
POINT_CLOUD = "sensor_msgs/msg/PointCloud2"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
TEXT = "std_msgs/msg/String"
POINT_FIELD_TYPES = {"<f8": 8, "<f4": 7, "<u4": 6, "<u2": 4}
"""`sensor_msgs/PointField`: FLOAT64, FLOAT32, UINT32, UINT16."""
LASER_FRAME = "laser"
SPIN_JOINT = "spin_joint"
_SPIN_JOINT_BYTES = SPIN_JOINT.encode()
_BEAM = np.dtype([("bearing", "<f8"), ("offset", "<u4")])
_BEAM_FIELDS = [("bearing", 0, POINT_FIELD_TYPES["<f8"]), ("offset", 8, POINT_FIELD_TYPES["<u4"])]
Beams = tuple[Floats, Times]
"""Bearings [rad] and times after the stamp [ns] of the beams of a scan, shape (n,) each."""


@cache
def _store() -> Any:
    return get_typestore(Stores.ROS2_JAZZY)


def definition(message_type: str) -> str:
    """Text of a message type with every type inside it, as MCAP's `ros2msg` schemas want it."""
    text: str = _store().generate_msgdef(message_type, ros_version=2)[0]
    return text


def encode_scan(scan: Scan) -> bytes:
    """One `sensor_msgs/msg/LaserScan` in CDR."""
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


class ScanPlaces(NamedTuple):
    """Where a LaserScan in CDR has its numbers."""

    order: str  # of the bytes, for `struct`
    numbers: slice  # the seven that all beams share
    ranges: slice  # float32 each
    intensities: slice  # the same; empty if they do not match the ranges one by one and say nothing about a beam
    shared: tuple[slice, ...]  # what messages have in common that differ in time and measurement only

    @classmethod
    def of(cls, data: bytes) -> ScanPlaces:
        """Those of a message; ValueError, or that of `struct`, where it is cut off."""
        order, _, at = _cdr_header(data)
        ranges = _floats(data, order, at + 28)
        intensities = _floats(data, order, ranges.stop)
        # of the seven the largest bearing says nothing new, and the time from scan to scan may wander
        shared = slice(1, 2), slice(12, at + 4), slice(at + 8, at + 16), slice(at + 20, ranges.start)
        lit = slice(intensities.start - 4, intensities.start)
        if intensities.stop - intensities.start != ranges.stop - ranges.start:
            intensities = slice(intensities.start, intensities.start)
        return cls(order, slice(at, at + 28), ranges, intensities, (*shared, lit))


def decode_scan(data: bytes) -> Scan:
    """Inverse of `encode_scan`, for any CDR LaserScan."""
    places = ScanPlaces.of(data)
    numbers = struct.unpack_from(f"{places.order}7f", data, places.numbers.start)
    return Scan(
        stamp_ns=_cdr_header(data)[1],
        angle_min_rad=numbers[0],
        angle_increment_rad=numbers[2],
        time_increment_s=numbers[3],
        scan_time_s=numbers[4],
        range_min_m=numbers[5],
        range_max_m=numbers[6],
        range_m=np.frombuffer(data[places.ranges], f"{places.order}f4").astype(np.float32),
        intensity=np.frombuffer(data[places.intensities], f"{places.order}f4").astype(np.float32),
    )


def scan_from_message(message: Any, first_beam_ns: int) -> Scan:
    """The scan inside a decoded LaserScan of any ROS version.

    Intensities that do not match the ranges one by one say nothing about a beam and are not taken.
    """
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
        intensity=_one_by_one(intensities, ranges),
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
    """Return a MultiEchoLaserScan as a LaserScan of its first, last or strongest echoes.

    Of all it has the first, and `echo_arrays` as a further field `echoes`.
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
    """One `sensor_msgs/msg/JointState` of the spin joint in CDR."""
    message = _store().types[JOINT_STATE](
        header=_header(time_ns, ""),
        name=[SPIN_JOINT],
        position=np.array([position_rad]),
        velocity=np.empty(0),
        effort=np.empty(0),
    )
    return bytes(_store().serialize_cdr(message, JOINT_STATE))


def encode_points(rows: NDArray[np.void], frame: str, time_ns: int) -> bytes:
    """One `sensor_msgs/msg/PointCloud2` in CDR, a row of the cloud for each row of the structured array."""
    types = _store().types
    fields = [
        types["sensor_msgs/msg/PointField"](
            name=name, offset=place[1], datatype=POINT_FIELD_TYPES[place[0].str], count=1
        )
        for name, place in (rows.dtype.fields or {}).items()
    ]
    message = types[POINT_CLOUD](
        header=_header(time_ns, frame),
        height=1,
        width=rows.size,
        fields=fields,
        is_bigendian=False,
        point_step=rows.dtype.itemsize,
        row_step=rows.dtype.itemsize * rows.size,
        data=np.frombuffer(rows.tobytes(), np.uint8),
        is_dense=False,
    )
    return bytes(_store().serialize_cdr(message, POINT_CLOUD))


def encode_beams(scan: Scan) -> bytes:
    """Bearings and times of the beams of a scan that has its own, as a `sensor_msgs/msg/PointCloud2` in CDR."""
    rows = np.zeros(scan.range_m.size, _BEAM)
    rows["bearing"], rows["offset"] = scan.bearing_rad, scan.time_ns - scan.stamp_ns
    return encode_points(rows, LASER_FRAME, scan.stamp_ns)


def decode_beams(data: bytes) -> tuple[int, Beams]:
    """Stamp [ns], bearings [rad] and times after the stamp [ns] in what `encode_beams` writes.

    Raises:
        ValueError: its rows are of something else.
    """
    return beams_in(decode_message(data, POINT_CLOUD))


def beams_in(message: Any) -> tuple[int, Beams]:
    """The same of a message that is decoded already; raises as `decode_beams`."""
    if [(field.name, field.offset, field.datatype) for field in message.fields] != _BEAM_FIELDS:
        raise ValueError("rows that are no beams")
    rows = np.frombuffer(message.data.tobytes(), _BEAM)
    return stamp_ns(message.header.stamp), (rows["bearing"].astype(np.float64), rows["offset"].astype(np.int64))


def encode_transforms(poses: Iterable[tuple[str, str, Pose]], time_ns: int) -> bytes:
    """One `tf2_msgs/msg/TFMessage` in CDR of parent, child and `T_parent_child`, shape (4, 4)."""
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
    """One `std_msgs/msg/String` in CDR."""
    return bytes(_store().serialize_cdr(_store().types[TEXT](data=text), TEXT))


class JointPlaces(NamedTuple):
    """Where a JointState in CDR has the position of the spin joint."""

    order: str  # of the bytes, for `struct`
    position: slice  # float64
    shared: tuple[slice, ...]  # what messages have in common that name the same joints

    @classmethod
    def of(cls, data: bytes) -> JointPlaces | None:
        """Those of a message, None if it tells no position of the joint; errors as of `ScanPlaces`."""
        order, _, at = _cdr_header(data)
        (count,) = struct.unpack_from(f"{order}I", data, at)
        at += 4
        names = []
        for _ in range(count):
            name, at = _cdr_string(data, order, at)
            names.append(name)
        at = _aligned(at, 4)
        (positions,) = struct.unpack_from(f"{order}I", data, at)
        at = _aligned(at + 4, 8)
        if _SPIN_JOINT_BYTES not in names or names.index(_SPIN_JOINT_BYTES) >= positions:
            return None
        start = at + 8 * names.index(_SPIN_JOINT_BYTES)
        if start + 8 > len(data):
            raise ValueError(f"{positions} positions in a message of {len(data)} bytes")
        return cls(order, slice(start, start + 8), (slice(1, 2), slice(12, at)))


def decode_joint(data: bytes) -> tuple[int, float]:
    """Time [ns] and position [rad] of the spin joint in a CDR JointState; NaN if it does not name the joint."""
    places, time_ns = JointPlaces.of(data), _cdr_header(data)[1]
    if places is None:
        return time_ns, math.nan
    return time_ns, struct.unpack_from(f"{places.order}d", data, places.position.start)[0]


def decode_message(data: bytes, message_type: str) -> Any:
    """Any message of a type that comes with ROS 2, from CDR."""
    return _store().deserialize_cdr(data, message_type)


def encode_message(message: object, message_type: str) -> bytes:
    """Inverse of `decode_message`, for a message of any ROS version."""
    return bytes(_store().serialize_cdr(message, message_type))


def stamp_ns(stamp: Any) -> int:
    """A ROS time as integer nanoseconds."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def _header(time_ns: int, frame_id: str) -> Any:
    seconds, nanoseconds = divmod(time_ns, 1_000_000_000)
    stamp = _store().types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)
    return _store().types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame_id)


def _cdr_header(data: bytes) -> tuple[str, int, int]:
    """Byte order of a message for `struct`, time [ns] of the std_msgs/Header it begins with, and where that ends."""
    # 4 bytes of encapsulation (the second one tells the byte order); alignment counts from behind them, so does not
    # change modulo 4, and modulo 8 only by `_aligned`
    order = "<" if data[1] & 1 else ">"
    seconds, nanoseconds = struct.unpack_from(f"{order}iI", data, 4)
    _, at = _cdr_string(data, order, 12)
    return order, seconds * 1_000_000_000 + nanoseconds, _aligned(at, 4)


def _cdr_string(data: bytes, order: str, at: int) -> tuple[bytes, int]:
    """A string without its closing zero, and where it ends."""
    at = _aligned(at, 4)
    (size,) = struct.unpack_from(f"{order}I", data, at)
    if at + 4 + size > len(data):
        raise ValueError(f"a string of {size} bytes in a message of {len(data)}")
    return data[at + 4 : at + 4 + max(size - 1, 0)], at + 4 + size


def _floats(data: bytes, order: str, at: int) -> slice:
    """Where the numbers of a sequence of float32 stand."""
    (count,) = struct.unpack_from(f"{order}I", data, at)
    if at + 4 + 4 * count > len(data):
        raise ValueError(f"{count} numbers in a message of {len(data)} bytes")
    return slice(at + 4, at + 4 + 4 * count)


def _aligned(at: int, size: int) -> int:
    return at + (4 - at) % size


def _one_by_one(intensities: Float32s, ranges: Float32s) -> Float32s:
    return intensities if intensities.size == ranges.size else np.empty(0, np.float32)
