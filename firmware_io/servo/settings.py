"""Settings of a servo that are changed for good: written down before that, read back after, set back from there."""

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
from firmware_io.servo.bus.registers import Register
from firmware_io.servo.bus.unit import ServoUnit
from firmware_io.servo.families import all_tables
from firmware_io.servo.find import find_servo, open_bus
from firmware_io.servo.fitness import settable, unfit_settings


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
    protocol: str
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
    with closing(open_bus(port)) as bus:
        unit = find_servo(bus, model, servo_id, unmute=True)
        check_torque(unit)
        unfit = unfit_settings(unit)
        if not unfit:
            yield f"{unit} ({unit.table.model}): every setting is as it should be"
            return
        yield keep_settings(folder, unit, [(one.register, one.was, one.wanted) for one in unfit])
        for one in unfit:
            yield changed(unit, one.register, one.was, one.wanted)[1]


def keep_settings(folder: Path, unit: ServoUnit, changes: list[tuple[Register, int, int]]) -> str:
    """Write down what is going to be changed: registers, their counts before and after; where, and what undoes it.

    Raises:
        DeviceError: the file cannot be written; nothing was changed then.
    """
    model, at = unit.table.model, f"{datetime.now():%Y%m%d-%H%M%S}"
    file = folder / f"servo-{model}-{unit.id}-{at}.json"
    kept = ServoSettings(
        schema_name="scanwright/servo-settings/1",
        port=unit.bus.port,
        model=model,
        protocol=unit.table.protocol,
        id=unit.id,
        settings=tuple(
            ServoSetting(register_name=register.name, before=was, after=wanted) for register, was, wanted in changes
        ),
    )
    _write(file, kept)
    return f"{unit.bus.port}: what it had is kept: `scanwright doctor --restore {file}` sets it back"


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
    expected = [table for table in all_tables() if (table.model, table.protocol) == (kept.model, kept.protocol)]
    known = settable(expected[0]) if expected else {}
    for setting in kept.settings:
        register = known.get(setting.register_name)
        fits = register is not None and register.bounds[0] <= setting.before <= register.bounds[1]
        if register is None or not fits or (register == expected[0].baud and setting.before not in expected[0].bauds):
            what = f"{setting.register_name} = {setting.before}"
            raise DeviceError(f"{file}: {kept.model} of protocol {kept.protocol} has no setting {what}")
    with closing(open_bus(port or kept.port)) as bus:
        now_id = next((one.after for one in kept.settings if known[one.register_name] == expected[0].id), kept.id)
        unit = find_servo(bus, kept.model, now_id, unmute=True)
        if unit.table != expected[0]:
            raise DeviceError(f"{unit} speaks protocol {unit.table.protocol}, not {kept.protocol}")
        check_torque(unit)
        for setting in reversed(kept.settings):
            register = known[setting.register_name]
            unit, said = changed(unit, register, unit.count(register), setting.before)
            yield said


def check_torque(unit: ServoUnit) -> None:
    """Refuse a servo that holds or turns something.

    Raises:
        DeviceError: its torque is on.
    """
    if unit.has_torque():
        raise DeviceError(
            f"{unit} has its torque on, and holds or turns something: "
            "end what drives it, or switch its power off and on; nothing was changed"
        )


def changed(unit: ServoUnit, register: Register, was: int, count: int) -> tuple[ServoUnit, str]:
    """Set one, and read it back; the servo as it answers now, and what was done.

    Raises:
        DeviceError: it keeps its count, or is not heard any more.
    """
    table, now = unit.table, unit
    if register == table.baud:
        unit.set_baud(table.bauds[count])
    elif register == table.id:
        now = unit.set_id(count)
    elif register == table.status_return and count == table.answers_all:
        unit.answer_everything()
    elif register == table.status_return:  # from here on it may not answer, nor be read back
        unit.bus.write_unanswered(unit.id, register, register.encode(count))
        return unit, f"{unit}: {register}: {was} -> {count}; it was not read back"
    else:
        unit.set_kept(register, count)
    return now, f"{unit}: {register}: {was} -> {now.count(register)}"


def _write(file: Path, kept: ServoSettings) -> None:
    """The file is on the disk before anything is changed."""
    try:
        with file.open("x", encoding="utf-8") as out:
            out.write(kept.model_dump_json(by_alias=True, indent=2) + "\n")
            out.flush()
            os.fsync(out.fileno())
    except OSError as error:
        raise DeviceError(f"{file}: cannot write, so nothing was changed: {error.strerror}") from error
