"""Conversion between the registers of a Dynamixel and the motion of its horn."""

from __future__ import annotations

import math

from scanwright.firmware_io.emulators.dynamics import Motion
from scanwright.firmware_io.emulators.servo.memory import Memory
from scanwright.firmware_io.emulators.servo_plant import Actuation
from scanwright.firmware_io.servo.bus.registers import ControlTable


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
