"""Change of the id or baud rate of a servo."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from scanwright.design.errors import DeviceError, ScanwrightError
from scanwright.firmware_io.servo.bus.bus import ServoBus
from scanwright.firmware_io.servo.bus.registers import Register
from scanwright.firmware_io.servo.bus.unit import PING_S, ServoUnit
from scanwright.firmware_io.servo.find import all_answering, find_servo, listen_first, open_bus
from scanwright.firmware_io.servo.settings import changed, check_torque, keep_settings

_IDS = range(253)


def set_address(
    port: str, new_id: int | None, new_baud: int | None, from_id: int | None, from_baud: int | None, folder: Path
) -> Iterator[str | Path]:
    """Set id and baud rate of a servo; yields as `settings.set_up`.

    Args:
        port: of the servo.
        new_id: None to keep its id.
        new_baud: None to keep its baud rate.
        from_id: current id; None if it is the only servo that answers.
        from_baud: current baud rate; None to try all known ones.
        folder: for the undo file.

    Raises:
        ScanwrightError: nothing to do, or an invalid id.
        DeviceError: no servo or several match, the id is taken, servo or adapter lack the baud rate, its torque is on,
            or the undo file cannot be written: then nothing was changed. Or the servo keeps its old setting.
    """
    if new_id is None and new_baud is None:
        raise ScanwrightError(f"{port}: nothing to set: give new_id, new_baud or both")
    if new_id is not None and new_id not in _IDS:
        raise ScanwrightError(f"new_id = {new_id}: servos have numbers from 0 to {_IDS[-1]}")
    with closing(open_bus(port)) as bus:
        unit = _only(bus, from_id, from_baud)
        table = unit.table
        yield f"{unit} ({table.model}), protocol {table.protocol} at {bus.baud} baud"
        counts = {
            table.id: unit.id if new_id is None else new_id,
            table.baud: table.baud_count(bus.baud if new_baud is None else new_baud),
        }
        changes = [(entry, was, count) for entry, count in counts.items() if (was := unit.count(entry)) != count]
        if not changes:
            yield f"{unit}: number and speed are right already"
            return
        check_torque(unit)
        _refuse_collision(unit, counts)
        yield keep_settings(folder, unit, changes)
        for register, was, count in changes:
            unit, line = changed(unit, register, was, count)
            yield line


def _only(bus: ServoBus, from_id: int | None, from_baud: int | None) -> ServoUnit:
    """Return the servo with this id and baud rate, or the only one."""
    listen_first(bus)
    if from_id is None:
        there = all_answering(bus, from_baud)
        if len(there) > 1:
            seen = ", ".join(f"{number} at {baud} baud" for baud, number in there)
            raise DeviceError(
                f"{bus.port}: several servos answer ({seen}): leave one on the cable, or give from_id and "
                "from_baud; nothing was changed"
            )
    return find_servo(bus, None, from_id, baud=from_baud)


def _refuse_collision(unit: ServoUnit, counts: dict[Register, int]) -> None:
    """Check that no servo has the new id at the new baud rate, and that the adapter supports that rate."""
    bus, table, before = unit.bus, unit.table, unit.bus.baud
    new_id, new_baud = counts[table.id], table.bauds[counts[table.baud]]
    if not bus.set_baud(new_baud):
        raise DeviceError(f"{bus.port}: this adapter does not support {new_baud} baud; nothing was changed")
    answering = bus.ping(new_id, PING_S)  # another servo: this one has another id or baud rate
    bus.set_baud(before)
    if answering:
        raise DeviceError(f"{bus.port}: a servo {new_id} answers at {new_baud} baud already; nothing was changed")
