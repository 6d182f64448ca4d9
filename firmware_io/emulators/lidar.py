"""Emulator of Hokuyo lidars, with the timing and the faults of real ones."""

from __future__ import annotations

import time

from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import DeviceError, suggest
from scanwright.firmware_io.emulators.hokuyo_models import IDENTITIES, Quartz
from scanwright.firmware_io.emulators.lidar_line import LidarLine, Ranging
from scanwright.firmware_io.emulators.lidar_machine import LidarMachine, TurnRanging
from scanwright.firmware_io.lidar.scip import measurement

_MOTOR_ERROR = 2e-3  # relative, turns are longer than reported
_HEAD = 32  # bytes of a scan before its ranges: echo, status, stamp


def hokuyo_emulator(
    model: str,
    ranging: TurnRanging,
    *,
    rate_error: float = 0.0,
    jitter_s: float = 0.0,
    clock_ms: int = 0,
    scanning: bool = False,
    scip_1: bool = False,
    seed: int = 0,
) -> LidarLine[LidarMachine]:
    """Return the emulator of a Hokuyo.

    Args:
        model: a key of `IDENTITIES`.
        ranging: as `Ranging` for all measured steps; called once per turn.
        rate_error: of the sensor's clock, 5e-5 is 50 ppm fast.
        jitter_s: largest random delay of scans.
        clock_ms: sensor time at the start.
        scanning: whether it scans from the start.
        scip_1: whether it starts in SCIP 1.1.
        seed: of the jitter.
    """
    if model not in IDENTITIES:
        raise DeviceError(f"no emulator of the lidar '{model}'{suggest(model, IDENTITIES)}")
    quartz = Quartz(time.monotonic_ns(), clock_ms, rate_error)
    machine = LidarMachine(IDENTITIES[model], ranging, quartz, motor_error=_MOTOR_ERROR, scip_1=scip_1)
    if scanning:
        machine.answer(measurement.continuous(machine.identity.parameters.window), time.monotonic_ns())
    return LidarLine(model, machine, jitter_s=jitter_s, head=_HEAD, seed=seed)


def scip_emulator(lidar: Lidar, ranging: Ranging, seed: int = 0) -> LidarLine[LidarMachine]:
    """Return the emulator of a catalogue sensor; raises as `hokuyo_emulator`."""
    bearing_rad = lidar.bearings_rad()
    return hokuyo_emulator(lidar.name, lambda time_ns: ranging(time_ns, bearing_rad), seed=seed)
