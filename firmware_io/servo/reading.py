"""State of a servo from a reading of its registers."""

from __future__ import annotations

import math

from scanwright.firmware_io.servo.bus.bus import ServoAnswer
from scanwright.firmware_io.servo.bus.registers import ControlTable
from scanwright.firmware_io.servo.progress import ServoState, TurnOrder


def state_of(
    table: ControlTable, answer: ServoAnswer, *, spins: bool, known: ServoState | None, order: TurnOrder | None
) -> ServoState:
    """Decode a reading of the present values.

    Args:
        table: of the servo.
        answer: reply to the reading.
        spins: whether it is in wheel mode.
        known: last state with a position, from which turns are counted.
        order: commanded motion.
    """
    data = answer.data
    count = round(table.pick(table.position, data) / table.position.unit)
    angle_rad = (count - table.centre) * table.position.unit
    velocity_rad_s = table.pick(table.velocity, data)
    if not table.speed_loop and spins:
        velocity_rad_s = math.nan  # the register contains the torque
    if not table.measures_turn and not 0 < count < table.last:
        angle_rad = math.nan  # at an end of the potentiometer, or in its dead sector
    elif known:
        angle_rad = nearest_turn(angle_rad, known.position_rad + _due_rad(known, velocity_rad_s, answer, order))
    else:
        angle_rad = nearest_turn(angle_rad, 0.0)  # servos of protocol 2.0 count turns
    return ServoState(
        time_ns=answer.sampled_ns,
        time_bound_ns=answer.bound_ns,
        position_rad=angle_rad,
        velocity_rad_s=velocity_rad_s,
        load=table.pick(table.load, data),
        voltage_V=table.pick(table.voltage, data),
        temperature_degC=table.pick(table.temperature, data),
    )


def nearest_turn(angle_rad: float, expected_rad: float) -> float:
    """Add full turns to an angle so that it is nearest to the expected one."""
    return angle_rad + 2 * math.pi * round((expected_rad - angle_rad) / (2 * math.pi))


def _due_rad(known: ServoState, velocity_rad_s: float, answer: ServoAnswer, order: TurnOrder | None) -> float:
    """Return the expected motion since the last known position; 0 without an order."""
    if not order:
        return 0.0
    measured = [rate for rate in (known.velocity_rad_s, velocity_rad_s) if not math.isnan(rate)]
    rate_rad_s = sum(measured) / len(measured) if measured else order.rate_rad_s
    return rate_rad_s * (answer.sampled_ns - known.time_ns) / 1e9
