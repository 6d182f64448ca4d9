"""Settings that the driver requires of a servo, and the error that lists those that differ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from scanwright.design.errors import DeviceError
from scanwright.firmware_io.serial_port import latency_ms, latency_timer
from scanwright.firmware_io.servo.bus.registers import ControlTable, Register, Setting
from scanwright.firmware_io.servo.bus.unit import ServoUnit

_READ_S = 0.007  # longest bytes of a reading, so that with 3 ms for adapter and program it is read at 100 Hz
_MUTE = "so that it answers nothing but pings"
_ANSWERS_LESS = "so that it does not answer writes"
_NEUTRAL = "which turns or shifts the angles"
_MODE = {True: "so that it does not turn continuously", False: "so that it does not go to every angle"}


@dataclass(frozen=True, slots=True)
class SettingChange:
    """A setting of a servo that must change."""

    register: Register
    now: int  # present count
    needed: int  # required count
    why: str  # effect of the present count

    def __str__(self) -> str:
        return f"{self.register} is {self.now}, {self.why}; {self.needed} is right"


class ServoSetupError(DeviceError):
    """Permanent settings must change before the servo can be used; nothing was written.

    Attributes:
        port: of the servo.
        model: catalogue name; None if the servo does not report it.
        servo_id: its id.
        changes: the settings, in the order in which they can be written.
    """

    def __init__(self, port: str, model: str | None, servo_id: int, changes: Sequence[SettingChange]) -> None:
        self.port, self.model, self.servo_id, self.changes = port, model, servo_id, tuple(changes)
        number = len(self.changes)
        registers = "1 register that outlasts" if number == 1 else f"{number} registers that outlast"
        head = f"{port}: servo {servo_id} ({model or 'model unknown'}): {registers} the power must change first"
        super().__init__("\n".join([f"{head}; nothing was written", *(f"  {change}" for change in self.changes)]))


def needed_settings(table: ControlTable, *, spins: bool | None) -> list[tuple[Setting, str]]:
    """Return the settings that the driver requires, and the effect of others; `spins` None: motion unknown."""
    mode = () if spins is None else table.mode(spins=spins)
    return [
        ((table.status_return, table.answers_all), _ANSWERS_LESS),
        *((setting, _NEUTRAL) for setting in table.neutral),
        *((setting, _MODE[bool(spins)]) for setting in mode),
    ]


def set_up_counts(table: ControlTable, baud: int, *, spins: bool | None) -> dict[Register, int]:
    """Return the counts of a configured servo: `needed_settings`, no return delay, a sufficient baud rate."""
    counts = {register: count for (register, count), _ in needed_settings(table, spins=spins)}
    counts[table.return_delay_ns] = 0
    return counts | (dict([table.fast]) if _reading_s(table, baud) > _READ_S else {})


def mode_changes(unit: ServoUnit, *, spins: bool) -> list[SettingChange]:
    """Read which settings of a mode differ."""
    return _differing(unit, [(setting, _MODE[spins]) for setting in unit.table.mode(spins=spins)])


def needed_changes(unit: ServoUnit, *, spins: bool | None) -> list[SettingChange]:
    """Read which required settings differ; first the replies of a servo that was unmuted, to be undone."""
    level = unit.table.status_return
    muted = [SettingChange(level, 0, unit.table.answers_all, _MUTE)] if unit.was_mute else []
    return muted + _differing(unit, needed_settings(unit.table, spins=spins))


def improvements(unit: ServoUnit) -> list[SettingChange]:
    """Read which optional settings differ: return delay and baud rate."""
    delay, baud = unit.table.return_delay_ns, unit.bus.baud
    late = f"so that its answers are {unit.value(delay) / 1e3:g} us late"
    changes = _differing(unit, [((delay, 0), late)])
    if (wire_s := _reading_s(unit.table, baud)) > _READ_S:
        register, count = unit.table.fast
        slow = f"{baud} baud, so that it can be read at {1 / wire_s:.0f} Hz at most"
        changes.append(SettingChange(register, unit.count(register), count, slow))
    return changes


def unfit_settings(unit: ServoUnit, *, spins: bool | None = None) -> list[SettingChange]:
    """Read `needed_changes` and `improvements`, in the order in which they can be written."""
    return needed_changes(unit, spins=spins) + improvements(unit)


def mute_servo(port: str, table: ControlTable, servo_id: int) -> ServoSetupError:
    """Return the error of a servo that permanently replies only to pings."""
    return ServoSetupError(port, None, servo_id, [SettingChange(table.status_return, 0, table.answers_all, _MUTE)])


def settable(table: ControlTable) -> dict[str, Register]:
    """Return the registers that a set-up can write, by name."""
    registers = [
        table.status_return,
        table.return_delay_ns,
        table.baud,
        table.id,
        *(register for register, _ in (*table.neutral, *table.wheel, *table.joint)),
    ]
    return {register.name: register for register in registers}


def slow_adapter(port: str) -> str | None:
    """Return advice for a USB adapter with a latency above 1 ms; None for others."""
    delay_ms = latency_ms(port)
    if delay_ms <= 1:
        return None
    return (
        f"the USB adapter gathers bytes for {delay_ms} ms, so angles are late and few: as root, "
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
    return (table.packets.overhead + table.present.size) * 10 / baud
