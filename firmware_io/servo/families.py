"""Supported servo families.

An installed package adds a `ServoFamily` by an entry point of the group "scanwright.servos" (docs/how-to/new-servo.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from scanwright.design.catalogue.catalogue import SERVO_GROUP
from scanwright.firmware_io.installed import with_installed
from scanwright.firmware_io.servo.bus.packet_format import PacketFormat
from scanwright.firmware_io.servo.bus.registers import ControlTable
from scanwright.firmware_io.servo.dynamixel.tables import TABLES as DYNAMIXEL_TABLES
from scanwright.firmware_io.servo.feetech.tables import TABLES as FEETECH_TABLES


@dataclass(frozen=True, slots=True)
class ServoFamily:
    """Servos of one maker.

    Attributes:
        bauds: baud rates, most common first.
        emulator: "package.module:Class" of its `emulators.servo.machine.ServoMachine`, with arguments (control table,
            load on the horn, time in ns, angle of the horn); drivers import no emulators.
    """

    name: str
    tables: tuple[ControlTable, ...]
    bauds: tuple[int, ...]
    emulator: str

    def formats(self, model: str | None) -> tuple[PacketFormat, ...]:
        """Return the packet formats of a model, or of all."""
        return tuple(dict.fromkeys(table.packets for table in self.tables if model in (None, table.model)))


FAMILIES = (
    ServoFamily(
        "Dynamixel",
        DYNAMIXEL_TABLES,
        (57_600, 1_000_000, 115_200, 2_000_000, 3_000_000, 4_000_000, 500_000, 200_000, 9600),
        "scanwright.firmware_io.emulators.servo.dynamixel_machine:DynamixelMachine",
    ),
    ServoFamily(
        "Feetech",
        FEETECH_TABLES,
        (1_000_000, 500_000, 115_200, 250_000, 128_000, 57_600, 76_800, 38_400),
        "scanwright.firmware_io.emulators.servo.feetech_machine:FeetechMachine",
    ),
)


@cache
def all_families() -> dict[str, ServoFamily]:
    """Return the shipped families and those of installed packages, by name; raises as `with_installed`."""
    return with_installed(SERVO_GROUP, ServoFamily, FAMILIES)


def all_tables() -> tuple[ControlTable, ...]:
    """Return the control tables of all families; raises as `all_families`."""
    return tuple(table for family in all_families().values() for table in family.tables)
