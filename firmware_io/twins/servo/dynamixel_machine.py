"""A servo without its bus: control table, instructions, motion and protection, at whatever time it is told.

Not published by the maker and therefore assumed: how long a restart takes, when the overload protection trips, and
that an AX-12A reads 0 or 1023 in its dead sector, the end that is nearer.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from design.catalogue.catalogue import load_catalogue
from design.catalogue.products import Servo
from firmware_io.servo.bus.registers import ControlTable
from firmware_io.twins.dynamics import Actuation, HornMotion, Load, plant_of
from firmware_io.twins.servo.dynamixel_memory import INDIRECT, ITEMS
from firmware_io.twins.servo.dynamixel_packets import FAST_BULK_READ, FAST_SYNC_READ, fast_status, status, take
from firmware_io.twins.servo.machine import BROADCAST, Request
from firmware_io.twins.servo.memory import ACCESS, RANGE, Memory

_BOOT_S = 0.5
_OVERLOAD_SHARE, _OVERLOAD_S = 0.8, 1.5
_VOLTAGE, _HEAT, _OVERLOAD = 1, 4, 32  # bits of both protocols
_BAUDS_2 = (9600, 57600, 115200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000)
_BAUDS_1_FAST = {250: 2_250_000, 251: 2_500_000, 252: 3_000_000}
_ERRORS_1 = {RANGE: 8, ACCESS: 8}  # the others of protocol 2.0 are instruction errors in 1.0


class DynamixelMachine:
    """One servo with power; methods as `ServoMachine` has them.

    Attributes:
        table: what the driver knows of the model.
        memory: the control table.
        axis: the true motion of the horn.
    """

    def __init__(self, table: ControlTable, load: Load, time_ns: int, angle_rad: float) -> None:
        self.table = table
        self.memory = Memory({item.address: item for item in ITEMS[self.table.number]}, self.table.ram)
        self.axis = HornMotion(plant_of(table.model), load, time_ns, angle_rad=angle_rad)
        self._pointers = INDIRECT.get(self.table.number, {})  # to the targets of indirect data
        self._turns = 0  # of the axis, when the servo last began to count
        self._latched = 0
        self._hot_degC = 30
        self._rated_v = load_catalogue().get(table.model, Servo).rated_v
        self._supply = 1.0
        self._strained_since_ns: int | None = None
        self._mute_until_ns = time_ns
        self._spoken_ns = time_ns
        self._registered: tuple[int, bytes] | None = None

    @property
    def id(self) -> int:
        """The servo's number on the bus."""
        return self.memory[7 if self._two else 3]

    @property
    def baud(self) -> float:
        """Bits per second that it understands."""
        code = self.memory[8 if self._two else 4]
        return _BAUDS_2[code] if self._two else _BAUDS_1_FAST.get(code, 2_000_000 / (code + 1))

    @property
    def return_delay_ns(self) -> int:
        """Between a request's end and the answer's begin."""
        return self.memory[9 if self._two else 5] * 2000

    def listens(self, now_ns: int) -> bool:
        """Whether it is up after a restart."""
        return now_ns >= self._mute_until_ns

    def answer(self, request: Request, now_ns: int) -> tuple[int, bytes] | None:
        """Carry out a request; error byte and data of the answer, None where there is none."""
        if request.id not in (self.id, BROADCAST):
            return None
        self._spoken_ns = now_ns
        error, data = self._carry_out(request, now_ns)
        return None if error is None else (error | self._conditions(), data)

    def take(self, buffer: bytearray) -> Request | None:
        """Take the next request off a buffer."""
        return take(buffer, self.table.protocol)

    def in_turn(self, request: Request) -> tuple[int, ...] | None:
        """The servos that answer one after the other: those of sync and bulk reads."""
        if request.id != BROADCAST or not request.intact:
            return None
        if request.instruction in (0x82, FAST_SYNC_READ) and self._two:
            return tuple(request.parameters[4:])
        if request.instruction in (0x92, FAST_BULK_READ):
            return tuple(request.parameters[::5] if self._two else request.parameters[2::3])
        return None

    def statuses(self, request: Request, said: Sequence[tuple[int, int, bytes]]) -> list[bytes]:
        """The bytes of what servos say: one status each, or one of all to a fast read."""
        if self._two and request.id == BROADCAST and request.instruction in (FAST_SYNC_READ, FAST_BULK_READ):
            parameters = request.parameters
            if request.instruction == FAST_SYNC_READ:
                size = len(parameters[4:]) * (self._span(parameters)[1] + 4)
            else:
                size = sum(self._span(parameters[k + 1 :])[1] + 4 for k in range(0, len(parameters), 5))
            return [fast_status(size, said)]
        return [status(self.table.protocol, *one) for one in said]

    def overheat(self) -> None:
        """The motor is 5 degrees above its limit."""
        self._hot_degC = self.memory[31 if self._two else 11] + 5

    def overload(self, now_ns: int) -> None:
        """The overload protection trips."""
        self._trip(_OVERLOAD, now_ns)

    def set_voltage(self, volts: float, now_ns: int) -> None:
        """The supply gives another voltage."""
        self._supply = volts / self._rated_v
        self.axis.change(now_ns, supply=self._supply)

    def restart(self, now_ns: int) -> None:
        """Back to the values at power-up; deaf and mute until that is done."""
        self.memory.reset(self.table.ram)
        if not self._two:
            self.memory[34] = self.memory[14]
        self._latched, self._registered = 0, None
        self._hot_degC = 30
        self._mute_until_ns = now_ns + round(_BOOT_S * 1e9)
        self._count_one_turn(now_ns)
        self._act(now_ns)

    def protect(self, now_ns: int) -> None:
        """What the servo watches by itself, to be called often: voltage, heat, load, and the silence of its bus."""
        memory = self.memory
        if bits := self._state_bits():
            self._trip(bits, now_ns)
        if self._strained(now_ns):
            self._trip(_OVERLOAD, now_ns)
        watched = self._two and 0 < memory[98] <= 127 and memory[64]
        if watched and now_ns - self._spoken_ns > memory[98] * 20_000_000:
            memory[98] = 255
            memory[104] = 0
            memory[116] = self._count(self.axis.motion(now_ns).angle_rad)
            self._act(now_ns)

    def _carry_out(self, request: Request, now_ns: int) -> tuple[int | None, bytes]:
        """Error and data of the answer; error None where there is none."""
        level, to_all = self.memory[68 if self._two else 16], request.id == BROADCAST
        parameters = request.parameters
        if not request.intact:
            return (None if to_all or level < 2 else 3 if self._two else 16), b""
        if request.instruction == 1:
            return 0, bytes(self.memory.data[0:2]) + bytes([self.memory[6]]) if self._two else b""
        if request.instruction == 2 and not to_all:
            error, data = self._read(*self._span(parameters), now_ns)
            return (None if level < 1 else error), data
        fast = self._two and request.instruction in (FAST_SYNC_READ, FAST_BULK_READ)
        if to_all and (fast or request.instruction in (0x82, 0x92)):
            return self._read_among_others(request, now_ns)
        error = self._change(request, now_ns)
        return (None if to_all or level < 2 else error), b""

    def _change(self, request: Request, now_ns: int) -> int:
        """Carry out what is no reading; its error."""
        wide = 2 if self._two else 1
        parameters = request.parameters
        unknown = 2 if self._two else 64
        if request.instruction in (3, 4) and len(parameters) > wide:
            address, data = int.from_bytes(parameters[:wide], "little"), parameters[wide:]
            if request.instruction == 3:
                return self._write(address, data, now_ns)
            self._registered = address, data
            self.memory[69 if self._two else 44] = 1
            return 0
        if request.instruction == 5 and self._registered:
            (address, data), self._registered = self._registered, None
            self.memory[69 if self._two else 44] = 0
            return self._write(address, data, now_ns)
        if request.instruction == 0x83 and len(parameters) > 2 * wide:
            address, size = self._span(parameters)
            rest = parameters[2 * wide :]
            for start in range(0, len(rest) - size, size + 1):
                if rest[start] == self.id:
                    return self._write(address, rest[start + 1 : start + 1 + size], now_ns)
            return 0
        if request.instruction == 0x93 and self._two:
            while len(parameters) >= 5:
                (address, size), end = self._span(parameters[1:]), 5 + int.from_bytes(parameters[3:5], "little")
                if parameters[0] == self.id:
                    return self._write(address, parameters[5 : 5 + size], now_ns)
                parameters = parameters[end:]
            return 0
        if request.instruction == 6:
            self.memory.reset(7 if self._two else 3)
        elif request.instruction == 8 and self._two:
            self.restart(now_ns)
        elif request.instruction == 0x10 and self._two and parameters == b"\x01\x44\x58\x4c\x22":
            self._count_one_turn(now_ns)
        else:
            return unknown
        return 0

    def _span(self, parameters: bytes) -> tuple[int, int]:
        """Address and length at the head of the parameters."""
        wide = 2 if self._two else 1
        return int.from_bytes(parameters[:wide], "little"), int.from_bytes(parameters[wide : 2 * wide], "little")

    def _read_among_others(self, request: Request, now_ns: int) -> tuple[int | None, bytes]:
        """Sync read and bulk read; in protocol 1.0 the MX know the second, and the AX neither."""
        parameters = request.parameters
        if request.instruction in (0x82, FAST_SYNC_READ) and self._two and self.id in parameters[4:]:
            return self._read(*self._span(parameters), now_ns)
        if request.instruction in (0x92, FAST_BULK_READ) and self._two:
            blocks = (parameters[start : start + 5] for start in range(0, len(parameters), 5))
            mine = next((block[1:] for block in blocks if block[0] == self.id), None)
        elif request.instruction == 0x92 and self.table.measures_turn:
            blocks = (parameters[start : start + 3] for start in range(1, len(parameters), 3))
            mine = next((bytes([block[2], block[0]]) for block in blocks if block[1:2] == bytes([self.id])), None)
        else:
            mine = None
        return (None, b"") if mine is None else self._read(*self._span(mine), now_ns)

    @property
    def _two(self) -> bool:
        return self.table.protocol == "2.0"

    def _error(self, number: int) -> int:
        return number if self._two else _ERRORS_1.get(number, 64)

    def _read(self, address: int, size: int, now_ns: int) -> tuple[int, bytes]:
        if not size or address + size > len(self.memory.data):
            return self._error(ACCESS), b""
        self._measure(now_ns)
        return 0, self._gather(address, size)

    def _gather(self, address: int, size: int) -> bytes:
        """Bytes as a client sees them: indirect data are those of their targets."""
        return bytes(self.memory.data[self._target(place)] for place in range(address, address + size))

    def _target(self, place: int) -> int:
        pointer = self._pointers.get(place)
        return place if pointer is None else self.memory[pointer]

    def _write(self, address: int, data: bytes, now_ns: int) -> int:
        memory, torque = self.memory, self.table.torque.address
        was_on = bool(memory[torque])
        if self._target(address) != address:
            for offset, byte in enumerate(data):
                memory.data[self._target(address + offset)] = byte
            self._act(now_ns)
            return 0
        if error := memory.refuses(address, data, locked=was_on if self._two else bool(memory[47])):
            return self._error(error)
        goals = (
            self._two and memory[98] == 255 and any(goal in range(address, address + len(data)) for goal in (104, 116))
        )
        if goals:  # the watchdog has stopped it: goals stay as they are until its error is cleared
            return RANGE
        if not self._two and address == 30 and not self._within_limits(data):
            return 2
        if self._two and address == torque and data[0] and self._latched:
            return 1  # only a restart helps
        memory.data[address : address + len(data)] = data
        if not self._two and address == 30:
            memory[torque] = 1  # a goal turns the torque on
        if not self._two and address == 34:
            self._latched &= ~_OVERLOAD
        if not was_on and memory[torque]:
            self._begin_torque(now_ns)
        self._act(now_ns)
        return 0

    def _within_limits(self, data: bytes) -> bool:
        low, high = self.memory[6], self.memory[8]
        return low == high == 0 or low <= int.from_bytes(data[:2], "little") <= high

    def _begin_torque(self, now_ns: int) -> None:
        """Position mode begins within one turn; in protocol 2.0 the goal is then where the horn is."""
        if not self._two or self.memory[11] == 3:
            self._count_one_turn(now_ns)
        if self._two:
            self._measure(now_ns)
            self.memory[116] = self.memory[132]

    def _count_one_turn(self, now_ns: int) -> None:
        self._turns = math.floor((self.axis.motion(now_ns).angle_rad + math.pi) / (2 * math.pi))

    def _count(self, angle_rad: float) -> int:
        table = self.table
        count = round(angle_rad / table.position.unit) + table.centre
        if self._two:
            return count - 4096 * self._turns + self.memory[20]
        if table.measures_turn:
            return count % (table.last + 1)
        within_rad = math.remainder(angle_rad, 2 * math.pi)
        return max(0, min(table.last, round(within_rad / table.position.unit) + table.centre))

    def _measure(self, now_ns: int) -> None:
        """Bring the present values up to date."""
        table, memory, motion = self.table, self.memory, self.axis.motion(now_ns)
        rate = round(motion.rate_rad_s / table.velocity.unit)
        milliseconds = now_ns // 1_000_000 % 32768
        memory[table.position.address] = self._count(motion.angle_rad)
        memory[table.voltage.address] = round(self._supply * self._rated_v * 10)
        memory[table.temperature.address] = self._hot_degC
        if self._two:
            memory[table.velocity.address] = rate
            memory[table.load.address] = round(motion.torque / table.load.unit)
            memory[120], memory[122] = milliseconds, int(abs(rate) > memory[24])
            return
        wheel = memory[6] == memory[8] == 0
        shown = round(motion.duty * 1023) if wheel and not table.speed_loop else rate
        memory[table.velocity.address] = _bit10(shown)
        memory[table.load.address] = _bit10(round(motion.duty * 1000))
        memory[46] = int(abs(rate) > 2)
        if 50 in memory:
            memory[50] = milliseconds

    def _act(self, now_ns: int) -> None:
        """Make the motor do what the control table says."""
        drive = self._wanted()
        now = self.axis.drive_at(now_ns)
        if drive != Actuation(now.mode, now.goal, now.rate_rad_s, torque_limit=now.torque_limit):
            self.axis.change(
                now_ns, mode=drive.mode, goal=drive.goal, rate_rad_s=drive.rate_rad_s, torque_limit=drive.torque_limit
            )

    def _wanted(self) -> Actuation:
        table, memory = self.table, self.memory
        if not memory[table.torque.address]:
            return Actuation()
        speed, goal = memory[table.wheel_speed.address], memory[table.goal.address]
        goal_rad = (goal - table.centre) * table.goal.unit + 2 * math.pi * self._turns
        if not self._two:
            limit = memory[34] / 1023
            if memory[6] == memory[8] == 0:
                signed = (speed & 1023) * (-1 if speed & 1024 else 1)
                if not table.speed_loop:
                    return Actuation("share", signed / 1023, torque_limit=limit)
                return Actuation("velocity", signed * table.wheel_speed.unit, torque_limit=limit)
            rate = (speed & 1023) * table.joint_speed.unit or math.inf
            return Actuation("position", goal_rad, rate, torque_limit=limit)
        limit, mode = memory[36] / 885, memory[11]
        if mode == 1:
            return Actuation("velocity", speed * table.wheel_speed.unit, torque_limit=limit)
        if mode in (3, 4):
            goal_rad -= memory[20] * table.goal.unit
            return Actuation("position", goal_rad, memory[112] * table.joint_speed.unit or math.inf, torque_limit=limit)
        return Actuation("share", memory[100] / 885, torque_limit=limit) if mode == 16 else Actuation()

    def _conditions(self) -> int:
        """The fault bits that go with each answer."""
        if self._two:
            return 0x80 if self.memory[70] else 0
        return self._latched | self._state_bits()

    def _state_bits(self) -> int:
        low, high, hot = (34, 32, 31) if self._two else (12, 13, 11)
        fits = self.memory[low] <= round(self._supply * self._rated_v * 10) <= self.memory[high]
        return (0 if fits else _VOLTAGE) | (_HEAT if self._hot_degC > self.memory[hot] else 0)

    def _strained(self, now_ns: int) -> bool:
        if abs(self.axis.motion(now_ns).torque) < _OVERLOAD_SHARE * self._supply:
            self._strained_since_ns = None
            return False
        if self._strained_since_ns is None:
            self._strained_since_ns = now_ns
        return now_ns - self._strained_since_ns > _OVERLOAD_S * 1e9

    def _trip(self, bits: int, now_ns: int) -> None:
        """A fault: reported, and the torque taken if the servo is set to shut down for it."""
        memory, table = self.memory, self.table
        self._latched |= bits & _OVERLOAD if not self._two else bits & memory[63]
        if self._two:
            memory[70] = memory[70] | bits
        if bits & memory[63 if self._two else 18] and memory[table.torque.address]:
            memory[table.torque.address] = 0
            if not self._two:
                memory[34] = 0
            self._act(now_ns)


def _bit10(count: int) -> int:
    return min(abs(count), 1023) | (1024 if count < 0 else 0)
