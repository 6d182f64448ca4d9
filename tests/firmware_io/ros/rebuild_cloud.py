"""Somebody else's program: rclpy and NumPy, nothing of ours. Rebuilds the cloud from scan, joint_states and the URDF.

    python rebuild_cloud.py SCANS OUT.npz

listens until it has SCANS scans with their points, and writes what it rebuilt beside what `points` said.
"""

import sys
import time
from xml.etree import ElementTree

import numpy as np
import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import JointState, LaserScan, PointCloud2
from std_msgs.msg import String

PATIENCE_S = 240.0
LAST_ANGLE_S = 20.0


def rigid(xyz, rpy):
    """URDF's fixed-axis angles."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    T = np.eye(4)
    T[:3, :3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    T[:3, 3] = xyz
    return T


def fixed(robot, joint):
    origin = robot.find(f"joint[@name='{joint}']/origin")
    return rigid(*([float(word) for word in origin.get(key).split()] for key in ("xyz", "rpy")))


def nanoseconds(header):
    return header.stamp.sec * 10**9 + header.stamp.nanosec


def rebuilt(message, joints, T_world_servo, T_rot_laser):
    ranges = np.array(message.ranges)
    bearing = message.angle_min + message.angle_increment * np.arange(ranges.size)
    time_ns = nanoseconds(message.header) + np.rint(message.time_increment * 1e9 * np.arange(ranges.size))
    times = np.array([t - nanoseconds(message.header) for t, _ in joints], float)
    angle = np.interp(time_ns - nanoseconds(message.header), times, [q for _, q in joints], np.nan, np.nan)
    ranges = np.where((ranges >= message.range_min) & (ranges <= message.range_max), ranges, np.nan)
    local = np.stack([ranges * np.cos(bearing), ranges * np.sin(bearing), 0 * ranges, 1 + 0 * ranges])
    x, y, z, w = T_rot_laser @ local
    turned = np.stack([np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y, z, w])
    return (T_world_servo @ turned)[:3].T


def main(count, out):
    rclpy.init()
    node = rclpy.create_node("somebody_else")
    scans, joints, points, urdf = [], [], {}, []
    node.create_subscription(LaserScan, "scan", scans.append, qos_profile_sensor_data)  # as Nav2 asks

    def angle(message):
        joints.append((nanoseconds(message.header), message.position[0]))

    node.create_subscription(JointState, "joint_states", angle, 1000)
    node.create_subscription(PointCloud2, "points", lambda m: points.update({nanoseconds(m.header): m}), 5)  # as RViz
    kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(String, "robot_description", lambda message: urdf.append(message.data), kept)
    print("listening", flush=True)
    end_s = time.monotonic() + PATIENCE_S
    while not (urdf and len(scans) >= count and len(points) >= count) and time.monotonic() < end_s:
        rclpy.spin_once(node, timeout_sec=0.1)
    last_ns = max(nanoseconds(m.header) + m.time_increment * (len(m.ranges) - 1) * 1e9 for m in scans)
    end_s = time.monotonic() + LAST_ANGLE_S
    while not (joints and max(joints)[0] >= last_ns) and time.monotonic() < end_s:
        rclpy.spin_once(node, timeout_sec=0.05)  # one message at a time: others may wait before the last angle
    robot = ElementTree.fromstring(urdf[0])
    joints.sort()
    chain = fixed(robot, "servo_mount"), fixed(robot, "laser_mount")
    kind = {"names": ["x", "y", "z"], "formats": ["<f4"] * 3, "offsets": [0, 4, 8]}
    said, found = [], []
    for message in scans:
        begin_ns = nanoseconds(message.header)
        end_ns = begin_ns + message.time_increment * (len(message.ranges) - 1) * 1e9
        heard = joints[0][0] <= begin_ns and end_ns <= joints[-1][0]
        if heard and (cloud := points.get(begin_ns)) is not None:  # who joins late has not heard all topics at first
            rows = np.frombuffer(bytes(cloud.data), np.dtype({**kind, "itemsize": cloud.point_step}))
            said.append(np.stack([rows[axis] for axis in "xyz"], axis=1))
            found.append(rebuilt(message, joints, *chain))
    stamps = [nanoseconds(message.header) for message in scans]
    np.savez(out, said=np.concatenate(said), rebuilt=np.concatenate(found), stamp_ns=stamps, lines=len(said))
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
