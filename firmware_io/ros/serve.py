"""`scanwright ros2`: a build folder's scanner, or a recording of it, as a node of ROS 2."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from design.angles import angles_in_use
from firmware_io.assembly.own_body import own_body_beside
from firmware_io.recording.mcap_chunks import read_note
from firmware_io.recording.metadata import NOTE, held_by
from firmware_io.ros.drive import drive
from firmware_io.ros.node import PublishedScanner, running_node
from firmware_io.ros.replay import replay
from firmware_io.ros.robot_frames import description
from firmware_io.scan.plan import ScanPlan

Say = Callable[[str], None]


def serve_devices(
    out: Path, plan: ScanPlan, ros_args: Sequence[str], say: Say, *, smooth: bool = True, publish_tf: bool = True
) -> None:
    """Publish what the devices say until Ctrl-C; they are stopped on every way out.

    Args:
        out: build folder.
        plan: endless.
        ros_args: as nodes of ROS 2 take them, `--ros-args -r scan:=front/scan` and the like.
        say: is told what is going on.
        smooth: smooth the steps of the encoder in the points.
        publish_tf: publish the frames; not where `robot_state_publisher` does.

    Raises:
        TaskError: the folder has no angle set.
        RecordingError: its URDF is none of ours.
    """
    held = plan.motion.mode == "stop_and_go"
    with running_node(_scanner(out, smooth and not held, publish_tf), ros_args, replayed=False) as node:
        drive(plan, node, say)


def serve_recording(
    out: Path,
    recording: Path,
    ros_args: Sequence[str],
    say: Say,
    *,
    rate: float = 1.0,
    smooth: bool = True,
    publish_tf: bool = True,
) -> None:
    """Publish a recording at its own pace, with its clock on /clock; the other arguments as for `serve_devices`.

    Raises:
        RecordingError: the recording is unreadable, or the rate is none.
    """
    held = held_by(read_note(recording, NOTE))
    with running_node(_scanner(out, smooth and not held, publish_tf), ros_args, replayed=True) as node:
        say("waiting for somebody to listen to scan, joint_states or points")
        node.await_subscriber()
        scans, angles = replay(recording, node, rate=rate)
        node.close()
        say(f"published {scans:,} scans and {angles:,} angles of {recording}")
        node.flush()


def _scanner(out: Path, smooth: bool, publish_tf: bool) -> PublishedScanner:
    in_use = angles_in_use(out)
    return PublishedScanner(
        in_use.angles, own_body_beside(in_use.path), description(out, in_use.angles), smooth, publish_tf
    )
