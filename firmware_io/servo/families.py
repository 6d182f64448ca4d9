"""The families of servos that can be driven. One line here makes a family known to every command."""

from __future__ import annotations

from dataclasses import dataclass

from firmware_io.servo.bus.packet_format import PacketFormat
from firmware_io.servo.bus.registers import ControlTable
from firmware_io.servo.dynamixel.tables import TABLES as DYNAMIXEL_TABLES
from firmware_io.servo.feetech.tables import TABLES as FEETECH_TABLES


@dataclass(frozen=True, slots=True)
class ServoFamily:
    """Servos of one maker.

    Attributes:
        name: of the family.
        tables: of its models.
        bauds: bits per second, those first that servos are set to most.
    """

    name: str
    tables: tuple[ControlTable, ...]
    bauds: tuple[int, ...]

    def formats(self, model: str | None) -> tuple[PacketFormat, ...]:
        """How the servos of that name, or all of them, pack what they say."""
        return tuple(dict.fromkeys(table.packets for table in self.tables if model in (None, table.model)))


FAMILIES = (
    ServoFamily(
        "Dynamixel",
        DYNAMIXEL_TABLES,
        (57_600, 1_000_000, 115_200, 2_000_000, 3_000_000, 4_000_000, 500_000, 200_000, 9600),
    ),
    ServoFamily("Feetech", FEETECH_TABLES, (1_000_000, 500_000, 115_200, 250_000, 128_000, 57_600, 76_800, 38_400)),
)


def all_tables() -> tuple[ControlTable, ...]:
    """The control tables of every family."""
    return tuple(table for family in FAMILIES for table in family.tables)
