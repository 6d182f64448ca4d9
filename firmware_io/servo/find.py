"""Find a servo on a port: its speed, its packets, its model. It is told nothing, but to answer where it is mute."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from itertools import product

from design.errors import DeviceError, DeviceTimeoutError, ProtocolError
from firmware_io.servo.bus.bus import BROADCAST, ServoBus
from firmware_io.servo.bus.packet_format import PacketFormat
from firmware_io.servo.bus.registers import ControlTable
from firmware_io.servo.bus.unit import PING_S, ServoUnit
from firmware_io.servo.families import FAMILIES, all_tables

_PATIENT_PING_S = 0.2
_LISTEN_S = 0.3


def open_bus(port: str) -> ServoBus:
    """The port alone, before it is known who is on it.

    Raises:
        DeviceError: no such port, it is in use, or may not be opened.
    """
    return ServoBus(port, FAMILIES[0].tables[0].packets)


def find_servo(
    bus: ServoBus, model: str | None, servo_id: int | None, *, baud: int | None = None, unmute: bool = False
) -> ServoUnit:
    """Set the bus to the speed and the packets that a servo answers to. Only asks, unless it is to unmute.

    Args:
        bus: a fresh one.
        model: what it must be; None for any that is known.
        servo_id: its number; None if it is alone.
        baud: the only speed to ask at; None for all that are known.
        unmute: let a servo that answers nothing but pings answer everything.

    Raises:
        DeviceError: none answers, several do, it is another model, or it is mute.
    """
    if model is not None and model not in {table.model for table in all_tables()}:
        known = ", ".join(sorted({table.model for table in all_tables()}))
        raise DeviceError(f"{bus.port}: model = {model!r}: not one this program can drive; known: {known}")
    bus.find_echo()
    mute: tuple[int, str, int] | None = None
    stranger: DeviceError | None = None
    # Twice: adapter or servo may still be starting, or this computer be busy.
    for wait_s, (speed, packets) in product((PING_S, _PATIENT_PING_S), _ways(model, baud)):
        bus.packets = packets
        if not bus.set_baud(speed):
            continue
        answering = bus.ping(BROADCAST if servo_id is None else servo_id, wait_s)
        if len(answering) > 1:
            raise DeviceError(f"{bus.port}: servos {answering} answer: say which one with --servo-id")
        if not answering:
            continue
        found_id = answering[0]
        try:
            with suppress(DeviceTimeoutError, ProtocolError):  # a late answer to the ping at another speed
                return ServoUnit(bus, _table(bus, found_id, model), found_id)
            if unmute and _any_table(packets).can_be_mute:
                ServoUnit(bus, _any_table(packets), found_id).answer_everything()
                with suppress(DeviceTimeoutError, ProtocolError):
                    return ServoUnit(bus, _table(bus, found_id, model), found_id, was_mute=True)
        except _StrangerError as error:  # families that share a form of packets tell themselves apart by their numbers
            stranger = error
            continue
        table = _any_table(packets)
        if not table.can_be_mute:
            continue
        if mute == (speed, packets.protocol, found_id):
            raise DeviceError(
                f"{bus.port}: servo {found_id} answers pings only: its {table.status_return} is 0; "
                f"`scanwright doctor --fix --servo {bus.port}` sets it to {table.answers_all}"
            )
        mute = speed, packets.protocol, found_id
    if stranger is not None:
        raise stranger
    who = "no servo" if servo_id is None else f"servo {servo_id} does not answer; no servo"
    speeds = ", ".join(str(one) for one in dict.fromkeys(speed for speed, _ in _ways(model, baud)))
    raise DeviceTimeoutError(f"{bus.port}: {who} at {speeds} baud: look at its power, its cable, its id")


def listen_first(bus: ServoBus) -> None:
    """Hear whether somebody speaks unasked, before anything is sent.

    Raises:
        DeviceError: somebody does.
    """
    if heard := bus.listen(_LISTEN_S):
        raise DeviceError(
            f"{bus.port}: {len(heard)} bytes came unasked, and a servo never speaks first: another program drives "
            "this bus, or something else hangs on this port; nothing was sent to it"
        )


def all_answering(bus: ServoBus, baud: int | None) -> list[tuple[int, int]]:
    """Speed and number of every servo that answers a ping, at one speed or at all that are known."""
    bus.find_echo()
    found = set()
    for speed, packets in _ways(None, baud):
        bus.packets = packets
        if bus.set_baud(speed):
            found |= {(speed, number) for number in bus.ping(BROADCAST, PING_S)}
    return sorted(found)


class _StrangerError(DeviceError):
    """A servo answers that is none of those packets' known models."""


def _ways(model: str | None, baud: int | None) -> Iterator[tuple[int, PacketFormat]]:
    """Speeds and packets to ask with: every family's first speed before any one's second."""
    most = max(len(family.bauds) for family in FAMILIES)
    asked = set()
    for rank in range(most):
        for family in FAMILIES:
            for packets in family.formats(model):
                speeds = family.bauds[rank : rank + 1] if baud is None else (baud,)
                for speed in speeds:
                    if (speed, packets) not in asked:
                        asked.add((speed, packets))
                        yield speed, packets


def _any_table(packets: PacketFormat) -> ControlTable:
    """One of those that speak so: what is common to all of them can be read from it."""
    return next(table for table in all_tables() if table.packets is packets)


def _table(bus: ServoBus, servo_id: int, model: str | None) -> ControlTable:
    """The control table of a servo that answers: of that number, with its id where the table has it.

    Raises:
        DeviceError: it is another model, or one that nobody knows; or as `ServoBus.read`.
    """
    speaking = [table for table in all_tables() if table.packets is bus.packets]
    any_unit = ServoUnit(bus, speaking[0], servo_id)
    number = any_unit.count(speaking[0].model_number)
    for table in speaking:
        if table.number == number and any_unit.count(table.id) == servo_id:
            if model not in (None, table.model):
                raise DeviceError(
                    f"{bus.port}: the model of servo {servo_id} is {table.model}, not {model}: look at cable and task"
                )
            return table
    known = ", ".join(f"{table.number} {table.model}" for table in all_tables())
    raise _StrangerError(f"{bus.port}: servo {servo_id} has model number {number}, which is unknown; known: {known}")
