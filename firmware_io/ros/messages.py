"""ROS 2 messages of the node. Requires the robot's ROS 2, or the wheels of the extra `ros`."""

from __future__ import annotations

from array import array
from collections.abc import Mapping
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState, LaserScan, PointCloud2, PointField

from scanwright.design.arrays import Pose
from scanwright.firmware_io.recording.ros_messages import LASER_FRAME, POINT_FIELD_TYPES, SPIN_JOINT
from scanwright.firmware_io.samples import Scan


def time_of(time_ns: int) -> Any:
    """Return a `builtin_interfaces/Time` of nanoseconds since 1970."""
    seconds, nanoseconds = divmod(time_ns, 1_000_000_000)
    return Time(sec=seconds, nanosec=nanoseconds)


def laser_scan(scan: Scan, stamp_ns: int) -> Any:
    """Return a `sensor_msgs/LaserScan` in the laser frame; the stamp is the time of the first beam."""
    message = LaserScan()
    message.header.stamp, message.header.frame_id = time_of(stamp_ns), LASER_FRAME
    message.angle_min = scan.angle_min_rad
    message.angle_max = scan.angle_min_rad + scan.angle_increment_rad * max(scan.range_m.size - 1, 0)
    message.angle_increment = scan.angle_increment_rad
    message.time_increment, message.scan_time = scan.time_increment_s, scan.scan_time_s
    message.range_min, message.range_max = scan.range_min_m, scan.range_max_m
    # an array of this kind is used unchanged; rclpy checks each number of other sequences
    message.ranges = array("f", scan.range_m.astype(np.float32).tobytes())
    message.intensities = array("f", scan.intensity.astype(np.float32).tobytes())
    return message


def joint_state(position_rad: float, stamp_ns: int) -> Any:
    """Return a `sensor_msgs/JointState` of the spin joint."""
    message = JointState(name=[SPIN_JOINT], position=array("d", [position_rad]))
    message.header.stamp = time_of(stamp_ns)
    return message


def point_cloud(rows: NDArray[np.void], frame: str, stamp_ns: int) -> Any:
    """Return a `sensor_msgs/PointCloud2` of structured rows, shape (height, width)."""
    height, width = rows.shape
    fields = [
        PointField(name=name, offset=place[1], datatype=POINT_FIELD_TYPES[place[0].str], count=1)
        for name, place in (rows.dtype.fields or {}).items()
    ]
    message = PointCloud2(height=height, width=width, fields=fields, is_bigendian=False, is_dense=False)
    message.header.stamp, message.header.frame_id = time_of(stamp_ns), frame
    message.point_step, message.row_step = rows.itemsize, rows.itemsize * width
    message.data = array("B", rows.tobytes())
    return message


def transform(parent: str, child: str, T_parent_child: Pose, stamp_ns: int) -> Any:
    """Return a `geometry_msgs/TransformStamped` for a `tf2_msgs/TFMessage`."""
    message = TransformStamped()
    message.header.stamp, message.header.frame_id, message.child_frame_id = time_of(stamp_ns), parent, child
    at, turned = message.transform.translation, message.transform.rotation
    at.x, at.y, at.z = T_parent_child[:3, 3].tolist()
    turned.x, turned.y, turned.z, turned.w = Rotation.from_matrix(T_parent_child[:3, :3]).as_quat().tolist()
    return message


def diagnostics(level: int, message: str, values: Mapping[str, object], stamp_ns: int) -> Any:
    """Return a `diagnostic_msgs/DiagnosticArray`; level 0 is good, 1 a warning, 2 an error, 3 stale."""
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

    pairs = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    status = DiagnosticStatus(level=bytes([level]), name="scanwright: scanner", message=message, values=pairs)
    array = DiagnosticArray(status=[status])
    array.header.stamp = time_of(stamp_ns)
    return array
