"""`scanwright ros2`: ROS 2 node of a build folder's scanner, or of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from scanwright.design.angles import angles_in_use
from scanwright.design.progress import Progress
from scanwright.firmware_io.assembly.own_body import own_body_of
from scanwright.firmware_io.recording.mcap_chunks import read_note, rests_in_scans
from scanwright.firmware_io.ros.drive import drive
from scanwright.firmware_io.ros.node import PublishedScanner, Publishing, running_node
from scanwright.firmware_io.ros.replay import replay
from scanwright.firmware_io.ros.robot_frames import description
from scanwright.firmware_io.scan.live_feed import UNWATCHED, Watch
from scanwright.firmware_io.scan.plan import ScanPlan


def serve_devices(
    out: Path,
    plan: ScanPlan,
    ros_args: Sequence[str],
    progress: Progress,
    points: Publishing,
    viewer: Watch = UNWATCHED,
) -> None:
    """Publish a scan until Ctrl-C; the devices are stopped on every exit.

    `plan` is endless; `ros_args` are those of ROS 2, such as `--ros-args -r scan:=front/scan`; `viewer` receives the
    scan too.

    Raises:
        TaskError: the folder has no angle set.
        RecordingError: its URDF is not of a build.
    """
    at_rest = plan.motion.mode == "stop_and_go"
    with running_node(_scanner(out, points, at_rest), ros_args, replayed=False) as node:
        drive(plan, node, progress, viewer)


def serve_recording(
    out: Path, recording: Path, ros_args: Sequence[str], progress: Progress, points: Publishing, *, rate: float = 1.0
) -> None:
    """Publish a recording in real time, with its clock on /clock; arguments and errors as for `serve_devices`."""
    at_rest = rests_in_scans(read_note(recording))
    with running_node(_scanner(out, points, at_rest), ros_args, replayed=True) as node:
        progress("waiting for a subscriber to scan, joint_states or points")
        node.await_subscriber()
        scans, angles = replay(recording, node, rate=rate)
        node.close()
        progress(f"published {scans:,} scans and {angles:,} angles of {recording}")
        node.flush()


def _scanner(out: Path, points: Publishing, at_rest: bool) -> PublishedScanner:
    in_use = angles_in_use(out)
    return PublishedScanner(
        angles=in_use.angles,
        own_body=own_body_of(in_use.path),
        urdf=description(out, in_use.angles),
        points=replace(points, smooth=points.smooth and not at_rest),
    )
