"""What `doctor` asks of a servo, telling it nothing: who it is, what it reports, how well it can be read."""

from __future__ import annotations

import time
from contextlib import closing
from dataclasses import dataclass
from statistics import median

from scanwright.firmware_io.servo.find import find_servo, listen_first, open_bus
from scanwright.firmware_io.servo.fitness import SettingChange, slow_adapter, unfit_settings

_READS = 100  # a second of them


@dataclass(frozen=True, slots=True)
class ServoExamination:
    """A servo as it was found.

    Attributes:
        name: port and number.
        model: name, as in the catalogue.
        protocol: protocol and speed, in words.
        reports: what it says is wrong with it; None where it is well.
        has_torque: something has driven it.
        unfit: settings that are not as the driver wants them.
        slow_adapter: what to do about an adapter that gathers bytes; None where it need not be.
        reads_hz: how often it can be asked.
        bound_ms: within which the time of an angle is known.
        voltage_V: of its supply.
        temperature_degC: inside.
    """

    name: str
    model: str
    protocol: str
    reports: str | None
    has_torque: bool
    unfit: tuple[SettingChange, ...]
    slow_adapter: str | None
    reads_hz: float
    bound_ms: float
    voltage_V: float  # noqa: N815 - volts
    temperature_degC: float  # noqa: N815


def examine_servo(port: str, model: str | None, servo_id: int | None, *, spins: bool | None = None) -> ServoExamination:
    """Listen, then ask.

    Args:
        port: of the servo.
        model: what it must be; None for any that is known.
        servo_id: its number; None if it is alone.
        spins: as in `fitness.needed_settings`.

    Raises:
        DeviceError: somebody else speaks on this port, no servo answers, several do, or it is another model.
    """
    with closing(open_bus(port)) as bus:
        listen_first(bus)
        unit = find_servo(bus, model, servo_id)
        table = unit.table
        reports, has_torque = unit.reported_fault(unit.present()), unit.has_torque()
        unfit = tuple(unfit_settings(unit, spins=spins))
        bus.return_delay_ns = unit.value(table.return_delay_ns)
        began_s = time.monotonic()
        answers = [unit.present() for _ in range(_READS)]
        reads_hz = _READS / (time.monotonic() - began_s)
        return ServoExamination(
            name=str(unit),
            model=table.model,
            protocol=f"protocol {table.protocol} at {bus.baud} baud",
            reports=reports,
            has_torque=has_torque,
            unfit=unfit,
            slow_adapter=slow_adapter(port),
            reads_hz=reads_hz,
            bound_ms=median(answer.bound_ns for answer in answers) / 1e6,
            voltage_V=table.pick(table.voltage, answers[-1].data),
            temperature_degC=table.pick(table.temperature, answers[-1].data),
        )
