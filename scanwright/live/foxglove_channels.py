"""A scan for Foxglove: the channels of the recording, and beside them points, frames and the scanner's description.

    /scan /joint_states    as recorded
    /points                sensor_msgs/PointCloud2, one message a scan, in `world`
    /tf                    world servo rot laser, at every angle of the servo
    /robot_description     std_msgs/String, the URDF, if the build has one; once a second, for those who come late

All are ROS 2 messages in CDR with their definitions, so that Foxglove needs nothing else. They go to whoever listens to
the context of the foxglove-sdk that they are made in: a server, or a file.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import foxglove
import numpy as np

from design import frames
from design.angles import AngleSet
from firmware_io.assembly.own_body import OwnBody
from firmware_io.assembly.streaming import Assembler, ScanPoints
from firmware_io.recording import ros_messages
from firmware_io.recording.recording import JOINT_TOPIC, SCAN_TOPIC
from firmware_io.ros.point_rows import point_rows
from firmware_io.ros.robot_frames import fixed_frames
from firmware_io.samples import JointSample, Scan

_DESCRIBED_NS = 1_000_000_000
_ANEW_NS = 1_000_000_000  # without an angle: the devices stood still, and began anew
_TYPES = {
    SCAN_TOPIC: ros_messages.LASER_SCAN,
    JOINT_TOPIC: ros_messages.JOINT_STATE,
    "/points": ros_messages.POINT_CLOUD,
    "/tf": ros_messages.TRANSFORMS,
    "/robot_description": ros_messages.TEXT,
}


class FoxgloveChannels:
    """A `Watch` that logs to the channels of a context."""

    def __init__(
        self,
        angles: AngleSet,
        own_body: OwnBody | None,
        urdf: str | None,
        context: foxglove.Context,
        *,
        smooth: bool = True,
        wall_minus_ns: int = 0,
    ) -> None:
        """Open the channels.

        Args:
            angles: angle set in use.
            own_body: beams that end on the scanner; None where that is not known.
            urdf: description with the frames of `angles`; None for none.
            context: whose sinks hear of it.
            smooth: smooth the steps of the encoder in the points.
            wall_minus_ns: added to every time; what it takes from the clock of the devices to time since 1970.
        """
        self._place = partial(Assembler, angles, own_body=own_body, smooth=smooth)
        self._fixed = [(one.parent, one.child, one.T_parent_child) for one in fixed_frames(angles)]
        self._urdf, self._wall_minus_ns = urdf, wall_minus_ns
        self.begin()
        self._channels = {
            topic: foxglove.Channel(
                topic,
                schema=foxglove.Schema(name=kind, encoding="ros2msg", data=ros_messages.definition(kind).encode()),
                message_encoding="cdr",
                context=context,
            )
            for topic, kind in _TYPES.items()
        }

    def begin(self) -> None:
        """Begin anew: nothing of what came before is assembled with what comes."""
        self._assembler, self._described_ns, self._joint_ns = self._place(), -(2**62), -(2**62)

    @property
    def heard(self) -> bool:
        """Whether somebody listens to any of the channels."""
        return any(channel.has_sinks() for channel in self._channels.values())

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

    def told(self, line: str) -> None:
        """Nothing: no channel is of words."""

    def close(self) -> None:
        """Log the points of the scans that still wait for their angles."""
        self._points(self._assembler.finish())

    def _push(self, thing: Scan | JointSample) -> None:
        self._points(self._assembler.push(thing))

    def _points(self, lines: list[ScanPoints]) -> None:
        for line in lines:
            at_ns = line.scan.stamp_ns + self._wall_minus_ns
            self._log("/points", ros_messages.encode_points(point_rows(line), "world", at_ns), at_ns)

    def _log(self, topic: str, data: bytes, time_ns: int) -> None:
        self._channels[topic].log(data, log_time=time_ns)
