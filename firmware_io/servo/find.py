"""Find baud rate, protocol and model of a servo on a port. Writes only to unmute a servo, on request."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import Literal

from scanwright.design.errors import DeviceError, DeviceTimeoutError, ProtocolError, removal
from scanwright.firmware_io.servo.bus.bus import ServoBus
from scanwright.firmware_io.servo.bus.packet_format import PacketFormat
from scanwright.firmware_io.servo.bus.registers import ControlTable
from scanwright.firmware_io.servo.bus.unit import PING_S, ServoUnit
from scanwright.firmware_io.servo.families import all_families, all_tables
from scanwright.firmware_io.servo.fitness import mute_servo

Unmute = Literal["never", "until power-off", "for good"]

_PATIENT_PING_S = 0.2  # four times as long, for a device that starts
_LISTEN_S = 0.3  # thirty readings of another program at 100 Hz


def open_bus(port: str) -> ServoBus:
    """The port alone, before it is known who is on it."""
    return ServoBus(port, all_tables()[0].packets)


def find_servo(
    bus: ServoBus, model: str | None, servo_id: int | None, *, baud: int | None = None, unmute: Unmute = "never"
) -> ServoUnit:
    """Set the bus to the speed and the packets that a servo answers to. Only reads, unless it may unmute the servo.

    Args:
        bus: a fresh one.
        model: what it must be; None for any that is known.
        servo_id: its number; None if it is alone.
        baud: the only speed to ask at; None for all that are known.
        unmute: whether to set a servo that answers nothing but pings to answer everything: never, only if that setting
            is volatile (else its torque is turned off), or always.

    Raises:
        ServoSetupError: it is mute, and may not be unmuted.
        DeviceError: none answers, several do, or it is another model.
    """
    if model is not None and model not in {table.model for table in all_tables()}:
        known = f"known: {', '.join(sorted({table.model for table in all_tables()}))}"
        raise DeviceError(f"{bus.port}: model = {model!r}: no driver for this model; {removal(model) or known}")
    bus.find_echo()
    mute: tuple[int, str, int] | None = None
    met: set[str] = set()
    for wait_s in (PING_S, _PATIENT_PING_S):  # adapter or servo may still be starting, or this computer be busy
        strangers = []
        for unit in _answering(bus, model, servo_id, baud, wait_s):
            identity = _identity(unit)
            if was_mute := identity is None and _may_unmute(unit.table, unmute):
                unit.answer_everything()
                identity = _identity(unit)
            if isinstance(identity, ControlTable):
                if model not in (None, identity.model):
                    wrong = f"the model of servo {unit.id} is {identity.model}, not {model}"
                    raise DeviceError(f"{bus.port}: {wrong}: check cable and task")
                return ServoUnit(bus, identity, unit.id, was_mute)
            here = bus.baud, bus.packets.protocol, unit.id
            if identity is not None:
                strangers.append(f"servo {unit.id} has model number {identity} in protocol {bus.packets.protocol}")
            elif unit.table.can_be_mute and mute == here:
                if (
                    unmute == "until power-off"
                ):  # who is going to drive it wants it without torque, and cannot read that
                    bus.write_unanswered(unit.id, unit.table.torque, unit.table.torque.encode(0))
                raise mute_servo(bus.port, unit.table, unit.id)
            elif unit.table.can_be_mute:
                mute = here
        if any(stranger in met for stranger in strangers):  # not once: a late answer may be taken for another one's
            known = ", ".join(f"{table.number} {table.model}" for table in all_tables())
            raise DeviceError(f"{bus.port}: {', '.join(strangers)}, which is unknown; known: {known}")
        met |= set(strangers)
    missing = "no servo" if servo_id is None else f"servo {servo_id} does not answer; no servo"
    speeds = ", ".join(str(one) for one in dict.fromkeys(speed for speed, _ in _line_settings(model, baud)))
    raise DeviceTimeoutError(f"{bus.port}: {missing} at {speeds} baud: check its power, cable and number")


def _may_unmute(table: ControlTable, unmute: Unmute) -> bool:
    level = table.status_return
    if not table.can_be_mute:
        return False
    return unmute == "for good" or (unmute == "until power-off" and not table.is_permanent(level))


def listen_first(bus: ServoBus) -> None:
    """Check whether a device sends unasked, before anything is sent to it."""
    if noise := bus.listen(_LISTEN_S):
        raise DeviceError(
            f"{bus.port}: {len(noise)} bytes came before any request: another program drives this bus, or no "
            "servo is on this port; nothing was sent"
        )


def all_answering(bus: ServoBus, baud: int | None) -> list[tuple[int, int]]:
    """Speed and number of every servo that answers a ping, at one speed or at all that are known."""
    bus.find_echo()
    answering = set()
    for speed, packets in _line_settings(None, baud):
        bus.packets = packets
        if bus.set_baud(speed):
            answering |= {(speed, number) for number in bus.ping(packets.everyone, PING_S)}
    return sorted(answering)


def _line_settings(model: str | None, baud: int | None) -> Iterator[tuple[int, PacketFormat]]:
    """Speeds and packets to ask with: every family's first speed before any one's second."""
    families = all_families().values()
    most = max(len(family.bauds) for family in families)
    tried = set()
    for rank in range(most):
        for family in families:
            for packets in family.formats(model):
                speeds = family.bauds[rank : rank + 1] if baud is None else (baud,)
                for speed in speeds:
                    if (speed, packets) not in tried:
                        tried.add((speed, packets))
                        yield speed, packets


def _answering(
    bus: ServoBus, model: str | None, servo_id: int | None, baud: int | None, wait_s: float
) -> Iterator[ServoUnit]:
    """A servo for each way in which one answers a ping, with the first table of those that speak so."""
    for speed, packets in _line_settings(model, baud):
        bus.packets = packets
        if bus.set_baud(speed):
            answering = bus.ping(packets.everyone if servo_id is None else servo_id, wait_s)
            if len(answering) > 1:
                raise DeviceError(f"{bus.port}: servos {answering} answer: give servo_id")
            if answering:
                yield ServoUnit(bus, _any_table(packets), answering[0])


def _any_table(packets: PacketFormat) -> ControlTable:
    """One of those that speak so: what is common to all of them can be read from it."""
    return next(table for table in all_tables() if table.packets is packets)


def _identity(unit: ServoUnit) -> ControlTable | int | None:
    """Return the table of a servo that answers; its model number if that is unknown; None if it has none.

    Families with one packet format read each other's registers as model numbers, so the id must match too.
    """
    with suppress(DeviceTimeoutError, ProtocolError):  # a late answer to the ping at another speed, or a mute one
        number = unit.count(unit.table.model_number)
        for table in all_tables():
            if (table.packets, table.number) == (unit.table.packets, number) and unit.count(table.id) == unit.id:
                return table
        return number
    return None
