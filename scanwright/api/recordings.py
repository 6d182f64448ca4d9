"""From a recording to a cloud, and to the mounting errors of its scanner."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from scanwright.api.arguments import AnglesLike, as_angle_set, as_task, with_say
from scanwright.design.angles import AngleSet
from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import check_place
from scanwright.design.progress import Progress, no_progress
from scanwright.firmware_io.assembly.options import DEFAULT, AssembleOptions
from scanwright.firmware_io.assembly.own_body import own_body_of
from scanwright.firmware_io.clouds.formats import check_target
from scanwright.firmware_io.recording.import_checks.corrections import Corrections
from scanwright.firmware_io.ros import robot_frames

if TYPE_CHECKING:
    from scanwright.firmware_io.assembly.assemble import AssembleSummary
    from scanwright.firmware_io.calibration.calibrate import Calibration
    from scanwright.firmware_io.poses.trajectory import Trajectory
    from scanwright.firmware_io.recording.importer import ImportSummary
    from scanwright.firmware_io.recording.recording import Recording


def import_bag(
    bag: str | Path | Sequence[str | Path],
    out: str | Path,
    *,
    scan: str,
    angle: str,
    angle_unit: str | None = None,
    hold: bool = False,
    also: Collection[str] = (),
    corrections: Corrections | None = None,
) -> ImportSummary:
    """Convert a ROS 1 or ROS 2 bag to a recording: MCAP with /scan and /joint_states.

    Args:
        bag: the bag, or all parts of a split one.
        out: recording to write, `.mcap`.
        scan: TOPIC[:FIELD] of the LaserScan.
        angle: joint angle: TOPIC[:FIELD], TOPIC:JOINT of a JointState, TOPIC:PARENT:CHILD of
            transforms, or FILE.csv[:COLUMN].
        angle_unit: deg, rad, or counts such as 4096/turn; transforms and quaternions have none.
        hold: the axis was at rest during each scan.
        also: topics to copy, such as /odom, /imu and /tf_static for `assemble`.
        corrections: of the recording, as its checks offer them.

    Raises:
        RecordingError: the bag is unreadable, has no such topic, or `out` cannot be written.

    Example:
        >>> import scanwright as sw
        >>> summary = sw.import_bag("turn.bag", "again.mcap", scan="/scan", angle="/joint_states", angle_unit="rad")
        >>> summary.out
        PosixPath('again.mcap')
    """
    from scanwright.firmware_io.recording.importer import import_bag

    bags = [Path(bag)] if isinstance(bag, str | Path) else [Path(part) for part in bag]
    chosen = corrections or Corrections()
    return import_bag(
        bags, Path(out), scan=scan, angle=angle, angle_unit=angle_unit, hold=hold, also=also, corrections=chosen
    )


def open_recording(path: str | Path) -> Recording:
    """Open a recording: `joint_log` has the joint angles, `scans()` yields the scans, `arrays()` returns all as arrays.

    Raises:
        RecordingError: the file is missing, truncated, without the topics and types of a recording, or empty.

    Example:
        >>> import scanwright as sw
        >>> recording = sw.open_recording("turn.mcap")
        >>> sum(1 for _ in recording.scans()) == len(recording.arrays().range_m)
        True
    """
    from scanwright.firmware_io.recording.recording import open_recording

    return open_recording(Path(path))


def assemble(
    recording: str | Path,
    angles: AnglesLike,
    out: str | Path,
    options: AssembleOptions = DEFAULT,
    **fields: Any,
) -> AssembleSummary:
    """Assemble a point cloud from a recording.

    If own_body.npz is next to the file of the angle set, beams that end on the scanner itself are dropped.

    Args:
        recording: `.mcap`.
        angles: angle set of the scanner that made it.
        out: cloud to write, PLY, PCD, LAS, LAZ, E57, NPZ or XYZ by its suffix; `out_000.ply` and so on if there are
            several.
        options: how to assemble.
        fields: fields of `AssembleOptions` as keywords, such as `voxel_m=0.05`.

    Raises:
        RecordingError: the recording is unreadable, no beam becomes a point, options contradict each other, or `out`
            is no format of clouds. Nothing is written then.
        InstallError: the format needs the extra `clouds`.

    Example:
        >>> import scanwright as sw
        >>> summary = sw.assemble("turn.mcap", "angles.json", "cloud.ply")
        >>> summary.beams == summary.points + sum(summary.left_out.values())
        True
    """
    from scanwright.firmware_io.assembly.assemble import assemble_recording
    from scanwright.firmware_io.assembly.finish import finish_clouds, seen_from

    options = replace(options, **fields)
    recording, scanner, target, organised = Path(recording), as_angle_set(angles), Path(out), options.organised
    check_target(target)
    if organised and options.thins:
        raise RecordingError("`organised` cannot be combined with `outliers` or `voxel_m`, which drop beams")
    platform, remarks = _platform(recording, options)
    paint = None
    if options.camera is not None:
        from scanwright.firmware_io.colour.paint import painter

        paint = painter(as_task(options.camera), recording, scanner, platform, options.lag_s, organised=organised)
        options = replace(options, organised=True)  # neighbours show how surfaces are turned to the camera
    own_body = None if isinstance(angles, AngleSet) else own_body_of(Path(angles))
    with ExitStack() as stack:
        finished = target.suffix.lower() != ".ply" or options.thins or options.normals
        folder = Path(stack.enter_context(TemporaryDirectory(dir=target.parent))) if finished else target.parent
        cloud = folder / f"{target.stem}.ply" if finished else target
        summary = assemble_recording(recording, scanner, cloud, options, platform=platform, own_body=own_body)
        if paint is not None:
            remarks += [paint(cloud).line(cloud) for cloud in summary.clouds]
            summary = summary if organised else replace(summary, rows=summary.points, width=0, padding=0)
        summary = replace(summary, notes=(*summary.notes, *remarks))
        if finished:
            finishing = replace(options, organised=organised)
            summary = finish_clouds(summary, target, finishing, seen_from(scanner, platform))
    return summary


def _platform(recording: Path, options: AssembleOptions) -> tuple[Trajectory | None, list[str]]:
    """Return the poses of the platform, oriented by its IMU if there is one, and remarks on them."""
    from scanwright.firmware_io.poses.pose_files import load_trajectory

    trajectory = None if options.poses is None else load_trajectory(options.poses, recording)
    if options.imu is None:
        return trajectory, []
    if trajectory is None:
        raise RecordingError("`imu` requires `poses`")
    from scanwright.firmware_io.poses.gyro import oriented
    from scanwright.firmware_io.poses.pose_files import imu_mount, load_gyro

    gyro = load_gyro(options.imu, recording)
    return oriented(trajectory, gyro, imu_mount(options.imu_rpy_deg, gyro, trajectory.platform, recording))


@with_say
def calibrate(
    recordings: Sequence[str | Path],
    angles: AnglesLike,
    out: str | Path,
    *,
    one_place: bool = False,
    progress: Progress = no_progress,
) -> Calibration:
    """Estimate a scanner's mounting errors from recordings of static scenes with walls; no targets needed.

    If the platform moved or the cloud became worse, only the report is written, and the result is `faulty`.

    If own_body.npz is next to the file of the angle set, beams that end on the scanner itself are dropped. If
    scanner.urdf is there, scanner.calibrated.urdf is written next to `out`.

    Args:
        recordings: of static scenes.
        angles: angle set of the scanner, as designed.
        out: calibrated angle set to write, `.json`.
        one_place: the scanner did not move between the recordings.
        progress: progress callback.

    Raises:
        RecordingError: a recording is unreadable, they do not determine the mounting errors, or `out` is the file of
            `angles`. Nothing is written then.

    Example:
        >>> import scanwright as sw
        >>> result = sw.calibrate(["turn.mcap"], "angles.json", "angles.calibrated.json")
        >>> result.angles.source
        'calibration'
    """
    from scanwright.firmware_io.calibration.calibrate import calibrate_recordings

    before, target = as_angle_set(angles), Path(out)
    check_place(target, RecordingError)
    if not isinstance(angles, AngleSet) and target.resolve() == Path(angles).resolve():
        raise RecordingError(f"{target}: contains the angles to calibrate; write to another file")
    own_body = None if isinstance(angles, AngleSet) else own_body_of(Path(angles))
    source = None if isinstance(angles, AngleSet) else Path(angles).with_name(robot_frames.URDF)
    urdf = robot_frames.calibrated_urdf_place(target)
    designed = source if source and source.is_file() and source.resolve() != urdf.resolve() else None
    if designed:
        robot_frames.with_frames(robot_frames.read_urdf(designed), before, str(designed))  # refused before the work
    paths = [Path(recording) for recording in recordings]
    result = calibrate_recordings(paths, before, target, one_place=one_place, own_body=own_body, progress=progress)
    if result.faulty:
        return result
    if designed:
        robot_frames.write_calibrated_urdf(designed, urdf, result.angles)
    fixed = robot_frames.fixed_frames(result.angles)
    remarks = [*robot_frames.what_changed(before, result.angles), *([f"wrote {urdf}"] if designed else [])]
    remarks += [f"  {frame.command()}" for frame in fixed]
    remarks += ["as parameters of a launch file:", *(f"  {frame.launch_parameters()}" for frame in fixed)]
    return replace(result, frames=tuple(remarks))
