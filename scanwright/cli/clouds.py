"""Commands about recordings and clouds: import, repair, assemble, calibrate, register, map, convert."""

from __future__ import annotations

import math
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from scanwright.cli.console import AsJson, Progress, show, show_json
from scanwright.cli.help import Commands

app = Commands("Clouds")

Organised = Annotated[
    bool, typer.Option("--organised", help="Keep a row for every beam of every scan, NaN where there is no point.")
]


class AngleUnit(Enum):
    """Unit of an angle in somebody's recording."""

    deg = "deg"
    rad = "rad"


class Per(Enum):
    """What makes one cloud."""

    recording = "recording"
    turn = "turn"
    half = "half"


@app.command("import")
def import_(
    bag: Annotated[Path, typer.Argument(metavar="BAG", help="ROS 1 or ROS 2 bag.")],
    scan: Annotated[str, typer.Option(metavar="TOPIC[:FIELD]", help="Where the LaserScan is.")],
    angle: Annotated[
        str,
        typer.Option(
            metavar="TOPIC[:FIELD]",
            help="Where the servo angle is; also TOPIC:JOINT, TOPIC:PARENT:CHILD of /tf, or FILE.csv[:COLUMN].",
        ),
    ],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FILE.mcap", help="Recording to write.")],
    angle_unit: Annotated[AngleUnit | None, typer.Option(help="Unit of the angle; transforms have none.")] = None,
    hold: Annotated[bool, typer.Option("--hold", help="The motor stood still during each scan.")] = False,
    also: Annotated[
        list[str] | None, typer.Option(metavar="TOPIC", help="Comes along as it is, such as /odom, /imu, /tf_static.")
    ] = None,
) -> None:
    """Bring somebody's ROS recording into the project's own: MCAP, /scan and /joint_states."""
    from scanwright import api

    summary = api.import_bag(
        bag, out, scan=scan, angle=angle, angle_unit=angle_unit and angle_unit.value, hold=hold, also=also or ()
    )
    show(summary.lines())


@app.command()
def repair(
    recording: Annotated[
        Path, typer.Argument(metavar="FILE", help="Recording that was cut off or damaged; it stays as it is.")
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="FILE.mcap", help="Recording to write; FILE.repaired.mcap if not given."),
    ] = None,
) -> None:
    """Save every whole message of a recording that was cut off or damaged, into another file."""
    from scanwright.firmware_io.recording.repair.repair import repair, repaired_place

    target = out or repaired_place(recording)
    show(repair(recording, target).lines(recording, target))


@app.command()
def assemble(
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="Recording made by `import`.")],
    angles: Annotated[Path, typer.Option(metavar="angles.json", help="Angle set of the scanner.")],
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="FILE", help="Cloud; its suffix is the format (ply, pcd, las, ...).")
    ],
    organised: Organised = False,
    lag_s: Annotated[float, typer.Option(help="Time by which the angle log is late, in seconds.")] = 0.0,
    per: Annotated[
        Per,
        typer.Option(
            help="One cloud for the recording, or for each (half) turn: FILE_000.ply, FILE_001.ply ... A turn ends "
            "where the axis turns back, too: of a sweep each way is one, and a full scan is two."
        ),
    ] = Per.recording,
    poses: Annotated[
        str | None,
        typer.Option(
            metavar="FILE|TOPIC",
            help="Where the platform was: a TUM or CSV file, or TOPIC[:PARENT:CHILD] of the recording (/tf, /odom).",
        ),
    ] = None,
    imu: Annotated[
        str | None,
        typer.Option(metavar="FILE.csv|TOPIC", help="How it turned between poses: the gyro of a sensor_msgs/Imu."),
    ] = None,
    imu_rpy_deg: Annotated[
        tuple[float, float, float] | None,
        typer.Option(metavar="R P Y", help="How the IMU stands on the platform; from /tf_static if not given."),
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
    min_range_m: Annotated[float, typer.Option(metavar="M", help="Leave out shorter beams.")] = 0.0,
    max_range_m: Annotated[float, typer.Option(metavar="M", help="Leave out longer beams.")] = math.inf,
    edges_deg: Annotated[
        float | None,
        typer.Option(
            metavar="DEG", help="Leave out beams that hang between two surfaces seen that grazing, such as 8."
        ),
    ] = None,
    outliers: Annotated[
        float | None,
        typer.Option(metavar="SIGMAS", help="Leave out points that stand alone, beyond so many sigmas, such as 2."),
    ] = None,
    voxel_m: Annotated[float | None, typer.Option(metavar="M", help="One point to a voxel of this edge.")] = None,
    normals: Annotated[bool, typer.Option("--normals", help="Add nx ny nz, towards the scanner.")] = False,
) -> None:
    """Turn a recording into a cloud: each beam at its own servo angle, through the frames of an angle set.

    Where an own_body.npz stands beside the angle set, the beams that end on the scanner itself are left out.
    """
    from scanwright import api

    summary = api.assemble(
        recording,
        angles,
        out,
        organised=organised,
        lag_s=lag_s,
        per=per.value,
        poses=poses,
        imu=imu,
        imu_rpy_deg=imu_rpy_deg,
        smooth=not straight,
        columns=[name.strip() for name in columns.split(",") if name.strip()],
        camera=camera,
        min_range_m=min_range_m,
        max_range_m=max_range_m,
        edges_deg=edges_deg,
        outliers=outliers,
        voxel_m=voxel_m,
        normals=normals,
    )
    show(summary.lines())


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

    Where an own_body.npz stands beside the angle set, the beams that end on the scanner itself are left out; where a
    scanner.urdf stands there, scanner.calibrated.urdf is written beside the calibrated one.
    """
    from scanwright import api

    found = api.calibrate(recordings, angles, out, one_place=one_place, say=Progress())
    if as_json:
        show_json(found.record)
    else:
        show(found.lines())


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
    angles: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Calibrated angle set of the clouds: its error counts too.")
    ] = None,
    spacing_m: Annotated[float, typer.Option(help="Distance of the points that are registered.")] = 0.1,
    map_spacing_m: Annotated[float, typer.Option(help="Distance of the points of the map.")] = 0.02,
) -> None:
    """Find where clouds stand to each other, from no start if need be, and merge them into one map."""
    from scanwright import api

    found = api.register(
        clouds,
        out,
        poses=poses,
        start=start,
        angles=angles,
        spacing_m=spacing_m,
        map_spacing_m=map_spacing_m,
        say=Progress(),
    )
    show(found.lines())
    raise typer.Exit(0 if found.complete else 1)


@app.command("map")
def map_(
    clouds: Annotated[
        list[Path], typer.Argument(metavar="CLOUD...", help="Clouds of one place in one frame, or with --poses; z up.")
    ],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FILE.yaml", help="Map to write; its .pgm goes beside.")],
    angles: Annotated[
        Path | None, typer.Option(metavar="angles.json", help="Angle set of the clouds: where they were seen from.")
    ] = None,
    poses: Annotated[
        Path | None, typer.Option(metavar="FILE.tum", help="Where the clouds stand, a line each, as register writes.")
    ] = None,
    resolution_m: Annotated[float, typer.Option(metavar="M", help="Edge of a cell.")] = 0.05,
    floor_m: Annotated[float | None, typer.Option(metavar="Z", help="Height of the floor; found if not given.")] = None,
    from_m: Annotated[float, typer.Option(metavar="M", help="Above the floor: what is lower is driven over.")] = 0.1,
    to_m: Annotated[float, typer.Option(metavar="M", help="Above the floor: what is higher is driven under.")] = 1.8,
    seen_through_m: Annotated[
        float | None,
        typer.Option(
            metavar="M", help="Leave out what moved: other clouds were seen through it, by more than, say, 0.1."
        ),
    ] = None,
) -> None:
    """Turn clouds into an occupancy grid for Nav2: a YAML and a PGM, cells occupied, free or unknown.

    Free is where beams passed close above the floor, so it takes where they came from: name --angles, or --poses.
    Clouds without are mapped all the same, with nothing free.
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
        say=Progress(),
    )
    show(summary.lines())


@app.command()
def convert(
    source: Annotated[Path, typer.Argument(metavar="IN", help="Cloud to read, or a recording (.mcap).")],
    target: Annotated[Path, typer.Argument(metavar="OUT", help="Cloud to write, or a bag (.bag, or a new folder).")],
    organised: Organised = False,
) -> None:
    """Turn a cloud into another format (named by its suffix), and say what that one cannot hold.

    A recording becomes a ROS 1 bag where OUT ends in .bag, else a ROS 2 bag in sqlite3.
    """
    from scanwright.firmware_io.recording.convert import convert

    show(convert(source, target, organised=organised))
