"""Commands that talk to devices: emulate, scan, ros2, doctor, servo-setup."""

from __future__ import annotations

from contextlib import AbstractContextManager, closing, suppress
from dataclasses import replace
from enum import Enum
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Annotated

import typer

from scanwright.cli.console import AllowOrigin, BuildFolder, Progress, complain, on_duty, require_pages, show
from scanwright.cli.help import Commands
from scanwright.cli.servo_setup import asking_first, print_steps, set_up_command
from scanwright.design.errors import DeviceError, ScanwrightError, notes_of, require
from scanwright.firmware_io.posix import require_posix
from scanwright.firmware_io.scan.scan_end import ScanEnd, failed, finished, stopped

if TYPE_CHECKING:
    from scanwright.firmware_io.scan.live_feed import Viewer
    from scanwright.firmware_io.scan.plan import ScanPlan
    from scanwright.firmware_io.scan.scan_summary import ScanSummary

app = Commands("Devices", first=require_posix)


class StampAt(Enum):
    """Which moment of a turn the stamps of a sensor mean."""

    step_0 = "step_0"
    rear = "rear"


class PointsPer(Enum):
    """What makes one message of points."""

    scan = "scan"
    turn = "turn"


class PointsIn(Enum):
    """In which frame points are published."""

    world = "world"
    rot = "rot"


ServoId = Annotated[
    int | None, typer.Option(min=0, max=252, metavar="ID", help="Number of the servo, where several share its bus.")
]


def _viewer(
    out: Path, *, live: bool = False, foxglove: bool, allow_origins: list[str] | None
) -> AbstractContextManager[Viewer]:
    if foxglove:
        require("foxglove", "--foxglove needs a websocket server", "websockets")
        from scanwright.live.foxglove_view import foxglove_feed
        from scanwright.serving.handshake import as_origins

        return foxglove_feed(out, as_origins(allow_origins))
    from scanwright.live.scan_page import live_page

    return live_page(out, wanted=live)


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
    seed: Annotated[int, typer.Option(min=0, help="Of the noise.")] = 0,
    factory_servo: Annotated[
        bool, typer.Option("--factory-servo", help="Servo as it comes from the factory, not yet set up.")
    ] = False,
) -> None:
    """Run a servo and a lidar without hardware, in a room, until Ctrl-C; `scan OUT` finds them."""
    from scanwright.design.angles import load_angles
    from scanwright.firmware_io.device_ports import announced
    from scanwright.firmware_io.emulators.head import read_load
    from scanwright.firmware_io.emulators.scanner import emulated_scanner
    from scanwright.firmware_io.emulators.world import room

    angles = load_angles(out / "angles.json")
    place = room(scene, unit_m, at)
    with (
        suppress(KeyboardInterrupt),
        on_duty(),
        emulated_scanner(
            angles, place, load=read_load(out, angles), sigma_mm=noise_mm, seed=seed, factory_servo=factory_servo
        ) as emulators,
        announced(out, emulators.ports),
    ):
        places = filter(None, [emulators.ports.lidar, emulators.lidar.address])
        print(f"lidar {angles.sensor} at {' and '.join(places)}")
        print(f"servo {angles.servo} at {emulators.ports.servo}")
        print(f"now run `scanwright scan {out}` in another terminal; Ctrl-C ends this one", flush=True)
        Event().wait()


@app.command()
def scan(
    out: BuildFolder,
    turns: Annotated[int, typer.Option(help="Full scans.")] = 1,
    lidar: Annotated[str | None, typer.Option(metavar="ADDR", help="Serial port or HOST:PORT of the lidar.")] = None,
    servo: Annotated[str | None, typer.Option(metavar="PORT", help="Serial port of the servo.")] = None,
    servo_id: ServoId = None,
    recording: Annotated[
        Path | None, typer.Option("--recording", "-o", metavar="FILE.mcap", help="Default: OUT/recordings/DATE.mcap.")
    ] = None,
    intensity: Annotated[bool, typer.Option("--intensity", help="Ask the sensor for intensities too.")] = False,
    cluster: Annotated[int, typer.Option(min=1, max=99, help="Steps that share one range, the least of theirs.")] = 1,
    every: Annotated[int, typer.Option(min=1, max=10, help="Take one scan of so many.")] = 1,
    stamp_at: Annotated[
        StampAt, typer.Option(help="What the sensor's stamps mean: step 0 (the specification) or the rear.")
    ] = StampAt.step_0,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would be done, and stop.")] = False,
    live: Annotated[
        bool, typer.Option("--live", help="Show the cloud while it grows, in a page of your browser.")
    ] = False,
    foxglove: Annotated[bool, typer.Option("--foxglove", help="Serve scans, points and frames to Foxglove.")] = False,
    allow_origin: AllowOrigin = None,
) -> None:
    """Turn the scanner, record, and assemble the cloud beside the recording."""
    if live:
        require_pages("scan --live")
    if live and foxglove:
        raise DeviceError("--live and --foxglove: one of them")
    viewer = _viewer(out, live=live, foxglove=foxglove, allow_origins=allow_origin)
    from scanwright import api
    from scanwright.firmware_io.scan.plan import plan_scan

    plan = plan_scan(
        out,
        turns=turns,
        lidar=lidar,
        servo=servo,
        servo_id=servo_id,
        recording=recording,
        intensity=intensity,
        cluster=cluster,
        every=every,
        stamp_at=stamp_at.value,
    )
    say = Progress()
    show(plan.lines())
    if dry_run:
        return
    with viewer as watch, closing(watch):
        try:
            recorded = _acquired(plan, say, watch, out, servo_id)
            watch.ended(finished(recorded))  # the devices stand, whatever becomes of the cloud
            say(f"recorded {recorded.duration_s:.1f} s, assembling")
            show(recorded.lines())
            cloud = api.assemble(plan.recording, plan.angles_path, plan.recording.with_suffix(".ply"))
            watch.ended(finished(recorded, cloud.lines()))
            show(cloud.lines())
        except ScanwrightError as error:
            _end(watch, failed(error), plan.recording)
            raise typer.Exit(2) from None


def _acquired(plan: ScanPlan, say: Progress, watch: Viewer, out: Path, servo_id: int | None) -> ScanSummary:
    """Record, after the person has agreed to what the servo needs; Ctrl-C ends the command."""
    from scanwright.firmware_io.scan.acquire import acquire

    try:
        with on_duty():
            return asking_first(lambda: acquire(plan, say, watch), out, servo_id)
    except KeyboardInterrupt as stop:
        _end(watch, stopped(stop), plan.recording)
        raise typer.Exit(130) from None


def _end(watch: Viewer, end: ScanEnd, recording: Path) -> None:
    """Say how a scan ended early, in the same words on standard error and to the viewer."""
    kept = (f"what was recorded is in {recording}",) if recording.exists() else ()
    end = replace(end, lines=(*end.lines, *kept))
    for line in end.lines:
        complain(line)
    watch.ended(end)


@app.command()
def ros2(
    out: BuildFolder,
    ros_args: Annotated[
        list[str] | None,
        typer.Argument(metavar="[-- --ros-args ...]", help="As nodes of ROS 2 take them: -r scan:=front/scan."),
    ] = None,
    recording: Annotated[
        Path | None, typer.Option(metavar="FILE.mcap", help="Publish a recording at its own pace, with /clock.")
    ] = None,
    rate: Annotated[float, typer.Option(help="How many times as fast as it was recorded.")] = 1.0,
    straight: Annotated[
        bool, typer.Option("--straight", help="Points straight between angles: later by one angle, not 0.35 s.")
    ] = False,
    points_per: Annotated[PointsPer, typer.Option(help="A message of points for each scan, or for each turn.")] = (
        PointsPer.scan
    ),
    points_in: Annotated[PointsIn, typer.Option(help="Frame of the points; a turn has none that turns.")] = (
        PointsIn.world
    ),
    no_tf: Annotated[bool, typer.Option("--no-tf", help="Leave the frames to robot_state_publisher.")] = False,
    lidar: Annotated[str | None, typer.Option(metavar="ADDR", help="Serial port or HOST:PORT of the lidar.")] = None,
    servo: Annotated[str | None, typer.Option(metavar="PORT", help="Serial port of the servo.")] = None,
    servo_id: ServoId = None,
    intensity: Annotated[bool, typer.Option("--intensity", help="Ask the sensor for intensities too.")] = False,
    foxglove: Annotated[bool, typer.Option("--foxglove", help="Serve the same to Foxglove, without a bridge.")] = False,
    allow_origin: AllowOrigin = None,
) -> None:
    """Publish scans, angles, frames and de-skewed points as a node of ROS 2, until Ctrl-C."""
    require(
        "ros",
        "ros2 needs rclpy: source the setup.bash of your ROS 2 (its Python is the one to install scanwright in), or",
        "rclpy",
        "sensor_msgs",
    )
    if foxglove and recording is not None:
        raise DeviceError("--foxglove and --recording: `scanwright view` serves a recording to Foxglove")
    viewer = _viewer(out, foxglove=foxglove, allow_origins=allow_origin)
    from scanwright.firmware_io.ros.serve import Publishing, serve_devices, serve_recording
    from scanwright.firmware_io.scan.plan import plan_scan

    given = ros_args or []
    points = Publishing(not straight, points_per is PointsPer.turn, points_in.value, not no_tf)
    try:
        if recording is not None:
            serve_recording(out, recording, given, Progress(), points, rate=rate)
            return
        plan = plan_scan(out, lidar=lidar, servo=servo, servo_id=servo_id, intensity=intensity, endless=True)
        show(plan.lines())
        with on_duty(), viewer as watch:
            asking_first(lambda: serve_devices(out, plan, given, Progress(), points, watch), out, servo_id)
    except KeyboardInterrupt as stop:
        for line in ("stopped", *notes_of(stop)):
            complain(line)
        raise typer.Exit(130) from None


@app.command()
def doctor(
    out: Annotated[Path | None, typer.Argument(metavar="[OUT]", help="Build folder of the scanner.")] = None,
    lidar: Annotated[str | None, typer.Option(metavar="ADDR", help="Serial port or HOST:PORT of the lidar.")] = None,
    servo: Annotated[str | None, typer.Option(metavar="PORT", help="Serial port of the servo.")] = None,
    servo_id: ServoId = None,
    fix: Annotated[
        bool,
        typer.Option("--fix", help="Set up the servo first, as servo-setup does; keeps a file to undo it."),
    ] = False,
    restore: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Undo the changes of --fix or servo-setup, and stop.")
    ] = None,
) -> None:
    """Examine the devices: ports, models, firmware, rates, clock; what is wrong, and the remedy. It only reads."""
    from scanwright.firmware_io.scan import doctor as diagnosis
    from scanwright.firmware_io.servo import settings

    if restore is not None:
        print_steps("", settings.restore(restore, servo))
        return
    if fix:
        print_steps(*diagnosis.fix(out, servo, servo_id))
    failed = False
    for finding in diagnosis.examine(out, lidar, servo, servo_id):
        hint = finding.hint
        if finding.code == diagnosis.SERVO_SETTING:
            hint = f"`{set_up_command(finding.subject, out, servo_id)}` sets it"
        print(f"{finding.severity:8} {finding.message}{hint and f': {hint}'}", flush=True)
        failed |= finding.severity == "error"
    raise typer.Exit(1 if failed else 0)


@app.command("servo-setup")
def servo_setup(
    port: Annotated[str, typer.Argument(metavar="PORT", help="Serial port of the servo.")],
    scanner: Annotated[
        Path | None, typer.Option(metavar="OUT", help="Build folder whose motion the servo is set up for.")
    ] = None,
    new_id: Annotated[int | None, typer.Option("--id", metavar="N", help="New number, 0 to 252; sets no more.")] = None,
    new_baud: Annotated[
        int | None, typer.Option("--baud", metavar="B", help="New speed, such as 1000000; sets no more.")
    ] = None,
    from_id: Annotated[
        int | None, typer.Option(min=0, max=252, metavar="N", help="Its number now; needed if several answer.")
    ] = None,
    from_baud: Annotated[
        int | None, typer.Option(metavar="B", help="Its speed now; default is to look at all.")
    ] = None,
    undo: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Undo the changes of an earlier set-up, and stop.")
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print what would be written, and stop.")] = False,
) -> None:
    """Write the settings that a scan needs to the servo; keeps a file to undo it."""
    from scanwright.design.angles import load_angles
    from scanwright.design.motion import Spin
    from scanwright.firmware_io.servo import settings
    from scanwright.firmware_io.servo.address import set_address

    numbers = new_id is not None or new_baud is not None
    if sum([numbers, undo is not None, scanner is not None or dry_run]) > 1:
        raise DeviceError("--id and --baud, --undo, --scanner and --dry-run: one at a time")
    folder = scanner or Path()
    if undo is not None:
        print_steps(port, settings.restore(undo, port))
    elif numbers:
        print_steps(port, set_address(port, new_id, new_baud, from_id, from_baud, folder))
    else:
        angles = None if scanner is None else load_angles(scanner / "angles.json")
        model, motion = (None, None) if angles is None else (angles.servo, angles.motion)
        spins = None if motion is None else isinstance(motion, Spin)
        if dry_run:
            show(map(str, settings.wanted_changes(port, model, from_id, spins=spins)))
        else:
            print_steps(port, settings.set_up(port, model, from_id, folder, spins=spins))
