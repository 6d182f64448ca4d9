"""State of a servo, its commanded motion, and detection of a stall."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from scanwright.firmware_io.servo.bus.bus import ServoAnswer
from scanwright.firmware_io.servo.bus.registers import ControlTable

_STALL_S = 0.5  # longest start of a motion
_STALL_COUNTS = 8  # expected motion above which a stall differs from the resolution of the encoder
_STALL_SHARE = 0.1  # of the expected motion
_ARRIVED_RAD = math.radians(5.0)  # a loop without integral part stops before its goal, due to friction and weight


@dataclass(frozen=True, slots=True)
class ServoState:
    """State of the servo at one time.

    Attributes:
        position_rad: with counted turns; counter-clockwise seen towards the horn, 0 at the encoder's centre. NaN in the
            AX-12A's dead sector.
        velocity_rad_s: NaN in the AX-12A's wheel mode, which measures none.
        load: fraction of the rated torque, positive counter-clockwise.
    """

    time_ns: int  # `time.monotonic_ns()` of the sampling
    time_bound_ns: int  # largest error of `time_ns`
    position_rad: float
    velocity_rad_s: float
    load: float
    voltage_V: float  # noqa: N815 - volts of the supply
    temperature_degC: float  # noqa: N815


@dataclass(frozen=True, slots=True)
class TurnOrder:
    """Commanded motion, with time and position of its last progress."""

    rate_rad_s: float  # negative clockwise
    goal_rad: float  # infinite for continuous rotation
    since_ns: int = 0  # time of the last progress; 0 without
    from_rad: float = math.nan  # position at that time


@dataclass(frozen=True, slots=True)
class Stall:
    """A commanded motion without progress."""

    moved_rad: float  # NaN in a dead sector
    due_rad: float  # expected motion

    def __str__(self) -> str:
        stuck = math.isnan(self.moved_rad)
        moved = "stuck in the dead sector" if stuck else f"moved {math.degrees(self.moved_rad):.1f} deg"
        return f"stall: {moved} instead of {math.degrees(self.due_rad):.1f}"


def follow(order: TurnOrder, state: ServoState, step_rad: float) -> TurnOrder | Stall | None:
    """Return the order with its progress; None if the goal is reached."""
    here_rad, latest_ns = state.position_rad, state.time_ns + state.time_bound_ns
    if abs(order.goal_rad - here_rad) < _ARRIVED_RAD:
        return None
    if not order.since_ns or math.isnan(order.from_rad) > math.isnan(here_rad):
        return replace(order, since_ns=latest_ns, from_rad=here_rad)
    elapsed_s = (state.time_ns - state.time_bound_ns - order.since_ns) / 1e9  # at least
    due_rad, moved_rad = abs(order.rate_rad_s) * elapsed_s, abs(here_rad - order.from_rad)
    enough_rad = math.pi if math.isnan(here_rad) else _STALL_COUNTS * step_rad
    if elapsed_s < _STALL_S or due_rad < enough_rad:
        return order
    if not moved_rad >= _STALL_SHARE * due_rad:
        return Stall(moved_rad, due_rad)
    return replace(order, since_ns=latest_ns, from_rad=here_rad)


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
