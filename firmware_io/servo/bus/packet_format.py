"""Encoding and decoding of the packets of a servo family."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from scanwright.firmware_io.servo.bus.serial_line import SerialLine

_PING, _READ, _WRITE, _REBOOT = 1, 2, 3, 8
NO_ANSWER = "no answer: check its power and cable; another program may have set another speed"


@dataclass(frozen=True, slots=True)
class Status:
    """One reply of a servo."""

    id: int
    error: int  # error byte
    data: bytes  # parameters, without stuffing
    length: int  # bytes on the wire


@dataclass(frozen=True, slots=True)
class Meaning:
    """Decoded error byte."""

    conditions: int = 0  # fault bits of the servo itself; 0 without a fault
    damaged: bool = False  # the request arrived damaged
    refusal: str | None = None  # why the servo rejected the request; None if it did not


class PacketFormat(ABC):
    """Packet format of a servo family; a packet contains an instruction and its parameters."""

    protocol: str  # name given by the maker, such as "2.0"
    overhead: int  # bytes of request and reply of a reading, without its values
    everyone = 254  # broadcast id, or the factory id if there is none
    address_bytes = 1  # of an address, and of a size

    @abstractmethod
    def packet(self, servo_id: int, instruction: int, parameters: bytes) -> bytes:
        """Encode a request."""

    @abstractmethod
    def acknowledged(self, servo_id: int) -> bytes:
        """Return the first bytes of the reply to an executed write; they do not depend on reported faults."""

    @abstractmethod
    def receive(self, line: SerialLine) -> Status:
        """Return the next status of any servo; raises DeviceTimeoutError, or ProtocolError if damaged."""

    @abstractmethod
    def meaning(self, error: int) -> Meaning:
        """Decode the error byte of a status."""

    def ping(self, servo_id: int) -> bytes:
        """Encode a ping."""
        return self.packet(servo_id, _PING, b"")

    def reading(self, servo_id: int, address: int, size: int) -> bytes:
        """Encode the request to read `size` bytes at an address."""
        block = address.to_bytes(self.address_bytes, "little") + size.to_bytes(self.address_bytes, "little")
        return self.packet(servo_id, _READ, block)

    def writing(self, servo_id: int, address: int, values: bytes) -> bytes:
        """Encode the request to write bytes at an address."""
        return self.packet(servo_id, _WRITE, address.to_bytes(self.address_bytes, "little") + values)

    def reboot(self, servo_id: int) -> bytes:
        """Encode the request to restart; not all families support it."""
        return self.packet(servo_id, _REBOOT, b"")
