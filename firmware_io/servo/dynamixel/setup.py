"""Find a servo on a bus, and make it ready: which speed, protocol and model it has, and what had to be set."""

from __future__ import annotations

import time
from contextlib import suppress
from itertools import product
from pathlib import Path

from design.errors import DeviceError, DeviceTimeoutError, ProtocolError
from firmware_io.servo.dynamixel.bus import BROADCAST, ServoBus
from firmware_io.servo.dynamixel.registers import TABLES, ControlTable, Register

_BAUDS = (57600, 1_000_000, 115200, 2_000_000, 3_000_000, 4_000_000, 500_000, 200_000, 9600)
_PING_S = 0.05  # a servo answers within a millisecond; USB adapters gather bytes for up to 16 ms, both ways
_NUMBER = Register(0, 2)  # the model number stands there in every control table
_REBOOT_S = 3.0
_READ_S = 0.007  # of bytes, so that with 3 ms for adapter and program 100 readings fit into a second


def find_servo(bus: ServoBus, model: str | None, servo_id: int | None) -> tuple[ControlTable, int]:
    """Set the bus to the speed and protocol that a servo answers to; its table and id.

    Raises:
        DeviceError: none answers, several do, or it is another model.
    """
    protocols = sorted({table.protocol for table in TABLES if model in (None, table.model)})
    if not protocols:
        known = ", ".join(sorted({table.model for table in TABLES}))
        raise DeviceError(f"{bus.port}: model = {model!r}: not one this program can drive; known: {known}")
    for baud, protocol in [*product(_BAUDS, protocols)] * 2:  # twice: adapter or servo may still be starting
        bus.protocol = protocol
        if bus.set_baud(baud):
            found = bus.ping(BROADCAST if servo_id is None else servo_id, _PING_S)
            if len(found) > 1:
                raise DeviceError(f"{bus.port}: servos {found} answer: say which one with servo_id")
            if found:
                with suppress(DeviceTimeoutError, ProtocolError):  # a late answer to the ping at another speed
                    return _table(bus, found[0], model), found[0]
    who = "no servo" if servo_id is None else f"servo {servo_id} does not answer; no servo"
    speeds = ", ".join(str(baud) for baud in _BAUDS)
    raise DeviceTimeoutError(f"{bus.port}: {who} at {speeds} baud: look at its power, its cable, its id")


def prepare(bus: ServoBus, table: ControlTable, servo_id: int) -> tuple[str, ...]:
    """Take the torque, clear faults, set what the driver relies on; what the user should know or do.

    Raises:
        DeviceError: a setting that the angles rely on cannot be made.
    """
    notes = []
    _answer_everything(bus, table, servo_id)
    answer = bus.write(servo_id, table.torque, table.torque.encode(0))
    if answer.conditions:
        code = _read(bus, servo_id, table.hardware_error) if table.hardware_error else answer.conditions
        notes.append(f"it reported {table.names(code)} and was reset: find out why before it turns again")
        _recover(bus, table, servo_id)
    for register, value in table.neutral:
        if (was := set_kept(bus, servo_id, register, value)) != value:
            notes.append(f"register {register.address} was {was}, which turns or shifts the angles: set to {value}")
    bus.return_delay_ns = _read(bus, servo_id, table.return_delay_ns) * table.return_delay_ns.unit
    try:
        if was := set_kept(bus, servo_id, table.return_delay_ns, 0):
            notes.append(f"its return delay was {was * 2} us: set to 0")
        bus.return_delay_ns = 0.0
    except DeviceError as error:
        notes.append(f"its return delay is {bus.return_delay_ns / 1e3:g} us and cannot be set to 0: {error}")
    return (*notes, *_slow(bus, table))


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


def set_kept(bus: ServoBus, servo_id: int, register: Register, value: int) -> int:
    """Set an entry that outlasts the power, torque being off; its count before. Written only if it differs: it wears.

    Raises:
        DeviceError: it keeps its value.
    """
    was = _read(bus, servo_id, register)
    if was != value:
        bus.write(servo_id, register, register.encode(value * register.unit))
        if _read(bus, servo_id, register) != value:
            name = f"{bus.port}: servo {servo_id}: register {register.address}"
            raise DeviceError(f"{name} stays {was}: its memory is locked; switch its power off and on")
    return was


def _read(bus: ServoBus, servo_id: int, register: Register) -> int:
    return round(register.decode(bus.read(servo_id, register).data) / register.unit)


def _table(bus: ServoBus, servo_id: int, model: str | None) -> ControlTable:
    try:
        number = _read(bus, servo_id, _NUMBER)
    except (DeviceTimeoutError, ProtocolError):  # it may be set to answer nothing but pings
        _answer_everything(bus, next(table for table in TABLES if table.protocol == bus.protocol), servo_id)
        number = _read(bus, servo_id, _NUMBER)
    for table in TABLES:
        if (table.number, table.protocol) == (number, bus.protocol):
            if model not in (None, table.model):
                raise DeviceError(
                    f"{bus.port}: servo {servo_id} is a {table.model}, not a {model}: look at cable and task"
                )
            return table
    known = ", ".join(f"{table.number} {table.model}" for table in TABLES)
    raise DeviceError(f"{bus.port}: servo {servo_id} has model number {number}, which is unknown; known: {known}")


def _answer_everything(bus: ServoBus, table: ControlTable, servo_id: int) -> None:
    with_answer = table.status_return.encode(2)
    try:
        answers = bus.read(servo_id, table.status_return).data == with_answer
    except DeviceTimeoutError:
        answers = False
    if not answers:
        bus.write_unanswered(servo_id, table.status_return, with_answer)
        time.sleep(_PING_S)  # whether it answers this very write is unknown: let an answer come and be dropped


def _slow(bus: ServoBus, table: ControlTable) -> list[str]:
    """What keeps the servo from being read 100 times a second."""
    notes = []
    latency_ms = bus.lower_latency()
    if latency_ms is not None and latency_ms > 1:
        timer = f"/sys/bus/usb-serial/devices/{Path(bus.port).resolve().name}/latency_timer"
        notes.append(
            f"the USB adapter gathers bytes for {latency_ms} ms, so angles come late and seldom: as root, "
            f'echo 1 > {timer}, or for good a udev rule with ATTR{{latency_timer}}="1"'
        )
    overhead = 25 if table.protocol == 2.0 else 14  # bytes of request and answer around the values
    wire_s = (overhead + table.block.size) * 10 / bus.baud
    if wire_s > _READ_S:
        notes.append(f"{bus.baud} baud allow {1 / wire_s:.0f} readings a second at best: set the servo to 1000000 baud")
    return notes
