"""Emulated servo of a catalogue model."""

from __future__ import annotations

from pkgutil import resolve_name

from scanwright.design.errors import DeviceError, removal
from scanwright.firmware_io.emulators.servo.machine import ServoMachine
from scanwright.firmware_io.emulators.servo_plant import Load
from scanwright.firmware_io.servo.families import all_families, all_tables


def machine_of(model: str, protocol: str | None, load: Load, time_ns: int, angle_rad: float) -> ServoMachine:
    """Return an emulated servo with power, or raise DeviceError; `protocol` None: the factory setting."""
    for family in all_families().values():
        for table in family.tables:
            if table.model == model and protocol in (None, table.protocol):
                made: ServoMachine = resolve_name(family.emulator)(table, load, time_ns, angle_rad)
                return made
    there = ", ".join(f"{table.model} with {table.protocol}" for table in all_tables())
    name = model if protocol is None else f"{model} with {protocol}"
    raise DeviceError(f"there is no emulator of a servo {name}; {removal(model) or f'there are: {there}'}")
