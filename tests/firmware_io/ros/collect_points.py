"""Somebody else's program: rclpy and NumPy. Keeps the first COUNT messages of `points`, beam by beam.

python collect_points.py COUNT OUT.npz [--ros-args ...]
"""

import sys
import time

import numpy as np
import rclpy
from sensor_msgs.msg import PointCloud2

PATIENCE_S = 240.0
TYPES = {8: "<f8", 7: "<f4", 6: "<u4", 4: "<u2"}


def main(count, out):
    rclpy.init()
    node = rclpy.create_node("collector")
    found = []
    node.create_subscription(PointCloud2, "points", found.append, 5)
    print("listening", flush=True)
    end_s = time.monotonic() + PATIENCE_S
    while len(found) < count and time.monotonic() < end_s:
        rclpy.spin_once(node, timeout_sec=0.1)
    clouds = {}
    for k, message in enumerate(found):
        formats = [TYPES[field.datatype] for field in message.fields]
        places = {"names": [field.name for field in message.fields], "formats": formats}
        kind = np.dtype({**places, "offsets": [f.offset for f in message.fields], "itemsize": message.point_step})
        clouds[f"cloud_{k}"] = np.frombuffer(bytes(message.data), kind).reshape(message.height, message.width)
    np.savez(out, frames=[message.header.frame_id for message in found], **clouds)
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
