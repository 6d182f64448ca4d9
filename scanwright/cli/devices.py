"""Commands that talk to devices: emulate, scan, ros2, doctor, servo-setup."""

from __future__ import annotations

import math
from contextlib import AbstractContextManager, closing, nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from typer import Argument, Option

from scanwright.cli.arguments import AllowOrigin, AsJson, BuildFolder, Intensity, Lidar, Rate, ServoId, ServoPort
from scanwright.cli.console import (
    ConsoleProgress,
    exit_code,
    high_priority,
    hint,
    print_error,
    require_pages,
    show,
    show_json,
    show_result,
)
from scanwright.cli.help import Commands
from scanwright.cli.servo_setup import asking_first, print_steps, set_up_command
from scanwright.design.errors import ScanwrightError, notes_of, require
from scanwright.design.findings import errors_in
from scanwright.firmware_io.capture import capturing, replaying
from scanwright.firmware_io.posix import require_posix
from scanwright.firmware_io.scan.scan_end import ScanEnd, failed, finished, stopped

if TYPE_CHECKING:
    from scanwright.cli.results.of_commands import Devices
    from scanwright.firmware_io.scan.live_feed import Viewer
    from scanwright.firmware_io.scan.plan import ScanPlan
    from scanwright.firmware_io.scan.scan_end import ScanSummary

app = Commands("Devices", first=require_posix)


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


@app.command(example="emulate out/ground_ahead")
def emulate(
    out: Annotated[Path | None, Argument(metavar="BUILD", help="Build folder of the scanner.")] = None,
    scene: Annotated[Path | None, Option(metavar="MESH", help="Surroundings [default: a furnished room].")] = None,
    unit_m: Annotated[float, Option(metavar="M", help="Length of one mesh unit; 0.001 for mm.")] = 1.0,
    at: Annotated[tuple[float, float, float], Option(metavar="X Y Z", help="Position in the scene, metres.")] = (
        0.0,
        0.0,
        0.0,
    ),
    noise_mm: Annotated[float | None, Option(min=0, metavar="SIGMA", help="Range noise [default: data sheet].")] = None,
    seed: Annotated[int, Option(min=0, metavar="N", help="Random seed.")] = 0,
    factory_servo: Annotated[bool, Option("--factory-servo", help="Servo with factory settings.")] = False,
    replay: Annotated[
        Path | None, Option(metavar="FILE", help="Emulate the devices of a `doctor --capture` instead.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Run an emulated lidar and servo.

    Runs until Ctrl-C. `scan`, `doctor` and `ros2` detect the emulated devices of the same build folder. Devices of a
    capture have no build folder: name their ports in those commands.
    """
    if (out is None) == (replay is None):
        raise ScanwrightError("BUILD, --replay: choose one of them")
    if replay is not None:
        with suppress(KeyboardInterrupt), high_priority(), replaying(replay) as terminals:
            show([f"{port} of the capture at {terminal}" for port, terminal in terminals.items()])
            Event().wait()
        return
    assert out is not None
    ConsoleProgress()("starting the emulated devices (the first run compiles the numerics)")
    from scanwright.cli.results.of_commands import Devices
    from scanwright.design.angles import load_angles
    from scanwright.firmware_io.device_ports import announced
    from scanwright.firmware_io.emulators.head import read_load
    from scanwright.firmware_io.emulators.scanner import emulated_scanner
    from scanwright.firmware_io.emulators.world import room

    angles = load_angles(out / "angles.json")
    place = room(scene, unit_m, at)
    with (
        suppress(KeyboardInterrupt),
        high_priority(),
        emulated_scanner(
            angles, place, load=read_load(out, angles), sigma_mm=noise_mm, seed=seed, factory_servo=factory_servo
        ) as emulators,
        announced(out, emulators.ports),
    ):
        places = [place for place in (emulators.ports.lidar, emulators.lidar.address) if place]
        lines = [
            f"lidar {angles.sensor} at {' and '.join(places)}",
            f"servo {angles.servo} at {emulators.ports.servo}",
        ]
        devices = Devices(angles.sensor, angles.servo, places, emulators.ports.servo)
        show_result(lambda: lines, devices, as_json)
        hint(f"next: `scanwright scan {out}` in another terminal; Ctrl-C ends this one")
        Event().wait()


@app.command(example="scan out/ground_ahead --live")
def scan(
    out: BuildFolder,
    turns: Annotated[int, Option(metavar="N", help="Number of full scans.")] = 1,
    period_s: Annotated[
        float | None, Option(metavar="S", help="Time of a full scan [default: as in the task].")
    ] = None,
    lidar: Lidar = None,
    servo: ServoPort = None,
    servo_id: ServoId = None,
    recording: Annotated[
        Path | None,
        Option("--recording", "-o", metavar="FILE.mcap", help="Output [default: BUILD/recordings/DATE.mcap]."),
    ] = None,
    intensity: Intensity = False,
    cluster: Annotated[int, Option(min=1, max=99, metavar="N", help="Merge N steps into the smallest range.")] = 1,
    every: Annotated[int, Option(min=1, max=10, metavar="N", help="Use every Nth scan of the lidar.")] = 1,
    stamp_at: Annotated[
        Literal["step_0", "rear", "first_beam", "last_beam"] | None,
        Option(help="Beam of the lidar's timestamps: Hokuyo step_0, rear; SICK first_beam, last_beam."),
    ] = None,
    echo: Annotated[Literal["first", "last"] | None, Option(help="Echo that a SICK reports, until power-off.")] = None,
    mean_filter_off: Annotated[
        bool, Option("--mean-filter-off", help="Switch a SICK's mean filter off, until power-off.")
    ] = False,
    dry_run: Annotated[bool, Option("--dry-run", help="Print the plan and exit.")] = False,
    live: Annotated[bool, Option("--live", help="Show the growing cloud in the browser.")] = False,
    foxglove: Annotated[bool, Option("--foxglove", help="Serve scans and points to Foxglove.")] = False,
    allow_origin: AllowOrigin = None,
    as_json: AsJson = False,
) -> None:
    """Record a full scan and assemble its point cloud.

    The cloud is written next to the recording.
    """
    if live:
        require_pages("scan --live")
    if live + foxglove + as_json > 1:
        raise ScanwrightError("--live, --foxglove, --json: choose one of them")
    viewer = _viewer(out, live=live, foxglove=foxglove, allow_origins=allow_origin)
    from scanwright import api
    from scanwright.cli.results.scans import ScanResult
    from scanwright.design.angles import CALIBRATED
    from scanwright.firmware_io.scan.plan import plan_scan

    plan = plan_scan(
        out,
        turns=turns,
        period_s=period_s,
        lidar=lidar,
        servo=servo,
        servo_id=servo_id,
        recording=recording,
        intensity=intensity,
        cluster=cluster,
        every=every,
        stamp_at=stamp_at,
        echo=echo,
        mean_filter_off=mean_filter_off,
    )
    progress = ConsoleProgress()
    result = ScanResult(_devices_of(plan), plan.angles_path, plan.duration_s)
    if not as_json:
        show(plan.lines())
    if dry_run:
        show_result(tuple, result, as_json)
        return
    with viewer as watch, closing(watch):
        try:
            recorded = _acquired(plan, progress, watch, out, servo_id)
            watch.ended(finished(recorded))  # the devices are at rest, even if assembling fails
            progress(f"recorded {recorded.duration_s:.1f} s, assembling")
            if not as_json:
                show(recorded.lines())
            cloud = api.assemble(plan.recording, plan.angles_path, plan.recording.with_suffix(".ply"))
            watch.ended(finished(recorded, cloud.lines()))
            show_result(cloud.lines, replace(result, recording=recorded, cloud=cloud), as_json)
            if (calibrated := out / CALIBRATED).exists():
                hint(f"next: `scanwright view {plan.recording} --angles {calibrated}`")
            else:
                hint(f"next: `scanwright calibrate {plan.recording} --angles {out / 'angles.json'} -o {calibrated}`")
        except ScanwrightError as error:
            _end(watch, failed(error), plan.recording)
            raise typer.Exit(exit_code(error)) from None


def _devices_of(plan: ScanPlan) -> Devices:
    from scanwright.cli.results.of_commands import Devices

    return Devices(plan.angles.sensor, plan.angles.servo, [plan.ports.lidar], plan.ports.servo)


def _acquired(plan: ScanPlan, progress: ConsoleProgress, watch: Viewer, out: Path, servo_id: int | None) -> ScanSummary:
    """Record a scan, after the user has agreed to changes of servo settings; Ctrl-C ends the command."""
    from scanwright.firmware_io.scan.acquire import acquire

    try:
        with high_priority():
            return asking_first(lambda: acquire(plan, progress, watch), out, servo_id)
    except KeyboardInterrupt as stop:
        _end(watch, stopped(stop), plan.recording)
        raise typer.Exit(130) from None


def _end(watch: Viewer, end: ScanEnd, recording: Path) -> None:
    """Print how a scan ended early on standard error, and pass it to the viewer."""
    recorded_in = (f"what was recorded is in {recording}",) if recording.exists() else ()
    end = replace(end, lines=(*end.lines, *recorded_in))
    for line in end.lines:
        print_error(line)
    watch.ended(end)


@app.command(example="ros2 out/ground_ahead -- --ros-args -r scan:=front/scan")
def ros2(
    out: BuildFolder,
    ros_args: Annotated[
        list[str] | None,
        Argument(metavar="-- ROS_ARGS", help="Arguments of the node."),
    ] = None,
    recording: Annotated[
        Path | None, Option(metavar="FILE.mcap", help="Publish a recording instead, with /clock.")
    ] = None,
    rate: Rate = 1.0,
    straight: Annotated[bool, Option("--straight", help="Interpolate joint angles linearly (less latency).")] = False,
    points_per: Annotated[Literal["scan", "turn"], Option(help="One message of points per scan or turn.")] = "scan",
    points_in: Annotated[
        Literal["world", "rot"], Option(help="Frame of the points; rot needs --points-per scan.")
    ] = "world",
    no_tf: Annotated[bool, Option("--no-tf", help="Do not publish tf.")] = False,
    lidar: Lidar = None,
    servo: ServoPort = None,
    servo_id: ServoId = None,
    intensity: Intensity = False,
    foxglove: Annotated[bool, Option("--foxglove", help="Also serve the data to Foxglove.")] = False,
    allow_origin: AllowOrigin = None,
    as_json: AsJson = False,
) -> None:
    """Run the scanner as a ROS 2 node.

    Publishes scans, joint angles, frames and motion-corrected points until Ctrl-C.
    """
    require(
        "ros",
        "ros2 needs rclpy: source the setup.bash of your ROS 2 (its Python is the one to install scanwright in), or",
        "rclpy",
        "sensor_msgs",
    )
    if foxglove and recording is not None:
        raise ScanwrightError(
            "--foxglove, --recording: choose one of them (`scanwright view` serves a recording to Foxglove)"
        )
    viewer = _viewer(out, foxglove=foxglove, allow_origins=allow_origin)
    from scanwright.cli.results.of_commands import Published
    from scanwright.firmware_io.ros.node import Publishing
    from scanwright.firmware_io.ros.serve import serve_devices, serve_recording
    from scanwright.firmware_io.scan.plan import plan_scan

    node_arguments = ros_args or []
    points = Publishing(not straight, points_per == "turn", points_in, not no_tf)
    try:
        if recording is not None:
            show_result(tuple, Published(None, recording), as_json)
            serve_recording(out, recording, node_arguments, ConsoleProgress(), points, rate=rate)
            return
        plan = plan_scan(out, lidar=lidar, servo=servo, servo_id=servo_id, intensity=intensity, endless=True)
        show_result(plan.lines, Published(_devices_of(plan), None), as_json)
        with high_priority(), viewer as watch:
            asking_first(
                lambda: serve_devices(out, plan, node_arguments, ConsoleProgress(), points, watch), out, servo_id
            )
    except KeyboardInterrupt as stop:
        for line in ("stopped", *notes_of(stop)):
            print_error(line)
        raise typer.Exit(130) from None


@app.command(example="doctor out/ground_ahead", no="a problem was found")
def doctor(
    out: Annotated[Path | None, Argument(metavar="BUILD", help="Build folder of the scanner.")] = None,
    lidar: Lidar = None,
    servo: ServoPort = None,
    servo_id: ServoId = None,
    fix: Annotated[bool, Option("--fix", help="Correct servo settings; saves the old ones.")] = False,
    restore: Annotated[Path | None, Option(metavar="FILE.json", help="Restore saved settings and exit.")] = None,
    capture: Annotated[
        Path | None, Option(metavar="FILE", help="Write the raw bytes of the devices to a file.")
    ] = None,
    udev: Annotated[bool, Option("--udev", help="Print udev rules for the adapters and exit.")] = False,
    as_json: AsJson = False,
) -> None:
    """Diagnose the connected lidar and servo.

    Reads only, unless --fix or --restore is given.
    """
    from scanwright.cli.results.of_commands import Diagnosis
    from scanwright.firmware_io.scan import doctor as diagnosis
    from scanwright.firmware_io.scan import host
    from scanwright.firmware_io.servo import settings

    if udev:
        print(host.udev_rules(), end="")
        return
    if restore is not None:
        print_steps("", settings.restore(restore, servo), as_json)
        return
    if fix:
        port, steps = diagnosis.fix(out, servo, servo_id)
        print_steps(port, steps) if not as_json else list(steps)
    findings = []
    with nullcontext() if capture is None else capturing(capture):
        for finding in diagnosis.examine(out, lidar, servo, servo_id):
            hint = finding.hint
            if finding.code == diagnosis.SERVO_SETTING:
                hint = f"`{set_up_command(finding.subject, out, servo_id)}` sets it"
            if finding.code in host.CURED_BY_RULES:
                hint += " (`scanwright doctor --udev` prints them)"
            findings.append(replace(finding, hint=hint))
            if not as_json:
                print(f"{finding.severity:8} {finding.message}{hint and f': {hint}'}", flush=True)
    if as_json:
        show_json(Diagnosis(findings))
    raise typer.Exit(1 if errors_in(findings) else 0)


@app.command("servo-setup", example="servo-setup /dev/ttyUSB0 --id 1 --baud 1000000")
def servo_setup(
    port: Annotated[str, Argument(metavar="PORT", help="Serial port of the servo.")],
    scanner: Annotated[Path | None, Option(metavar="BUILD", help="Build folder with the motion.")] = None,
    new_id: Annotated[int | None, Option("--id", metavar="N", help="New id, 0 to 252; nothing else.")] = None,
    new_baud: Annotated[int | None, Option("--baud", metavar="B", help="New baud rate; nothing else.")] = None,
    from_id: Annotated[
        int | None, Option(min=0, max=252, metavar="N", help="Current id, if several servos answer.")
    ] = None,
    from_baud: Annotated[int | None, Option(metavar="B", help="Current baud rate [default: try all].")] = None,
    undo: Annotated[Path | None, Option(metavar="FILE.json", help="Restore saved settings and exit.")] = None,
    centre: Annotated[bool, Option("--centre", help="Turn the horn to its centre and exit.")] = False,
    dry_run: Annotated[bool, Option("--dry-run", help="Print what would be written, and exit.")] = False,
    as_json: AsJson = False,
) -> None:
    """Set up a servo, or set its id or baud rate.

    Writes the settings that a scan needs, verifies them, and saves the old ones for --undo.
    """
    from scanwright.cli.results.of_commands import Settings
    from scanwright.design.angles import load_angles
    from scanwright.design.motion import Spin
    from scanwright.firmware_io.servo import settings
    from scanwright.firmware_io.servo.address import set_address

    numbers = new_id is not None or new_baud is not None
    if sum([numbers, undo is not None, centre, scanner is not None or dry_run]) > 1:
        raise ScanwrightError("--id and --baud, --undo, --centre, --scanner and --dry-run: choose one of these")
    folder = scanner or Path()
    if centre:
        from scanwright.firmware_io.servo.centre import turn_to_centre

        at_deg = math.degrees(asking_first(lambda: turn_to_centre(port, servo_id=from_id), folder, from_id))
        show_result(lambda: [f"{at_deg:+.1f} deg from its centre, torque off"], Settings([], None, at_deg), as_json)
    elif undo is not None:
        print_steps(port, settings.restore(undo, port), as_json)
    elif numbers:
        print_steps(port, set_address(port, new_id, new_baud, from_id, from_baud, folder), as_json)
    else:
        angles = None if scanner is None else load_angles(scanner / "angles.json")
        model, motion = (None, None) if angles is None else (angles.servo, angles.motion)
        spins = None if motion is None else isinstance(motion, Spin)
        if dry_run:
            changes = [str(change) for change in settings.pending_changes(port, model, from_id, spins=spins)]
            show_result(lambda: changes, Settings(changes), as_json)
        else:
            print_steps(port, settings.set_up(port, model, from_id, folder, spins=spins), as_json)
