"""ROS 2 node that publishes a scan in real time.

    scan               sensor_msgs/LaserScan      in `laser`; the stamp is the time of the first beam
    joint_states       sensor_msgs/JointState     `spin_joint`, as read from the encoder
    points             sensor_msgs/PointCloud2    one message per scan, in `world` or `rot`, or per turn, in `world`;
                                                  de-skewed, a row for every beam
    robot_description  std_msgs/String            the URDF with the frames in use, if the build has one; latched
    tf, tf_static      tf2_msgs/TFMessage         world servo rot laser, if ROS 2 has tf2_msgs
    diagnostics        diagnostic_msgs/DiagnosticArray    once a second, if ROS 2 has diagnostic_msgs
    clock              rosgraph_msgs/Clock        of a replayed recording

Messages are published as bytes of CDR, like those of recordings. Publishers are reliable, as RViz requires; this also
serves subscribers with best effort. Parameters `running` and
`period_s` start, stop and change the motion. Requires the robot's ROS 2, or the wheels of the extra.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from importlib.util import find_spec
from threading import Event, Thread
from typing import Any, Literal

import numpy as np
import rclpy
from numpy.typing import NDArray
from rcl_interfaces.msg import SetParametersResult
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, LaserScan, PointCloud2
from std_msgs.msg import String

from scanwright.design import frames
from scanwright.design.angles import AngleSet
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.assembly.own_body import OwnBody
from scanwright.firmware_io.assembly.streaming import Assembler, ScanPoints
from scanwright.firmware_io.recording import ros_messages
from scanwright.firmware_io.ros.drive import Interrupted
from scanwright.firmware_io.ros.point_rows import Turns, in_rot, point_rows, turn_rows
from scanwright.firmware_io.ros.robot_frames import fixed_frames
from scanwright.firmware_io.samples import JointSample, Scan

PointsFrame = Literal["world", "rot"]
_DIAGNOSED_S = 1.0  # between two messages (REP 107: 1 Hz)
_SILENT_S = 2.0  # without a scan until the scanner is stale
_SETTLED_S = 1.0  # without a further subscription
_FLUSHED_S = 5.0  # for slow subscribers
_LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@dataclass(frozen=True, slots=True)
class Publishing:
    """Options of the node."""

    smooth: bool = True  # smooth the steps of the encoder in the points
    per_turn: bool = False  # one message of points per turn, not per scan
    frame: PointsFrame = "world"  # of the points
    publish_tf: bool = True  # publish the frames; False if `robot_state_publisher` does

    def __post_init__(self) -> None:
        if self.per_turn and self.frame == "rot":
            raise RecordingError(
                "frame = rot, per_turn: a frame that rotates cannot hold the points of a turn; publish per scan"
            )


@dataclass(frozen=True, slots=True, eq=False)
class PublishedScanner:
    """The published scanner."""

    angles: AngleSet  # angle set in use
    own_body: OwnBody | None  # self-occlusion mask, if known
    urdf: str | None  # its description with the frames of `angles`
    points: Publishing


class ScannerNode:
    """A `Steered` watch that publishes. Its methods are called by the driving thread; another one sets parameters."""

    def __init__(self, scanner: PublishedScanner, *, replayed: bool) -> None:
        """`replayed`: times are those of a recording, not of this computer's monotonic clock."""
        self._scanner, self._replayed = scanner, replayed
        self._wall_minus_ns = 0 if replayed else time.time_ns() - time.monotonic_ns()
        self.node = rclpy.create_node("scanwright")
        self.running, self.period_s, self.scans = True, 0.0, 0
        self._changed = Event()
        self._beams, self._status, self._failed = 0, "waiting for the devices", False
        self._scanned_s = self._diagnosed_s = time.monotonic()
        self.begin()
        make = self.node.create_publisher
        self._scan = make(LaserScan, "scan", 10)
        self._joint = make(JointState, "joint_states", 100)
        self._points = make(PointCloud2, "points", 10)
        self._clock = make(Clock, "/clock", 10) if replayed else None
        self._tf = self._tf_publisher() if scanner.points.publish_tf and find_spec("tf2_msgs") else None
        self._diagnostics = self._diagnostics_publisher() if find_spec("diagnostic_msgs") else None
        if scanner.urdf is not None:
            self._description = make(String, "robot_description", _LATCHED)
            self._description.publish(String(data=scanner.urdf))
        self.node.declare_parameter("running", True)
        self.node.declare_parameter("period_s", 0.0)
        self.node.add_on_set_parameters_callback(self._set)

    def begin(self) -> None:
        """Reset the assembly before a new run of the devices."""
        self._assembler = Assembler(
            self._scanner.angles, own_body=self._scanner.own_body, smooth=self._scanner.points.smooth
        )
        self._turns = Turns()
        self._changed.clear()

    def joint(self, time_ns: int, position_rad: float) -> None:
        """See `Watch`."""
        self._check()
        stamp_ns = time_ns + self._wall_minus_ns
        if self._clock is not None:
            self._clock.publish(Clock(clock=Time(nanoseconds=stamp_ns).to_msg()))
        self._joint.publish(ros_messages.encode_joint(stamp_ns, position_rad))
        if self._tf is not None:
            self._tf(stamp_ns, position_rad)
        self._push(JointSample(time_ns, position_rad))
        if time.monotonic() - self._diagnosed_s > _DIAGNOSED_S:
            self.diagnose()

    def scan(self, scan: Scan) -> None:
        """See `Watch`."""
        self._check()
        stamped = replace(scan, stamp_ns=scan.stamp_ns + self._wall_minus_ns)
        self._scan.publish(ros_messages.encode_scan(stamped))
        self.scans += 1
        self._scanned_s = time.monotonic()
        self._push(scan)

    def message(self, line: str) -> None:
        """See `Watch`."""
        self._check()
        self._status = line

    def failed(self, line: str) -> None:
        """Report a failure in the diagnostics until the next scan."""
        self._status, self._failed = line, True
        self.node.get_logger().error(line)

    def close(self) -> None:
        """Publish the scans that wait for their angles."""
        for line in self._assembler.finish():
            self._place(line)
        self._publish_turns(self._turns.finish())

    def await_subscriber(self) -> None:
        """Wait for the first subscriber, until it has subscribed to all its topics."""
        count, since_s = 0, time.monotonic()
        while not count or time.monotonic() - since_s < _SETTLED_S:
            now = sum(publisher.get_subscription_count() for publisher in (self._scan, self._joint, self._points))
            if now != count:
                count, since_s = now, time.monotonic()
            time.sleep(0.02)

    def flush(self) -> None:
        """Wait until the subscribers have received all messages."""
        for publisher in (self._scan, self._joint, self._points):
            publisher.wait_for_all_acked(Duration(seconds=_FLUSHED_S))

    def wait(self, seconds: float) -> None:
        """Publish the diagnostics, and wait for a change of the parameters, at most `seconds`."""
        self.diagnose()
        self._changed.wait(seconds)
        self._changed.clear()

    def diagnose(self) -> None:
        """Publish the diagnostics."""
        now_s = time.monotonic()
        self._diagnosed_s = now_s
        if self._diagnostics is None:
            return
        silent = now_s - self._scanned_s > _SILENT_S
        self._failed &= silent
        level = 2 if self._failed else 3 if silent and self.running else 0
        left_out = {f"left out: {reason}": count for reason, count in self._assembler.left_out.items()}
        values = {"scans": self.scans, "beams": self._beams, "running": self.running, **left_out}
        self._diagnostics.publish(_diagnostics(level, self._status, values))

    def _check(self) -> None:
        if self._changed.is_set():
            raise Interrupted

    def _push(self, thing: Scan | JointSample) -> None:
        for line in self._assembler.push(thing):
            self._place(line)

    def _place(self, line: ScanPoints) -> None:
        self._beams += line.scan.range_m.size
        if self._scanner.points.per_turn:
            self._publish_turns(self._turns.push(line))
            return
        if self._scanner.points.frame == "rot":
            line = in_rot(line, self._scanner.angles)
        self._publish_points(point_rows(line), line.scan.stamp_ns)

    def _publish_turns(self, turns: list[list[ScanPoints]]) -> None:
        for lines in turns:
            self._publish_points(turn_rows(lines), lines[0].scan.stamp_ns)

    def _publish_points(self, rows: NDArray[np.void], stamp_ns: int) -> None:
        frame = self._scanner.points.frame
        self._points.publish(ros_messages.encode_points(rows, frame, stamp_ns + self._wall_minus_ns))

    def _set(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name == "period_s" and not 0 <= parameter.value <= 3600:
                return SetParametersResult(successful=False, reason=f"period_s = {parameter.value}: 0 to 3600")
        for parameter in parameters:
            if parameter.name in ("running", "period_s") and not self._replayed:
                setattr(self, parameter.name, parameter.value)
                self._changed.set()
        return SetParametersResult(successful=True)

    def _tf_publisher(self) -> Callable[[int, float], None]:
        """Publish the fixed frames, and return a function that publishes the rotating one."""
        from tf2_msgs.msg import TFMessage

        self._tf_static = self.node.create_publisher(TFMessage, "/tf_static", _LATCHED)
        fixed = [(f.parent, f.child, f.T_parent_child) for f in fixed_frames(self._scanner.angles)]
        self._tf_static.publish(ros_messages.encode_transforms(fixed, time.time_ns()))
        turning = self.node.create_publisher(TFMessage, "/tf", 100)

        def publish(stamp_ns: int, position_rad: float) -> None:
            turned = ("servo", "rot", frames.rigid(frames.Rz(position_rad), np.zeros(3)))
            turning.publish(ros_messages.encode_transforms([turned], stamp_ns))

        return publish

    def _diagnostics_publisher(self) -> Any:
        from diagnostic_msgs.msg import DiagnosticArray

        return self.node.create_publisher(DiagnosticArray, "/diagnostics", 10)


def _diagnostics(level: int, message: str, values: Mapping[str, object]) -> Any:
    """Return a `diagnostic_msgs/DiagnosticArray`; level 0 is good, 1 a warning, 2 an error, 3 stale."""
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

    pairs = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    status = DiagnosticStatus(level=bytes([level]), name="scanwright: scanner", message=message, values=pairs)
    array = DiagnosticArray(status=[status])
    array.header.stamp = Time(nanoseconds=time.time_ns()).to_msg()
    return array


@contextmanager
def running_node(scanner: PublishedScanner, ros_args: Sequence[str], *, replayed: bool) -> Iterator[ScannerNode]:
    """Run the node during the body, with a thread for its parameters."""
    rclpy.init(args=["scanwright", *ros_args], signal_handler_options=SignalHandlerOptions.NO)
    node = ScannerNode(scanner, replayed=replayed)
    executor = SingleThreadedExecutor()
    executor.add_node(node.node)

    def spin() -> None:
        with suppress(ExternalShutdownException):
            executor.spin()

    thread = Thread(target=spin, name="ros", daemon=True)
    thread.start()
    try:
        yield node
    finally:
        executor.shutdown()
        thread.join(timeout=5.0)
        node.node.destroy_node()
        rclpy.try_shutdown()
