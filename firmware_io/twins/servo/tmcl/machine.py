"""A PD42-3-1140 without its bus: commands, parameters, steps and protection, at whatever time it is told.

Not published, or not at hand, and therefore assumed: factory values and bounds, how long a restart takes, that a
wrong sum is answered with status 1, that the encoder is in its middle where the horn is at 0, that the rotor finds
its step without a jump when its current comes, and that 128 in parameter 6 is the rated current. The current at rest
(7) is not told from that in motion. No switch is there to be searched: command 13 is not available.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.products import Servo
from scanwright.firmware_io.servo.bus.registers import ControlTable
from scanwright.firmware_io.twins.dynamics import HornMotion
from scanwright.firmware_io.twins.servo.machine import Request
from scanwright.firmware_io.twins.servo.tmcl.datagrams import STRING, reply, take
from scanwright.firmware_io.twins.servo.tmcl.parameters import (
    AXIS_READINGS,
    AXIS_SETTINGS,
    BAUDS,
    GLOBAL,
    GLOBAL_SETTINGS,
    KEPT_VARIABLES,
    RUNNING,
    USER,
    USER_VARIABLES,
    from_the_factory,
)
from scanwright.firmware_io.twins.servo.tmcl.steps import COUNTS, Steps, encoder_count
from scanwright.firmware_io.twins.servo_plant import Actuation, Load, plant_of

_DONE, _UNKNOWN, _TYPE, _VALUE, _ABSENT = 100, 2, 3, 4, 6
_BOOT_S, _LEAST_V = 0.5, 9.0
_FULL_STEPS, _CLOCK_HZ, _RATED_CURRENT = 200, 16e6, 128
_BY_LOAD, _BY_ENCODER, _HOT = 1, 2, 2
_WELL_DEGC, _HOT_DEGC = 30, 125
_VERSION = (1140 << 16) | (1 << 8) | 42

Answer = tuple[int, int]  # status and value


class TmclMachine:
    """One module with power; methods as `ServoMachine` has them.

    Attributes:
        table: what the driver knows of the model.
        memory: parameters by their addresses; those of what it does now are not kept here.
        axis: the true motion of the horn.
        forgets_ns: as in the maker's open firmware.
    """

    forgets_ns = 5_000_000

    def __init__(self, table: ControlTable, load: Load, time_ns: int, angle_rad: float) -> None:
        self.table = table
        self.memory, self._kept = from_the_factory(), from_the_factory()
        self.axis = HornMotion(plant_of(table.model), load, time_ns, angle_rad=angle_rad)
        self._supply_v = load_catalogue().get(table.model, Servo).rated_v
        self._degC, self._alarm, self._holds = _WELL_DEGC, 0, False
        self._steps = Steps(time_ns, 0.0, 0.0, 0.0, self._unit_rad, angle_rad)
        self._encoder_zero = float(encoder_count(angle_rad))
        self._mute_until_ns = time_ns
        self._act(time_ns)

    @property
    def id(self) -> int:
        """Its number on the bus."""
        return self.memory[GLOBAL + 66]

    @property
    def baud(self) -> float:
        """Bits per second that it understands."""
        return BAUDS[self.memory[GLOBAL + 65]]

    @property
    def return_delay_ns(self) -> int:
        """Between a request's end and the answer's begin."""
        return self.memory[GLOBAL + 75] * 1_000_000

    def take(self, buffer: bytearray) -> Request | None:
        """Take the next request off a buffer."""
        return take(buffer)

    def listens(self, now_ns: int) -> bool:
        """Whether it is up after a restart, and has enough voltage to be."""
        return now_ns >= self._mute_until_ns and self._supply_v >= _LEAST_V

    def in_turn(self, request: Request) -> tuple[int, ...] | None:
        """Only one is asked at a time."""
        del request
        return None

    def statuses(self, request: Request, said: Sequence[tuple[int, int, bytes]]) -> list[bytes]:
        """The bytes of what modules say; the value's highest byte first."""
        host = self.memory[GLOBAL + 76]
        return [reply(host, module, status, request.instruction, value) for module, status, value in said]

    def answer(self, request: Request, now_ns: int) -> tuple[int, bytes] | None:
        """Carry out a request; status and value of the answer, None where there is none."""
        if request.id != self.id:
            return None
        kind, bank, asked = request.parameters[0], request.parameters[1], request.parameters[2:]
        value = int.from_bytes(asked, "big", signed=True)
        if not request.intact:
            return 1, asked
        if request.instruction == 136 and kind == 0:
            return STRING, b"1140V142"
        if request.instruction == 137 and value == 1234:
            self.memory.update(from_the_factory())
            self._kept.update(from_the_factory())
            return None
        status, told = self._carry_out(request.instruction, kind, bank, value, now_ns)
        return status, told.to_bytes(4, "big", signed=told < 0)

    def overheat(self) -> None:
        """The power stages are too hot, and off."""
        self._degC = _HOT_DEGC

    def overload(self, now_ns: int) -> None:
        """It has seen by the load that the motor stalls, and stops (stallGuard)."""
        self._halt(_BY_LOAD, now_ns)

    def set_voltage(self, volts: float, now_ns: int) -> None:
        """The supply gives another voltage; with too little the module is off."""
        was_off, self._supply_v = self._supply_v < _LEAST_V, volts
        if volts < _LEAST_V or was_off:
            self.restart(now_ns)

    def restart(self, now_ns: int) -> None:
        """Back to what was kept; the counts of steps and encoder begin at 0. Deaf and mute until that is done."""
        self.memory.update({at: count for at, count in self._kept.items() if not GLOBAL <= at < USER})
        self._degC, self._alarm, self._holds = _WELL_DEGC, 0, False
        angle_rad = self.axis.motion(now_ns).angle_rad
        self._steps = Steps(now_ns, 0.0, 0.0, 0.0, self._unit_rad, angle_rad)
        self._encoder_zero = float(encoder_count(angle_rad))
        self._mute_until_ns = now_ns + round(_BOOT_S * 1e9)
        self._act(now_ns)

    def protect(self, now_ns: int) -> None:
        """What the module watches by itself: heat, and steps that the horn does not follow."""
        if self._degC >= _HOT_DEGC and self._holds:
            self._act(now_ns)
        most = self.memory[212]
        if most and self._holds and abs(self._steps.position(now_ns) - self._encoder(now_ns)) > most:
            self._halt(_BY_ENCODER, now_ns)

    @property
    def _unit_rad(self) -> float:
        return 2 * math.pi / (_FULL_STEPS << self.memory[140])

    def _rate(self, speed: int) -> float:
        """Microsteps a second of the ramp generator's own unit."""
        return float(speed * _CLOCK_HZ / (2 ** self.memory[154] * 2048 * 32))

    def _encoder(self, now_ns: int) -> float:
        """Microsteps that the encoder has counted (209)."""
        count = encoder_count(self.axis.motion(now_ns).angle_rad)
        return (count - self._encoder_zero) * (self.memory[210] & ~15) / 512

    def _halt(self, alarm: int, now_ns: int) -> None:
        self._alarm |= alarm
        self._turn(0, now_ns)

    def _turn(self, speed: int, now_ns: int) -> None:
        """Without end, to the right where the speed is above 0."""
        self.memory[2] = speed
        here = self._steps.position(now_ns)
        self._steps = self._steps.go(now_ns, math.copysign(math.inf, speed) if speed else here, self._rate(abs(speed)))
        self._act(now_ns)

    def _move(self, goal: int, now_ns: int) -> None:
        self.memory[0] = goal
        self._steps = self._steps.go(now_ns, goal, self._rate(self.memory[4]))
        self._act(now_ns)

    def _carry_out(self, command: int, kind: int, bank: int, value: int, now_ns: int) -> Answer:
        doing: dict[int, Callable[[], Answer]] = {
            1: lambda: self._rotate(value, 1, bank, now_ns),
            2: lambda: self._rotate(value, -1, bank, now_ns),
            3: lambda: self._rotate(0, 1, bank, now_ns),
            4: lambda: self._move_to(kind, bank, value, now_ns),
            5: lambda: self._set_axis(kind, bank, value, now_ns),
            6: lambda: self._get_axis(kind, bank, now_ns),
            7: lambda: self._store(kind, kind in AXIS_SETTINGS and kind not in RUNNING and bank == 0),
            8: lambda: self._set_axis(kind, bank, self._kept.get(kind, 0), now_ns),
            9: lambda: self._set_global(kind, bank, value),
            10: lambda: self._get_global(kind, bank),
            11: lambda: self._store(USER + kind, bank == 2 and kind in KEPT_VARIABLES),
            13: lambda: (_ABSENT, value),
            15: lambda: self._input(kind, bank),
            136: lambda: (_DONE, _VERSION) if kind == 1 else (_TYPE, value),
        }
        carry_out = doing.get(command)
        return carry_out() if carry_out else (_UNKNOWN, value)

    def _rotate(self, speed: int, sense: int, motor: int, now_ns: int) -> Answer:
        if motor or not 0 <= speed <= 2047:
            return _VALUE, speed
        self._turn(sense * speed, now_ns)
        return _DONE, speed

    def _move_to(self, kind: int, motor: int, value: int, now_ns: int) -> Answer:
        if kind > 1:
            return _TYPE, value
        if motor:
            return _VALUE, value
        self._move(value if kind == 0 else value + round(self._steps.position(now_ns)), now_ns)
        return _DONE, value

    def _set_axis(self, number: int, motor: int, value: int, now_ns: int) -> Answer:
        if number not in AXIS_SETTINGS:
            return _TYPE, value
        _, least, most = AXIS_SETTINGS[number]
        if motor or not least <= value <= most:
            return _VALUE, value
        match number:
            case 0:
                self._move(value, now_ns)
            case 1:
                self._steps = self._steps.count(now_ns, value)
            case 2:
                self._turn(value, now_ns)
            case 209:
                self._encoder_zero = encoder_count(self.axis.motion(now_ns).angle_rad) - value * 512 / (
                    self.memory[210] & ~15 or 512
                )
            case _:
                self.memory[number] = value
                if number == 140:
                    angle_rad = self._steps.angle_rad(self._steps.position(now_ns))
                    self._steps = self._steps.take(now_ns, angle_rad, self._unit_rad)
                self._act(now_ns)
        return _DONE, value

    def _get_axis(self, number: int, motor: int, now_ns: int) -> Answer:
        if motor or number not in (*AXIS_SETTINGS, *AXIS_READINGS):
            return _VALUE if motor else _TYPE, 0
        steps, speed = self._steps, self._steps.speed(now_ns)
        if number == 207:  # reading takes it back
            alarm, self._alarm = self._alarm, 0
            return _DONE, alarm
        now: dict[int, float] = {
            1: steps.position(now_ns),
            3: speed / self._rate(1),
            8: float(speed == 0 and steps.position(now_ns) == self.memory[0]),
            208: (_HOT if self._degC >= _HOT_DEGC else 0) | (0 if speed else 0x80),
            209: self._encoder(now_ns),
            215: encoder_count(self.axis.motion(now_ns).angle_rad) % COUNTS,
        }
        return _DONE, round(now.get(number, self.memory.get(number, 0)))

    def _set_global(self, number: int, bank: int, value: int) -> Answer:
        if bank == 2 and number in USER_VARIABLES:
            self.memory[USER + number] = value
        elif bank == 0 and number in GLOBAL_SETTINGS:
            _, least, most = GLOBAL_SETTINGS[number]
            if not least <= value <= most:
                return _VALUE, value
            self.memory[GLOBAL + number] = value  # which outlasts the power without a command to store it
        else:
            return _TYPE, value
        return _DONE, value

    def _get_global(self, number: int, bank: int) -> Answer:
        address = {0: GLOBAL, 2: USER}.get(bank, -USER) + number
        return (_DONE, self.memory[address]) if address in self.memory and bank in (0, 2) else (_TYPE, 0)

    def _store(self, address: int, can_be: bool) -> Answer:
        if not can_be:
            return _TYPE, 0
        self._kept[address] = self.memory[address]
        return _DONE, self.memory[address]

    def _input(self, port: int, bank: int) -> Answer:
        inputs = {(8, 1): round(self._supply_v * 10), (9, 1): self._degC, **{(k, 0): 0 for k in range(4)}, (0, 1): 0}
        return (_DONE, inputs[port, bank]) if (port, bank) in inputs else (_TYPE, 0)

    def _act(self, now_ns: int) -> None:
        """Let the motor do what the parameters say."""
        holds = bool(self.memory[167]) and self._degC < _HOT_DEGC
        if holds and not self._holds:
            angle_rad = self.axis.motion(now_ns).angle_rad
            self._steps = self._steps.take(now_ns, angle_rad, self._unit_rad)
        self._holds, steps, now = holds, self._steps, self.axis.drive_at(now_ns)
        drive = Actuation()
        if holds:
            limit = min(1.0, self.memory[6] / _RATED_CURRENT)
            drive = Actuation(
                "steps", steps.angle_rad(steps.goal), steps.rate * steps.unit_rad or math.inf, torque_limit=limit
            )
        if drive != Actuation(now.mode, now.goal, now.rate_rad_s, torque_limit=now.torque_limit):
            self.axis.change(
                now_ns, mode=drive.mode, goal=drive.goal, rate_rad_s=drive.rate_rad_s, torque_limit=drive.torque_limit
            )
