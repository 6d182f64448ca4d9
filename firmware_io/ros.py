"""Scans and joint samples as ROS 2 messages: pure bytes -> value functions for the two types that we record.

The layout is CDR as ROS 2 writes it; `rosbags` holds the message definitions of the ROS 2 releases.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from firmware_io.samples import Scan

LASER_SCAN = "sensor_msgs/msg/LaserScan"
JOINT_STATE = "sensor_msgs/msg/JointState"
LASER_FRAME = "laser"
SPIN_JOINT = "spin_joint"


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


def decode_scan(data: bytes) -> Scan:
    """Inverse of `encode_scan`, for any CDR LaserScan."""
    message = _store().deserialize_cdr(data, LASER_SCAN)
    return scan_of(message, stamp_ns(message.header.stamp))


def scan_of(message: Any, first_beam_ns: int) -> Scan:
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
        intensity=intensities if intensities.size == ranges.size else np.empty(0, np.float32),
    )


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


def decode_joint(data: bytes) -> tuple[int, float]:
    """Time [ns] and position [rad] of the spin joint in a CDR JointState; NaN where it does not name the joint."""
    message = _store().deserialize_cdr(data, JOINT_STATE)
    positions = dict(zip(message.name, message.position.tolist(), strict=False))
    return stamp_ns(message.header.stamp), positions.get(SPIN_JOINT, math.nan)


def stamp_ns(stamp: Any) -> int:
    """A ROS time as integer nanoseconds."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def _header(time_ns: int, frame_id: str) -> Any:
    seconds, nanoseconds = divmod(time_ns, 1_000_000_000)
    stamp = _store().types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)
    return _store().types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame_id)
