"""What a family of servos says on its bus: how its packets are made, taken apart and understood."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from scanwright.firmware_io.servo.bus.serial_line import SerialLine

NO_ANSWER = "no answer: check its power and cable; another program may have set another speed"


@dataclass(frozen=True, slots=True)
class Status:
    """One answer of a servo, as it came.

    Attributes:
        id: of the servo.
        error: its error byte.
        data: parameters, without stuffing.
        length: in bytes, on the wire.
    """

    id: int
    error: int
    data: bytes
    length: int


@dataclass(frozen=True, slots=True)
class Meaning:
    """What an error byte means.

    Attributes:
        conditions: bits of it that tell of the servo, not of the request; 0 when it is well.
        damaged: the request arrived damaged.
        refusal: why the servo does not do what it was told; None where it does.
    """

    conditions: int = 0
    damaged: bool = False
    refusal: str | None = None


class PacketFormat(Protocol):
    """How the servos of a family pack what is said on their bus."""

    protocol: str
    """As the maker calls it: "2.0"."""
    overhead: int
    """Bytes of a reading, request and answer, around its values."""
    everyone: int
    """The number that all answer to; where there is none, the one that they have from the factory."""

    def ping(self, servo_id: int) -> bytes:
        """The request to say no more than that it is there."""

    def reading(self, servo_id: int, address: int, size: int) -> bytes:
        """The request for the values at an address."""

    def writing(self, servo_id: int, address: int, values: bytes) -> bytes:
        """The request to take these values to an address."""

    def reboot(self, servo_id: int) -> bytes:
        """The request to restart."""

    def acknowledged(self, servo_id: int) -> bytes:
        """What the answer to a write that was obeyed begins with."""

    def receive(self, line: SerialLine) -> Status:
        """The next status of any servo.

        Raises:
            DeviceTimeoutError: the line's deadline passed.
            ProtocolError: what came is damaged.
        """

    def meaning(self, error: int) -> Meaning:
        """What the error byte of a status means."""
