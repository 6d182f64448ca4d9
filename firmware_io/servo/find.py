"""Detection of baud rate, protocol and model of a servo on a port."""

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

_PATIENT_PING_S = 0.2  # for a device that is starting
_LISTEN_S = 0.3  # thirty readings of another program at 100 Hz


def open_bus(port: str) -> ServoBus:
    """Open a port before its servos are known."""
    return ServoBus(port, all_tables()[0].packets)


def find_servo(
    bus: ServoBus, model: str | None, servo_id: int | None, *, baud: int | None = None, unmute: Unmute = "never"
) -> ServoUnit:
    """Set the bus to the baud rate and packets of a servo. Only reads, unless `unmute` allows to write.

    Args:
        bus: a newly opened one.
        model: expected catalogue name; None for any.
        servo_id: None if it is the only servo.
        baud: None to try all known ones.
        unmute: whether to set a servo that replies only to pings to reply to all requests: never, only if that setting
            is volatile (otherwise its torque is turned off), or always.

    Raises:
        ServoSetupError: it replies only to pings, and `unmute` does not allow to change that.
        DeviceError: no servo replies, several do, or it is another model.
    """
    if model is not None and model not in {table.model for table in all_tables()}:
        known = f"known: {', '.join(sorted({table.model for table in all_tables()}))}"
        raise DeviceError(f"{bus.port}: model = {model!r}: no driver for this model; {removal(model) or known}")
    bus.find_echo()
    mute: tuple[int, str, int] | None = None
    met: set[str] = set()
    for wait_s in (PING_S, _PATIENT_PING_S):  # adapter or servo may be starting, or this computer busy
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
                if unmute == "until power-off":  # the driver requires torque off, which it cannot read back
                    bus.write_unanswered(unit.id, unit.table.torque, unit.table.torque.encode(0))
                raise mute_servo(bus.port, unit.table, unit.id)
            elif unit.table.can_be_mute:
                mute = here
        if any(stranger in met for stranger in strangers):  # twice: a late reply can be mistaken for another one
            known = ", ".join(f"{table.number} {table.model}" for table in all_tables())
            raise DeviceError(f"{bus.port}: {', '.join(strangers)}, which is unknown; known: {known}")
        met |= set(strangers)
    missing = "no servo" if servo_id is None else f"servo {servo_id} does not answer; no servo"
    rates = ", ".join(dict.fromkeys(str(rate) for rate, _ in _line_settings(model, baud)))
    raise DeviceTimeoutError(f"{bus.port}: {missing} at {rates} baud: check its power, cable and number")


def _may_unmute(table: ControlTable, unmute: Unmute) -> bool:
    level = table.status_return
    if not table.can_be_mute:
        return False
    return unmute == "for good" or (unmute == "until power-off" and not table.is_permanent(level))


def listen_first(bus: ServoBus) -> None:
    """Raise DeviceError if a device sends without a request."""
    if noise := bus.listen(_LISTEN_S):
        raise DeviceError(
            f"{bus.port}: {len(noise)} bytes came before any request: another program drives this bus, or no "
            "servo is on this port; nothing was sent"
        )


def all_answering(bus: ServoBus, baud: int | None) -> list[tuple[int, int]]:
    """Return baud rate and id of all servos that reply to a ping, at one baud rate or at all known ones."""
    bus.find_echo()
    answering = set()
    for rate, packets in _line_settings(None, baud):
        bus.packets = packets
        if bus.set_baud(rate):
            answering |= {(rate, number) for number in bus.ping(packets.everyone, PING_S)}
    return sorted(answering)


def _line_settings(model: str | None, baud: int | None) -> Iterator[tuple[int, PacketFormat]]:
    """Return the baud rates and packet formats to try: the first rate of all families before their second."""
    families = all_families().values()
    pairs = (
        (rate, packets)
        for rank in range(max(len(family.bauds) for family in families))
        for family in families
        for packets in family.formats(model)
        for rate in (family.bauds[rank : rank + 1] if baud is None else (baud,))
    )
    return iter(dict.fromkeys(pairs))


def _answering(
    bus: ServoBus, model: str | None, servo_id: int | None, baud: int | None, wait_s: float
) -> Iterator[ServoUnit]:
    """Yield a servo for each baud rate and packet format with a reply to a ping, with any table of that format."""
    for rate, packets in _line_settings(model, baud):
        bus.packets = packets
        if bus.set_baud(rate):
            answering = bus.ping(packets.everyone if servo_id is None else servo_id, wait_s)
            if len(answering) > 1:
                raise DeviceError(f"{bus.port}: servos {answering} answer: give servo_id")
            if answering:
                yield ServoUnit(bus, next(table for table in all_tables() if table.packets is packets), answering[0])


def _identity(unit: ServoUnit) -> ControlTable | int | None:
    """Return the table of a servo; its model number if that is unknown; None if it does not report one.

    Families with one packet format read each other's registers as model numbers, so the id must match too.
    """
    with suppress(DeviceTimeoutError, ProtocolError):  # a late reply to a ping at another rate, or only pings
        number = unit.count(unit.table.model_number)
        for table in all_tables():
            if (table.packets, table.number) == (unit.table.packets, number) and unit.count(table.id) == unit.id:
                return table
        return number
    return None
