"""Control tables of the servos: where each value stands, how it is coded, what one count is worth.

Sources are ROBOTIS' e-manual pages ax/ax-12a, mx/mx-28, mx/mx-64, mx/mx-64-2 and x/xm430-w350. Units are SI: radians,
radians per second, volts. Angles are counter-clockwise as one looks at the horn, 0 at the encoder's centre. Load is a
fraction of the rated (stall) torque.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from design.errors import DeviceError

RPM = 2 * math.pi / 60

Sign = Literal["none", "twos", "bit10"]
_BIT10 = 1 << 10  # protocol 1.0: size in the lower ten bits, and this one set for clockwise


@dataclass(frozen=True, slots=True)
class Register:
    """One entry of a control table.

    Attributes:
        address: of its lowest byte; little-endian.
        size: in bytes.
        unit: what one count is worth.
        sign: how negative values are written.
        name: of a setting that outlasts a scan, as the e-manual has it.
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
        if self.sign == "bit10":
            return -_BIT10 + 1, _BIT10 - 1
        bits = 8 * self.size
        return (-(1 << bits - 1), (1 << bits - 1) - 1) if self.sign == "twos" else (0, (1 << bits) - 1)

    def encode(self, value: float) -> bytes:
        """The bytes of a value in SI units, rounded to a count.

        Raises:
            DeviceError: it does not fit; nothing is masked or clipped.
        """
        low, high = self.bounds
        if not low * self.unit - self.unit / 2 < value < high * self.unit + self.unit / 2:
            raise DeviceError(f"{self}: {value:g}: not in {low * self.unit:g} .. {high * self.unit:g}")
        count = round(value / self.unit)
        if self.sign == "bit10":
            return (abs(count) | (_BIT10 if count < 0 else 0)).to_bytes(self.size, "little")
        return count.to_bytes(self.size, "little", signed=self.sign == "twos")

    def decode(self, data: bytes) -> float:
        """The value in SI units of `size` bytes; the inverse of `encode`."""
        if self.sign == "bit10":
            count = int.from_bytes(data, "little")
            return (count & _BIT10 - 1) * self.unit * (-1 if count & _BIT10 else 1)
        return int.from_bytes(data, "little", signed=self.sign == "twos") * self.unit


Setting = tuple[Register, int]


@dataclass(frozen=True, slots=True)
class ControlTable:
    """What the driver needs to know of one model with one protocol.

    Attributes:
        model: name, as in the catalogue.
        number: model number that the servo answers.
        protocol: 1.0 or 2.0.
        ram: first address that is not kept without power; below it torque must be off to write.
        centre: count of the encoder's centre, angle 0.
        last: highest count of one turn, or of the range that the sensor covers.
        measures_turn: False where the position sensor has a dead sector.
        speed_loop: False where "speed" in wheel mode is a share of the supply voltage, and no speed is measured.
        wheel: settings of continuous rotation.
        joint: settings of going to an angle.
        neutral: settings that would turn or shift the angles' zero, with the value that does not.
        fast: the setting for 1 Mbaud.
        faults: what the bits of the fault byte mean (protocol 1.0: of the status; 2.0: of register `hardware_error`).
        joint_speed: speed on the way to an angle; count 0 means unlimited.
        watchdog: None in protocol 1.0, which has none.
    """

    model: str
    number: int
    protocol: float
    ram: int
    centre: int
    last: int
    measures_turn: bool
    speed_loop: bool
    wheel: tuple[Setting, ...]
    joint: tuple[Setting, ...]
    neutral: tuple[Setting, ...]
    fast: Setting
    faults: dict[int, str]
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
    watchdog: Register | None = None

    @property
    def block(self) -> Register:
        """All present values as one stretch of addresses, to be read in one transaction."""
        present = (self.load, self.velocity, self.position, self.voltage, self.temperature)
        first = min(register.address for register in present)
        return Register(first, max(register.address + register.size for register in present) - first)

    def names(self, code: int) -> str:
        """The faults that a fault byte tells of."""
        named = " and ".join(name for bit, name in self.faults.items() if code >> bit & 1)
        return named or f"fault code {code}"

    def pick(self, register: Register, block: bytes) -> float:
        """One value out of the block."""
        start = register.address - self.block.address
        return register.decode(block[start : start + register.size])


_DELAY_NS = 2000.0  # return delay counts 2 us
_FAULTS_1 = {0: "voltage", 2: "overheating", 5: "overload"}
_FAULTS_2 = {0: "voltage", 2: "overheating", 3: "motor encoder", 4: "electrical shock", 5: "overload"}


def _protocol_1(model: str, number: int, *, step_deg: float, last: int, speed_rpm: float) -> ControlTable:
    ax = model == "AX-12A"
    clockwise = Register(6, 2, name="cw_angle_limit")
    counterclockwise = Register(8, 2, name="ccw_angle_limit")
    step_rad = math.radians(step_deg)
    # In wheel mode the AX-12A takes a share of the voltage: that share of its 59 rpm without load, at 12 V.
    wheel_unit = 59 * RPM / 1023 if ax else speed_rpm * RPM
    return ControlTable(
        model=model,
        number=number,
        protocol=1.0,
        ram=24,
        centre=(last + 1) // 2,
        last=last,
        measures_turn=not ax,
        speed_loop=not ax,
        wheel=((clockwise, 0), (counterclockwise, 0)),
        joint=((clockwise, 0), (counterclockwise, last)),
        neutral=()
        if ax
        else (
            (Register(20, 2, sign="twos", name="multi_turn_offset"), 0),
            (Register(22, 1, name="resolution_divider"), 1),
        ),
        fast=(Register(4, 1, name="baud_rate"), 1),
        faults=_FAULTS_1,
        return_delay_ns=Register(5, 1, _DELAY_NS, name="return_delay_time"),
        status_return=Register(16, 1, name="status_return_level"),
        torque=Register(24, 1),
        wheel_speed=Register(32, 2, wheel_unit, "bit10"),
        joint_speed=Register(32, 2, speed_rpm * RPM),
        goal=Register(30, 2, step_rad),
        load=Register(40, 2, 0.001, "bit10"),
        velocity=Register(38, 2, speed_rpm * RPM, "bit10"),
        position=Register(36, 2, step_rad),
        voltage=Register(42, 1, 0.1),
        temperature=Register(43, 1),
        torque_limit=Register(34, 2, 0.001),
        max_torque=Register(14, 2, 0.001),
    )


def _protocol_2(model: str, number: int, *, current_mA: float, stall_A: float) -> ControlTable:
    mode, speed, step_rad = Register(11, 1, name="operating_mode"), 0.229 * RPM, 2 * math.pi / 4096
    return ControlTable(
        model=model,
        number=number,
        protocol=2.0,
        ram=64,
        centre=2048,
        last=4095,
        measures_turn=True,
        speed_loop=True,
        wheel=((mode, 1),),
        joint=((mode, 3),),
        neutral=((Register(10, 1, name="drive_mode"), 0), (Register(20, 4, sign="twos", name="homing_offset"), 0)),
        fast=(Register(8, 1, name="baud_rate"), 3),
        faults=_FAULTS_2,
        return_delay_ns=Register(9, 1, _DELAY_NS, name="return_delay_time"),
        status_return=Register(68, 1, name="status_return_level"),
        torque=Register(64, 1),
        wheel_speed=Register(104, 4, speed, "twos"),
        joint_speed=Register(112, 4, speed),
        goal=Register(116, 4, step_rad, "twos"),
        load=Register(126, 2, current_mA / 1000 / stall_A, "twos"),
        velocity=Register(128, 4, speed, "twos"),
        position=Register(132, 4, step_rad, "twos"),
        voltage=Register(144, 2, 0.1),
        temperature=Register(146, 1),
        hardware_error=Register(70, 1),
        watchdog=Register(98, 1, 0.020),
    )


TABLES = (
    _protocol_1("AX-12A", 12, step_deg=300 / 1024, last=1023, speed_rpm=0.111),
    _protocol_1("MX-28", 29, step_deg=360 / 4096, last=4095, speed_rpm=0.114),
    _protocol_1("MX-64R", 310, step_deg=360 / 4096, last=4095, speed_rpm=0.114),
    _protocol_2("MX-64R", 311, current_mA=3.36, stall_A=4.1),
    _protocol_2("XM430-W350", 1020, current_mA=2.69, stall_A=2.3),
)
