"""Somebody else's program: stops the scanner by its parameter, asks for a senseless period, starts it again."""

import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from sensor_msgs.msg import PointCloud2

PATIENCE_S = 240.0


def main():
    rclpy.init()
    node = rclpy.create_node("steering")
    client = AsyncParameterClient(node, "scanwright")
    assert client.wait_for_services(PATIENCE_S)
    told, points = [], []
    node.create_subscription(DiagnosticArray, "/diagnostics", lambda message: told.append(message.status[0]), 10)
    node.create_subscription(PointCloud2, "points", lambda _: points.append(time.monotonic()), 5)

    def until(condition):
        end_s = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < end_s
            rclpy.spin_once(node, timeout_sec=0.1)

    def put(name, value):
        asked = client.set_parameters([Parameter(name, value=value)])
        until(asked.done)
        return asked.result().results[0].successful

    def running():
        return {pair.key: pair.value for pair in told[-1].values}["running"] if told else None

    until(lambda: points and running() == "True")
    assert put("running", False)
    until(lambda: running() == "False")
    assert not put("period_s", -1.0)
    assert put("period_s", 4.0) and put("running", True)
    restarted_s = time.monotonic()
    until(lambda: points[-1] > restarted_s and running() == "True" and told[-1].level == b"\0")
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
