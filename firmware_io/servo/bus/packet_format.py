"""What a family of servos says on its bus: how its packets are made, taken apart and understood."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from scanwright.firmware_io.servo.bus.serial_line import SerialLine

_PING, _READ, _WRITE, _REBOOT = 1, 2, 3, 8
NO_ANSWER = "no answer: check its power and cable; another program may have set another speed"


@dataclass(frozen=True, slots=True)
class Status:
    """One answer of a servo, as it came."""

    id: int
    error: int  # its error byte
    data: bytes  # parameters, without stuffing
    length: int  # in bytes, on the wire


@dataclass(frozen=True, slots=True)
class Meaning:
    """What an error byte means."""

    conditions: int = 0  # bits of it that tell of the servo, not of the request; 0 when it is well
    damaged: bool = False  # the request arrived damaged
    refusal: str | None = None  # why the servo does not do what it was told; None if it does


class PacketFormat(ABC):
    """How the servos of a family pack what is said on their bus; packets hold an instruction and its parameters.

    Attributes:
        everyone: number that all answer to; without one, the number that they have from the factory.
        address_bytes: of an address, and of a size.
    """

    protocol: str  # as the maker calls it: "2.0"
    overhead: int  # bytes of a reading, request and answer, around its values
    everyone = 254
    address_bytes = 1

    @abstractmethod
    def packet(self, servo_id: int, instruction: int, parameters: bytes) -> bytes:
        """The bytes of a request."""

    @abstractmethod
    def acknowledged(self, servo_id: int) -> bytes:
        """What the answer to a write that was obeyed begins with, whatever the servo reports of itself."""

    @abstractmethod
    def receive(self, line: SerialLine) -> Status:
        """Return the next status of any servo; raises DeviceTimeoutError, or ProtocolError if damaged."""

    @abstractmethod
    def meaning(self, error: int) -> Meaning:
        """What the error byte of a status means."""

    def ping(self, servo_id: int) -> bytes:
        """The request to say no more than that it is there."""
        return self.packet(servo_id, _PING, b"")

    def reading(self, servo_id: int, address: int, size: int) -> bytes:
        """The request for the values at an address."""
        return self.packet(
            servo_id, _READ, b"".join(one.to_bytes(self.address_bytes, "little") for one in (address, size))
        )

    def writing(self, servo_id: int, address: int, values: bytes) -> bytes:
        """The request to take these values to an address."""
        return self.packet(servo_id, _WRITE, address.to_bytes(self.address_bytes, "little") + values)

    def reboot(self, servo_id: int) -> bytes:
        """The request to restart, which not every family knows."""
        return self.packet(servo_id, _REBOOT, b"")
