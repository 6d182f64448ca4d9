"""A scan for Foxglove: the channels of the recording, points, frames and the scanner's description.

/scan /joint_states    as recorded
/points                sensor_msgs/PointCloud2, one message a scan, in `world`
/tf                    world servo rot laser, at every angle of the servo
/robot_description     std_msgs/String, the URDF, if the build has one; once a second
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from scanwright.design import frames
from scanwright.design.angles import AngleSet
from scanwright.firmware_io.assembly.own_body import OwnBody
from scanwright.firmware_io.assembly.streaming import Assembler, ScanPoints
from scanwright.firmware_io.recording import ros_messages
from scanwright.firmware_io.recording.recording import JOINT_TOPIC, SCAN_TOPIC
from scanwright.firmware_io.ros.point_rows import point_rows
from scanwright.firmware_io.ros.robot_frames import fixed_frames
from scanwright.firmware_io.samples import JointSample, Scan

_DESCRIBED_NS = 1_000_000_000  # a viewer that connects later waits at most a second for the description
_ANEW_NS = 1_000_000_000  # without an angle: the devices were restarted
Log = Callable[[str, bytes, int], None]  # called with a topic, a message and its time [ns]

_TYPES = {
    SCAN_TOPIC: ros_messages.LASER_SCAN,
    JOINT_TOPIC: ros_messages.JOINT_STATE,
    "/points": ros_messages.POINT_CLOUD,
    "/tf": ros_messages.TRANSFORMS,
    "/robot_description": ros_messages.TEXT,
}


def channels() -> dict[str, tuple[str, str]]:
    """Return the channels: topic -> name and definition of its ROS 2 message."""
    return {topic: (kind, ros_messages.definition(kind)) for topic, kind in _TYPES.items()}


class FoxgloveChannels:
    """A `Watch` that logs to the channels."""

    def __init__(
        self,
        angles: AngleSet,
        own_body: OwnBody | None,
        urdf: str | None,
        log: Log,
        *,
        smooth: bool = True,
        wall_minus_ns: int = 0,
    ) -> None:
        """`smooth`: smooth the encoder steps; `wall_minus_ns`: from the clock of the devices to time since 1970."""
        self._place = partial(Assembler, angles, own_body=own_body, smooth=smooth)
        self._fixed = [(one.parent, one.child, one.T_parent_child) for one in fixed_frames(angles)]
        self._urdf, self._wall_minus_ns = urdf, wall_minus_ns
        self._log = log
        self.begin()

    def begin(self) -> None:
        """Start again: earlier data are not assembled with later ones."""
        self._assembler, self._described_ns, self._joint_ns = self._place(), -(2**62), -(2**62)

    def joint(self, time_ns: int, position_rad: float) -> None:
        """See `Watch`."""
        at_ns = time_ns + self._wall_minus_ns
        if self._urdf is not None and at_ns - self._described_ns >= _DESCRIBED_NS:
            self._described_ns = at_ns
            self._log("/robot_description", ros_messages.encode_text(self._urdf), at_ns)
        self._log(JOINT_TOPIC, ros_messages.encode_joint(at_ns, position_rad), at_ns)
        turned = ("servo", "rot", frames.rigid(frames.Rz(position_rad), np.zeros(3)))
        self._log("/tf", ros_messages.encode_transforms([*self._fixed, turned], at_ns), at_ns)
        if at_ns - self._joint_ns > _ANEW_NS:
            self.close()
            self._assembler = self._place()
        self._joint_ns = at_ns
        self._push(JointSample(time_ns, position_rad))

    def scan(self, scan: Scan) -> None:
        """See `Watch`."""
        at_ns = scan.stamp_ns + self._wall_minus_ns
        self._log(SCAN_TOPIC, ros_messages.encode_scan(replace(scan, stamp_ns=at_ns)), at_ns)
        self._push(scan)

    def message(self, line: str) -> None:
        """Ignore: no channel has text."""

    def close(self) -> None:
        """Log the points of the scans that wait for their angles."""
        self._points(self._assembler.finish())

    def _push(self, thing: Scan | JointSample) -> None:
        self._points(self._assembler.push(thing))

    def _points(self, lines: list[ScanPoints]) -> None:
        for line in lines:
            at_ns = line.scan.stamp_ns + self._wall_minus_ns
            self._log("/points", ros_messages.encode_points(point_rows(line), "world", at_ns), at_ns)
