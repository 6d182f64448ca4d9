"""The settings that the driver needs in a servo: which differ, why each matters, and the error that lists them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from scanwright.design.errors import DeviceError
from scanwright.firmware_io.serial_port import latency_ms, latency_timer
from scanwright.firmware_io.servo.bus.registers import ControlTable, Register, Setting
from scanwright.firmware_io.servo.bus.unit import ServoUnit

_READ_S = 0.007  # of bytes, so that with 3 ms for adapter and program 100 readings fit into a second
_MUTE = "so that it answers nothing but pings"
_ANSWERS_LESS = "so that it does not answer writes"
_NEUTRAL = "which turns or shifts the angles"
_MODE = {True: "so that it does not turn continuously", False: "so that it does not go to every angle"}


@dataclass(frozen=True, slots=True)
class SettingChange:
    """A setting of a servo that must change.

    Attributes:
        register: its register.
        now: its count.
        needed: the count that the driver needs.
        why: what the setting does as it is.
    """

    register: Register
    now: int
    needed: int
    why: str

    def __str__(self) -> str:
        return f"{self.register} is {self.now}, {self.why}; {self.needed} is right"


class ServoSetupError(DeviceError):
    """Settings that are permanent must change before the servo can be used; nothing was written, nothing moved.

    Attributes:
        port: of the servo.
        model: name, as in the catalogue; None if the servo does not answer a question for it.
        servo_id: its number on the bus.
        changes: the settings, in the order in which they can be written.
    """

    def __init__(self, port: str, model: str | None, servo_id: int, changes: Sequence[SettingChange]) -> None:
        self.port, self.model, self.servo_id, self.changes = port, model, servo_id, tuple(changes)
        number = len(self.changes)
        registers = "1 register that outlasts" if number == 1 else f"{number} registers that outlast"
        head = f"{port}: servo {servo_id} ({model or 'model unknown'}): {registers} the power must change first"
        super().__init__("\n".join([f"{head}; nothing was written", *(f"  {change}" for change in self.changes)]))


def needed_settings(table: ControlTable, *, spins: bool | None) -> list[tuple[Setting, str]]:
    """Return the settings that the driver requires, and the effect of others; `spins` None: motion not known yet."""
    mode = () if spins is None else table.mode(spins=spins)
    return [
        ((table.status_return, table.answers_all), _ANSWERS_LESS),
        *((setting, _NEUTRAL) for setting in table.neutral),
        *((setting, _MODE[bool(spins)]) for setting in mode),
    ]


def set_up_counts(table: ControlTable, baud: int, *, spins: bool | None) -> dict[Register, int]:
    """The counts of a servo that is set up: `needed_settings`, no return delay, and a speed that suffices."""
    counts = {register: count for (register, count), _ in needed_settings(table, spins=spins)}
    counts[table.return_delay_ns] = 0
    return counts | (dict([table.fast]) if _reading_s(table, baud) > _READ_S else {})


def mode_changes(unit: ServoUnit, *, spins: bool) -> list[SettingChange]:
    """The settings of one mode that differ; only reads."""
    return _differing(unit, [(setting, _MODE[spins]) for setting in unit.table.mode(spins=spins)])


def needed_changes(unit: ServoUnit, *, spins: bool | None) -> list[SettingChange]:
    """Return the required settings that differ; an unmuting that was made comes first, to be kept and undone."""
    level = unit.table.status_return
    muted = [SettingChange(level, 0, unit.table.answers_all, _MUTE)] if unit.was_mute else []
    return muted + _differing(unit, needed_settings(unit.table, spins=spins))


def improvements(unit: ServoUnit) -> list[SettingChange]:
    """The settings that differ and that the driver can do without, if less well; only reads."""
    delay = unit.table.return_delay_ns
    late = f"so that its answers are {unit.value(delay) / 1e3:g} us late"
    return [*_differing(unit, [((delay, 0), late)]), *_slow(unit)]


def unfit_settings(unit: ServoUnit, *, spins: bool | None = None) -> list[SettingChange]:
    """All of `needed_changes` and `improvements`, in the order in which they can be written; only reads."""
    return needed_changes(unit, spins=spins) + improvements(unit)


def mute_servo(port: str, table: ControlTable, servo_id: int) -> ServoSetupError:
    """The error of a servo that answers nothing but pings, and keeps that without power."""
    return ServoSetupError(port, None, servo_id, [SettingChange(table.status_return, 0, table.answers_all, _MUTE)])


def settable(table: ControlTable) -> dict[str, Register]:
    """The registers that a set-up may write, and the number of the servo, by their names."""
    registers = [
        table.status_return,
        table.return_delay_ns,
        table.baud,
        table.id,
        *(register for register, _ in (*table.neutral, *table.wheel, *table.joint)),
    ]
    return {register.name: register for register in registers}


def slow_adapter(port: str) -> str | None:
    """What to do about a USB adapter that gathers bytes before it hands them over; None if there is none."""
    gathers_ms = latency_ms(port)
    if gathers_ms <= 1:
        return None
    return (
        f"the USB adapter gathers bytes for {gathers_ms} ms, so angles are late and few: as root, "
        f'echo 1 > {latency_timer(port)}, or permanently a udev rule with ATTR{{latency_timer}}="1"'
    )


def _differing(unit: ServoUnit, needed: list[tuple[Setting, str]]) -> list[SettingChange]:
    table = unit.table
    changes = []
    for (register, count), why in needed:
        now = unit.count(register)
        named = f"{table.modes[now]}, " if register == table.wheel[0][0] and now in table.modes else ""
        changes.append(SettingChange(register, now, count, named + why))
    return [change for change in changes if change.now != change.needed]


def _reading_s(table: ControlTable, baud: int) -> float:
    """How long the bytes of one reading take."""
    return (table.packets.overhead + table.present.size) * 10 / baud


def _slow(unit: ServoUnit) -> Iterator[SettingChange]:
    """Its speed, if the servo cannot be read 100 times a second."""
    table, baud = unit.table, unit.bus.baud
    if (wire_s := _reading_s(table, baud)) > _READ_S:
        register, count = table.fast
        why = f"{baud} baud, so that it can be read at {1 / wire_s:.0f} Hz at most"
        yield SettingChange(register, unit.count(register), count, why)
