"""Emulated Dynamixel without its bus: control table, instructions, motion and protection at given times.

Assumed, as not published: duration of a restart, threshold of the overload protection, and that an AX-12A reads 0 or
1023 in its dead sector, the nearer one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from scanwright.firmware_io.emulators.dynamics import Motion
from scanwright.firmware_io.emulators.servo import dynamixel_groups as groups
from scanwright.firmware_io.emulators.servo.dynamixel_memory import INDIRECT, ITEMS
from scanwright.firmware_io.emulators.servo.dynamixel_packets import fast_status, status, take
from scanwright.firmware_io.emulators.servo.machine import BROADCAST, OVERLOAD, Request, ServoMachine
from scanwright.firmware_io.emulators.servo.memory import ACCESS, RANGE, Memory
from scanwright.firmware_io.emulators.servo_plant import Actuation, Load
from scanwright.firmware_io.servo.bus.registers import ControlTable

_OVERLOAD_SHARE, _OVERLOAD_S = 0.8, 1.5
_BAUDS_2 = (9600, 57600, 115200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000)  # e-manual, by count
_BAUDS_1_FAST = {250: 2_250_000, 251: 2_500_000, 252: 3_000_000}  # e-manual of MX: by count
_ERRORS_1 = {RANGE: 8, ACCESS: 8}  # the others of protocol 2.0 are instruction errors in 1.0


class DynamixelMachine(ServoMachine):
    """A Dynamixel of protocol 1.0 or 2.0."""

    def __init__(self, table: ControlTable, load: Load, time_ns: int, angle_rad: float) -> None:
        super().__init__(table, ITEMS[table.number], load, time_ns, angle_rad)
        self._pointers = INDIRECT.get(self.table.number, {})  # to the targets of indirect data
        self._spoken_ns = time_ns

    @property
    def baud(self) -> float:
        """Baud rate."""
        code = self.memory[8 if self._two else 4]
        return _BAUDS_2[code] if self._two else _BAUDS_1_FAST.get(code, 2_000_000 / (code + 1))

    @property
    def limits(self) -> tuple[int, int, int]:
        """As `ServoMachine.limits`."""
        return (34, 32, 31) if self._two else (12, 13, 11)

    def answer(self, request: Request, now_ns: int) -> tuple[int, bytes] | None:
        """Execute a request; return error byte and data of the reply, None without a reply."""
        if request.id not in (self.id, BROADCAST):
            return None
        self._spoken_ns = now_ns
        error, data = self._carry_out(request, now_ns)
        return None if error is None else (error | self._conditions(), data)

    def take(self, buffer: bytearray) -> Request | None:
        """As `ServoMachine.take`."""
        return take(buffer, self.table.protocol)

    def in_turn(self, request: Request) -> tuple[int, ...] | None:
        """As `ServoMachine.in_turn`."""
        return groups.ids_in_turn(request, two=self._two) if request.id == BROADCAST and request.intact else None

    def statuses(self, request: Request, answers: Sequence[tuple[int, int, bytes]]) -> list[bytes]:
        """Encode one status of each servo, or a common one for a fast read."""
        if self._two and request.id == BROADCAST and request.instruction in groups.FAST:
            return [fast_status(groups.fast_size(request), answers)]
        return [status(self.table.protocol, *answer) for answer in answers]

    def overload(self, now_ns: int) -> None:
        """Trip the overload protection."""
        self._trip(OVERLOAD, now_ns)

    def restart(self, now_ns: int) -> None:
        """As `ServoMachine.restart`."""
        super().restart(now_ns)
        if not self._two:
            self.memory[34] = self.memory[14]
        self._count_one_turn(now_ns)
        self._act(now_ns)

    def protect(self, now_ns: int) -> None:
        """Check voltage, temperature, load, and the watchdog of its bus; call this often."""
        memory = self.memory
        if bits := self._state_bits():
            self._trip(bits, now_ns)
        if self._strained(now_ns, _OVERLOAD_SHARE, _OVERLOAD_S):
            self._trip(OVERLOAD, now_ns)
        watched = self._two and 0 < memory[98] <= 127 and memory[64]
        if watched and now_ns - self._spoken_ns > memory[98] * 20_000_000:
            memory[98] = 255
            memory[104] = 0
            memory[116] = count_of(self.table, memory, self._turns, self.axis.motion(now_ns).angle_rad)
            self._act(now_ns)

    def _carry_out(self, request: Request, now_ns: int) -> tuple[int | None, bytes]:
        """Return error and data of the reply; error None without a reply."""
        level, to_all = self.memory[68 if self._two else 16], request.id == BROADCAST
        parameters = request.parameters
        if not request.intact:
            return (None if to_all or level < 2 else 3 if self._two else 16), b""
        if request.instruction == 1:
            return 0, bytes(self.memory.data[0:2]) + bytes([self.memory[6]]) if self._two else b""
        if request.instruction == 2 and not to_all:
            error, data = self._read(*groups.span(parameters, two=self._two), now_ns)
            return (None if level < 1 else error), data
        if to_all and (request.instruction in groups.READS or (self._two and request.instruction in groups.FAST)):
            mine = groups.span_for(request, self.id, two=self._two, bulk=self._two or self.table.measures_turn)
            return (None, b"") if mine is None else self._read(*mine, now_ns)
        error = self._change(request, now_ns)
        return (None if to_all or level < 2 else error), b""

    def _change(self, request: Request, now_ns: int) -> int:
        """Execute a request other than a reading; return its error."""
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
        if (request.instruction == groups.SYNC_WRITE and len(parameters) > 2 * wide) or (
            request.instruction == groups.BULK_WRITE and self._two
        ):
            mine = groups.write_for(request, self.id, two=self._two)
            return 0 if mine is None else self._write(*mine, now_ns)
        if request.instruction == 6:
            self.memory.reset(7 if self._two else 3)
        elif request.instruction == 8 and self._two:
            self.restart(now_ns)
        elif request.instruction == 0x10 and self._two and parameters == b"\x01\x44\x58\x4c\x22":
            self._count_one_turn(now_ns)
        else:
            return unknown
        return 0

    @property
    def _two(self) -> bool:
        return self.table.protocol == "2.0"

    def _error(self, number: int) -> int:
        return number if self._two else _ERRORS_1.get(number, 64)

    def _read(self, address: int, size: int, now_ns: int) -> tuple[int, bytes]:
        if not size or address + size > len(self.memory.data):
            return self._error(ACCESS), b""
        self._measure(now_ns)
        return 0, bytes(self.memory.data[self._target(place)] for place in range(address, address + size))

    def _target(self, place: int) -> int:
        """Return the address of the target of indirect data; of other data, its own."""
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
        if error := memory.refuses(address, data, locked=was_on or (not self._two and bool(memory[47]))):
            return self._error(error)
        goals = (
            self._two and memory[98] == 255 and any(goal in range(address, address + len(data)) for goal in (104, 116))
        )
        if goals:  # the watchdog has stopped it: goals are rejected until its error is cleared
            return RANGE
        low, high = (0, 0) if self._two else (memory[6], memory[8])
        goal = int.from_bytes(data[:2], "little")
        if not self._two and address == 30 and not (low == high == 0 or low <= goal <= high):
            return 2
        if self._two and address == torque and data[0] and self._latched:
            return 1  # only a restart helps
        memory.data[address : address + len(data)] = data
        if not self._two and address == 30:
            memory[torque] = 1  # a goal turns the torque on
        if not self._two and address == 34:
            self._latched &= ~OVERLOAD
        if not was_on and memory[torque]:  # position mode begins within one turn
            if not self._two or memory[11] == 3:
                self._count_one_turn(now_ns)
            if self._two:  # the goal is then the present position
                self._measure(now_ns)
                memory[116] = memory[132]
        self._act(now_ns)
        return 0

    def _measure(self, now_ns: int) -> None:
        """Update the present values."""
        update_present(self.table, self.memory, self._turns, self.axis.motion(now_ns), now_ns)
        self.memory[self.table.voltage.address] = round(self._supply * self._rated_v * 10)
        self.memory[self.table.temperature.address] = self._hot_degC

    def actuation(self) -> Actuation:
        """As `ServoMachine.actuation`."""
        return requested_actuation(self.table, self.memory, self._turns)

    def _conditions(self) -> int:
        """Return the fault bits of each reply."""
        if self._two:
            return 0x80 if self.memory[70] else 0
        return self._latched | self._state_bits()

    def _trip(self, bits: int, now_ns: int) -> None:
        """Report a fault, and turn the torque off if the servo is set to shut down for it."""
        memory, table = self.memory, self.table
        self._latched |= bits & OVERLOAD if not self._two else bits & memory[63]
        if self._two:
            memory[70] = memory[70] | bits
        if bits & memory[63 if self._two else 18] and memory[table.torque.address]:
            memory[table.torque.address] = 0
            if not self._two:
                memory[34] = 0
            self._act(now_ns)


def requested_actuation(table: ControlTable, memory: Memory, turns: int) -> Actuation:
    """Return the actuation that the registers request; `turns`: of the axis when the servo began to count."""
    if not memory[table.torque.address]:
        return Actuation()
    speed, goal = memory[table.wheel_speed.address], memory[table.goal.address]
    goal_rad = (goal - table.centre) * table.goal.unit + 2 * math.pi * turns
    if table.protocol != "2.0":
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


def update_present(table: ControlTable, memory: Memory, turns: int, motion: Motion, now_ns: int) -> None:
    """Update the registers of position, velocity, load and time; `turns` as in `requested_actuation`."""
    rate = round(motion.rate_rad_s / table.velocity.unit)
    milliseconds = now_ns // 1_000_000 % 32768
    memory[table.position.address] = count_of(table, memory, turns, motion.angle_rad)
    if table.protocol == "2.0":
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


def count_of(table: ControlTable, memory: Memory, turns: int, angle_rad: float) -> int:
    """Return the count of the encoder or potentiometer at an angle of the horn; `turns` as above."""
    count = round(angle_rad / table.position.unit) + table.centre
    if table.protocol == "2.0":
        return count - 4096 * turns + memory[20]
    if table.measures_turn:
        return count % (table.last + 1)
    within_rad = math.remainder(angle_rad, 2 * math.pi)
    return max(0, min(table.last, round(within_rad / table.position.unit) + table.centre))


def _bit10(count: int) -> int:
    """Encode a magnitude of ten bits and its sign above them."""
    return min(abs(count), 1023) | (1024 if count < 0 else 0)
