"""The front door: every command of `scanwright` is one function, its docstring is its help.

A command imports its room only when it is called, so that `--help` answers at once.
"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from design.objective import Problem, Score
    from design.search import SearchResult
    from design.task import LoadedTask

app = typer.Typer(
    help="One task file becomes the angles, the parts and the frame chain of a rotating 2D lidar.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

TaskFile = Annotated[Path, typer.Argument(metavar="TASK", help="Task file, or the name of a shipped task.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object for a program to read.")]


class AngleUnit(Enum):
    """Unit of an angle in somebody's recording."""

    deg = "deg"
    rad = "rad"


@app.command()
def build(
    task: TaskFile,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder that holds one build folder per task.")] = Path(
        "out"
    ),
) -> None:
    """Make everything of a task: angles, parts, assembly, frame chain, pictures, into DIR/<task>/."""
    from design.folder import fresh_folder, is_current, manifest_of, write_manifest
    from design.task import load_task

    loaded = load_task(task)
    target = out / loaded.task.name
    if is_current(target, loaded):
        print(f"{target}: nothing has changed, no work to do ({len(manifest_of(target)['files'])} files)")
        return

    from cad.build import build_parts
    from cad.deck import mount_offset_mm
    from design import build as writer
    from design.picture import density_picture
    from design.scanner import scanner_of

    with fresh_folder(target) as work:
        problem, standard, result = _optimise(loaded)
        best = result.best[0]
        angles = writer.angle_set(loaded, best)
        offset = mount_offset_mm(scanner_of(angles, loaded.task.printer, loaded.products))
        angles = angles.model_copy(update={"t_world_rot_mm": offset})
        made = build_parts(scanner_of(angles, loaded.task.printer, loaded.products), work, _say)
        _say("drawing density.png")
        settings = {f"{loaded.task.name}: J = {best.score.J:.3f}": best.angles_rad}
        settings |= {f"{name}: J = {s.J:.3f}": writer.standard_settings()[name] for name, s in standard.items()}
        density_picture(work / "density.png", problem, settings, _title(loaded))
        (work / "angles.json").write_text(angles.to_json(), encoding="utf-8")
        writer.write_task(work, loaded)
        writer.write_search(work, result)
        writer.write_left_out(work, [*writer.directions_left_out(problem), *result.left_out, *made.left_out])
        write_manifest(work, loaded, [asdict(part) for part in made.parts])
    _print_optimum(result, standard)
    for warning in loaded.warnings():
        print(f"warning: {warning}")
    for finding in made.findings:
        print(f"{finding.severity}: {finding.message}")
    print(f"wrote {len(manifest_of(target)['files'])} files to {target}")


@app.command()
def optimise(task: TaskFile, as_json: AsJson = False) -> None:
    """Search all mounting angles of a task and print the best ten families of settings."""
    from design.build import directions_left_out
    from design.task import NAMES, load_task

    loaded = load_task(task)
    problem, standard, result = _optimise(loaded)
    left_out = [*directions_left_out(problem), *result.left_out]
    if as_json:
        best = [
            {f"{name}_deg": angle for name, angle in zip(NAMES, family.angles_deg, strict=True)}
            | {"J": family.score.J, "J_error": family.score.J_error, "settings": family.members, "note": family.word}
            for family in result.best
        ]
        _print_json(
            {
                "task": loaded.task.name,
                "best": best,
                "standard": {name: {"J": s.J, "J_error": s.J_error} for name, s in standard.items()},
                "covered": result.covered,
                "evaluated": result.evaluated,
                "seconds": round(result.seconds, 3),
                "left_out": [asdict(entry) for entry in left_out],
            }
        )
        return
    _print_optimum(result, standard)
    print(f"covered {result.covered:,} settings, computed {result.evaluated:,} J in {result.seconds:.1f} s")
    for entry in left_out:
        print(f"left out {entry.what}: {entry.why} ({entry.saved:,} {entry.unit})")


@app.command()
def evaluate(
    task: TaskFile,
    angles: Annotated[str, typer.Option(metavar="A_ROT,B_ROT,A_LASER,B_LASER", help="The setting, in degrees.")],
    cloud: Annotated[
        Path | None, typer.Option(metavar="FILE.ply", help="Write the simulated beams as points on the unit sphere.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Judge one setting of the mounting angles, the closed form beside the paper's ball search."""
    import numpy as np

    from design.coverage import coverage
    from design.gaps import gaps
    from design.objective import problem_of, score
    from design.oracle import ball_score
    from design.task import load_task

    loaded = load_task(task)
    setting = np.radians(_four_angles(angles))
    problem = problem_of(loaded)
    _say("closed form")
    result = score(problem, setting)
    seen = coverage(problem, setting)
    lines = gaps(problem, setting)
    _say("ball search, 8 start phases")
    ball = ball_score(problem, setting)
    facts = {
        "J": result.J,
        "J_error": result.J_error,
        "J_lower": result.J_lower,
        "J_ball": ball.J,
        "J_ball_error": ball.J_error,
        "blind_fraction": seen.blind_fraction,
        "blind_weight_fraction": result.blind_weight,
        "masked_fraction": seen.masked_fraction,
        "min_density": result.least,
        **asdict(lines),
    }
    if cloud is not None:
        from design.beams import simulated_scan
        from firmware_io.cloud import write_points

        note = f"task {loaded.task.name}, simulated beams on the unit sphere, frame world"
        write_points(cloud, simulated_scan(problem.bearings_rad, problem.lines, setting), [note])
    if as_json:
        _print_json({"task": loaded.task.name, "angles_deg": np.degrees(setting).round(6).tolist(), **facts})
        return
    print(f"J              {result.J:.5f} +- {result.J_error:.1e}   mean of g(true count) over the start phase")
    print(f"J_lower        {result.J_lower:.5f}             g of the mean count: a lower bound")
    print(f"J_ball         {ball.J:.5f} +- {ball.J_error:.1e}   ball search over 8 simulated scans")
    print(f"blind          {seen.blind_fraction:.2%} of the unmasked sphere, {result.blind_weight:.2%} of the weight")
    print(f"masked         {seen.masked_fraction:.2%} of the sphere")
    print(f"min_density    {result.least} beams per ball, lowest in the weighted region at any start phase")
    for cone in lines.blind_cones:
        x, y, z = cone.axis_world
        print(f"blind cone     {cone.half_angle_deg:.2f} deg about ({x:.3f}, {y:.3f}, {z:.3f})")
    print(f"line gap       {lines.line_gap_deg:.3f} deg at the widest, {lines.line_gap_mm(10):.0f} mm at 10 m")
    crossing = "" if lines.crossing_deg is None else f", lines crossing at {lines.crossing_deg:.0f} deg on average"
    print(f"seen twice     {lines.seen_twice:.1%} of the weight{crossing}")
    print(f"half a turn    misses {lines.half_turn_misses:.1%} of the weight that a full turn sees")
    if cloud is not None:
        print(f"wrote {problem.lines.count * len(problem.bearings_rad):,} points to {cloud}")


@app.command()
def accuracy(
    task: TaskFile,
    stress: Annotated[bool, typer.Option("--stress", help="The table of stiff and extreme cases instead.")] = False,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder that holds one folder of reports per task.")] = Path(
        "out/accuracy"
    ),
) -> None:
    """Report error against run time of every way to compute J, at the optimum of a task."""
    from design import accuracy_report as report
    from design.accuracy import measure, on_front
    from design.objective import problem_of
    from design.stress import stress_rows
    from design.task import load_task

    loaded = load_task(task)
    folder = out / loaded.task.name
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
    problem, _, result = _optimise(loaded)
    truth, points = measure(problem, result.best[0].angles_rad, _say)
    folder.mkdir(parents=True, exist_ok=True)
    report.write_points(folder / "work_precision.csv", points, truth)
    report.work_precision_picture(folder / "work_precision.png", points, truth, f"{loaded.task.name}: {_title(loaded)}")
    print(f"reference J = {truth.J:.9f} +- {truth.J_error:.0e}")
    for point, front in zip(points, on_front(points, truth.J_error), strict=True):
        seconds = f"{sorted(point.seconds)[len(point.seconds) // 2]:.4f} s" if point.seconds else point.failed
        print(f"{'*' if front else ' '} {point.method:24} {point.setting:16} error {point.J_error:.1e}  {seconds}")
    print(f"* nothing is both faster and nearer; wrote work_precision.csv and .png to {folder}")


@app.command()
def compare(
    task: TaskFile,
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder that holds one folder of comparisons per task.")
    ] = Path("out/compare"),
    as_json: AsJson = False,
) -> None:
    """Put the optimum of a task beside the usual mounts and ready-made scanners: table, CSV and picture."""
    from design import compare as comparison
    from design.compare_picture import compare_picture
    from design.task import load_task

    loaded = load_task(task)
    with comparison.report_folder(out / loaded.task.name) as folder:
        problem, _, result = _optimise(loaded)
        rows = comparison.compare(loaded, problem, result.best[0], _say)
        comparison.write_csv(folder / "compare.csv", rows)
        compare_picture(folder / "compare.png", rows, f"{loaded.task.name}: {_title(loaded)}, and what else there is")
    if as_json:
        _print_json({"task": loaded.task.name, "rows": [asdict(row) for row in rows]})
        return
    for line in [*comparison.table(rows), *comparison.notes(loaded)]:
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
    from firmware_io.importer import import_bag

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
) -> None:
    """Turn a recording into a cloud: each beam at its own servo angle, through the frames of an angle set."""
    from design.angles import load_angles
    from firmware_io.assemble import assemble_recording

    summary = assemble_recording(recording, load_angles(angles), out, flat=flat, lag_s=lag_s)
    for reason, count in summary.left_out.items():
        print(f"left out {count:,} beams: {reason.replace('_', ' ')}")
    form = f"organised, {summary.height:,} scans x {summary.width:,} beams" if summary.width else "flat"
    print(f"wrote {summary.points:,} points of {summary.beams:,} beams ({form}) to {summary.out}")


@app.command()
def catalogue(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="Show one product with all sources.")] = None,
) -> None:
    """List the products that a task can name, or one of them with the source of every value."""
    from design.catalogue import load_catalogue

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
    from design.task import Task

    _print_json(Task.model_json_schema())


def run() -> None:
    """Entry point: one line and exit 2 for what a person can mend, a traceback for a bug."""
    from design.errors import ScanwrightError

    try:
        app(prog_name="scanwright")
    except ScanwrightError as error:
        print(f"scanwright: {error}", file=sys.stderr)
        sys.exit(2)


def _optimise(loaded: LoadedTask) -> tuple[Problem, dict[str, Score], SearchResult]:
    """The task as numbers, the score of the standard alignments, and the search."""
    from design.build import standard_settings
    from design.objective import problem_of, score
    from design.search import search

    _say("reading the task (the first run compiles the numerics: some 20 s)")
    problem = problem_of(loaded)
    standard = {name: score(problem, setting) for name, setting in standard_settings().items()}
    return problem, standard, search(problem, loaded.task.angles, _say)


def _print_optimum(result: SearchResult, standard: dict[str, Score]) -> None:
    import math

    print("  alpha_rot  beta_rot  alpha_laser  beta_laser         J   +-       settings")
    for family in result.best:
        a, b, c, d = family.angles_deg
        error = f"{family.score.J_error:.0e}"
        print(
            f"{a:11.2f} {b:9.2f} {c:12.2f} {d:11.2f} {family.score.J:9.4f}   {error} {family.members:9} {family.word}"
        )
    best = result.best[0].score
    for name, other in standard.items():
        print(f"beams per ball over the weighted region: {math.exp(other.J - best.J):.2f} x {name} (J = {other.J:.4f})")


def _title(loaded: LoadedTask) -> str:
    task = loaded.task
    return f"{task.sensor}, one turn in {task.motion.period_s:g} s"


def _four_angles(text: str) -> list[float]:
    from design.errors import TaskError

    try:
        angles = [float(part) for part in text.split(",")]
    except ValueError:
        angles = []
    if len(angles) != 4 or not all(abs(angle) <= 360 for angle in angles):
        raise TaskError(f"--angles = '{text}': four numbers in degrees, such as --angles=0,90,0,-90 for rolling")
    return angles


def _say(line: str) -> None:
    """Progress, on standard error so that results can be piped."""
    print(f"  .. {line}", file=sys.stderr, flush=True)


def _print_json(value: Any) -> None:
    print(json.dumps(value, indent=2))


if __name__ == "__main__":
    run()
