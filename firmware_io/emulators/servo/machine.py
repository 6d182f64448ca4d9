"""What the bus of an emulator asks of the servos on it, and how several of them answer one request."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from scanwright.firmware_io.emulators.dynamics import HornMotion
from scanwright.firmware_io.servo.bus.registers import ControlTable

BROADCAST = 254  # e-manual; memory table of the STS


@dataclass(frozen=True, slots=True)
class Request:
    """One instruction packet.

    Attributes:
        id: of the servo it is for.
        instruction: its number.
        parameters: without stuffing.
        wire: its bytes.
        intact: whether the checksum is right.
    """

    id: int
    instruction: int
    parameters: bytes
    wire: bytes
    intact: bool


class Entries(Protocol):
    """What a servo keeps at its addresses."""

    def __getitem__(self, address: int) -> int:
        """The count at an address."""

    def __setitem__(self, address: int, value: int) -> None:
        """Set it, whatever the servo would take."""


class ServoMachine(Protocol):
    """A servo without its bus: control table, instructions, motion and protection, at whatever time it is told."""

    table: ControlTable
    axis: HornMotion
    forgets_ns: int
    """The pause after which it forgets the beginning of a request that did not go on."""

    @property
    def memory(self) -> Entries:
        """Its control table."""

    @property
    def id(self) -> int:
        """Its number on the bus."""

    @property
    def baud(self) -> float:
        """Bits per second that it understands."""

    @property
    def return_delay_ns(self) -> int:
        """Between a request's end and the answer's begin."""

    def take(self, buffer: bytearray) -> Request | None:
        """Take the next request off a buffer, and what lies before it; None until one is complete."""

    def listens(self, now_ns: int) -> bool:
        """Whether it is up after a restart."""

    def answer(self, request: Request, now_ns: int) -> tuple[int, bytes] | None:
        """Carry out a request; error byte and data of the answer, None where there is none."""

    def in_turn(self, request: Request) -> tuple[int, ...] | None:
        """The servos that answer a request one after the other, each waiting for the one before it; None for others."""

    def statuses(self, request: Request, answers: Sequence[tuple[int, int, bytes]]) -> list[bytes]:
        """The bytes of what servos say to a request; id, error and data of each."""

    def overheat(self) -> None:
        """The motor is 5 degrees above its limit."""

    def overload(self, now_ns: int) -> None:
        """The overload protection trips."""

    def set_voltage(self, volts: float, now_ns: int) -> None:
        """The supply gives another voltage."""

    def restart(self, now_ns: int) -> None:
        """Back to the values at power-up; deaf and mute until that is done."""

    def protect(self, now_ns: int) -> None:
        """What the servo watches by itself, to be called often."""


def answers(servos: Sequence[ServoMachine], request: Request, now_ns: int) -> list[bytes]:
    """What the servos of one bus answer to a request, in the order of their statuses."""
    answers = {servo.id: answer for servo in servos if (answer := servo.answer(request, now_ns)) is not None}
    answering_ids = servos[0].in_turn(request)
    order = sorted(answers) if answering_ids is None else list(answering_ids)
    in_order: list[tuple[int, int, bytes]] = []
    for servo_id in order:
        if servo_id not in answers:  # those after it wait for ever
            break
        in_order.append((servo_id, *answers[servo_id]))
    return servos[0].statuses(request, in_order) if in_order else []
