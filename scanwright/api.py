"""What a person wants of a scanner, a typed function each; `import scanwright as sw` gives all of them.

Angles of the arguments are degrees, lengths metres, as in task files; arrays that come back are SI units. Everything
that can go wrong by wrong input raises a `ScanwrightError` whose message is one line for each fault.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from cad.kernel import require_kernel
from design.angles import AngleSet
from design.angles import load_angles as load_angles
from design.errors import RecordingError
from design.task.task import LoadedTask
from design.task.task import load_task as load_task
from firmware_io.assembly.own_body import own_body_beside
from firmware_io.clouds.cloud import Cloud
from firmware_io.clouds.formats import check_target, read_clouds, write_clouds
from firmware_io.ros import robot_frames
from scanwright.pipeline.build import Build, build_task

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from cad.assembly.assembly import Assembly
    from cad.checks.check import Check
    from design.evaluation.comparison import ComparisonRow
    from design.evaluation.evaluation import Evaluation
    from design.search.optimum import Optimum
    from firmware_io.assembly.assemble import AssembleSummary
    from firmware_io.calibration.calibrate import Calibration
    from firmware_io.lidar.lidar import LidarDriver
    from firmware_io.mapping.map_files import MapSummary
    from firmware_io.recording.arrays import RecordingArrays
    from firmware_io.recording.importer import ImportSummary
    from firmware_io.recording.recording import Recording
    from firmware_io.registration.register_files import RegisteredFiles
    from firmware_io.scan.scan_summary import ScanSummary
    from firmware_io.servo.servo import ServoDriver

TaskLike = LoadedTask | str | Path | Mapping[str, Any]
"""A loaded task, the name of a shipped one, a file, or a table with the keys of a task file."""
AnglesLike = AngleSet | str | Path
"""An angle set, or the file of one."""
Say = Callable[[str], None]


def _quiet(_line: str) -> None:
    """Progress that nobody asked for."""


def _task(task: TaskLike) -> LoadedTask:
    return task if isinstance(task, LoadedTask) else load_task(task)


def _angles(angles: AnglesLike) -> AngleSet:
    return angles if isinstance(angles, AngleSet) else load_angles(Path(angles))


def optimise(task: TaskLike, *, say: Say = _quiet) -> Optimum:
    """Search all mounting angles of a task.

    Args:
        task: what the scanner shall see.
        say: is told what is being done.

    Returns:
        The best families of settings, `optimum.search.best`, the best one first; `optimum.angle_set()` is what parts
        and frame chain are made from.

    Raises:
        TaskError: the task is malformed, no direction has a weight, or no setting keeps its limits.

    Example:
        >>> import scanwright as sw
        >>> optimum = sw.optimise("ceiling")
        >>> alpha_rot, beta_rot, alpha_laser, beta_laser = optimum.search.best[0].angles_deg
        >>> alpha_rot, beta_rot  # this task fixes them: it hangs upside down
        (180.0, 0.0)
    """
    from design.search.optimum import find_optimum

    return find_optimum(_task(task), say)


def evaluate(
    task: TaskLike,
    angles_deg: Sequence[float],
    *,
    pole: str | None = None,
    lever: str | None = None,
    say: Say = _quiet,
) -> Evaluation:
    """Judge one setting of the mounting angles, the closed form beside the paper's ball search.

    Args:
        task: what the scanner shall see.
        angles_deg: alpha_rot, beta_rot, alpha_laser, beta_laser.
        pole: "WIDTH_MM,HEIGHT_MM,RANGE_M" of a thin upright pole, to tell the chance that it is hit.
        lever: "X_MM,Y_MM,RANGE_M": the optical centre off the axis, as seen at a range.
        say: is told what is being done.

    Raises:
        TaskError: the task is malformed, these are not four angles, or no direction has a weight.

    Example:
        >>> import scanwright as sw
        >>> rolling = sw.evaluate("uniform", (0, 90, 0, -90))
        >>> abs(rolling.score.J - rolling.ball.J) < rolling.score.J_error + rolling.ball.J_error
        True
    """
    from design.evaluation import evaluation

    loaded = _task(task)
    problem = evaluation.problem_to_judge(loaded, lever)
    return evaluation.evaluate(loaded, problem, evaluation.setting_rad(angles_deg), pole, say)


def compare(task: TaskLike, *, say: Say = _quiet) -> tuple[Optimum, list[ComparisonRow]]:
    """Put the optimum of a task beside the usual mounts, the scanner for little money, and ready-made ones.

    Raises:
        TaskError: as for `optimise`.
    """
    from design.evaluation.comparison import compare
    from design.search.optimum import find_optimum

    optimum = find_optimum(_task(task), say)
    return optimum, compare(optimum.loaded, optimum.problem, optimum.search.best[0], say)


def draw_density(task: TaskLike, settings_deg: Mapping[str, Sequence[float]]) -> Figure:
    """Draw how many beams of a full scan fall within the ball around each direction, a map for each setting.

    Args:
        task: what the scanner shall see: its region and its masks are drawn in.
        settings_deg: title of a map -> its (alpha_rot, beta_rot, alpha_laser, beta_laser).

    Raises:
        TaskError: the task is malformed, a setting is not four angles, or no direction has a weight.

    Example:
        >>> import scanwright as sw
        >>> figure = sw.draw_density("ceiling", {"rolling": (0, 90, 0, -90)})
        >>> figure.get_size_inches().tolist()
        [8.0, 4.0]
    """
    from design.evaluation.density_picture import density_figure
    from design.evaluation.evaluation import setting_rad
    from design.objective.problem import problem_of

    loaded = _task(task)
    settings = {name: setting_rad(angles) for name, angles in settings_deg.items()}
    return density_figure(problem_of(loaded), settings, loaded.task.name)


def build(task: TaskLike, out: str | Path = "out", *, say: Say = _quiet) -> Build:
    """Make everything of a task, into `out/<task>/`: angles, parts, drawings, parts list, frame chain, report.

    Nothing is done where the folder already holds the build of this very task.

    Raises:
        InstallError: the CAD kernel is not installed.
        TaskError: as for `optimise`.
        BuildError: no setting can be built, or the folder cannot be written.
    """
    require_kernel("build")
    loaded = _task(task)
    return build_task(loaded, Path(out) / loaded.task.name, say)


def make_parts(task: TaskLike, angles: AnglesLike, *, say: Say = _quiet) -> Assembly:
    """Make the parts of a scanner in memory, in the rotation frame [mm], without labels.

    Args:
        task: whose printer and deck the parts are for.
        angles: angle set of the scanner, such as `optimise(task).angle_set()`.
        say: is told what is being done.

    Returns:
        Solids of cadquery by name: `made["alignment_linkage"]`; `bought` are lidar, servo, ring and the like.

    Raises:
        InstallError: the CAD kernel is not installed.
        BuildError: a part cannot be made.
    """
    require_kernel("the making of parts")
    from cad.assembly.make import make_parts

    say("making the parts")
    return make_parts(_task(task).scanner(_angles(angles)))


def check(folder: str | Path, *, say: Say = _quiet) -> list[Check]:
    """Check the parts of a build folder: room, beams, loads, print. `severity` is "error" where one fails.

    Raises:
        InstallError: the CAD kernel is not installed.
        TaskError: the folder has no angle set or no task.
        BuildError: a part cannot be made.
    """
    require_kernel("check")
    folder = Path(folder)
    scanner = load_task(folder / "task.toml").scanner(load_angles(folder / "angles.json"))
    from cad.checks.run import check_scanner

    return check_scanner(scanner, say)


def open_servo(port: str, model: str | None = None, servo_id: int | None = None) -> ServoDriver:
    """Find the servo on a port, whatever its speed and protocol; it stands, without torque. Use it with `with`.

    Args:
        port: such as "/dev/serial/by-id/...".
        model: what it must be; None for any that is known.
        servo_id: its number on the bus; None if it is alone there.

    Raises:
        DeviceError: no port, no servo, several servos, another model, or settings that cannot be made.
    """
    from firmware_io.servo.servo import open_servo

    return open_servo(port, model, servo_id)


def open_lidar(address: str, model: str | None = None) -> LidarDriver:
    """Open a lidar at a serial port or HOST:PORT, whatever it is doing. Use it with `with`.

    Args:
        address: where it is.
        model: name in the catalogue, for sensors that do not tell theirs; None asks one family after the other.

    Raises:
        DeviceError: no such port, it is in use, or what answers is no sensor that is known.
    """
    from firmware_io.lidar.families import open_lidar

    return open_lidar(address, model)


@dataclass(frozen=True, slots=True)
class Scanned:
    """A scan: what was recorded, and the cloud of it."""

    recorded: ScanSummary
    assembled: AssembleSummary


def scan(
    folder: str | Path,
    *,
    turns: int = 1,
    lidar: str | None = None,
    servo: str | None = None,
    servo_id: int | None = None,
    recording: str | Path | None = None,
    intensity: bool = False,
    cluster: int = 1,
    every: int = 1,
    stamp_at: Literal["step_0", "rear"] = "step_0",
    say: Say = _quiet,
) -> Scanned:
    """Turn the scanner of a build folder, record, and assemble the cloud beside the recording.

    Args:
        folder: its `angles.json` is all that is needed.
        turns: full scans.
        lidar: serial port or HOST:PORT; None for the emulated or the plugged-in one, as for `servo`.
        servo: serial port.
        servo_id: number of the servo, where several share its bus.
        recording: file to write, `.mcap`; None for one in the folder, named by date and time.
        intensity: ask the sensor for intensities too.
        cluster: steps that share one range, the least of theirs.
        every: one scan of so many is taken.
        stamp_at: what the sensor's stamps mean: step 0 (the specification) or the rear.
        say: is told what is being done.

    Raises:
        ScanwrightError: no angle set, no motion, no port, an unusable file name, or a device fails; both devices are
            stopped then, and what was recorded is whole.
    """
    from firmware_io.scan.acquire import acquire
    from firmware_io.scan.plan import plan_scan

    named = None if recording is None else Path(recording)
    plan = plan_scan(
        Path(folder),
        turns=turns,
        lidar=lidar,
        servo=servo,
        servo_id=servo_id,
        recording=named,
        intensity=intensity,
        cluster=cluster,
        every=every,
        stamp_at=stamp_at,
    )
    recorded = acquire(plan, say)
    return Scanned(recorded, assemble(plan.recording, plan.angles_path, plan.recording.with_suffix(".ply")))


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
    from firmware_io.recording.importer import import_bag

    return import_bag(Path(bag), Path(out), scan=scan, angle=angle, angle_unit=angle_unit, hold=hold, also=also)


def simulate(
    angles: AnglesLike,
    scene: str | Path | None = None,
    *,
    turns: int = 1,
    noise_mm: float | None = None,
    seed: int = 0,
) -> RecordingArrays:
    """Record a scene without devices, faster than time: the servo obeys to the letter, ranges have their noise.

    Args:
        angles: angle set of the scanner, with its motion.
        scene: mesh in metres, STL, PLY, OBJ, DAE or GLB, the scanner's world frame at its origin; None for a furnished
            room.
        turns: full scans.
        noise_mm: range noise; None for the data sheet's.
        seed: of the noise.

    Raises:
        SceneError: the mesh cannot be used.
        TaskError: the sensor is not in the catalogue.
        DeviceError: the angle set does not say how the servo moves.
    """
    from firmware_io.twins.scanner import room
    from firmware_io.twins.simulated import simulated_recording

    place = room(None if scene is None else Path(scene))
    return simulated_recording(_angles(angles), place, turns=turns, sigma_mm=noise_mm, seed=seed)


def open_recording(path: str | Path) -> Recording:
    """Open a recording: `joint_log` has the servo's angles, `scans()` gives the scans, `arrays()` all of it as arrays.

    Raises:
        RecordingError: the file is missing, cut off, not of our topics and types, or empty.
    """
    from firmware_io.recording.recording import open_recording

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
        per: one cloud for the recording, or for each (half) turn.
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
    from firmware_io.assembly.assemble import BeamLimits, assemble_recording
    from firmware_io.assembly.finish import Finish, finish_clouds, seen_from
    from firmware_io.poses.gyro import oriented
    from firmware_io.poses.gyro_files import imu_mount, load_gyro
    from firmware_io.poses.pose_files import load_trajectory

    recording, angle_set, target = Path(recording), _angles(angles), Path(out)
    check_target(target)
    limits, finish = BeamLimits(min_range_m, max_range_m, edges_deg), Finish(outliers, voxel_m, normals)
    if organised and finish.thins:
        raise RecordingError(f"{target}: organised: every beam keeps its row, so none can go: leave out --organised")
    trajectory = None if poses is None else load_trajectory(poses, recording)
    said_of_gyro: list[str] = []
    if imu is not None:
        if trajectory is None:
            raise RecordingError("imu: a gyro goes from pose to pose; name the --poses too")
        gyro = load_gyro(imu, recording)
        trajectory, said_of_gyro = oriented(
            trajectory, gyro, imu_mount(imu_rpy_deg, gyro, trajectory.platform, recording)
        )
    paint = None
    if camera is not None:
        from firmware_io.colour.paint import painter

        paint = painter(_task(camera), recording, angle_set, trajectory, lag_s, organised=organised)
    with ExitStack() as stack:
        finished = target.suffix.lower() != ".ply" or finish != Finish()
        folder = Path(stack.enter_context(TemporaryDirectory(dir=target.parent))) if finished else target.parent
        summary = assemble_recording(
            recording,
            angle_set,
            folder / f"{target.stem}.ply" if finished else target,
            organised=organised or paint is not None,  # neighbours tell how surfaces lie to the camera
            lag_s=lag_s,
            per=per,
            poses=trajectory,
            own_body=None if isinstance(angles, AngleSet) else own_body_beside(Path(angles)),
            smooth=smooth,
            columns=columns,
            beams=limits,
        )
        summary = replace(summary, said=(*summary.said, *said_of_gyro))
        if paint is not None:
            painted = tuple(paint(cloud).line(cloud) for cloud in summary.clouds)
            summary = replace(summary, said=(*summary.said, *painted))
            summary = summary if organised else replace(summary, rows=summary.points, width=0, padding=0)
        if finished:
            where = seen_from(angle_set, trajectory)
            summary = finish_clouds(summary, target, finish, where, organised=organised)
    return summary


def calibrate(
    recordings: Sequence[str | Path],
    angles: AnglesLike,
    out: str | Path,
    *,
    one_place: bool = False,
    say: Say = _quiet,
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
        RecordingError: a recording is unreadable, or they do not show the mounting errors. Nothing is written then.
    """
    from firmware_io.calibration.calibrate import calibrate_recordings

    before, target = _angles(angles), Path(out)
    own_body = None if isinstance(angles, AngleSet) else own_body_beside(Path(angles))
    beside = None if isinstance(angles, AngleSet) else Path(angles).with_name(robot_frames.URDF)
    urdf = robot_frames.calibrated_urdf_place(target)
    designed = beside if beside and beside.is_file() and beside.resolve() != urdf.resolve() else None
    if designed:
        robot_frames.with_frames(robot_frames.read_urdf(designed), before, str(designed))  # refused before the work
    paths = [Path(recording) for recording in recordings]
    found = calibrate_recordings(paths, before, target, one_place=one_place, own_body=own_body, say=say)
    if designed:
        robot_frames.write_calibrated_urdf(designed, urdf, found.angles)
    fixed = robot_frames.fixed_frames(found.angles)
    said = [*robot_frames.what_changed(before, found.angles), *([f"wrote {urdf}"] if designed else [])]
    said += [f"  {frame.command()}" for frame in fixed]
    said += ["as parameters of a launch file:", *(f"  {frame.launch_parameters()}" for frame in fixed)]
    return replace(found, frames=tuple(said))


def register(
    clouds: Sequence[str | Path],
    out: str | Path,
    *,
    poses: str | Path | None = None,
    start: str | Path | None = None,
    angles: AngleSet | str | Path | None = None,
    spacing_m: float = 0.1,
    map_spacing_m: float = 0.02,
    say: Say = _quiet,
) -> RegisteredFiles:
    """Find where clouds stand to each other, from no start if need be, and merge them into one map.

    Args:
        clouds: of one place, two or more.
        out: map to write.
        poses: TUM file to write; None for one beside the map.
        start: TUM file of start poses, a line for each cloud; found if not given.
        angles: calibrated angle set that all clouds were assembled with: what its covariance means for the poses is
            part of their covariance. Without it the calibration is taken to be right.
        spacing_m: distance of the points that are registered.
        map_spacing_m: distance of the points of the map.
        say: is told what is being done.

    Raises:
        RecordingError: a file cannot be read or written, there is only one cloud, or the angle set states no
            covariance.
    """
    from firmware_io.registration.register_files import register_files

    target = Path(out)
    tum = target.with_suffix(".tum") if poses is None else Path(poses)
    given = None if start is None else Path(start)
    scanner = None if angles is None else _angles(angles)
    paths = [Path(cloud) for cloud in clouds]
    return register_files(paths, target, tum, given, spacing_m, map_spacing_m, scanner, say)


def make_map(
    clouds: Sequence[str | Path],
    out: str | Path,
    *,
    angles: AnglesLike | None = None,
    poses: str | Path | None = None,
    resolution_m: float = 0.05,
    floor_m: float | None = None,
    from_m: float = 0.1,
    to_m: float = 1.8,
    seen_through_m: float | None = None,
    say: Say = _quiet,
) -> MapSummary:
    """Turn clouds into an occupancy grid, as ROS's map_server reads it: YAML and PGM.

    A cell is occupied where a point lies in it between two heights above the floor; free where it is not and a
    beam passed below the lower one; else unknown.

    Args:
        clouds: of one place, z up, in one frame or with `poses`.
        out: YAML file to write; the PGM goes beside it.
        angles: angle set that all clouds were assembled with: its optical centre is where they were seen from. Without
            it the origins of clouds that have poses are; of others nobody knows it, and they free nothing.
        poses: TUM file, a line for each cloud, as `register` writes it; the poses in the files if not given.
        resolution_m: edge of a cell.
        floor_m: height of the floor in the map; found if not given.
        from_m: what is lower above the floor is driven over.
        to_m: what is higher above the floor is driven under.
        seen_through_m: leave out what came or went: points that another cloud was seen through, by more than this; 0.1
            is usual.
        say: is told what is being done.

    Raises:
        RecordingError: a file cannot be read or written, there is no floor, or the numbers make no map. Nothing is
            written then.
    """
    from firmware_io.mapping.map_files import map_files

    scanner = None if angles is None else _angles(angles)
    tum = None if poses is None else Path(poses)
    paths = [Path(cloud) for cloud in clouds]
    return map_files(paths, Path(out), scanner, tum, floor_m, from_m, to_m, resolution_m, seen_through_m, say)


def read_cloud(path: str | Path) -> Cloud:
    """Read a cloud: PLY, PCD, LAS, LAZ, E57, NPZ or XYZ, by its suffix.

    Raises:
        InstallError: the format needs the extra `clouds`, which is not installed.
        RecordingError: the format is not known, the file is not what its suffix says, or it holds several clouds.
    """
    clouds, _unread = read_clouds(Path(path))
    if len(clouds) != 1:
        raise RecordingError(
            f"{path}: holds {len(clouds)} clouds, not one: firmware_io.clouds.formats.read_clouds reads all"
        )
    return clouds[0]


def write_cloud(path: str | Path, cloud: Cloud | np.ndarray[Any, Any], *, organised: bool = False) -> list[str]:
    """Write a cloud: PLY, PCD, LAS, LAZ, E57, NPZ or XYZ, by its suffix.

    Rows without a point are left out, unless the cloud is organised and the format says what its rows and columns are
    (PCD, E57, NPZ).

    Args:
        path: the file.
        cloud: a cloud, or the points [m] of one, shape (n, 3).
        organised: keep the rows and columns of an organised cloud in PLY and XYZ too, in comments.

    Returns:
        What the format cannot hold, one sentence each.

    Raises:
        InstallError: the format needs the extra `clouds`, which is not installed.
        RecordingError: the format is not known or cannot hold this, or the file cannot be written.
    """
    record = cloud if isinstance(cloud, Cloud) else Cloud(np.asarray(cloud) * 1.0)
    return list(write_clouds(Path(path), [record], organised=organised).said)
