"""`scanwright doctor`: what is plugged in, how well it answers, what is wrong and what to do about it.

It reads. Only ports that were named, or whose USB ids are in the catalogue, are opened. A servo is listened to first,
then asked, and told nothing: whoever drives it goes on, and what it holds stays held. A lidar measures for a few
seconds, its laser on, and keeps no setting of that. What is to be set is set by `fix` alone, and `restore` undoes it.
"""

from __future__ import annotations

import platform
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from scanwright.design.angles import AngleSet, load_angles
from scanwright.design.errors import DeviceError
from scanwright.design.motion import Spin
from scanwright.firmware_io.device_ports import emulated, lidar_ports, servo_ports
from scanwright.firmware_io.lidar.families import open_lidar
from scanwright.firmware_io.scan.acquire import check_model
from scanwright.firmware_io.scan.axis_thread import SERVO_HZ
from scanwright.firmware_io.scan.lidar_scans import CLOCK_GOOD_NS
from scanwright.firmware_io.serial_port import latency_timer
from scanwright.firmware_io.servo import settings
from scanwright.firmware_io.servo.examine import examine_servo
from scanwright.firmware_io.servo.fitness import ServoSetupError

_LOOK_S = 4.0
_BOUND_MS = 2.0


@dataclass(frozen=True, slots=True)
class DeviceFinding:
    """One line of the diagnosis.

    Attributes:
        verdict: whether something must be done.
        says: what was seen; ends with the remedy if something is wrong.
        set_up: port of the servo whose set-up is the remedy, or was made; None if there is no such servo.
        undo: file from which that set-up can be undone; None if it was not made.
    """

    verdict: Literal["ok", "warning", "wrong"]
    says: str
    set_up: str | None = None
    undo: Path | None = None


def examine(out: Path | None, lidar: str | None, servo: str | None, servo_id: int | None) -> Iterator[DeviceFinding]:
    """Examine the named ports, else the emulated scanner of the build folder, else what the catalogue knows by USB ids.

    Args:
        out: build folder; its angle set says which devices it should be.
        lidar: address.
        servo: port.
        servo_id: number of the servo on its bus; None if it is alone.
    """
    yield DeviceFinding("ok", f"python {platform.python_version()} on {platform.system()} {platform.machine()}")
    angles = None if out is None else load_angles(out / "angles.json")
    twins = None if out is None else emulated(out)
    lidars, servos = [lidar] if lidar else lidar_ports(), [servo] if servo else servo_ports()
    if twins is not None and lidar is None and servo is None:
        yield DeviceFinding("ok", f"the scanner of {out} is emulated by process {twins.pid}")
        lidars, servos = [twins.lidar], [twins.servo]
    model, spins = _servo_of(angles)
    examinations = [_guarded(_examine_lidar(port, angles)) for port in lidars]
    examinations += [_guarded(_examine_servo(port, model, servo_id, spins=spins)) for port in servos]
    with ThreadPoolExecutor(max(len(examinations), 1)) as side_by_side:  # as a scan asks them
        for findings in side_by_side.map(list[DeviceFinding], examinations):
            yield from findings
    if not lidars:
        yield DeviceFinding(
            "wrong",
            "no lidar that is known by its USB ids: plug it in, give it power, or name it: --lidar /dev/ttyUSB0 or "
            "--lidar 192.168.0.10:10940",
        )
    if not servos:
        yield DeviceFinding(
            "wrong",
            "no adapter of a servo on USB: plug in its U2D2 or USB2Dynamixel, or name another with --servo PORT",
        )


def fix(out: Path | None, servo: str | None, servo_id: int | None) -> Iterator[DeviceFinding]:
    """Set what keeps a servo from working well; only on a port that was named, or of an emulated scanner.

    Args:
        out: build folder, which gets the file of the old settings; None for the working folder.
        servo: port.
        servo_id: number of the servo on its bus; None if it is alone.
    """
    twins = None if out is None else emulated(out)
    port = servo or (twins.servo if twins else None)
    if port is None:
        yield DeviceFinding("wrong", "a servo is set up only on a port that was named: name it with --servo PORT")
        return
    model, spins = _servo_of(None if out is None else load_angles(out / "angles.json"))
    yield from _told(settings.set_up(port, model, servo_id, Path() if out is None else out, spins=spins), port)


def restore(file: Path, servo: str | None) -> Iterator[DeviceFinding]:
    """Set a servo back to what `fix` found; `servo` is its port where that has another name now."""
    yield from _told(settings.restore(file, servo), servo)


def _servo_of(angles: AngleSet | None) -> tuple[str | None, bool | None]:
    """Model of the servo, and whether it spins, as far as an angle set says so."""
    if angles is None:
        return None, None
    return angles.servo, None if angles.motion is None else isinstance(angles.motion, Spin)


def _told(steps: Iterator[str | Path], port: str | None) -> Iterator[DeviceFinding]:
    yield from _guarded(
        DeviceFinding("ok", f"the old settings are kept in {step}", port, step)
        if isinstance(step, Path)
        else DeviceFinding("ok", step)
        for step in steps
    )


def _guarded(examination: Iterator[DeviceFinding]) -> Iterator[DeviceFinding]:
    """A device that fails ends its own examination only."""
    try:
        yield from examination
    except ServoSetupError as error:
        for change in error.changes:
            yield DeviceFinding("wrong", f"{error.port}: servo {error.servo_id}: {change}", set_up=error.port)
    except DeviceError as error:
        for line in (str(error), *getattr(error, "__notes__", ())):
            yield DeviceFinding("wrong", line)


def _examine_lidar(port: str, angles: AngleSet | None) -> Iterator[DeviceFinding]:
    with open_lidar(port, angles.sensor if angles else None) as lidar:
        told = {"serial number": lidar.serial_number, "firmware": lidar.firmware}
        yield DeviceFinding("ok", ", ".join([f"{port}: {lidar.model}", *(f"{k} {v}" for k, v in told.items() if v)]))
        if angles is not None:
            check_model(angles, lidar)
        for says in lidar.condition():
            yield DeviceFinding("ok", f"{port}: {says}")
        lidar.start()
        began_ns = lidar.read().arrival_ns
        late_ns: list[int] = []
        while True:
            timed = lidar.read()
            late_ns.append(timed.arrival_ns - timed.scan.stamp_ns)
            if timed.arrival_ns - began_ns > _LOOK_S * 1e9:
                break
        rate_hz = len(late_ns) / ((timed.arrival_ns - began_ns) / 1e9)
        lidar.stop()
    yield _judged(
        abs(rate_hz / lidar.scan_rate_hz - 1) < 0.02,
        f"{port}: {rate_hz:.1f} scans/s of {lidar.scan_rate_hz:.1f}",
        "scans are lost: try another cable or USB port, no hub, and look at the slip ring",
    )
    yield _judged(
        not lidar.bad_packets,
        f"{port}: {lidar.bad_packets} bad packets",
        "bits are lost on the way: look at cable and slip ring, lead the servo's supply apart from them",
    )
    jitter_ms = (max(late_ns) - min(late_ns)) / 1e6
    yield _judged(
        timed.uncertainty_ns < CLOCK_GOOD_NS,
        f"{port}: its clock is known to {timed.uncertainty_ns / 1e6:.2f} ms, scans come up to {jitter_ms:.1f} ms late",
        "this computer is busy: end other programs, or take another USB port",
    )
    if timed.warning:
        yield DeviceFinding("wrong", f"{port}: {timed.warning}")
    share = float(np.isfinite(timed.scan.range_m).mean())
    yield _judged(share > 0.1, f"{port}: {share:.0%} of the beams come back", "is the window covered or dirty?")


def _examine_servo(
    port: str, model: str | None, servo_id: int | None, *, spins: bool | None
) -> Iterator[DeviceFinding]:
    found = examine_servo(port, model, servo_id, spins=spins)
    yield DeviceFinding("ok", f"{found.who} ({found.model}), {found.speaks}")
    if found.reports:
        says = f"{found.who} reports {found.reports}: find out why before it turns again; `scan` resets it"
        yield DeviceFinding("warning", says)
    if found.has_torque:
        yield DeviceFinding("warning", f"{found.who} has its torque on: something has driven it, and it may move")
    for unfit in found.unfit:
        yield DeviceFinding("warning", f"{found.who}: {unfit}", set_up=port)
    if found.slow_adapter:
        yield DeviceFinding("warning", f"{port}: {found.slow_adapter}")
    yield DeviceFinding("ok", f"{port}: {found.voltage_V:.1f} V, {found.temperature_degC:.0f} deg C")
    remedy = "set the latency timer of the adapter to 1 ms" if latency_timer(port) else "end other programs"
    yield _judged(
        found.reads_hz > 1.2 * SERVO_HZ,
        f"{port}: {found.reads_hz:.0f} reads/s, {SERVO_HZ:.0f} are needed",
        f"{remedy}, and mind the servo's settings above",
    )
    yield _judged(
        found.bound_ms < _BOUND_MS, f"{port}: the time of an angle is known to {found.bound_ms:.2f} ms", remedy
    )


def _judged(good: bool, says: str, remedy: str) -> DeviceFinding:
    return DeviceFinding("ok", says) if good else DeviceFinding("warning", f"{says}: {remedy}")
