"""Commands about recordings and clouds: import, repair, assemble, calibrate, register, map, convert."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from scanwright.cli.arguments import Angles, AsJson
from scanwright.cli.console import ConsoleProgress, Verbosity, as_typed, hint, show, show_result, verbosity
from scanwright.cli.help import Commands
from scanwright.cli.record_options import record_options
from scanwright.cli.results.of_commands import Mapped, Registered
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.assembly.options import COLUMNS, AssembleOptions
from scanwright.firmware_io.recording.import_checks.corrections import Corrections, read_time_increment

app = Commands("Clouds")

Organised = Annotated[bool, Option("--organised", help="Keep one row per beam; NaN if there is no point.")]


@app.command("import", example="import bag --scan /scan --angle /joint_states:pan --angle-unit rad -o rec.mcap")
@record_options(Corrections, "time_increment")
def import_(
    bag: Annotated[list[Path], Argument(metavar="BAG", help="ROS 1 or ROS 2 bag, or all parts of a split one.")],
    options: Corrections,
    scan: Annotated[
        str | None,
        Option(metavar="TOPIC[:FIELD]", help="LaserScan or MultiEchoLaserScan; omit it to list the topics."),
    ] = None,
    angle: Annotated[
        str | None,
        Option(metavar="TOPIC[:FIELD]", help="Joint angle; or TOPIC:JOINT, /tf:PARENT:CHILD, FILE.csv[:COLUMN]."),
    ] = None,
    out: Annotated[Path | None, Option("--out", "-o", metavar="FILE.mcap", help="Recording to write.")] = None,
    angle_unit: Annotated[
        str | None, Option(metavar="UNIT", help="deg, rad or 4096/turn; not for a transform or quaternion.")
    ] = None,
    hold: Annotated[bool, Option("--hold", help="The axis was at rest during each scan.")] = False,
    also: Annotated[list[str] | None, Option(metavar="TOPIC", help="Topic to copy, such as /odom; repeatable.")] = None,
    time_increment: Annotated[
        str | None, Option(metavar="S", help="Time from beam to beam; auto: from step and mirror turn.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Convert a ROS bag to a Scanwright recording.

    The recording is an MCAP file with /scan and /joint_states. The checks of the bag print what is wrong with it, what
    that costs at 5 m, and the option that corrects it.
    """
    from scanwright import api
    from scanwright.firmware_io.recording.bags import topic_lines

    if scan is None or angle is None or out is None:
        needed = {"--scan": scan, "--angle": angle, "--out": out}
        missing = ", ".join(option for option, value in needed.items() if value is None)
        show(topic_lines(bag))
        raise RecordingError(f"missing {missing}: choose them from the topics of {bag[0]}, listed above")
    if time_increment is not None:
        options = replace(options, time_increment=read_time_increment(time_increment))
    summary = api.import_bag(
        bag, out, scan=scan, angle=angle, angle_unit=angle_unit, hold=hold, also=also or (), corrections=options
    )
    show_result(summary.lines, summary, as_json)
    hint(
        f"next: `scanwright assemble {out} --angles ANGLES.json -o cloud.ply`; a build folder has this file, and for "
        "another scanner 'Bring your own recording' in the documentation shows its five lines"
    )


@app.command(example="repair rec.mcap")
def repair(
    recording: Annotated[Path, Argument(metavar="FILE", help="Damaged or truncated recording.")],
    out: Annotated[
        Path | None, Option("--out", "-o", metavar="FILE.mcap", help="Output [default: NAME.repaired.mcap].")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Recover a damaged or truncated recording.

    Writes every intact message to a new file.
    """
    from scanwright.firmware_io.recording.repair.repair import repair, repaired_place

    target = out or repaired_place(recording)
    summary = repair(recording, target)
    show_result(lambda: summary.lines(recording, target), asdict(summary) | {"out": target}, as_json)


@app.command(example="assemble rec.mcap --angles out/ground_ahead/angles.json -o cloud.ply")
@record_options(AssembleOptions, "smooth", "columns", "camera", poses="FILE|TOPIC", imu="FILE|TOPIC", outliers="SIGMAS")
def assemble(
    recording: Annotated[Path, Argument(metavar="RECORDING", help="Recording made by `scan` or `import`.")],
    angles: Angles,
    out: Annotated[Path, Option("--out", "-o", metavar="FILE", help="Cloud; its suffix is the format, such as ply.")],
    options: AssembleOptions,
    straight: Annotated[bool, Option("--straight", help="Interpolate joint angles linearly.")] = False,
    columns: Annotated[str, Option(metavar="LIST", help="Columns besides x,y,z.")] = ",".join(COLUMNS),
    camera: Annotated[Path | None, Option(metavar="TASK", help="Colour points with images of its [camera].")] = None,
    as_json: AsJson = False,
) -> None:
    """Assemble a point cloud from a recording.

    If own_body.npz is next to the angle set, beams that end on the scanner itself are dropped.
    """
    from scanwright import api

    names = tuple(name.strip() for name in columns.split(",") if name.strip())
    summary = api.assemble(recording, angles, out, options, smooth=not straight, columns=names, camera=camera)
    show_result(summary.lines, summary, as_json)


@app.command(
    example="calibrate rec.mcap --angles out/t/angles.json -o out/t/angles.calibrated.json",
    no="the platform moved, or the cloud became worse",
)
def calibrate(
    recordings: Annotated[list[Path], Argument(metavar="RECORDING", help="Recordings of static scenes.")],
    angles: Angles,
    out: Annotated[Path, Option("--out", "-o", metavar="FILE.json", help="Calibrated angle set to write.")],
    one_place: Annotated[bool, Option("--one-place", help="The scanner did not move between the recordings.")] = False,
    as_json: AsJson = False,
) -> None:
    """Estimate mounting errors from recordings.

    Needs static scenes with walls in several directions, and no targets. With -v, prints the frames for ROS 2 as well.
    If own_body.npz is next to the angle set, beams that hit the scanner itself are dropped; if scanner.urdf is there,
    scanner.calibrated.urdf is written next to the calibrated angle set.
    """
    from scanwright import api

    result = api.calibrate(recordings, angles, out, one_place=one_place, progress=ConsoleProgress())
    show_result(lambda: map(as_typed, result.lines(verbosity() is Verbosity.VERBOSE)), result.record, as_json)
    raise typer.Exit(1 if result.faulty else 0)


@app.command(example="register a.ply b.ply -o merged.ply", no="a cloud could not be aligned")
def register(
    clouds: Annotated[list[Path], Argument(metavar="CLOUD", help="Two or more clouds of one place.")],
    out: Annotated[Path, Option("--out", "-o", metavar="FILE", help="Merged cloud to write.")],
    poses: Annotated[
        Path | None, Option(metavar="FILE.tum", help="Output poses [default: next to the output].")
    ] = None,
    start: Annotated[Path | None, Option(metavar="FILE.tum", help="Initial poses, one line per cloud.")] = None,
    angles: Annotated[
        Path | None, Option(metavar="FILE.json", help="Angle set: include its uncertainty in the errors.")
    ] = None,
    spacing_m: Annotated[float, Option(metavar="M", help="Point spacing for alignment.")] = 0.1,
    map_spacing_m: Annotated[float, Option(metavar="M", help="Point spacing of the merged cloud.")] = 0.02,
    as_json: AsJson = False,
) -> None:
    """Align point clouds and merge them.

    Works without initial poses.
    """
    from scanwright import api

    result = api.register(
        clouds,
        out,
        poses=poses,
        start=start,
        angles=angles,
        spacing_m=spacing_m,
        map_spacing_m=map_spacing_m,
        progress=ConsoleProgress(),
    )
    record = Registered(result.complete, result.points, result.wrote, result.notes)
    show_result(result.lines, record, as_json)
    raise typer.Exit(0 if result.complete else 1)


@app.command("map", example="map a.ply b.ply --poses merged.tum -o room.yaml")
def map_(
    clouds: Annotated[list[Path], Argument(metavar="CLOUD", help="Clouds of one place, z up.")],
    out: Annotated[Path, Option("--out", "-o", metavar="FILE.yaml", help="Map to write, with a .pgm next to it.")],
    angles: Annotated[Path | None, Option(metavar="FILE", help="Angle set: position of the scanner.")] = None,
    poses: Annotated[
        Path | None, Option(metavar="FILE.tum", help="Poses of the clouds, as written by `register`.")
    ] = None,
    resolution_m: Annotated[float, Option(metavar="M", help="Cell size.")] = 0.05,
    floor_m: Annotated[float | None, Option(metavar="Z", help="Floor height [default: detect].")] = None,
    from_m: Annotated[float, Option(metavar="M", help="Lowest height of obstacles above the floor.")] = 0.1,
    to_m: Annotated[float, Option(metavar="M", help="Highest height of obstacles above the floor.")] = 1.8,
    seen_through_m: Annotated[
        float | None,
        Option(metavar="M", help="Drop moving objects: beams passed by more than this; 0.1 is usual."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Create a Nav2 occupancy grid from point clouds.

    A cell is free only if beams passed low above the floor, so give --angles or --poses (the position of the scanner);
    otherwise no cell is free.
    """
    from scanwright import api

    summary = api.make_map(
        clouds,
        out,
        angles=angles,
        poses=poses,
        resolution_m=resolution_m,
        floor_m=floor_m,
        from_m=from_m,
        to_m=to_m,
        seen_through_m=seen_through_m,
        progress=ConsoleProgress(),
    )
    show_result(summary.lines, Mapped(summary.points, summary.moved, summary.wrote, summary.notes), as_json)


@app.command(example="convert cloud.ply cloud.laz")
def convert(
    source: Annotated[Path, Argument(metavar="IN", help="Cloud, or recording (.mcap).")],
    target: Annotated[Path, Argument(metavar="OUT", help="Cloud, .bag, or a new folder for a bag.")],
    organised: Organised = False,
    decimal_comma: Annotated[bool, Option("--decimal-comma", help="Numbers of IN are written as 1,5.")] = False,
    as_json: AsJson = False,
) -> None:
    """Convert a point cloud or recording to another format.

    The suffix of a cloud is its format. A recording becomes a ROS 1 bag if OUT ends in .bag, otherwise a ROS 2 bag
    (sqlite3).
    """
    from scanwright.firmware_io.recording.convert import convert

    result = convert(source, target, organised=organised, decimal_comma=decimal_comma)
    show_result(result.lines, result, as_json)
