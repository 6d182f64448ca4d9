"""Preparation of a servo: torque off, faults cleared, settings checked."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Sequence
from pathlib import Path

from scanwright.design.errors import DeviceError, DeviceTimeoutError
from scanwright.firmware_io.servo.bus.unit import PING_S, ServoUnit
from scanwright.firmware_io.servo.fitness import (
    ServoSetupError,
    SettingChange,
    improvements,
    needed_changes,
    slow_adapter,
)
from scanwright.firmware_io.servo.settings import write_changes

_REBOOT_S = 3.0  # [assumed]: the e-manual states no time


def prepare(unit: ServoUnit, *, spins: bool | None, undo_folder: Path | None) -> tuple[str, ...]:
    """Turn the torque off, clear faults, check the settings; return warnings. Raises as `set_agreed`."""
    table, bus = unit.table, unit.bus
    if not table.is_permanent(table.status_return):
        unit.answer_everything()
    _torque_off(unit)
    changes = needed_changes(unit, spins=spins)
    set_agreed(unit, changes, undo_folder)
    notes = [f"{change.register} was {change.now}, {change.why}: set to {change.needed}" for change in changes]
    if reported := unit.reported_fault(unit.present()):
        notes.append(f"it reported {reported} and was reset: find the cause before it turns again")
        _recover(unit)
    bus.return_delay_ns = unit.value(table.return_delay_ns)
    bus.lower_latency()
    if timer := slow_adapter(bus.port):
        notes.append(timer)
    return (*notes, *(str(change) for change in improvements(unit)))


def set_agreed(unit: ServoUnit, changes: Sequence[SettingChange], undo_folder: Path | None) -> None:
    """Write volatile settings, and permanent ones only with a folder for their undo file.

    Raises:
        ServoSetupError: a permanent setting differs and there is no folder; nothing was written.
        DeviceError: no reply, the file cannot be written, or the servo does not keep a setting.
    """
    permanent = [change for change in changes if unit.table.is_permanent(change.register)]
    if permanent:
        if undo_folder is None:
            raise ServoSetupError(unit.bus.port, unit.table.model, unit.id, permanent)
        deque(write_changes(unit, permanent, undo_folder), maxlen=0)
    for change in changes:
        if change not in permanent:
            unit.set_permanent(change.register, change.needed)


def _torque_off(unit: ServoUnit) -> None:
    """Turn the torque off, also of a servo that does not reply to writes."""
    level, torque = unit.table.status_return, unit.table.torque
    if unit.count(level) == unit.table.answers_all:
        unit.write(torque, 0)
        return
    unit.bus.write_unanswered(unit.id, torque, torque.encode(0))
    time.sleep(PING_S)
    if unit.count(torque):
        raise DeviceError(f"{unit}: its torque stays on: cut its power")


def _recover(unit: ServoUnit) -> None:
    """Clear a shutdown: by the torque limit, which it lowers, or by a restart if there is no such register."""
    table = unit.table
    if table.torque_limit and table.max_torque:
        unit.bus.write(unit.id, table.torque_limit, unit.read(table.max_torque).data)
        return
    unit.bus.reboot(unit.id)
    end_s = time.monotonic() + _REBOOT_S
    while not unit.bus.ping(unit.id, PING_S):
        if time.monotonic() > end_s:
            raise DeviceTimeoutError(f"{unit}: no answer {_REBOOT_S:g} s after its restart")
