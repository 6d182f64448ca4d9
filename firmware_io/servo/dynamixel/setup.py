"""Find a servo on a bus, and make it ready: which speed, protocol and model it has, and what had to be set."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import product

from design.errors import DeviceError, DeviceTimeoutError, ProtocolError
from firmware_io.serial_port import latency_timer
from firmware_io.servo.dynamixel.bus import BROADCAST, ServoBus
from firmware_io.servo.dynamixel.registers import TABLES, ControlTable, Register, Setting

_BAUDS = (57600, 1_000_000, 115200, 2_000_000, 3_000_000, 4_000_000, 500_000, 200_000, 9600)
_PING_S = 0.05  # a servo answers within a millisecond; USB adapters gather bytes for up to 16 ms, both ways
_PATIENT_PING_S = 0.2
_NUMBER = Register(0, 2)  # the model number stands there in every control table
_REBOOT_S = 3.0
_READ_S = 0.007  # of bytes, so that with 3 ms for adapter and program 100 readings fit into a second
_ANSWERS_ALL = 2  # status return level


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


@dataclass(frozen=True, slots=True)
class FoundServo:
    """A servo that answers; `was_mute` where it answered nothing but pings before."""

    table: ControlTable
    id: int
    was_mute: bool = False


def find_servo(bus: ServoBus, model: str | None, servo_id: int | None, *, unmute: bool = False) -> FoundServo:
    """Set the bus to the speed and protocol that a servo answers to. Only asks, unless it is to unmute.

    Args:
        bus: a fresh one.
        model: what it must be; None for any that is known.
        servo_id: its number; None if it is alone.
        unmute: let a servo that answers nothing but pings answer everything.

    Raises:
        DeviceError: none answers, several do, it is another model, or it is mute.
    """
    protocols = sorted({table.protocol for table in TABLES if model in (None, table.model)})
    if not protocols:
        known = ", ".join(sorted({table.model for table in TABLES}))
        raise DeviceError(f"{bus.port}: model = {model!r}: not one this program can drive; known: {known}")
    bus.find_echo()
    mute = None
    # Twice: adapter or servo may still be starting, or this computer be busy.
    for wait_s, baud, protocol in product((_PING_S, _PATIENT_PING_S), _BAUDS, protocols):
        bus.protocol = protocol
        if bus.set_baud(baud):
            found = bus.ping(BROADCAST if servo_id is None else servo_id, wait_s)
            if len(found) > 1:
                raise DeviceError(f"{bus.port}: servos {found} answer: say which one with --servo-id")
            if found:
                with suppress(DeviceTimeoutError, ProtocolError):  # a late answer to the ping at another speed
                    return FoundServo(_table(bus, found[0], model), found[0])
                if unmute:
                    answer_everything(bus, _any_table(protocol), found[0])
                    with suppress(DeviceTimeoutError, ProtocolError):
                        return FoundServo(_table(bus, found[0], model), found[0], was_mute=True)
                if mute == (baud, protocol, found[0]):
                    level = _any_table(protocol).status_return
                    raise DeviceError(
                        f"{bus.port}: servo {found[0]} answers pings only: its {level} is 0; "
                        f"`scanwright doctor --fix --servo {bus.port}` sets it to {_ANSWERS_ALL}"
                    )
                mute = baud, protocol, found[0]
    who = "no servo" if servo_id is None else f"servo {servo_id} does not answer; no servo"
    speeds = ", ".join(str(baud) for baud in _BAUDS)
    raise DeviceTimeoutError(f"{bus.port}: {who} at {speeds} baud: look at its power, its cable, its id")


def prepare(bus: ServoBus, table: ControlTable, servo_id: int) -> tuple[str, ...]:
    """Take the torque, clear faults, set what the driver relies on; what the user should know or do.

    Raises:
        DeviceError: a setting that the angles rely on cannot be made.
    """
    notes = []
    answer_everything(bus, table, servo_id)
    answer = bus.write(servo_id, table.torque, table.torque.encode(0))
    if answer.conditions:
        code = value(bus, servo_id, table.hardware_error) if table.hardware_error else answer.conditions
        notes.append(f"it reported {table.names(code)} and was reset: find out why before it turns again")
        _recover(bus, table, servo_id)
    for register, count in table.neutral:
        if (was := set_kept(bus, servo_id, register, count)) != count:
            notes.append(f"{register} was {was}, {_HARM_NEUTRAL}: set to {count}")
    delay = table.return_delay_ns
    bus.return_delay_ns = value(bus, servo_id, delay) * delay.unit
    try:
        if was := set_kept(bus, servo_id, delay, 0):
            notes.append(f"{delay} was {was} ({was * delay.unit / 1e3:g} us): set to 0")
        bus.return_delay_ns = 0.0
    except DeviceError as error:
        notes.append(f"{delay} is {bus.return_delay_ns / 1e3:g} us and cannot be set to 0: {error}")
    bus.lower_latency()
    if timer := slow_adapter(bus.port):
        notes.append(timer)
    notes += [f"{unfit}: `scanwright doctor --fix` sets it" for unfit in _slow(bus, table, servo_id)]
    return tuple(notes)


_HARM_NEUTRAL = "which turns or shifts the angles"


def unfit_settings(bus: ServoBus, found: FoundServo) -> list[Unfit]:
    """What is not, or was not, as the driver wants it; only asks. The order is the one in which it can be set."""
    table, servo_id = found.table, found.id
    level, delay = table.status_return, table.return_delay_ns
    wanted: list[tuple[Setting, str]] = [
        ((level, _ANSWERS_ALL), "so that it does not answer what it is told"),
        *((setting, _HARM_NEUTRAL) for setting in table.neutral),
        ((delay, 0), f"so that its answers come {value(bus, servo_id, delay) * delay.unit / 1e3:g} us late"),
    ]
    known = [(register, value(bus, servo_id, register), count, harm) for (register, count), harm in wanted]
    muted = [Unfit(level, 0, _ANSWERS_ALL, "so that it answers nothing but pings")] if found.was_mute else []
    return [*muted, *(Unfit(*one) for one in known if one[1] != one[2]), *_slow(bus, table, servo_id)]


def settable(table: ControlTable) -> dict[str, Register]:
    """The settings that `unfit_settings` may name, by their names."""
    registers = [
        table.status_return,
        table.return_delay_ns,
        table.fast[0],
        *(register for register, _ in table.neutral),
    ]
    return {register.name: register for register in registers}


def _recover(bus: ServoBus, table: ControlTable, servo_id: int) -> None:
    """Let it turn again: a restart in protocol 2.0; in 1.0 the torque limit, which is 0 after a shutdown."""
    if table.torque_limit and table.max_torque:
        bus.write(servo_id, table.torque_limit, bus.read(servo_id, table.max_torque).data)
        return
    bus.reboot(servo_id)
    end_s = time.monotonic() + _REBOOT_S
    while not bus.ping(servo_id, _PING_S):
        if time.monotonic() > end_s:
            raise DeviceTimeoutError(f"{bus.port}: servo {servo_id}: no answer {_REBOOT_S:g} s after its restart")


def set_kept(bus: ServoBus, servo_id: int, register: Register, count: int) -> int:
    """Set an entry that outlasts the power, torque being off; its count before. Written only if it differs: it wears.

    Raises:
        DeviceError: it keeps its value.
    """
    was = value(bus, servo_id, register)
    if was != count:
        bus.write(servo_id, register, register.encode(count * register.unit))
        if value(bus, servo_id, register) != count:
            name = f"{bus.port}: servo {servo_id}: {register}"
            raise DeviceError(f"{name} stays {was}: its memory is locked; switch its power off and on")
    return was


def set_baud_of(bus: ServoBus, servo_id: int, register: Register, count: int) -> None:
    """Set the speed of a servo, torque being off, and find it at its new one.

    Raises:
        DeviceError: it answers at no speed with that count.
    """
    bus.write_unanswered(servo_id, register, register.encode(count))
    time.sleep(_PING_S)  # until the request is out at the old speed, and its answer, if any, is over
    for baud in (bus.baud, *_BAUDS):
        with suppress(DeviceTimeoutError, ProtocolError):
            if (
                bus.set_baud(baud)
                and servo_id in bus.ping(servo_id, _PING_S)
                and value(bus, servo_id, register) == count
            ):
                return
    raise DeviceTimeoutError(
        f"{bus.port}: servo {servo_id}: {register}: not heard with {count}: power off and on, look again"
    )


def answer_everything(bus: ServoBus, table: ControlTable, servo_id: int) -> None:
    """Let a servo answer whatever is asked of it or told to it."""
    with_answer = table.status_return.encode(_ANSWERS_ALL)
    try:
        answers = bus.read(servo_id, table.status_return).data == with_answer
    except DeviceTimeoutError:
        answers = False
    if not answers:
        bus.write_unanswered(servo_id, table.status_return, with_answer)
        time.sleep(_PING_S)  # whether it answers this very write is unknown: let an answer come and be dropped


def value(bus: ServoBus, servo_id: int, register: Register) -> int:
    """The count in a register."""
    return round(register.decode(bus.read(servo_id, register).data) / register.unit)


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


def _any_table(protocol: float) -> ControlTable:
    """One of a protocol: what is common to all of them can be read from it."""
    return next(table for table in TABLES if table.protocol == protocol)


def _table(bus: ServoBus, servo_id: int, model: str | None) -> ControlTable:
    number = value(bus, servo_id, _NUMBER)
    for table in TABLES:
        if (table.number, table.protocol) == (number, bus.protocol):
            if model not in (None, table.model):
                raise DeviceError(
                    f"{bus.port}: the model of servo {servo_id} is {table.model}, not {model}: look at cable and task"
                )
            return table
    known = ", ".join(f"{table.number} {table.model}" for table in TABLES)
    raise DeviceError(f"{bus.port}: servo {servo_id} has model number {number}, which is unknown; known: {known}")


def _slow(bus: ServoBus, table: ControlTable, servo_id: int) -> Iterator[Unfit]:
    """Its speed, where it keeps the servo from being read 100 times a second."""
    overhead = 25 if table.protocol == 2.0 else 14  # bytes of request and answer around the values
    wire_s = (overhead + table.block.size) * 10 / bus.baud
    if wire_s > _READ_S:
        register, count = table.fast
        harm = f"{bus.baud} baud, so that it can be read {1 / wire_s:.0f} times a second at best"
        yield Unfit(register, value(bus, servo_id, register), count, harm)
