"""Diagnosis of the connected devices, with remedies.

It only reads. It opens the given ports, and those whose USB ids are in the catalogue. A servo is read only if no other
program drives it. A lidar measures for a few seconds, its laser on, and keeps no setting.
"""

from __future__ import annotations

import platform
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from statistics import median

import numpy as np

from scanwright.design.angles import AngleSet, load_angles
from scanwright.design.errors import DeviceError, notes_of
from scanwright.design.findings import Finding
from scanwright.design.motion import Spin
from scanwright.firmware_io.device_ports import emulated, lidar_ports, servo_ports
from scanwright.firmware_io.lidar.families import open_lidar
from scanwright.firmware_io.scan.acquire import check_model
from scanwright.firmware_io.scan.axis_thread import SERVO_HZ
from scanwright.firmware_io.scan.host import examine_host
from scanwright.firmware_io.scan.lidar_scans import CLOCK_GOOD_NS
from scanwright.firmware_io.serial_port import latency_timer
from scanwright.firmware_io.servo import settings
from scanwright.firmware_io.servo.find import find_servo, listen_first, open_bus
from scanwright.firmware_io.servo.fitness import ServoSetupError, slow_adapter, unfit_settings

SERVO_SETTING = "servo_setting"  # code of a finding that a set-up of the servo at port `subject` solves
_MEASURED_S = 4.0  # 40 turns of the slowest lidar: a rate within 2.5 %
_RATE_WITHIN = 0.02  # data sheets specify 1 to 2 %
_RETURNS_LEAST = 0.1  # of the beams; only scenes outdoors have fewer
_BOUND_MS = 2.0  # 0.12 deg at 60 deg/s
_READS = 100  # one second
_READS_HZ = 1.2 * SERVO_HZ  # with a reserve


def examine(out: Path | None, lidar: str | None, servo: str | None, servo_id: int | None) -> Iterator[Finding]:
    """Examine the given ports, the emulated scanner of the build folder, or the ports with USB ids of the catalogue.

    The angle set of the build folder `out` names the expected devices; `servo_id` is None for the only servo.
    """
    yield _ok("system", "", f"python {platform.python_version()} on {platform.system()} {platform.machine()}")
    angles = None if out is None else load_angles(out / "angles.json")
    emulators = None if out is None else emulated(out)
    lidars, servos = [lidar] if lidar else lidar_ports(), [servo] if servo else servo_ports()
    if emulators is not None and lidar is None and servo is None:
        yield _ok("emulated", str(out), f"the scanner of {out} is emulated by process {emulators.pid}")
        lidars, servos = [emulators.lidar], [emulators.servo]
    else:
        yield from examine_host([*lidars, *servos])
    model, spins = _servo_of(angles)
    examinations = [_guarded(port, _examine_lidar(port, angles)) for port in lidars]
    examinations += [_guarded(port, _examine_servo(port, model, servo_id, spins=spins)) for port in servos]
    with ThreadPoolExecutor(max(len(examinations), 1)) as together:  # as a scan reads them
        for findings in together.map(list[Finding], examinations):
            yield from findings
    elsewhere = [file.parent for file in sorted(Path("out").glob("*/emulated.json")) if emulated(file.parent)]
    named = "".join(f"; an emulated scanner runs: name its build folder {folder}" for folder in elsewhere)
    if not lidars:
        hint = "plug it in, power it, or name its port or HOST:PORT" + named
        yield Finding("lidar_absent", "error", "lidar", "no lidar with a USB id of the catalogue", hint=hint)
    if not servos:
        hint = "plug in its U2D2 or USB2Dynamixel, or name the port of another adapter" + named
        yield Finding("servo_absent", "error", "servo", "no adapter of a servo on USB", hint=hint)


def fix(out: Path | None, servo: str | None, servo_id: int | None) -> tuple[str, Iterator[str | Path]]:
    """Correct servo settings of a given port or an emulated scanner; DeviceError without either.

    The build folder `out`, or the working folder, gets the undo file. Returns the port, and the steps of
    `settings.set_up`.
    """
    emulators = None if out is None else emulated(out)
    port = servo or (emulators.servo if emulators else None)
    if port is None:
        raise DeviceError("servo: no port given; a servo is set up only on a port that is named")
    model, spins = _servo_of(None if out is None else load_angles(out / "angles.json"))
    return port, settings.set_up(port, model, servo_id, Path() if out is None else out, spins=spins)


def _servo_of(angles: AngleSet | None) -> tuple[str | None, bool | None]:
    """Return the model of the servo, and whether it spins; None if the angle set does not specify it."""
    if angles is None:
        return None, None
    return angles.servo, None if angles.motion is None else isinstance(angles.motion, Spin)


def _guarded(port: str, examination: Iterator[Finding]) -> Iterator[Finding]:
    """Convert the errors of an examination to findings."""
    try:
        yield from examination
    except ServoSetupError as error:
        for change in error.changes:
            yield Finding(SERVO_SETTING, "error", port, f"{port}: servo {error.servo_id}: {change}")
    except DeviceError as error:
        for line in (str(error), *notes_of(error)):
            yield Finding("device_failed", "error", port, line)


def _examine_lidar(port: str, angles: AngleSet | None) -> Iterator[Finding]:
    with open_lidar(port, angles.sensor if angles else None) as lidar:
        identity = {"serial number": lidar.serial_number, "firmware": lidar.firmware}
        known = [f"{name} {value}" for name, value in identity.items() if value]
        yield _ok("lidar_identity", port, ", ".join([f"{port}: {lidar.model}", *known]))
        if angles is not None:
            check_model(angles, lidar)
        for condition in lidar.condition():
            yield _ok("lidar_condition", port, f"{port}: {condition}")
        lidar.start()
        began_ns = lidar.read().arrival_ns
        late_ns: list[int] = []
        while True:
            timed = lidar.read()
            late_ns.append(timed.arrival_ns - timed.scan.stamp_ns)
            if timed.arrival_ns - began_ns > _MEASURED_S * 1e9:
                break
        rate_hz = len(late_ns) / ((timed.arrival_ns - began_ns) / 1e9)
        lidar.stop()
    jitter_ms, uncertainty_ms = (max(late_ns) - min(late_ns)) / 1e6, timed.uncertainty_ns / 1e6
    share = float(np.isfinite(timed.scan.range_m).mean())
    rate = f"scan rate: {rate_hz:.1f} Hz (nominal {lidar.scan_rate_hz:.1f})"
    late = f"timestamp uncertainty: {uncertainty_ms:.2f} ms; scans arrive up to {jitter_ms:.1f} ms late"
    slip_ring = "check cable and slip ring, and route the servo's supply apart from them"
    even = abs(rate_hz / lidar.scan_rate_hz - 1) < _RATE_WITHIN
    yield _judged(even, "scan_rate", port, rate, rate_hz, lidar.scan_rate_hz, "Hz", f"no USB hub; {slip_ring}")
    bad = lidar.bad_packets
    yield _judged(not bad, "bad_packets", port, f"bad packets: {bad}", bad, 0, "", slip_ring)
    exact = timed.uncertainty_ns < CLOCK_GOOD_NS
    yield _judged(exact, "timestamp", port, late, uncertainty_ms, CLOCK_GOOD_NS / 1e6, "ms", "end other programs")
    if timed.warning:
        yield Finding("lidar_warning", "error", port, f"{port}: {timed.warning}")
    returns, window = f"beams with a return: {share:.0%}", "check whether the window is covered or dirty"
    yield _judged(share > _RETURNS_LEAST, "returns", port, returns, share, _RETURNS_LEAST, "", window)


def _examine_servo(port: str, model: str | None, servo_id: int | None, *, spins: bool | None) -> Iterator[Finding]:
    with closing(open_bus(port)) as bus:
        listen_first(bus)
        unit = find_servo(bus, model, servo_id)
        table, name = unit.table, str(unit)
        protocol = f"protocol {table.protocol} at {bus.baud} baud"
        reports, has_torque = unit.reported_fault(unit.present()), unit.has_torque()
        unfit = unfit_settings(unit, spins=spins)
        bus.return_delay_ns = unit.value(table.return_delay_ns)
        began_s = time.monotonic()
        answers = [unit.present() for _ in range(_READS)]
        reads_hz = _READS / (time.monotonic() - began_s)
    bound_ms = median(answer.bound_ns for answer in answers) / 1e6
    volts, degC = (table.pick(register, answers[-1].data) for register in (table.voltage, table.temperature))
    yield _ok("servo_identity", port, f"{name} ({table.model}), {protocol}")
    if reports:
        hint = "find the cause before it turns again; a scan resets it"
        yield Finding("servo_fault", "warning", port, f"{name} reports {reports}", hint=hint)
    if has_torque:
        moving = f"{name} has its torque on: a program drives it, and it may move"
        yield Finding("servo_torque", "warning", port, moving)
    for change in unfit:
        yield Finding(SERVO_SETTING, "warning", port, f"{name}: {change}")
    if timer := slow_adapter(port):
        yield Finding("adapter_latency", "warning", port, f"{port}: {timer}")
    yield _ok("servo_supply", port, f"{port}: {volts:.1f} V, {degC:.0f} deg C")
    hint = "set the latency timer of the adapter to 1 ms" if latency_timer(port) else "end other programs"
    reads = f"read rate: {reads_hz:.0f} Hz (required {SERVO_HZ:.0f})"
    angle_time = f"timestamp uncertainty of an angle: {bound_ms:.2f} ms"
    yield _judged(reads_hz > _READS_HZ, "read_rate", port, reads, reads_hz, _READS_HZ, "Hz", hint)
    yield _judged(bound_ms < _BOUND_MS, "angle_time", port, angle_time, bound_ms, _BOUND_MS, "ms", hint)


def _ok(code: str, subject: str, message: str) -> Finding:
    return Finding(code, "ok", subject, message)


def _judged(good: bool, code: str, port: str, text: str, value: float, limit: float, unit: str, hint: str) -> Finding:
    """Return a finding that is ok, or a warning with a hint."""
    return Finding(code, "ok" if good else "warning", port, f"{port}: {text}", value, limit, unit, "" if good else hint)
