"""State of a servo, its commanded motion, and detection of a stall."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

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
