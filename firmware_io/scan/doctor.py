"""`scanwright doctor`: what is plugged in, how well it answers, what is wrong and what to do about it.

Nothing turns; the laser is on for a few seconds.
"""

from __future__ import annotations

import platform
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Literal

import numpy as np

from design.angles import AngleSet, load_angles
from design.errors import DeviceError
from firmware_io.device_ports import emulated, lidar_ports, servo_ports
from firmware_io.lidar.scip.driver import new_clock, open_lidar
from firmware_io.scan.acquire import CLOCK_GOOD_NS, check_model
from firmware_io.scan.axis_thread import SERVO_HZ
from firmware_io.servo.dynamixel.driver import open_servo

_LOOK_S = 4.0
_SERVO_READS = 100
_BOUND_MS = 2.0


@dataclass(frozen=True, slots=True)
class DeviceFinding:
    """One line of the diagnosis; `says` ends with the remedy where something is wrong."""

    verdict: Literal["ok", "warning", "wrong"]
    says: str


def examine(out: Path | None, lidar: str | None, servo: str | None) -> Iterator[DeviceFinding]:
    """Examine the named ports, else the emulated scanner of the build folder, else whatever is plugged in."""
    yield DeviceFinding("ok", f"python {platform.python_version()} on {platform.system()} {platform.machine()}")
    angles = None if out is None else load_angles(out / "angles.json")
    twins = None if out is None else emulated(out)
    lidars, servos = [lidar] if lidar else lidar_ports(), [servo] if servo else servo_ports()
    if twins is not None and lidar is None and servo is None:
        yield DeviceFinding("ok", f"the scanner of {out} is emulated by process {twins.pid}")
        lidars, servos = [twins.lidar], [twins.servo]
    for port in lidars:
        yield from _guarded(_examine_lidar(port, angles))
    for port in servos:
        yield from _guarded(_examine_servo(port, angles.servo if angles else None))
    if not lidars:
        yield DeviceFinding(
            "wrong",
            "no Hokuyo sensor on USB: plug it in (12 V and USB), or give an Ethernet one as --lidar 192.168.0.10:10940",
        )
    if not servos:
        yield DeviceFinding(
            "wrong", "no serial adapter on USB: plug in the servo's U2D2 or USB2Dynamixel, or give --servo PORT"
        )


def _guarded(examination: Iterator[DeviceFinding]) -> Iterator[DeviceFinding]:
    """A device that fails ends its own examination only."""
    try:
        yield from examination
    except DeviceError as error:
        yield DeviceFinding("wrong", str(error))


def _examine_lidar(port: str, angles: AngleSet | None) -> Iterator[DeviceFinding]:
    with open_lidar(port) as lidar:
        yield DeviceFinding(
            "ok", f"{port}: {lidar.model}, serial number {lidar.serial_number}, firmware {lidar.firmware}"
        )
        if angles is not None:
            check_model(angles, lidar)
        clock, expected_hz = new_clock(lidar), 1 / lidar.parameters.scan_period_s
        lidar.start()
        began_ns = lidar.read().arrival_ns
        late_ns: list[int] = []
        while True:
            raw = lidar.read()
            moment = clock.update(raw.stamp_ms, raw.arrival_ns, raw.restarts)
            late_ns.append(raw.arrival_ns - moment.time_ns)
            if raw.arrival_ns - began_ns > _LOOK_S * 1e9:
                break
        rate_hz = len(late_ns) / ((raw.arrival_ns - began_ns) / 1e9)
        lidar.stop()
    yield _judged(
        abs(rate_hz / expected_hz - 1) < 0.02,
        f"{port}: {rate_hz:.1f} scans/s of {expected_hz:.1f}",
        "scans are lost: try another cable or USB port, no hub, and look at the slip ring",
    )
    yield _judged(
        not lidar.bad_packets,
        f"{port}: {lidar.bad_packets} bad packets",
        "bits are lost on the way: look at cable and slip ring, lead the servo's supply apart from them",
    )
    jitter_ms = (max(late_ns) - min(late_ns)) / 1e6
    yield _judged(
        moment.uncertainty_ns < CLOCK_GOOD_NS,
        f"{port}: its clock is known to {moment.uncertainty_ns / 1e6:.2f} ms, scans come up to {jitter_ms:.1f} ms late",
        "this computer is busy: end other programs, or take another USB port",
    )
    share = float(np.isfinite(raw.range_m).mean())
    yield _judged(share > 0.1, f"{port}: {share:.0%} of the beams come back", "is the window covered or dirty?")


def _examine_servo(port: str, model: str | None) -> Iterator[DeviceFinding]:
    with open_servo(port, model) as servo:
        yield DeviceFinding("ok", f"{servo}, protocol {servo.protocol:.1f} at {servo.baud} baud")
        for warning in servo.warnings():
            yield DeviceFinding("warning", f"{port}: {warning}")
        began_s = time.monotonic()
        states = [servo.read() for _ in range(_SERVO_READS)]
        rate_hz = _SERVO_READS / (time.monotonic() - began_s)
    last = states[-1]
    yield DeviceFinding("ok", f"{port}: {last.voltage_V:.1f} V, {last.temperature_degC:.0f} deg C")
    yield _judged(
        rate_hz > 1.2 * SERVO_HZ,
        f"{port}: {rate_hz:.0f} reads/s, {SERVO_HZ:.0f} are needed",
        "set the latency timer of the adapter to 1 ms, and the servo to 1 Mbaud",
    )
    bound_ms = median(state.time_bound_ns for state in states) / 1e6
    yield _judged(
        bound_ms < _BOUND_MS,
        f"{port}: the time of an angle is known to {bound_ms:.2f} ms",
        "set the latency timer of the adapter to 1 ms",
    )


def _judged(good: bool, says: str, remedy: str) -> DeviceFinding:
    return DeviceFinding("ok", says) if good else DeviceFinding("warning", f"{says}: {remedy}")
