"""The front door: every command of `scanwright` is one function, its docstring is its help.

A command imports its room only when it is called, so that `--help` answers at once.
"""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import asdict
from enum import Enum
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from multiprocessing.connection import Connection
    from multiprocessing.process import BaseProcess

    from cad.findings import Finding
    from design.angles import AngleSet
    from design.search.optimum import Optimum
    from design.search.with_parts import Chosen
    from design.task.task import LoadedTask
    from firmware_io.assembly.trajectory import Trajectory
    from firmware_io.scan.live_feed import Feed

app = typer.Typer(
    help="One task file becomes the angles, the parts and the frame chain of a rotating 2D lidar.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

TaskFile = Annotated[Path, typer.Argument(metavar="TASK", help="Task file, or the name of a shipped task.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object for a program to read.")]


BuildFolder = Annotated[Path, typer.Argument(metavar="OUT", help="Build folder of the scanner, with angles.json.")]


class StampAt(Enum):
    """Which moment of a turn the stamps of a sensor mean."""

    step_0 = "step_0"
    rear = "rear"


class AngleUnit(Enum):
    """Unit of an angle in somebody's recording."""

    deg = "deg"
    rad = "rad"


class Per(Enum):
    """What makes one cloud."""

    recording = "recording"
    turn = "turn"
    half = "half"


@app.command()
def build(
    task: TaskFile,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder that holds one build folder per task.")] = Path(
        "out"
    ),
    check: Annotated[
        bool, typer.Option("--check", help="TASK is a build folder: build it again elsewhere, compare every file.")
    ] = False,
) -> None:
    """Make everything of a task: angles, parts, drawings, parts list, frame chain, pictures, into DIR/<task>/."""
    from design.task.task import load_task
    from scanwright.pipeline.folder import is_current, manifest_of

    if check:
        _check_build(task)
        return
    loaded = load_task(task)
    target = out / loaded.task.name
    if is_current(target, loaded):
        print(f"{target}: nothing has changed, no work to do ({len(manifest_of(target)['files'])} files)")
        return
    optimum, chosen, findings = _build(loaded, target)
    for line in [*optimum.table(), *chosen.lines()]:
        print(line)
    for warning in loaded.warnings():
        print(f"warning: {warning}")
    for finding in findings:
        print(f"{finding.severity}: {finding.message}")
    print(f"wrote {len(manifest_of(target)['files'])} files to {target}")


def _build(asked: LoadedTask, target: Path) -> tuple[Optimum, Chosen, tuple[Finding, ...]]:
    """Make the build folder of a task."""
    from cad.files.parts import build_parts, write_files
    from cad.kernel import require_kernel
    from cad.layout.deck import mount_offset_mm
    from design.angles import standard_settings
    from design.concurrency.second_process import second_process
    from design.evaluation.density_picture import density_picture
    from design.scanner import scanner_of
    from design.search.optimum import optimum_of
    from design.search.with_parts import choose
    from scanwright.pipeline import records as writer
    from scanwright.pipeline.folder import fresh_folder, write_manifest
    from scanwright.report.page import write_report

    with fresh_folder(target) as work, second_process() as begin:
        begin(require_kernel)  # it loads while the search runs
        optimum = optimum_of(asked, _say)
        # with `period_s = "shortest"` the search has changed the motion, and a rebuild must ask for it again
        loaded, problem, result = optimum.loaded, optimum.problem, optimum.search
        require_kernel()
        from cad.assembly.shadow import PartsWorkshop
        from cad.checks.run import check_files
        from cad.files.write_all import export_scanner

        first = writer.angle_set(loaded, result.best[0])
        product = scanner_of(first, loaded.task.printer, loaded.products, loaded.task.deck)
        workshop = PartsWorkshop(product)
        chosen = choose(problem, result.best, loaded.task.angles, loaded.task.limits, workshop, _say)
        best = chosen.family
        angles = writer.angle_set(loaded, best).model_copy(update={"task_sha256": asked.sha256()})
        offset = mount_offset_mm(scanner_of(angles, loaded.task.printer, loaded.products, loaded.task.deck))
        angles = angles.model_copy(update={"t_world_rot_mm": offset})
        scanner = scanner_of(angles, loaded.task.printer, loaded.products, loaded.task.deck)
        checked = begin(check_files, scanner, workshop.assembly(scanner), _say)
        made = build_parts(scanner, work, _say, workshop.assembly)
        exported = export_scanner(scanner, made, work, _say, begin)
        _say("drawing density.png")
        settings = {f"{loaded.task.name}: J = {best.score.J:.3f}": best.angles_rad}
        settings |= {f"{name}: J = {s.J:.3f}": standard_settings()[name] for name, s in optimum.standard.items()}
        density_picture(work / "density.png", problem, settings, optimum.title)
        write_files(work, checked())
        (work / "angles.json").write_text(angles.to_json(), encoding="utf-8")
        writer.write_task(work, asked)
        writer.write_search(work, result)
        writer.write_left_out(work, [*optimum.left_out, *made.left_out, *exported.left_out])
        write_manifest(work, asked, [asdict(part) for part in made.parts])
        _say("writing report.html")
        write_report(work)
    return optimum, chosen, (*made.findings, *exported.findings)


def _check_build(folder: Path) -> None:
    """Build the task of a build folder again, elsewhere; exit 1 where a file differs."""
    import tempfile

    from design.task.task import load_task
    from scanwright.pipeline.folder import first_difference, manifest_of

    loaded = load_task(folder / "task.toml")
    with tempfile.TemporaryDirectory() as elsewhere:
        again = Path(elsewhere) / loaded.task.name
        _build(loaded, again)
        difference = first_difference(folder, again)
    if difference is not None:
        print(f"{folder}: {difference}")
        raise typer.Exit(1)
    print(f"{folder}: built again, all {len(manifest_of(folder)['files'])} files are the same")


@app.command()
def report(out: BuildFolder) -> None:
    """Write report.html of a build folder from the files in it: the answer, 3D view, checks, parts, steps, drawings."""
    from scanwright.report.page import write_report

    print(f"wrote {write_report(out)}")


@app.command()
def check(out: BuildFolder, as_json: AsJson = False) -> None:
    """Check the parts of a build folder: room, beams, loads, print. Exit 1 where one fails."""
    from design.angles import load_angles
    from design.scanner import scanner_of
    from design.task.task import load_task

    loaded = load_task(out / "task.toml")
    scanner = scanner_of(load_angles(out / "angles.json"), loaded.task.printer, loaded.products, loaded.task.deck)
    from cad.kernel import require_kernel

    require_kernel()
    from cad.checks.run import check_scanner

    checks = check_scanner(scanner, _say)
    failed = [entry for entry in checks if entry.severity == "error"]
    if as_json:
        _print_json({"task": loaded.task.name, "checks": [asdict(entry) for entry in checks]})
    else:
        for entry in checks:
            print(f"{entry.severity:7} {entry.message}")
        print(f"{len(checks) - len(failed)} of {len(checks)} without a failure")
    raise typer.Exit(1 if failed else 0)


@app.command()
def optimise(
    task: TaskFile,
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Draw the lowest J over scan planes and over axes.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Search all mounting angles of a task and print the best ten families of settings."""
    from design.search.optimum import optimum_of
    from design.task.task import load_task

    optimum = optimum_of(load_task(task), _say)
    if picture is not None:
        from design.evaluation.landscape_picture import landscape_picture

        landscape_picture(picture, optimum.search, f"{optimum.asked.task.name}: {optimum.long_title}")
    if as_json:
        _print_json(optimum.facts())
        return
    for line in [*optimum.table(), optimum.long_title]:
        print(line)
    result = optimum.search
    print(f"covered {result.covered:,} settings, computed {result.evaluated:,} J in {result.seconds:.1f} s")
    for entry in optimum.left_out:
        print(f"left out {entry.what}: {entry.why} ({entry.saved:,} {entry.unit})")


@app.command()
def evaluate(
    task: TaskFile,
    angles: Annotated[str, typer.Option(metavar="A_ROT,B_ROT,A_LASER,B_LASER", help="The setting, in degrees.")],
    cloud: Annotated[
        Path | None, typer.Option(metavar="FILE.ply", help="Write the simulated beams as points on the unit sphere.")
    ] = None,
    pole: Annotated[
        str | None,
        typer.Option(metavar="WIDTH_MM,HEIGHT_MM,RANGE_M", help="Tell the chance to hit a thin upright pole."),
    ] = None,
    lever: Annotated[
        str | None,
        typer.Option(metavar="X_MM,Y_MM,RANGE_M", help="Optical centre off the axis by (x, y), as seen at a range."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Judge one setting of the mounting angles, the closed form beside the paper's ball search."""
    import numpy as np

    from design.evaluation import evaluation
    from design.task.task import load_task

    loaded = load_task(task)
    setting = evaluation.setting_of(angles)
    problem = evaluation.problem_to_judge(loaded, lever)
    found = evaluation.evaluate(loaded, problem, setting, pole, _say)
    points = 0
    if cloud is not None:
        from firmware_io.clouds.ply import write_points

        beams = evaluation.simulated_beams(problem, setting)
        write_points(cloud, beams, [f"task {loaded.task.name}, simulated beams on the unit sphere, frame world"])
        points = len(beams)
    if as_json:
        name, angles_deg = loaded.task.name, np.degrees(setting).round(6).tolist()
        _print_json({"task": name, "angles_deg": angles_deg, **found.facts()})
        return
    for line in found.lines():
        print(line)
    if cloud is not None:
        print(f"wrote {points:,} points to {cloud}")


@app.command()
def accuracy(
    task: TaskFile,
    stress: Annotated[bool, typer.Option("--stress", help="The table of stiff and extreme cases instead.")] = False,
    choices: Annotated[
        bool, typer.Option("--choices", help="Meshes, integrator of the emulated servo and its angle instead.")
    ] = False,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder that holds one folder of reports per task.")] = Path(
        "out/accuracy"
    ),
) -> None:
    """Report error against run time of every way to compute J, at the optimum of a task; of other choices too."""
    from design.accuracy import report as report
    from design.accuracy.methods import as_log, best_points, measure
    from design.accuracy.stress import stress_rows
    from design.objective.problem import problem_of
    from design.search.optimum import optimum_of
    from design.task.task import load_task

    loaded = load_task(task)
    folder = out / loaded.task.name
    if choices:
        _choices(loaded, folder)
        return
    loaded = as_log(loaded)
    if stress:
        _say("stiff and extreme cases")
        rows = stress_rows(loaded, problem_of(loaded))
        folder.mkdir(parents=True, exist_ok=True)
        report.write_rows(folder / "stress.csv", rows)
        for row in rows:
            mark = "ok  " if row.passed else "FAIL"
            print(f"{mark} {row.case:58} {row.quantity:15} expected {row.expected:.8g}, off by {row.error:.1e}")
        failed = sum(not row.passed for row in rows)
        print(f"{len(rows) - failed} of {len(rows)} within what is allowed; wrote {folder / 'stress.csv'}")
        raise typer.Exit(1 if failed else 0)
    optimum = optimum_of(loaded, _say)
    truth, points = measure(optimum.problem, optimum.search.best[0].angles_rad, _say)
    folder.mkdir(parents=True, exist_ok=True)
    report.write_points(folder / "work_precision.csv", points, truth)
    report.work_precision_picture(folder / "work_precision.png", points, truth, f"{loaded.task.name}: {optimum.title}")
    print(f"reference J = {truth.J:.9f} +- {truth.J_error:.0e}")
    for point, front in zip(points, best_points(points, truth.J_error), strict=True):
        seconds = f"{sorted(point.seconds)[len(point.seconds) // 2]:.4f} s" if point.seconds else point.failed
        print(f"{'*' if front else ' '} {point.method:24} {point.setting:16} error {point.J_error:.1e}  {seconds}")
    print(f"* nothing is both faster and nearer; wrote work_precision.csv and .png to {folder}")


def _choices(loaded: LoadedTask, folder: Path) -> None:
    """Error against run time of every numerical choice that is not J."""
    from cad.kernel import require_kernel
    from design.accuracy.trials import best_trials, trials_picture, write_trials
    from design.scanner import scanner_of
    from design.search.optimum import optimum_of
    from firmware_io.twins.dynamics import plant_of
    from scanwright.pipeline.records import angle_set
    from scanwright.trials.axis import axis_trials
    from scanwright.trials.solver import solver_trials

    require_kernel()
    from cad.assembly.assembly import make_parts
    from scanwright.trials.mesh import mesh_trials

    optimum = optimum_of(loaded, _say)
    angles = angle_set(optimum.loaded, optimum.search.best[0])
    solids = make_parts(scanner_of(angles, loaded.task.printer, loaded.products, loaded.task.deck)).made
    trials = [*mesh_trials(solids, _say), *solver_trials(plant_of(loaded.task.servo), _say), *axis_trials(_say)]
    folder.mkdir(parents=True, exist_ok=True)
    write_trials(folder / "choices.csv", trials)
    trials_picture(folder / "choices.png", trials)
    for trial, best in zip(trials, best_trials(trials), strict=True):
        mark = "=" if trial.chosen else "*" if best else " "
        method = f"{trial.method}, {trial.setting}"
        price = f"{trial.error:.1e} {trial.unit:11} {trial.median_s:.4f} s {trial.size}"
        print(f"{mark} {trial.choice:26} {method:50} {price}")
    print(f"= chosen, * nothing is both faster and nearer; wrote choices.csv and .png to {folder}")


@app.command()
def compare(
    task: TaskFile,
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder that holds one folder of comparisons per task.")
    ] = Path("out/compare"),
    as_json: AsJson = False,
) -> None:
    """Put the optimum of a task beside the usual mounts and ready-made scanners: table, CSV and picture."""
    from design.evaluation import comparison
    from design.evaluation.comparison_picture import compare_picture
    from design.search.optimum import optimum_of
    from design.task.task import load_task
    from scanwright.pipeline.folder import report_folder

    loaded = load_task(task)
    with report_folder(out / loaded.task.name) as folder:
        optimum = optimum_of(loaded, _say)
        rows = comparison.compare(optimum.loaded, optimum.problem, optimum.search.best[0], _say)
        comparison.write_csv(folder / "compare.csv", rows)
        title = f"{loaded.task.name}: {optimum.title}, and what else there is"
        compare_picture(folder / "compare.png", rows, title)
    if as_json:
        _print_json({"task": loaded.task.name, "rows": [asdict(row) for row in rows]})
        return
    for line in [*comparison.table(rows), *comparison.notes(optimum.loaded)]:
        print(line)
    print(f"wrote compare.csv and compare.png to {out / loaded.task.name}")


@app.command("import")
def import_(
    bag: Annotated[Path, typer.Argument(metavar="BAG", help="ROS 1 or ROS 2 bag.")],
    scan: Annotated[str, typer.Option(metavar="TOPIC[:FIELD]", help="Where the LaserScan is.")],
    angle: Annotated[str, typer.Option(metavar="TOPIC[:FIELD]", help="Where the servo angle is.")],
    angle_unit: Annotated[AngleUnit, typer.Option(help="Unit of the angle in the bag.")],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FILE.mcap", help="Recording to write.")],
    hold: Annotated[bool, typer.Option("--hold", help="The motor stood still during each scan.")] = False,
) -> None:
    """Bring somebody's ROS recording into the project's own: MCAP, /scan and /joint_states."""
    from firmware_io.recording.importer import import_bag

    summary = import_bag(bag, out, scan=scan, angle=angle, angle_unit=angle_unit.value, hold=hold)
    for warning in summary.warnings:
        print(f"warning: {warning}")
    for reason, count in summary.left_out.items():
        if count:
            print(f"left out {count:,}: {reason.replace('_', ' ')}")
    low, high = summary.angle_deg
    print(
        f"wrote {summary.scans:,} scans ({summary.beams:,} beams) and {summary.joint_samples:,} angles, "
        f"{low:.2f} to {high:.2f} deg, {summary.duration_s:.1f} s, to {summary.out}"
    )


@app.command()
def assemble(
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="Recording made by `import`.")],
    angles: Annotated[Path, typer.Option(metavar="angles.json", help="Angle set of the scanner.")],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FILE.ply", help="Cloud to write.")],
    flat: Annotated[
        bool, typer.Option("--flat", help="Only points that exist; default keeps beam i in column i.")
    ] = False,
    lag_s: Annotated[float, typer.Option(help="Time by which the angle log is late, in seconds.")] = 0.0,
    per: Annotated[
        Per, typer.Option(help="One cloud for the recording, or for each (half) turn: FILE_000.ply, FILE_001.ply ...")
    ] = Per.recording,
    poses: Annotated[
        str | None,
        typer.Option(
            metavar="FILE|TOPIC",
            help="Where the platform was: a TUM or CSV file, or TOPIC[:PARENT:CHILD] of the recording (/tf, /odom).",
        ),
    ] = None,
    straight: Annotated[
        bool, typer.Option("--straight", help="Take the angle straight between its samples, steps not smoothed.")
    ] = False,
    columns: Annotated[
        str, typer.Option(help="What to write of each point beside x,y,z.")
    ] = "intensity,time_s,joint_rad,ring",
    camera: Annotated[
        Path | None, typer.Option(metavar="TASK", help="Colour the points from the images of a task's [camera].")
    ] = None,
) -> None:
    """Turn a recording into a cloud: each beam at its own servo angle, through the frames of an angle set.

    Where an own_body.npz stands beside the angle set, the beams that end on the scanner itself are left out.
    """
    from design.angles import load_angles
    from firmware_io.assembly.assemble import assemble_recording
    from firmware_io.assembly.own_body import own_body_beside
    from firmware_io.assembly.pose_files import load_trajectory

    angle_set, trajectory = load_angles(angles), None if poses is None else load_trajectory(poses, recording)
    paint = None if camera is None else _painter(camera, recording, angle_set, trajectory, lag_s)
    summary = assemble_recording(
        recording,
        angle_set,
        out,
        flat=flat,
        lag_s=lag_s,
        per=per.value,
        poses=trajectory,
        own_body=own_body_beside(angles),
        smooth=not straight,
        columns=[name.strip() for name in columns.split(",") if name.strip()],
    )
    for line in summary.said:
        print(line)
    for reason, count in summary.left_out.items():
        print(f"left out {count:,} beams: {reason.replace('_', ' ')}")
    form = f"organised, {summary.height:,} scans x {summary.width:,} beams" if summary.width else "flat"
    where = f"{summary.out}" if per is Per.recording else f"{len(summary.clouds)} clouds, {summary.clouds[0]} and on"
    if paint is not None:
        for cloud in summary.clouds:
            print(paint(cloud))
    print(f"wrote {summary.points:,} points of {summary.beams:,} beams ({form}) to {where}")


def _painter(
    task: Path, recording: Path, angles: AngleSet, poses: Trajectory | None, lag_s: float
) -> Callable[[Path], str]:
    """Colours a cloud with the images of a task's camera, and says how much of it."""
    from design.errors import TaskError
    from design.task.task import load_task
    from firmware_io.colour.camera_views import views_of
    from firmware_io.colour.paint import colour_cloud, spacing_of, stands_m
    from firmware_io.recording.recording import open_recording

    loaded, source = load_task(task), open_recording(recording)
    taken = loaded.task.camera
    if taken is None:
        raise TaskError(f"{loaded.source}: camera: this task describes no camera; `scanwright schema` says how")
    views = views_of(taken, loaded.source.parent, angles, source, poses, lag_s)

    def paint(cloud: Path) -> str:
        done = colour_cloud(cloud, taken, views, spacing_of(source), stands_m(source, angles, poses))
        return (
            f"coloured {done.coloured:,} points of {cloud.name} from {done.images} images; without colour "
            f"{done.hidden:,} behind others, {done.outside:,} in no image"
        )

    return paint


@app.command()
def emulate(
    out: BuildFolder,
    scene: Annotated[
        Path | None, typer.Option(metavar="MESH", help="STL, PLY, OBJ, DAE or GLB; default is a furnished room.")
    ] = None,
    unit_m: Annotated[float, typer.Option(metavar="M", help="Length of one unit of the mesh, 0.001 for mm.")] = 1.0,
    at: Annotated[
        tuple[float, float, float], typer.Option(metavar="X Y Z", help="Where the scanner stands in the mesh, metres.")
    ] = (0.0, 0.0, 0.0),
    noise_mm: Annotated[float | None, typer.Option(min=0, help="Range noise; default is the data sheet's.")] = None,
    seed: Annotated[int, typer.Option(help="Of the noise.")] = 0,
) -> None:
    """Run a servo and a lidar without hardware, in a room, until Ctrl-C; `scan OUT` finds them."""
    from threading import Event

    from design.angles import load_angles
    from firmware_io.ports import announced
    from firmware_io.twins.head import load_of
    from firmware_io.twins.scanner import emulated_scanner, room

    angles = load_angles(out / "angles.json")
    place = room(scene, unit_m, at)
    with (
        suppress(KeyboardInterrupt),
        _on_duty(),
        emulated_scanner(angles, place, load=load_of(out, angles), sigma_mm=noise_mm, seed=seed) as twins,
        announced(out, twins.ports),
    ):
        print(f"lidar {angles.sensor} at {twins.ports.lidar} and {twins.lidar.address}")
        print(f"servo {angles.servo} at {twins.ports.servo}")
        print(f"now run `scanwright scan {out}` in another terminal; Ctrl-C ends this one", flush=True)
        Event().wait()


@app.command()
def scan(
    out: BuildFolder,
    turns: Annotated[int, typer.Option(help="Full scans.")] = 1,
    lidar: Annotated[str | None, typer.Option(metavar="ADDR", help="Serial port or HOST:PORT of the lidar.")] = None,
    servo: Annotated[str | None, typer.Option(metavar="PORT", help="Serial port of the servo.")] = None,
    recording: Annotated[
        Path | None, typer.Option("--recording", "-o", metavar="FILE.mcap", help="Default: OUT/recordings/DATE.mcap.")
    ] = None,
    intensity: Annotated[bool, typer.Option("--intensity", help="Ask the sensor for intensities too.")] = False,
    stamp_at: Annotated[
        StampAt, typer.Option(help="What the sensor's stamps mean: step 0 (the specification) or the rear.")
    ] = StampAt.step_0,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would be done, and stop.")] = False,
    live: Annotated[
        bool, typer.Option("--live", help="Show the cloud while it grows, in a page of your browser.")
    ] = False,
) -> None:
    """Turn the scanner, record, and assemble the cloud beside the recording."""
    from firmware_io.assembly.assemble import assemble_recording
    from firmware_io.assembly.own_body import own_body_beside
    from firmware_io.scan.acquire import acquire
    from firmware_io.scan.live_feed import NOBODY
    from firmware_io.scan.plan import plan_scan

    plan = plan_scan(
        out,
        turns=turns,
        lidar=lidar,
        servo=servo,
        recording=recording,
        intensity=intensity,
        stamp_at=stamp_at.value,
    )
    for line in plan.lines():
        print(line)
    if dry_run:
        return
    page, watch = _live_page(out) if live else (None, NOBODY)
    try:
        with _on_duty(), closing(watch):
            summary = acquire(plan, _say_in_place, watch)
    except KeyboardInterrupt:
        kept = f"; what was recorded is in {plan.recording}" if plan.recording.exists() else ""
        print(f"scanwright: stopped, both devices stand still{kept}", file=sys.stderr)
        raise typer.Exit(130) from None
    _say_in_place(f"recorded {summary.duration_s:.1f} s, assembling")
    for reason, count in summary.left_out.items():
        print(f"left out {count:,}: {reason}")
    if summary.reconnects:
        print(f"the lidar was away {summary.reconnects} times")
    if summary.speed_deg_s:
        print(f"servo turned at {summary.speed_deg_s:.2f} deg/s, ripple {summary.ripple_deg:.3f} deg")
    print(f"beams are timed to {summary.clock_ns / 1e6:.2f} ms")
    print(
        f"recorded {summary.scans:,} scans and {summary.joint_samples:,} angles, {summary.duration_s:.1f} s, "
        f"to {summary.recording}"
    )
    own_body = own_body_beside(out / "angles.json")
    cloud = assemble_recording(plan.recording, plan.angles, plan.recording.with_suffix(".ply"), own_body=own_body)
    for reason, count in cloud.left_out.items():
        print(f"left out {count:,} beams: {reason.replace('_', ' ')}")
    for sentence in cloud.said:
        print(sentence)
    print(f"wrote {cloud.points:,} points of {cloud.beams:,} beams to {', '.join(map(str, cloud.clouds))}")
    if page is not None:
        with suppress(KeyboardInterrupt):
            page.join()


def _live_page(out: Path) -> tuple[BaseProcess, Feed]:
    """A page that shows the scan of a build folder, in a process of its own, and the way to feed it."""
    from multiprocessing import get_context

    from firmware_io.scan.live_feed import Feed

    spawn = get_context("spawn")
    receiving, sending = spawn.Pipe(duplex=False)
    page = spawn.Process(target=_show_live, args=(receiving, out), daemon=True)
    page.start()
    receiving.close()
    return page, Feed(sending)


def _show_live(receiving: Connection, out: Path) -> None:
    """What the page's process does."""
    from design.angles import load_angles
    from firmware_io.assembly.own_body import own_body_beside
    from firmware_io.scan.live_feed import Placing, growing
    from scanwright.live.page_life import run_live

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the scan, and that ends this
    placing = Placing(load_angles(out / "angles.json"), own_body_beside(out / "angles.json"))
    run_live(growing(receiving, placing), f"scan of {out.name}")


@app.command()
def doctor(
    out: Annotated[Path | None, typer.Argument(metavar="[OUT]", help="Build folder of the scanner.")] = None,
    lidar: Annotated[str | None, typer.Option(metavar="ADDR", help="Serial port or HOST:PORT of the lidar.")] = None,
    servo: Annotated[str | None, typer.Option(metavar="PORT", help="Serial port of the servo.")] = None,
) -> None:
    """Examine the devices: ports, models, firmware, rates, clock; what is wrong, and the remedy. Nothing turns."""
    from firmware_io.scan.doctor import examine

    wrong = False
    for finding in examine(out, lidar, servo):
        print(f"{finding.verdict:8} {finding.says}", flush=True)
        wrong |= finding.verdict == "wrong"
    raise typer.Exit(1 if wrong else 0)


@app.command()
def repair(
    recording: Annotated[Path, typer.Argument(metavar="FILE", help="Recording that was cut off.")],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FILE.mcap", help="Write there and leave FILE as it is.")
    ] = None,
) -> None:
    """Close a recording that was cut off by a crash, a full disk or a pulled plug: all that is whole is kept."""
    from firmware_io.recording.repair import repair as mend

    summary = mend(recording, out or recording)
    first_ns, last_ns = summary.times_ns
    kept = " and ".join(f"{count:,} messages of {topic}" for topic, count in sorted(summary.messages.items()))
    print(f"{recording}: {kept}, {(last_ns - first_ns) / 1e9:.1f} s")
    if summary.whole:
        print("it is whole: nothing to repair, nothing written")
        return
    chunks = f"{summary.damaged_chunks} damaged chunks, {summary.lost_messages:,} messages known to be lost"
    print(f"left out {summary.lost_bytes:,} bytes that are not whole ({chunks})")
    print(f"wrote {out or recording}")


@app.command()
def register(
    clouds: Annotated[list[Path], typer.Argument(metavar="CLOUD...", help="Clouds of one place, two or more.")],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FILE", help="Map to write.")],
    poses: Annotated[
        Path | None, typer.Option(metavar="FILE.tum", help="Poses to write; beside the map by default.")
    ] = None,
    start: Annotated[
        Path | None, typer.Option(metavar="FILE.tum", help="Start poses, a line for each cloud; found if not given.")
    ] = None,
    spacing_m: Annotated[float, typer.Option(help="Distance of the points that are registered.")] = 0.1,
    map_spacing_m: Annotated[float, typer.Option(help="Distance of the points of the map.")] = 0.02,
) -> None:
    """Find where clouds stand to each other, from no start if need be, and merge them into one map."""
    import numpy as np

    from firmware_io.registration.session import register_files

    tum = poses or out.with_suffix(".tum")
    session = register_files(clouds, out, tum, start, spacing_m, map_spacing_m, _say)
    for line in session.said:
        print(f"note: {line}")
    for pair in session.found.pairs:
        if not pair.why_not:
            print(f"{pair.a} - {pair.b}: {pair.overlap:.0%} overlap, {pair.contradiction:.1%} contradicted")
    for pair in session.refused:
        print(f"{pair.a} - {pair.b}: not used: {'; '.join(pair.why_not)}")
    if not session.found.complete:
        lost = [name for name, T in zip(session.names, session.found.T_world, strict=True) if np.isnan(T[0, 0])]
        print(f"no place was found for {', '.join(lost)}: nothing is written")
        raise typer.Exit(1)
    for name, T, covariance in zip(session.names, session.found.T_world, session.found.covariance, strict=True):
        x, y, z = T[:3, 3]
        sigma_mm, sigma_deg = 1e3 * np.sqrt(covariance[3:, 3:].trace()), np.degrees(np.sqrt(covariance[:3, :3].trace()))
        print(f"{name}: at ({x:.4f}, {y:.4f}, {z:.4f}) m, sigma {sigma_mm:.2f} mm and {sigma_deg:.4f} deg")
    print(f"wrote {session.points:,} points to {', '.join(str(path) for path in session.wrote)}")


@app.command()
def convert(
    source: Annotated[Path, typer.Argument(metavar="IN", help="Cloud to read, or a recording (.mcap).")],
    target: Annotated[Path, typer.Argument(metavar="OUT", help="Cloud to write, or a bag (.bag, or a new folder).")],
) -> None:
    """Turn a cloud into another format (ply pcd las laz e57 npz xyz), and say what that one cannot hold.

    A recording becomes a ROS 1 bag where OUT ends in .bag, else a ROS 2 bag in sqlite3.
    """
    if source.suffix == ".mcap":
        from firmware_io.recording.bag_export import export_bag

        exported = export_bag(source, target)
        for topic, kind in exported.unknown.items():
            print(f"note: left out {topic}: this ROS has no {kind}")
        print(f"wrote {', '.join(f'{count:,} of {topic}' for topic, count in exported.written.items())} to {target}")
        return
    from firmware_io.clouds.files import read_clouds, write_clouds

    clouds, unread = read_clouds(source)
    wrote, lost = write_clouds(target, clouds)
    for line in [*unread, *lost]:
        print(f"note: {line}")
    points = sum(len(cloud.points_m) for cloud in clouds)
    print(f"wrote {points:,} rows to {', '.join(str(path) for path in wrote)}")


@app.command()
def calibrate(
    recordings: Annotated[
        list[Path], typer.Argument(metavar="RECORDING...", help="Recordings of scenes that stand still.")
    ],
    angles: Annotated[Path, typer.Option(metavar="angles.json", help="Angle set of the scanner, as designed.")],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FILE.json", help="Calibrated angle set to write.")],
    one_place: Annotated[
        bool, typer.Option("--one-place", help="The scanner stood still from the first recording to the last.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Find a scanner's mounting errors from scans of any scene with walls; no targets needed.

    Where an own_body.npz stands beside the angle set, the beams that end on the scanner itself are left out.
    """
    from design.angles import load_angles
    from firmware_io.assembly.own_body import own_body_beside
    from firmware_io.calibration.report import lines
    from firmware_io.calibration.session import calibrate_recordings, report_path

    own_body = own_body_beside(angles)
    record = calibrate_recordings(
        recordings, load_angles(angles), out, one_place=one_place, own_body=own_body, say=_say
    )
    if as_json:
        _print_json(record)
        return
    for line in lines(record):
        print(line)
    print(f"wrote {out} and {report_path(out).name}")


@app.command()
def study(
    study: Annotated[Path, typer.Argument(metavar="STUDY", help="Study file, or the name of a shipped study.")],
    scheduler: Annotated[
        str | None, typer.Option(metavar="tcp://HOST:PORT", help="A running Dask scheduler; else this computer works.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of tables and winners; default: out/STUDY.")
    ] = None,
    results: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Results, shared with the workers or not; default: OUT/results.")
    ] = None,
    processes: Annotated[int | None, typer.Option(min=1, help="Of this computer; default: one for each core.")] = None,
    plan: Annotated[bool, typer.Option("--plan", help="Say what it would cost, and stop.")] = False,
) -> None:
    """Cross tasks with products, judge every candidate with its parts, and build the winners of the trade-off."""
    from scanwright.study.crossing import Crossing
    from scanwright.study.study import load_study

    crossing = Crossing(load_study(study))
    folder = out or Path("out") / crossing.loaded.study.name
    kept = results or folder / "results"
    if plan:
        from scanwright.study.plan import plan_of

        for line in plan_of(crossing, kept, _say_in_place).lines():
            print(line)
        return
    from scanwright.study.answer.write import write_answer
    from scanwright.study.candidate_parts import judge
    from scanwright.study.runner.cluster import cluster
    from scanwright.study.runner.store import open_store
    from scanwright.study.session import Session

    session = Session(crossing, open_store(kept), judge)
    try:
        with cluster(scheduler, processes) as client:
            session.run(client, _say_in_place)
        for line in write_answer(session, folder):
            print(line)
        for combination, loaded in session.winners():
            _build_winner(loaded, folder / combination.name)
    except KeyboardInterrupt:
        print("scanwright: stopped; the same command goes on where it was", file=sys.stderr)
        raise typer.Exit(130) from None
    print(f"wrote study.csv, study.parquet and front.png to {folder}")


def _build_winner(loaded: LoadedTask, target: Path) -> None:
    from scanwright.pipeline.folder import is_current

    if is_current(target, loaded):
        print(f"{target}: nothing has changed, no work to do")
        return
    _build(loaded, target)
    print(f"built {target}")


@app.command()
def studio(
    task: Annotated[Path, typer.Argument(metavar="[TASK]", help="Task file, or the name of a shipped task.")] = Path(
        "ground_ahead"
    ),
    port: Annotated[int, typer.Option(help="Port on this computer; 0 is any that is free.")] = 0,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder that holds one build folder per task.")] = Path(
        "out"
    ),
) -> None:
    """Drag the angles and paint what matters in a page of your browser, and see what it comes to."""
    from design.task.task import load_task
    from scanwright.live.page_life import run_studio
    from scanwright.studio.view.bodies import bodies_of
    from scanwright.studio.view.preview_scan import glimpse
    from scanwright.studio.view.workbench import Workbench

    run_studio(load_task(task), Workbench(bodies_of, glimpse), port=port, out=out, say=_say)


@app.command()
def catalogue(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="Show one product with all sources.")] = None,
) -> None:
    """List the products that a task can name, or one of them with the source of every value."""
    from design.catalogue.catalogue import load_catalogue

    products = load_catalogue()
    if name is not None:
        product = products.named(name)
        print(f"{product.name} ({product.maker})")
        for field, origin in product.provenance().items():
            mark = " " if origin.verified else "?"
            print(f"  {mark} {field} = {json.dumps(getattr(product, field))}   [{origin.source}]")
        print("  ? not verified: measure yours, and override the product in a catalogue file of your own")
        return
    for product in products:
        doubt = product.unverified()
        note = f"   not verified: {', '.join(doubt)}" if doubt else ""
        print(f"{product.kind:10} {product.name:20} {product.maker}{note}")


@app.command()
def schema() -> None:
    """Print the JSON schema of a task file, so that an editor completes and checks it."""
    from design.task.task import Task

    _print_json(Task.model_json_schema())


def run() -> None:
    """Entry point: one line and exit 2 for what a person can mend, a traceback for a bug."""
    from design.errors import ScanwrightError

    try:
        app(prog_name="scanwright")
    except ScanwrightError as error:
        print(f"scanwright: {error}", file=sys.stderr)
        sys.exit(2)


@contextmanager
def _on_duty() -> Iterator[None]:
    """Go first where the system allows it (times get blurred on a busy computer), and end well on every signal."""
    usual = os.nice(0)
    with suppress(PermissionError):
        os.nice(-10)

    def interrupt(number: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt(signal.Signals(number).name)

    before = {number: signal.signal(number, interrupt) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        os.setpriority(os.PRIO_PROCESS, 0, usual)


def _say_in_place(line: str) -> None:
    """Progress of long work: on a terminal, what follows a line with a percentage takes its place."""
    if sys.stderr.isatty():
        print(f"\r\033[K  .. {line}", end="" if "%" in line else "\n", file=sys.stderr, flush=True)
    else:
        _say(line)


def _say(line: str) -> None:
    """Progress, on standard error so that results can be piped."""
    print(f"  .. {line}", file=sys.stderr, flush=True)


def _print_json(value: Any) -> None:
    print(json.dumps(value, indent=2))
