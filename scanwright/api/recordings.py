"""From a recording to a cloud, and to the mounting errors of the scanner that made it."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Literal

from scanwright.api.arguments import AnglesLike, Say, TaskLike, as_angle_set, as_task, quiet
from scanwright.design.angles import AngleSet
from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import check_place
from scanwright.firmware_io.assembly.own_body import own_body_of
from scanwright.firmware_io.clouds.formats import check_target
from scanwright.firmware_io.ros import robot_frames

if TYPE_CHECKING:
    from scanwright.firmware_io.assembly.assemble import AssembleSummary
    from scanwright.firmware_io.calibration.calibrate import Calibration
    from scanwright.firmware_io.poses.trajectory import Trajectory
    from scanwright.firmware_io.recording.importer import ImportSummary
    from scanwright.firmware_io.recording.recording import Recording


def import_bag(
    bag: str | Path,
    out: str | Path,
    *,
    scan: str,
    angle: str,
    angle_unit: Literal["deg", "rad"] | None = None,
    hold: bool = False,
    also: Collection[str] = (),
) -> ImportSummary:
    """Bring somebody's ROS 1 or ROS 2 bag into the project's own form: MCAP, /scan and /joint_states.

    Args:
        bag: the bag.
        out: recording to write, `.mcap`.
        scan: TOPIC[:FIELD] of the LaserScan.
        angle: where the servo's angle is: TOPIC[:FIELD], TOPIC:JOINT of a JointState, TOPIC:PARENT:CHILD of
            transforms, or FILE.csv[:COLUMN].
        angle_unit: of that angle; transforms have none.
        hold: the motor stood still during each scan.
        also: topics that come along as they are, such as /odom, /imu and /tf_static for `assemble`.

    Raises:
        RecordingError: the bag is unreadable, has no such topic, or `out` cannot be written.
    """
    from scanwright.firmware_io.recording.importer import import_bag

    return import_bag(Path(bag), Path(out), scan=scan, angle=angle, angle_unit=angle_unit, hold=hold, also=also)


def open_recording(path: str | Path) -> Recording:
    """Open a recording: `joint_log` has the servo's angles, `scans()` gives the scans, `arrays()` all of it as arrays.

    Raises:
        RecordingError: the file is missing, cut off, not of our topics and types, or empty.
    """
    from scanwright.firmware_io.recording.recording import open_recording

    return open_recording(Path(path))


def assemble(
    recording: str | Path,
    angles: AnglesLike,
    out: str | Path,
    *,
    organised: bool = False,
    lag_s: float = 0.0,
    per: Literal["recording", "turn", "half"] = "recording",
    poses: str | None = None,
    imu: str | None = None,
    imu_rpy_deg: tuple[float, float, float] | None = None,
    smooth: bool = True,
    columns: Iterable[str] = ("intensity", "time_s", "joint_rad", "ring"),
    camera: TaskLike | None = None,
    min_range_m: float = 0.0,
    max_range_m: float = math.inf,
    edges_deg: float | None = None,
    outliers: float | None = None,
    voxel_m: float | None = None,
    normals: bool = False,
) -> AssembleSummary:
    """Turn a recording into a cloud: each beam at its own servo angle, through the frames of an angle set.

    Where an own_body.npz stands beside the file of the angle set, beams that end on the scanner itself are left out.

    Args:
        recording: `.mcap`.
        angles: angle set of the scanner that made it.
        out: cloud to write, PLY, PCD, LAS, LAZ, E57, NPZ or XYZ by its suffix; `out_000.ply` and so on where there are
            several.
        organised: keep beam i of every scan in its row i, NaN where it became no point; else only points.
        lag_s: time by which the angle log is late.
        per: one cloud for the recording, or for each (half) turn, which ends where the axis turns back, too: a full
            scan of a sweep, there and back, is two.
        poses: where the platform was: a TUM or CSV file, or TOPIC[:PARENT:CHILD] of the recording (/tf, /odom).
        imu: how it turned between two poses: a topic of `sensor_msgs/Imu`, or a CSV file with the gyro's wx wy wz.
        imu_rpy_deg: roll, pitch and yaw of the IMU on the platform that the poses are of; from /tf_static of the
            recording if not given.
        smooth: smooth the steps of the encoder where that helps.
        columns: of each point beside x y z.
        camera: a task whose [camera] the points are coloured with.
        min_range_m: beams that are shorter are left out.
        max_range_m: beams that are longer are left out.
        edges_deg: leave out beams that hang between a near and a far surface, both seen that grazing; 8 is usual.
        outliers: leave out points that stand alone, beyond so many standard deviations; 2 is usual.
        voxel_m: one point to a voxel of this edge.
        normals: add columns nx ny nz, towards the scanner.

    Raises:
        RecordingError: the recording is unreadable, no beam of it becomes a point, or `out` is no format that holds
            this. Nothing is written then.
        InstallError: the format needs the extra `clouds`.
    """
    from scanwright.firmware_io.assembly.assemble import BeamLimits, assemble_recording
    from scanwright.firmware_io.assembly.finish import Finish, finish_clouds, seen_from

    recording, scanner, target = Path(recording), as_angle_set(angles), Path(out)
    check_target(target)
    limits, finish = BeamLimits(min_range_m, max_range_m, edges_deg), Finish(outliers, voxel_m, normals)
    if organised and finish.thins:
        raise RecordingError(f"{target}: organised: every beam keeps its row, so none can go: leave out --organised")
    platform, notes = _platform(recording, poses, imu, imu_rpy_deg)
    paint = None
    if camera is not None:
        from scanwright.firmware_io.colour.paint import painter

        paint = painter(as_task(camera), recording, scanner, platform, lag_s, organised=organised)
    with ExitStack() as stack:
        finished = target.suffix.lower() != ".ply" or finish != Finish()
        folder = Path(stack.enter_context(TemporaryDirectory(dir=target.parent))) if finished else target.parent
        summary = assemble_recording(
            recording,
            scanner,
            folder / f"{target.stem}.ply" if finished else target,
            organised=organised or paint is not None,  # neighbours tell how surfaces lie to the camera
            lag_s=lag_s,
            per=per,
            poses=platform,
            own_body=None if isinstance(angles, AngleSet) else own_body_of(Path(angles)),
            smooth=smooth,
            columns=columns,
            beams=limits,
        )
        if paint is not None:
            notes += [paint(cloud).line(cloud) for cloud in summary.clouds]
            summary = summary if organised else replace(summary, rows=summary.points, width=0, padding=0)
        summary = replace(summary, notes=(*summary.notes, *notes))
        if finished:
            summary = finish_clouds(summary, target, finish, seen_from(scanner, platform), organised=organised)
    return summary


def _platform(
    recording: Path, poses: str | None, imu: str | None, imu_rpy_deg: tuple[float, float, float] | None
) -> tuple[Trajectory | None, list[str]]:
    """Where the platform was, how it turned between two poses if an IMU tells, and what is to be said of that."""
    from scanwright.firmware_io.poses.pose_files import load_trajectory

    trajectory = None if poses is None else load_trajectory(poses, recording)
    if imu is None:
        return trajectory, []
    if trajectory is None:
        raise RecordingError("imu: a gyro goes from pose to pose; name the --poses too")
    from scanwright.firmware_io.poses.gyro import oriented
    from scanwright.firmware_io.poses.gyro_files import imu_mount, load_gyro

    gyro = load_gyro(imu, recording)
    return oriented(trajectory, gyro, imu_mount(imu_rpy_deg, gyro, trajectory.platform, recording))


def calibrate(
    recordings: Sequence[str | Path],
    angles: AnglesLike,
    out: str | Path,
    *,
    one_place: bool = False,
    say: Say = quiet,
) -> Calibration:
    """Find a scanner's mounting errors from scans of any scene with walls; no targets needed.

    Where an own_body.npz stands beside the file of the angle set, beams that end on the scanner itself are left out.
    Where its scanner.urdf stands there, it is written again with the true frames beside `out`.

    Args:
        recordings: of scenes that stand still.
        angles: angle set of the scanner, as designed.
        out: calibrated angle set to write, `.json`.
        one_place: the scanner stood still from the first recording to the last.
        say: is told what is being done.

    Raises:
        RecordingError: a recording is unreadable, they do not show the mounting errors, or `out` is the file of
            `angles`. Nothing is written then.
    """
    from scanwright.firmware_io.calibration.calibrate import calibrate_recordings

    before, target = as_angle_set(angles), Path(out)
    check_place(target, RecordingError)
    if not isinstance(angles, AngleSet) and target.resolve() == Path(angles).resolve():
        raise RecordingError(f"{target}: holds the angles that are to be calibrated: write to another file (-o)")
    own_body = None if isinstance(angles, AngleSet) else own_body_of(Path(angles))
    beside = None if isinstance(angles, AngleSet) else Path(angles).with_name(robot_frames.URDF)
    urdf = robot_frames.calibrated_urdf_place(target)
    designed = beside if beside and beside.is_file() and beside.resolve() != urdf.resolve() else None
    if designed:
        robot_frames.with_frames(robot_frames.read_urdf(designed), before, str(designed))  # refused before the work
    paths = [Path(recording) for recording in recordings]
    found = calibrate_recordings(
        paths, before, target, one_place=one_place, own_body=own_body, progress=lambda step, _=None: say(step)
    )
    if designed:
        robot_frames.write_calibrated_urdf(designed, urdf, found.angles)
    fixed = robot_frames.fixed_frames(found.angles)
    notes = [*robot_frames.what_changed(before, found.angles), *([f"wrote {urdf}"] if designed else [])]
    notes += [f"  {frame.command()}" for frame in fixed]
    notes += ["as parameters of a launch file:", *(f"  {frame.launch_parameters()}" for frame in fixed)]
    return replace(found, frames=tuple(notes))
