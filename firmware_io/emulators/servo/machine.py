"""What the bus of an emulator asks of the servos on it, and how several of them answer one request."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.servo import Servo
from scanwright.firmware_io.emulators.dynamics import HornMotion
from scanwright.firmware_io.emulators.servo.memory import Memory, TableItem
from scanwright.firmware_io.emulators.servo_plant import Actuation, Load, plant_of
from scanwright.firmware_io.servo.bus.registers import ControlTable

BROADCAST = 254  # e-manual; memory table of the STS
VOLTAGE, HEAT, OVERLOAD = 1, 4, 32  # fault bits of both Dynamixel protocols and of the STS
_BOOT_NS = 500_000_000  # [assumed]
_USUAL_DEGC = 30


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


class ServoMachine(ABC):
    """A servo with power and without its bus, at a time that the caller gives.

    Attributes:
        forgets_ns: the pause after which it forgets the beginning of a request that did not go on; assumed.
    """

    forgets_ns = 100_000_000

    def __init__(
        self, table: ControlTable, items: Iterable[TableItem], load: Load, time_ns: int, angle_rad: float
    ) -> None:
        self.table = table  # what the driver knows of the model
        self.memory = Memory({item.address: item for item in items}, table.ram)  # the control table, as on the wire
        self.axis = HornMotion(plant_of(table.model), load, time_ns, angle_rad=angle_rad)  # the true motion of the horn
        self._rated_v = load_catalogue().get(table.model, Servo).rated_v
        self._supply = 1.0
        self._hot_degC = _USUAL_DEGC
        self._latched = 0
        self._strained_since_ns: int | None = None
        self._turns = 0  # of the axis, when the servo last began to count
        self._mute_until_ns = time_ns
        self._registered: tuple[int, bytes] | None = None

    @property
    def id(self) -> int:
        """Its number on the bus."""
        return self.memory[self.table.id.address]

    @property
    @abstractmethod
    def baud(self) -> float:
        """Bits per second that it understands."""

    @property
    def return_delay_ns(self) -> int:
        """Between a request's end and the answer's begin."""
        return self.memory[self.table.return_delay_ns.address] * 2000

    @property
    @abstractmethod
    def limits(self) -> tuple[int, int, int]:
        """Addresses of the least and the highest voltage, and of the highest temperature."""

    @abstractmethod
    def take(self, buffer: bytearray) -> Request | None:
        """Take the next request off a buffer, and what lies before it; None until one is complete."""

    def listens(self, now_ns: int) -> bool:
        """Whether it is up after a restart."""
        return now_ns >= self._mute_until_ns

    @abstractmethod
    def answer(self, request: Request, now_ns: int) -> tuple[int, bytes] | None:
        """Carry out a request; error byte and data of the answer, None if there is none."""

    @abstractmethod
    def in_turn(self, request: Request) -> tuple[int, ...] | None:
        """The servos that answer a request one after the other, each waiting for the one before it; None for others."""

    @abstractmethod
    def statuses(self, request: Request, answers: Sequence[tuple[int, int, bytes]]) -> list[bytes]:
        """The bytes of what servos say to a request; id, error and data of each."""

    @abstractmethod
    def wanted(self) -> Actuation:
        """What the control table makes the motor do."""

    def overheat(self) -> None:
        """The motor is 5 degrees above its limit."""
        self._hot_degC = self.memory[self.limits[2]] + 5

    @abstractmethod
    def overload(self, now_ns: int) -> None:
        """The overload protection trips."""

    def set_voltage(self, volts: float, now_ns: int) -> None:
        """The supply gives another voltage."""
        self._supply = volts / self._rated_v
        self.axis.change(now_ns, supply=self._supply)

    def restart(self, now_ns: int) -> None:
        """Back to the values at power-up; deaf and mute until that is done."""
        self.memory.reset(self.table.ram)
        self._latched, self._registered, self._hot_degC = 0, None, _USUAL_DEGC
        self._mute_until_ns = now_ns + _BOOT_NS

    @abstractmethod
    def protect(self, now_ns: int) -> None:
        """What the servo watches by itself, to be called often."""

    def _state_bits(self) -> int:
        low, high, hot = (self.memory[address] for address in self.limits)
        fits = low <= round(self._supply * self._rated_v * 10) <= high
        return (0 if fits else VOLTAGE) | (HEAT if self._hot_degC > hot else 0)

    def _strained(self, now_ns: int, share: float, after_s: float) -> bool:
        """Whether the motor has given more than a share of its torque for so long."""
        if abs(self.axis.motion(now_ns).torque) < share * self._supply:
            self._strained_since_ns = None
            return False
        if self._strained_since_ns is None:
            self._strained_since_ns = now_ns
        return now_ns - self._strained_since_ns > after_s * 1e9

    def _count_one_turn(self, now_ns: int) -> None:
        self._turns = math.floor((self.axis.motion(now_ns).angle_rad + math.pi) / (2 * math.pi))

    def _act(self, now_ns: int) -> None:
        """Make the motor do what the control table says."""
        drive, now = self.wanted(), self.axis.drive_at(now_ns)
        if drive != Actuation(now.mode, now.goal, now.rate_rad_s, torque_limit=now.torque_limit):
            self.axis.change(
                now_ns, mode=drive.mode, goal=drive.goal, rate_rad_s=drive.rate_rad_s, torque_limit=drive.torque_limit
            )


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
