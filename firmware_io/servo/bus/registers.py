"""Control tables of servos: address, coding and unit of each value.

Units are SI: radians, radians per second, volts. Angles are counter-clockwise seen towards the horn, 0 at the encoder's
centre. Load is a fraction of the stall torque, or of the duty if the servo reports only that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from scanwright.design.errors import DeviceError
from scanwright.firmware_io.servo.bus.packet_format import PacketFormat

RPM = 2 * math.pi / 60  # rad/s

Sign = Literal["none", "twos"] | int


@dataclass(frozen=True, slots=True)
class Register:
    """One entry of a control table.

    Attributes:
        address: of its lowest byte; little-endian.
        size: in bytes.
        unit: SI value of one count; negative if counts grow clockwise.
        sign: encoding of negative counts; a number is the index of a sign bit, with the magnitude in the bits below it.
        name: of a setting, as in the e-manual.
    """

    address: int
    size: int
    unit: float = 1.0
    sign: Sign = "none"
    name: str = ""

    def __str__(self) -> str:
        return f"{self.name} (register {self.address})" if self.name else f"register {self.address}"

    @property
    def bounds(self) -> tuple[int, int]:
        """Smallest and largest count."""
        if isinstance(self.sign, int):
            return 1 - (1 << self.sign), (1 << self.sign) - 1
        bits = 8 * self.size
        return (-(1 << bits - 1), (1 << bits - 1) - 1) if self.sign == "twos" else (0, (1 << bits) - 1)

    def encode(self, value: float) -> bytes:
        """Return the bytes of a value in SI units; DeviceError if it does not fit."""
        low, high = self.bounds
        if not low - 0.5 < value / self.unit < high + 0.5:
            least, most = sorted((low * self.unit, high * self.unit))
            raise DeviceError(f"{self}: {value:g}: not in {least:g} .. {most:g}")
        count = round(value / self.unit)
        if isinstance(self.sign, int):
            return (abs(count) | ((1 << self.sign) if count < 0 else 0)).to_bytes(self.size, "little")
        return count.to_bytes(self.size, "little", signed=self.sign == "twos")

    def decode(self, data: bytes) -> float:
        """Return the value in SI units of `size` bytes; the inverse of `encode`."""
        count = int.from_bytes(data, "little", signed=self.sign == "twos")
        if isinstance(self.sign, int):
            size = count & (1 << self.sign) - 1
            count = -size if count >> self.sign & 1 else size
        return count * self.unit


Setting = tuple[Register, int]


@dataclass(frozen=True, slots=True)
class ControlTable:
    """Registers and properties of one model with one protocol.

    Attributes:
        model: catalogue name.
        number: value of `model_number`.
        ram: first volatile address; torque must be off to write below it.
        centre: count of the encoder's centre, angle 0.
        last: highest count of one turn, or of the range that the sensor covers.
        measures_turn: False if the position sensor has a dead sector.
        speed_loop: False if "speed" in wheel mode is a part of the supply voltage, and no speed is measured.
        wheel: settings of continuous rotation.
        joint: settings of moving to an angle.
        neutral: settings that turn or shift the zero of angles, with the value that does not.
        bauds: baud rates, by the count of `baud`.
        answers_all: count of `status_return` with which all requests get a reply.
        faults: names of the bits of `hardware_error` if there is one, otherwise of the error byte of each reply.
        joint_speed: speed towards an angle; count 0 means unlimited.
        max_torque: `torque_limit` after a start; a shutdown lowers that.
        lock: 1 in it keeps settings unchanged, or makes writes to them volatile.
        watchdog: time without requests after which the servo stops.
        modes: names of the counts of the first register of `wheel`.
    """

    model: str
    packets: PacketFormat
    number: int
    ram: int
    centre: int
    last: int
    measures_turn: bool
    speed_loop: bool
    wheel: tuple[Setting, ...]
    joint: tuple[Setting, ...]
    neutral: tuple[Setting, ...]
    bauds: dict[int, int]
    answers_all: int
    faults: dict[int, str]
    model_number: Register
    id: Register
    baud: Register
    return_delay_ns: Register
    status_return: Register
    torque: Register
    wheel_speed: Register
    joint_speed: Register
    goal: Register
    load: Register
    velocity: Register
    position: Register
    voltage: Register
    temperature: Register
    torque_limit: Register | None = None
    max_torque: Register | None = None
    hardware_error: Register | None = None
    lock: Register | None = None
    watchdog: Register | None = None
    modes: dict[int, str] = field(default_factory=dict)

    def is_permanent(self, register: Register) -> bool:
        """Whether a register is permanent (EEPROM): such a register is written only if a person agrees."""
        return register.address < self.ram

    def mode(self, *, spins: bool) -> tuple[Setting, ...]:
        """Return the settings of continuous rotation, or of moving to an angle."""
        return self.wheel if spins else self.joint

    @property
    def protocol(self) -> str:
        """Name of the protocol given by the maker."""
        return self.packets.protocol

    @property
    def can_be_mute(self) -> bool:
        """Whether it can be set to reply only to pings: the levels are 0 pings, 1 reads, 2 all requests."""
        return self.answers_all > 1

    @property
    def fast(self) -> Setting:
        """The setting for 1 Mbaud."""
        return self.baud, self.baud_count(1_000_000)

    def baud_count(self, baud: int) -> int:
        """Return the count of a baud rate; DeviceError if the servo does not have it."""
        for count, known in self.bauds.items():
            if known == baud:
                return count
        raise DeviceError(
            f"{baud} baud: {self.model} supports {', '.join(str(rate) for rate in sorted(self.bauds.values()))}"
        )

    @property
    def reach_rad(self) -> tuple[float, float]:
        """Range of angles."""
        ends = [(count - self.centre) * self.position.unit for count in (0, self.last)]
        return min(ends), max(ends)

    @property
    def present(self) -> Register:
        """Block of addresses with all present values, for one transaction."""
        values = (self.position, self.load, self.velocity, self.voltage, self.temperature)
        first = min(register.address for register in values)
        return Register(first, max(register.address + register.size for register in values) - first)

    def names(self, code: int) -> str:
        """Return the names of the faults in a fault byte."""
        named = " and ".join(name for bit, name in self.faults.items() if code >> bit & 1)
        return named or f"fault code {code}"

    def pick(self, register: Register, data: bytes) -> float:
        """Return one value of the bytes of `present`, in SI units."""
        start = register.address - self.present.address
        return register.decode(data[start : start + register.size])
