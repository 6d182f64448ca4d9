"""Emulated Feetech STS3215 without its bus: memory table, instructions, motion and protection at given times.

Assumed, as not published: duration of a restart; no reply to a damaged request; values out of bounds are ignored; an
overload leaves the torque of register 34 and ends when the torque is turned off. A goal turns the torque on, since the
maker's examples move a servo without writing register 40.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from scanwright.firmware_io.emulators.servo.dynamixel_packets import status, take
from scanwright.firmware_io.emulators.servo.machine import BROADCAST, OVERLOAD, Request, ServoMachine
from scanwright.firmware_io.emulators.servo.memory import TableItem, ro, rw
from scanwright.firmware_io.emulators.servo_plant import Actuation, Load
from scanwright.firmware_io.servo.bus.registers import ControlTable

_BAUDS = (1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400)  # memory table of the STS, by count
_PING, _READ, _WRITE, _REG_WRITE, _ACTION, _SYNC_READ, _SYNC_WRITE = 1, 2, 3, 4, 5, 0x82, 0x83
_ID, _BAUD, _DELAY, _LEVEL, _OFFSET, _MODE, _TORQUE, _LOCK, _PRESENT = 5, 6, 7, 8, 31, 33, 40, 55, 56
_GOALS = 42, 46  # position, or speed of a wheel
_TO_CENTRE = 128  # written to the torque: the present position becomes 2048

_ITEMS: tuple[TableItem, ...] = (
    *(
        ro(0, 1, 3),
        ro(1, 1, 10),
        ro(2, 1),
        ro(3, 2, 777),
        rw(_ID, 1, 1, 253),
        rw(_BAUD, 1, 0, 7),
        rw(_DELAY, 1, 250, 254),
    ),
    *(rw(_LEVEL, 1, 1, 1), rw(9, 2, 0, 4094), rw(11, 2, 4095, 4095), rw(13, 1, 70, 100), rw(14, 1, 140, 254)),
    *(rw(15, 1, 40, 254), rw(16, 2, 1000, 1000), rw(18, 1, 12, 254), rw(19, 1, 44, 254), rw(20, 1, 47, 254)),
    *(rw(21, 1, 32, 254), rw(22, 1, 32, 254), rw(23, 1, 0, 254), rw(24, 1, 16, 254), rw(25, 1, 0, 254)),
    *(rw(26, 1, 1, 16), rw(27, 1, 1, 16), rw(28, 2, 500, 2047), rw(30, 1, 1, 128, 1), rw(_OFFSET, 2, 0, 4095)),
    *(rw(_MODE, 1, 0, 3), rw(34, 1, 20, 254), rw(35, 1, 200, 254), rw(36, 1, 80, 254), rw(37, 1, 10, 254)),
    *(rw(38, 1, 200, 254), rw(39, 1, 10, 254), rw(_TORQUE, 1, 0, 128), rw(41, 1, 0, 254), rw(42, 2, 2048)),
    *(rw(44, 2, 0), rw(46, 2, 0), rw(48, 2, 1000, 1000), rw(_LOCK, 1, 1, 1), ro(_PRESENT, 2), ro(58, 2), ro(60, 2)),
    *(ro(62, 1), ro(63, 1), ro(64, 1), ro(65, 1), ro(66, 1), ro(67, 2), ro(69, 2)),
)


class FeetechMachine(ServoMachine):
    """An STS3215."""

    def __init__(self, table: ControlTable, load: Load, time_ns: int, angle_rad: float) -> None:
        super().__init__(table, _ITEMS, load, time_ns, angle_rad)
        self._unsaved: dict[int, int] = {}  # address -> byte before a locked write, restored at power-up

    @property
    def baud(self) -> float:
        """Baud rate."""
        return _BAUDS[self.memory[_BAUD]]

    @property
    def limits(self) -> tuple[int, int, int]:
        """As `ServoMachine.limits`."""
        return 15, 14, 13

    def take(self, buffer: bytearray) -> Request | None:
        """As `ServoMachine.take`."""
        return take(buffer, "1.0")  # frame and sum are those of the Dynamixel

    def in_turn(self, request: Request) -> tuple[int, ...] | None:
        """As `ServoMachine.in_turn`."""
        return tuple(request.parameters[2:]) if request.instruction == _SYNC_READ else None

    def statuses(self, request: Request, answers: Sequence[tuple[int, int, bytes]]) -> list[bytes]:
        """As `ServoMachine.statuses`."""
        del request
        return [status("1.0", *answer) for answer in answers]

    def answer(self, request: Request, now_ns: int) -> tuple[int, bytes] | None:
        """Execute a request; return status byte and data of the reply, None without a reply."""
        if request.id not in (self.id, BROADCAST) or not request.intact:
            return None
        parameters, to_all = request.parameters, request.id == BROADCAST
        if request.instruction == _PING:
            return self._status(), b""
        if request.instruction == _READ and len(parameters) == 2 and not to_all:
            return self._status(), self._read(parameters[0], parameters[1], now_ns)
        if request.instruction == _SYNC_READ and to_all:
            mine = self.id in parameters[2:]
            return (self._status(), self._read(parameters[0], parameters[1], now_ns)) if mine else None
        answers_all = bool(self.memory[_LEVEL])
        self._change(request, now_ns)
        return None if to_all or not answers_all else (self._status(), b"")

    def overload(self, now_ns: int) -> None:
        """Trip the overload protection."""
        self._latched |= OVERLOAD
        self._act(now_ns)

    def restart(self, now_ns: int) -> None:
        """Restore the permanent values, and those at power-up."""
        super().restart(now_ns)
        for address, byte in self._unsaved.items():
            self.memory.data[address] = byte
        self._unsaved.clear()
        self.memory[48] = self.memory[16]
        self._act(now_ns)

    def protect(self, now_ns: int) -> None:
        """Check voltage, temperature and load."""
        bits = self._state_bits()
        if bits & self.memory[19] and self.memory[_TORQUE]:
            self.memory[_TORQUE] = 0
            self._act(now_ns)
        if self._strained(now_ns, self.memory[36] / 100, self.memory[35] / 100) and not self._latched & OVERLOAD:
            self.overload(now_ns)

    def _status(self) -> int:
        return self._latched | self._state_bits()

    def _read(self, address: int, size: int, now_ns: int) -> bytes:
        motion, memory, table = self.axis.motion(now_ns), self.memory, self.table
        memory[_PRESENT] = (round(motion.angle_rad / table.position.unit) + table.centre - self._offset()) % 4096
        memory[58] = _sized(round(motion.rate_rad_s / table.velocity.unit), 15)
        memory[60] = _sized(round(motion.duty * -1000), 10)
        memory[62], memory[63] = round(self._supply * self._rated_v * 10), self._hot_degC
        memory[65], memory[66] = self._status(), int(abs(motion.rate_rad_s) > 0.01)
        return bytes(memory.data[address : address + size]).ljust(size, b"\0")

    def _offset(self) -> int:
        return _signed(self.memory[_OFFSET], 11)

    def _change(self, request: Request, now_ns: int) -> None:
        parameters = request.parameters
        if request.instruction == _WRITE and len(parameters) > 1:
            self._write(parameters[0], parameters[1:], now_ns)
        elif request.instruction == _REG_WRITE and len(parameters) > 1:
            self._registered = parameters[0], parameters[1:]
        elif request.instruction == _ACTION and self._registered:
            (address, data), self._registered = self._registered, None
            self._write(address, data, now_ns)
        elif request.instruction == _SYNC_WRITE and len(parameters) > 2:
            address, size, rest = parameters[0], parameters[1], parameters[2:]
            for start in range(0, len(rest) - size, size + 1):
                if rest[start] == self.id:
                    self._write(address, rest[start + 1 : start + 1 + size], now_ns)

    def _write(self, address: int, data: bytes, now_ns: int) -> None:
        memory = self.memory
        if memory.refuses(address, data, locked=False):
            return
        was_on, mode = memory[_TORQUE], memory[_MODE]
        for place in range(address, min(address + len(data), self.table.ram)):
            self._unsaved.setdefault(place, memory.data[place])
        memory.data[address : address + len(data)] = data
        if not memory[_LOCK]:
            self._unsaved.clear()
        last = address + len(data) - 1
        if not was_on and not address <= _TORQUE <= last and address <= _GOALS[memory[_MODE] == 1] <= last:
            memory[_TORQUE] = 1
        if memory[_TORQUE] == _TO_CENTRE:
            memory[_OFFSET] = _sized(round(self.axis.motion(now_ns).angle_rad / self.table.position.unit), 11)
            memory[_TORQUE] = was_on
        if not memory[_TORQUE]:
            self._latched &= ~OVERLOAD
        if (memory[_TORQUE] and not was_on) or mode != memory[_MODE]:
            self._count_one_turn(now_ns)
        self._act(now_ns)

    def actuation(self) -> Actuation:
        """As `ServoMachine.actuation`."""
        memory, table = self.memory, self.table
        if not memory[_TORQUE]:
            return Actuation()
        limit = memory[48] / 1000
        if self._latched & OVERLOAD:
            limit = min(limit, memory[34] / 100)
        if memory[_MODE] == 1:
            rate_rad_s = _signed(memory[46], 15) * table.wheel_speed.unit
            return Actuation("velocity", rate_rad_s, torque_limit=limit)
        if memory[_MODE] == 0:
            count = _signed(memory[42], 15) + self._offset() - table.centre
            goal_rad = count * table.goal.unit + 2 * math.pi * self._turns
            return Actuation("position", goal_rad, memory[46] * table.joint_speed.unit or math.inf, torque_limit=limit)
        return Actuation()


def _signed(count: int, bit: int) -> int:
    """Decode a magnitude with a sign bit."""
    size = count & (1 << bit) - 1
    return -size if count >> bit & 1 else size


def _sized(number: int, bit: int) -> int:
    """Encode a number as magnitude and sign bit; the inverse of `_signed`."""
    return min(abs(number), (1 << bit) - 1) | (1 << bit if number < 0 else 0)
