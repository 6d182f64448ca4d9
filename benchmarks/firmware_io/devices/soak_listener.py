"""Somebody who listens to `scan` and tells each second how many came, and the largest gap between their stamps [s].

For `soak`; rclpy and nothing of ours.
"""

from __future__ import annotations

import time
from itertools import pairwise
from typing import Any

import rclpy
from rclpy.qos import QoSProfile
from sensor_msgs.msg import LaserScan


def main() -> None:
    """Until it is killed."""
    rclpy.init()
    node = rclpy.create_node("soak_listener")
    stamps_ns: list[int] = []

    def heard(message: Any) -> None:
        stamps_ns.append(message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec)

    node.create_subscription(LaserScan, "scan", heard, QoSProfile(depth=1000))
    told_s, count = time.monotonic(), 0
    while True:
        rclpy.spin_once(node, timeout_sec=0.1)
        if time.monotonic() - told_s >= 1.0 and len(stamps_ns) > 1:
            gap_ns = max(after - before for before, after in pairwise(stamps_ns))
            count += len(stamps_ns) - 1
            print(count, gap_ns / 1e9, flush=True)
            stamps_ns, told_s = stamps_ns[-1:], time.monotonic()


if __name__ == "__main__":
    main()
