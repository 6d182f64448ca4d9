"""Settings of a servo that `doctor --fix` changed: written down before they are changed, and set back from there."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import closing
from datetime import datetime
from pathlib import Path
from typing import Literal

from pydantic import Field, ValidationError

from design.errors import DeviceError
from design.record import Record, explain
from firmware_io.servo.dynamixel.bus import ServoBus
from firmware_io.servo.dynamixel.registers import TABLES, ControlTable, Register
from firmware_io.servo.dynamixel.setup import (
    answer_everything,
    find_servo,
    set_baud_of,
    set_kept,
    settable,
    unfit_settings,
    value,
)


class ServoSetting(Record):
    """One setting, in counts of its register."""

    register_name: str = Field(alias="register")
    before: int
    after: int


class ServoSettings(Record):
    """What was changed of one servo, in the order of the changes."""

    schema_name: Literal["scanwright/servo-settings/1"] = Field(alias="schema")
    port: str
    model: str
    protocol: float
    id: int = Field(ge=0, le=252)
    settings: tuple[ServoSetting, ...] = Field(min_length=1)


def fix(port: str, model: str | None, servo_id: int | None, folder: Path) -> Iterator[str]:
    """Set what is not as the driver wants it; each change in words, as it is made and read back.

    Args:
        port: of the servo.
        model: what it must be; None for any that is known.
        servo_id: its number; None if it is alone.
        folder: gets the file with the counts before.

    Raises:
        DeviceError: no such servo, it holds its torque, or keeps a count; or the file cannot be written.
    """
    with closing(ServoBus(port)) as bus:
        found = find_servo(bus, model, servo_id, unmute=True)
        table, found_id = found.table, found.id
        _check_torque(bus, table, found_id)
        unfit = unfit_settings(bus, found)
        if not unfit:
            yield f"{port}: servo {found_id} ({table.model}): every setting is as it should be"
            return
        file = folder / f"servo-{table.model}-{found_id}-{datetime.now():%Y%m%d-%H%M%S}.json"
        kept = ServoSettings(
            schema_name="scanwright/servo-settings/1",
            port=port,
            model=table.model,
            protocol=table.protocol,
            id=found_id,
            settings=tuple(
                ServoSetting(register_name=one.register.name, before=one.was, after=one.wanted) for one in unfit
            ),
        )
        _write(file, kept)
        yield f"{port}: what it had is kept: `scanwright doctor --restore {file}` sets it back"
        for one in unfit:
            yield _changed(bus, table, found_id, one.register, one.was, one.wanted)


def restore(file: Path, port: str | None) -> Iterator[str]:
    """Set back what `fix` has changed, the last change first; each in words, as it is made and read back.

    Args:
        file: the one that `fix` wrote.
        port: where the servo is now; None for where it was.

    Raises:
        DeviceError: no such file, no such servo, it holds its torque, or keeps a count.
    """
    try:
        kept = ServoSettings.model_validate_json(file.read_bytes())
    except OSError as error:
        raise DeviceError(f"{file}: cannot read: {error.strerror}") from error
    except ValidationError as error:
        raise DeviceError(explain(error, file, ServoSettings)) from error
    expected = [table for table in TABLES if (table.model, table.protocol) == (kept.model, kept.protocol)]
    known = settable(expected[0]) if expected else {}
    for setting in kept.settings:
        register = known.get(setting.register_name)
        if register is None or not register.bounds[0] <= setting.before <= register.bounds[1]:
            what = f"{setting.register_name} = {setting.before}"
            raise DeviceError(f"{file}: {kept.model} of protocol {kept.protocol} has no setting {what}")
    with closing(ServoBus(port or kept.port)) as bus:
        found = find_servo(bus, kept.model, kept.id, unmute=True)
        table, found_id = found.table, found.id
        if table != expected[0]:
            raise DeviceError(f"{bus.port}: servo {found_id} speaks protocol {table.protocol}, not {kept.protocol}")
        _check_torque(bus, table, found_id)
        for setting in reversed(kept.settings):
            register = known[setting.register_name]
            yield _changed(bus, table, found_id, register, value(bus, found_id, register), setting.before)


def _check_torque(bus: ServoBus, table: ControlTable, servo_id: int) -> None:
    if value(bus, servo_id, table.torque):
        raise DeviceError(
            f"{bus.port}: servo {servo_id} has its torque on, and holds or turns something: "
            "end what drives it, or switch its power off and on; nothing was changed"
        )


def _changed(bus: ServoBus, table: ControlTable, servo_id: int, register: Register, was: int, count: int) -> str:
    """Set one, and read it back."""
    if register == table.fast[0]:
        set_baud_of(bus, servo_id, register, count)
    elif register == table.status_return and count == 2:
        answer_everything(bus, table, servo_id)
    elif register == table.status_return:  # from here on it may not answer, nor be read back
        bus.write_unanswered(servo_id, register, register.encode(count))
        return f"{bus.port}: servo {servo_id}: {register}: {was} -> {count}; it was not read back"
    else:
        set_kept(bus, servo_id, register, count)
    return f"{bus.port}: servo {servo_id}: {register}: {was} -> {value(bus, servo_id, register)}"


def _write(file: Path, kept: ServoSettings) -> None:
    """The file is on the disk before anything is changed."""
    try:
        with file.open("x", encoding="utf-8") as out:
            out.write(kept.model_dump_json(by_alias=True, indent=2) + "\n")
            out.flush()
            os.fsync(out.fileno())
    except OSError as error:
        raise DeviceError(f"{file}: cannot write, so nothing was changed: {error.strerror}") from error
