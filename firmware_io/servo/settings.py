"""Permanent changes of servo settings, with an undo file."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import closing
from datetime import datetime
from pathlib import Path
from typing import Literal

from pydantic import Field, ValidationError

from scanwright.design.errors import DeviceError, ScanwrightError
from scanwright.design.files.faults import format_validation_error
from scanwright.design.files.record import Record
from scanwright.firmware_io.servo.bus.registers import Register
from scanwright.firmware_io.servo.bus.unit import ServoUnit
from scanwright.firmware_io.servo.families import all_tables
from scanwright.firmware_io.servo.find import find_servo, open_bus
from scanwright.firmware_io.servo.fitness import SettingChange, settable, unfit_settings


class ServoSetting(Record):
    """One setting, in counts of its register."""

    register_name: str = Field(alias="register")
    before: int
    after: int


class ServoSettings(Record):
    """Undo file: the changes of one servo, in their order."""

    schema_name: Literal["scanwright/servo-settings/1"] = Field(alias="schema")
    port: str
    model: str
    protocol: str
    id: int = Field(ge=0, le=252)
    settings: tuple[ServoSetting, ...] = Field(min_length=1)


def set_up(
    port: str,
    model: str | None,
    servo_id: int | None,
    undo_folder: Path,
    *,
    spins: bool | None = None,
    agreed: Sequence[SettingChange] | None = None,
) -> Iterator[str | Path]:
    """Write the required and recommended settings.

    Args:
        port: of the servo.
        model: expected catalogue name; None for any.
        servo_id: None if it is the only servo.
        undo_folder: gets the undo file.
        spins: as in `fitness.needed_settings`.
        agreed: write only these changes; None for all of `fitness.unfit_settings`.

    Yields:
        The undo file, once it is on the disk; then a line for each setting that was written and read back.

    Raises:
        DeviceError: no such servo, its torque is on, a setting is not as agreed or is not kept, or the file cannot be
            written.
    """
    with closing(open_bus(port)) as bus:
        unit = find_servo(bus, model, servo_id, unmute="for good")
        check_torque(unit)
        changes = unfit_settings(unit, spins=spins) if agreed is None else _still_true(unit, agreed)
        if changes:
            yield from write_changes(unit, changes, undo_folder)
        else:
            yield f"{unit} ({unit.table.model}): every setting is right"


def pending_changes(port: str, model: str | None, servo_id: int | None, *, spins: bool | None) -> list[SettingChange]:
    """Read which settings `set_up` would write. Arguments and errors as for `set_up`."""
    with closing(open_bus(port)) as bus:
        return unfit_settings(find_servo(bus, model, servo_id), spins=spins)


def write_changes(unit: ServoUnit, changes: Sequence[SettingChange], undo_folder: Path) -> Iterator[str | Path]:
    """Write the undo file and the changes, with torque off, and read all back. Yields and raises as `set_up`."""
    try:
        file = keep_settings(undo_folder, unit, [(change.register, change.now, change.needed) for change in changes])
    except DeviceError:
        if unit.was_mute:  # it was unmuted to read its model
            unit.set_answers(0)
        raise
    yield file
    for change in changes:
        unit, line = changed(unit, change.register, change.now, change.needed)
        yield line
    for change in changes:
        if (now := unit.count(change.register)) != change.needed:
            raise DeviceError(
                f"{unit}: {change.register}: {change.needed} was written, and it is {now} again: the servo has "
                "restarted or does not keep it: check its supply; nothing was moved"
            )


def _still_true(unit: ServoUnit, agreed: Sequence[SettingChange]) -> Sequence[SettingChange]:
    """Return the changes; DeviceError if a setting has changed since they were agreed."""
    for change in agreed:
        muted = unit.was_mute and change.register == unit.table.status_return
        if not muted and (now := unit.count(change.register)) != change.now:
            raise DeviceError(
                f"{unit}: {change.register} is {now}, and was {change.now} before: it may be another servo; "
                "nothing was written"
            )
    return agreed


def keep_settings(folder: Path, unit: ServoUnit, changes: Sequence[tuple[Register, int, int]]) -> Path:
    """Write the undo file of the changes and return its path; DeviceError if that fails, before any change."""
    model, at = unit.table.model, f"{datetime.now():%Y%m%d-%H%M%S}"
    saved = ServoSettings(
        schema_name="scanwright/servo-settings/1",
        port=unit.bus.port,
        model=model,
        protocol=unit.table.protocol,
        id=unit.id,
        settings=tuple(
            ServoSetting(register_name=register.name, before=was, after=needed) for register, was, needed in changes
        ),
    )
    return _write(folder, f"servo-{model}-{unit.id}-{at}", saved)


def restore(file: Path, port: str | None) -> Iterator[str]:
    """Undo the changes of a file, the last one first; yield a line for each setting that was written and read back.

    Args:
        file: written by `keep_settings`.
        port: present port of the servo; None for that of the file.

    Raises:
        ScanwrightError: the file does not exist or is not an undo file.
        DeviceError: no such servo, its torque is on, or it does not accept a count.
    """
    try:
        saved = ServoSettings.model_validate_json(file.read_bytes())
    except OSError as error:
        raise ScanwrightError(f"{file}: cannot read: {error.strerror}") from error
    except ValidationError as error:
        raise ScanwrightError(format_validation_error(error, file, ServoSettings)) from error
    expected = [table for table in all_tables() if (table.model, table.protocol) == (saved.model, saved.protocol)]
    known = settable(expected[0]) if expected else {}
    for setting in saved.settings:
        register = known.get(setting.register_name)
        fits = register is not None and register.bounds[0] <= setting.before <= register.bounds[1]
        if register is None or not fits or (register == expected[0].baud and setting.before not in expected[0].bauds):
            what = f"{setting.register_name} = {setting.before}"
            raise ScanwrightError(f"{file}: {saved.model} of protocol {saved.protocol} has no setting {what}")
    with closing(open_bus(port or saved.port)) as bus:
        new_ids = [entry.after for entry in saved.settings if known[entry.register_name] == expected[0].id]
        unit = find_servo(bus, saved.model, new_ids[0] if new_ids else saved.id, unmute="for good")
        if unit.table != expected[0]:
            raise DeviceError(f"{unit} has protocol {unit.table.protocol}, not {saved.protocol}")
        check_torque(unit)
        for setting in reversed(saved.settings):
            register = known[setting.register_name]
            unit, line = changed(unit, register, unit.count(register), setting.before)
            yield line


def check_torque(unit: ServoUnit) -> None:
    """Raise DeviceError if the torque of the servo is on."""
    if unit.has_torque():
        raise DeviceError(
            f"{unit} has its torque on, and holds or turns something: "
            "end the program that drives it, or switch it off and on; nothing was changed"
        )


def changed(unit: ServoUnit, register: Register, was: int, needed: int) -> tuple[ServoUnit, str]:
    """Set one register and read it back; return the servo with its present id, and a line for the user."""
    table, now = unit.table, unit
    if register == table.baud:
        unit.set_baud(table.bauds[needed])
    elif register == table.id:
        now = unit.set_id(needed)
    elif register == table.status_return and needed == table.answers_all:
        unit.answer_everything()
    elif register == table.status_return:  # from here on it may not reply
        unit.set_answers(needed)
        return unit, f"{unit}: {register}: {was} -> {needed}; it was not read back"
    else:
        unit.set_permanent(register, needed)
    return now, f"{unit}: {register}: {was} -> {now.count(register)}"


def _write(folder: Path, stem: str, saved: ServoSettings) -> Path:
    """Write a file with a new name to the disk, and return its path."""
    file, again = folder / f"{stem}.json", 1
    while os.path.lexists(file):  # two changes within a second
        again += 1
        file = folder / f"{stem}-{again}.json"
    try:
        with file.open("x", encoding="utf-8") as out:
            out.write(saved.model_dump_json(by_alias=True, indent=2) + "\n")
            out.flush()
            os.fsync(out.fileno())
    except OSError as error:
        raise DeviceError(f"{file}: cannot write, so nothing was changed: {error.strerror}") from error
    return file
