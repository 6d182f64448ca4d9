"""What a servo's settings must be: what is not as the driver wants it, and what is set before it is driven."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

from design.errors import DeviceError, DeviceTimeoutError
from firmware_io.serial_port import latency_timer
from firmware_io.servo.bus.registers import ControlTable, Register, Setting
from firmware_io.servo.bus.unit import PING_S, ServoUnit

_REBOOT_S = 3.0
_READ_S = 0.007  # of bytes, so that with 3 ms for adapter and program 100 readings fit into a second
_HARM_NEUTRAL = "which turns or shifts the angles"


@dataclass(frozen=True, slots=True)
class Unfit:
    """A setting of a servo that is not as the driver wants it.

    Attributes:
        register: which.
        was: its count.
        wanted: the count it should have.
        harm: what it does as it is.
    """

    register: Register
    was: int
    wanted: int
    harm: str

    def __str__(self) -> str:
        return f"{self.register} is {self.was}, {self.harm}; {self.wanted} is right"


def prepare(unit: ServoUnit) -> tuple[str, ...]:
    """Take the torque, clear faults, set what the driver relies on; what the user should know or do.

    Raises:
        DeviceError: a setting that the angles rely on cannot be made.
    """
    notes, table, bus = [], unit.table, unit.bus
    unit.answer_everything()
    stopped = unit.write(table.torque, 0)
    if reported := unit.told(unit.present() if table.alarms else stopped):
        notes.append(f"it reported {reported} and was reset: find out why before it turns again")
        _recover(unit)
    for register, count in table.neutral:
        if (was := unit.set_kept(register, count)) != count:
            notes.append(f"{register} was {was}, {_HARM_NEUTRAL}: set to {count}")
    delay = table.return_delay_ns
    bus.return_delay_ns = unit.value(delay)
    try:
        if was := unit.set_kept(delay, 0):
            notes.append(f"{delay} was {was} ({was * delay.unit / 1e3:g} us): set to 0")
        bus.return_delay_ns = 0.0
    except DeviceError as error:
        notes.append(f"{delay} is {bus.return_delay_ns / 1e3:g} us and cannot be set to 0: {error}")
    bus.lower_latency()
    if timer := slow_adapter(bus.port):
        notes.append(timer)
    notes += [f"{unfit}: `scanwright doctor --fix` sets it" for unfit in _slow(unit)]
    return tuple(notes)


def unfit_settings(unit: ServoUnit) -> list[Unfit]:
    """What is not, or was not, as the driver wants it; only asks. The order is the one in which it can be set."""
    table = unit.table
    level, delay = table.status_return, table.return_delay_ns
    levels = () if level is None else ((level, table.answers_all),)
    wanted: list[tuple[Setting, str]] = [
        *((setting, "so that it does not answer what it is told") for setting in levels),
        *((setting, _HARM_NEUTRAL) for setting in table.neutral),
        ((delay, 0), f"so that its answers come {unit.value(delay) / 1e3:g} us late"),
    ]
    known = [(register, unit.count(register), count, harm) for (register, count), harm in wanted]
    muted = (
        [Unfit(level, 0, table.answers_all, "so that it answers nothing but pings")] if unit.was_mute and level else []
    )
    return [*muted, *(Unfit(*one) for one in known if one[1] != one[2]), *_slow(unit)]


def settable(table: ControlTable) -> dict[str, Register]:
    """The settings that `unfit_settings` may name, and the number of the servo, by their names."""
    registers = [
        *([table.status_return] if table.status_return else []),
        table.return_delay_ns,
        table.baud,
        table.id,
        *(register for register, _ in table.neutral),
    ]
    return {register.name: register for register in registers}


def slow_adapter(port: str) -> str | None:
    """What to do about a USB adapter that gathers bytes before it hands them over; None where there is none."""
    timer = latency_timer(port)
    try:
        latency_ms = 0 if timer is None else int(timer.read_text())
    except (OSError, ValueError):
        return None
    if latency_ms <= 1:
        return None
    return (
        f"the USB adapter gathers bytes for {latency_ms} ms, so angles come late and seldom: as root, "
        f'echo 1 > {timer}, or for good a udev rule with ATTR{{latency_timer}}="1"'
    )


def _recover(unit: ServoUnit) -> None:
    """Let it turn again: the torque limit, which is less after a shutdown; without such a register by a restart."""
    table = unit.table
    if table.alarms:  # to read it was enough
        return
    if table.torque_limit and table.max_torque:
        unit.bus.write(unit.id, table.torque_limit, unit.read(table.max_torque).data)
        return
    unit.bus.reboot(unit.id)
    end_s = time.monotonic() + _REBOOT_S
    while not unit.bus.ping(unit.id, PING_S):
        if time.monotonic() > end_s:
            raise DeviceTimeoutError(f"{unit}: no answer {_REBOOT_S:g} s after its restart")


def _slow(unit: ServoUnit) -> Iterator[Unfit]:
    """Its speed, where it keeps the servo from being read 100 times a second."""
    table, bus = unit.table, unit.bus
    wire_s = sum(bus.packets.overhead + register.size for register in table.present) * 10 / bus.baud
    if wire_s > _READ_S:
        register, count = table.fast
        harm = f"{bus.baud} baud, so that it can be read {1 / wire_s:.0f} times a second at best"
        yield Unfit(register, unit.count(register), count, harm)
