"""A Hokuyo lidar in software, with the timing and the faults of a real one."""

from __future__ import annotations

import time

from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import DeviceError, suggest
from scanwright.firmware_io.emulators.hokuyo_models import IDENTITIES, Quartz
from scanwright.firmware_io.emulators.lidar_line import LidarLine, Ranging
from scanwright.firmware_io.emulators.lidar_machine import LidarMachine, Look
from scanwright.firmware_io.lidar.scip import measurement

_HEAD = 32  # bytes of a scan before its ranges: echo, status, stamp


class LidarEmulator(LidarLine):
    """A lidar that answers SCIP.

    Attributes:
        smallest_delay_ns: from the start of a turn (step 0) to the arrival of an undelayed scan.
    """

    machine: LidarMachine

    def __init__(
        self,
        model: str,
        look: Look,
        *,
        rate_error: float = 0.0,
        jitter_s: float = 0.0,
        motor_error: float = 2e-3,
        clock_ms: int = 0,
        scanning: bool = False,
        scip_1: bool = False,
        seed: int = 0,
    ) -> None:
        """Nothing runs before `with`.

        Args:
            model: URG-04LX, UTM-30LX, UXM-30LX-E or UST-10LX.
            look: true times [ns, time.monotonic_ns] of the beams, shape (n,), in order -> range [m] (inf or NaN: no
                return, -inf: too near) and intensity, both (n,). It is asked once per turn for every measured step.
            rate_error: of the sensor's clock, 5e-5 is 50 ppm fast.
            jitter_s: scans arrive up to this much late, evenly spread.
            motor_error: turns take this part longer than the sensor says.
            clock_ms: what the sensor's clock shows at the start; beyond 2**24 it wraps.
            scanning: it scans already, as if somebody had not stopped it.
            scip_1: it wakes up in SCIP 1.1.
            seed: of the jitter.

        Raises:
            DeviceError: there is no emulator of this model.
        """
        if model not in IDENTITIES:
            raise DeviceError(f"no emulator of the lidar '{model}'{suggest(model, IDENTITIES)}")
        quartz = Quartz(time.monotonic_ns(), clock_ms, rate_error)
        machine = LidarMachine(IDENTITIES[model], look, quartz, motor_error=motor_error, scip_1=scip_1)
        super().__init__(model, machine, jitter_s=jitter_s, head=_HEAD, seed=seed)
        self.smallest_delay_ns = machine.arc_ns
        if scanning:
            machine.answer(measurement.continuous(machine.identity.parameters.window), time.monotonic_ns())


def scip_emulator(lidar: Lidar, ranging: Ranging, seed: int = 0) -> LidarEmulator:
    """The emulator of a sensor of the catalogue.

    Raises:
        DeviceError: there is no emulator of this model.
    """
    bearing_rad = lidar.bearings_rad()
    return LidarEmulator(lidar.name, lambda time_ns: ranging(time_ns, bearing_rad), seed=seed)
