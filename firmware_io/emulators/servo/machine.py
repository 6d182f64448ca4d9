"""Interface of emulated servos, and the replies of several of them to one request."""

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
    """One instruction packet."""

    id: int  # of the servo
    instruction: int
    parameters: bytes  # without stuffing
    wire: bytes  # all bytes
    intact: bool  # whether the checksum is right


class ServoMachine(ABC):
    """A servo with power and without its bus, at given times."""

    forgets_ns = 100_000_000  # [assumed]: pause after which it drops the start of an incomplete request

    def __init__(
        self, table: ControlTable, items: Iterable[TableItem], load: Load, time_ns: int, angle_rad: float
    ) -> None:
        self.table = table
        self.memory = Memory({item.address: item for item in items}, table.ram)  # the control table
        self.axis = HornMotion(plant_of(table.model), load, time_ns, angle_rad=angle_rad)  # true motion of the horn
        self._rated_v = load_catalogue().get(table.model, Servo).rated_v
        self._supply = 1.0
        self._hot_degC = _USUAL_DEGC
        self._latched = 0
        self._strained_since_ns: int | None = None
        self._turns = 0  # of the axis, at the last start of the count
        self._mute_until_ns = time_ns
        self._registered: tuple[int, bytes] | None = None

    @property
    def id(self) -> int:
        """Id on the bus."""
        return self.memory[self.table.id.address]

    @property
    @abstractmethod
    def baud(self) -> float:
        """Baud rate."""

    @property
    def return_delay_ns(self) -> int:
        """Time between the end of a request and the start of its reply."""
        return self.memory[self.table.return_delay_ns.address] * 2000

    @property
    @abstractmethod
    def limits(self) -> tuple[int, int, int]:
        """Addresses of the lowest and highest voltage, and of the highest temperature."""

    @abstractmethod
    def take(self, buffer: bytearray) -> Request | None:
        """Remove the next request, and the bytes before it, from a buffer; None until one is complete."""

    def listens(self, now_ns: int) -> bool:
        """Whether it is not restarting."""
        return now_ns >= self._mute_until_ns

    @abstractmethod
    def answer(self, request: Request, now_ns: int) -> tuple[int, bytes] | None:
        """Execute a request; return error byte and data of the reply, None without a reply."""

    @abstractmethod
    def in_turn(self, request: Request) -> tuple[int, ...] | None:
        """Return the servos that reply in turn, each waiting for the one before it; None for other requests."""

    @abstractmethod
    def statuses(self, request: Request, answers: Sequence[tuple[int, int, bytes]]) -> list[bytes]:
        """Encode the replies of servos to a request, from id, error and data of each."""

    @abstractmethod
    def actuation(self) -> Actuation:
        """Return the actuation that the control table requests."""

    def overheat(self) -> None:
        """Heat the motor to 5 degrees above its limit."""
        self._hot_degC = self.memory[self.limits[2]] + 5

    @abstractmethod
    def overload(self, now_ns: int) -> None:
        """Trip the overload protection."""

    def set_voltage(self, volts: float, now_ns: int) -> None:
        """Set the supply voltage."""
        self._supply = volts / self._rated_v
        self.axis.change(now_ns, supply=self._supply)

    def restart(self, now_ns: int) -> None:
        """Restore the values at power-up; no communication until that is done."""
        self.memory.reset(self.table.ram)
        self._latched, self._registered, self._hot_degC = 0, None, _USUAL_DEGC
        self._mute_until_ns = now_ns + _BOOT_NS

    @abstractmethod
    def protect(self, now_ns: int) -> None:
        """Check its protection; call this often."""

    def _state_bits(self) -> int:
        low, high, hot = (self.memory[address] for address in self.limits)
        fits = low <= round(self._supply * self._rated_v * 10) <= high
        return (0 if fits else VOLTAGE) | (HEAT if self._hot_degC > hot else 0)

    def _strained(self, now_ns: int, share: float, after_s: float) -> bool:
        """Whether the motor had more than a fraction of its torque for `after_s`."""
        if abs(self.axis.motion(now_ns).torque) < share * self._supply:
            self._strained_since_ns = None
            return False
        if self._strained_since_ns is None:
            self._strained_since_ns = now_ns
        return now_ns - self._strained_since_ns > after_s * 1e9

    def _count_one_turn(self, now_ns: int) -> None:
        self._turns = math.floor((self.axis.motion(now_ns).angle_rad + math.pi) / (2 * math.pi))

    def _act(self, now_ns: int) -> None:
        """Apply the actuation of the control table."""
        drive, now = self.actuation(), self.axis.drive_at(now_ns)
        if drive != Actuation(now.mode, now.goal, now.rate_rad_s, torque_limit=now.torque_limit):
            self.axis.change(
                now_ns, mode=drive.mode, goal=drive.goal, rate_rad_s=drive.rate_rad_s, torque_limit=drive.torque_limit
            )


def answers(servos: Sequence[ServoMachine], request: Request, now_ns: int) -> list[bytes]:
    """Return the replies of the servos of one bus to a request, in order."""
    answers = {servo.id: answer for servo in servos if (answer := servo.answer(request, now_ns)) is not None}
    answering_ids = servos[0].in_turn(request)
    in_order: list[tuple[int, int, bytes]] = []
    for servo_id in sorted(answers) if answering_ids is None else answering_ids:
        if servo_id not in answers:  # those after it wait forever
            break
        in_order.append((servo_id, *answers[servo_id]))
    return servos[0].statuses(request, in_order) if in_order else []
