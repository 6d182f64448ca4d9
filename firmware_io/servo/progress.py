"""Whether a servo does what it was told: its state, the order it has, and the stall that parts them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

_STALL_S = 0.5  # as long as the horn may take to start moving
_STALL_COUNTS = 8  # of the encoder, due at least before a stall can be told from its steps
_STALL_SHARE = 0.1  # of the way due
_ARRIVED_RAD = math.radians(5.0)  # a loop without integral stops short of its goal, by friction and weight


@dataclass(frozen=True, slots=True)
class ServoState:
    """What the servo was doing at one moment.

    Attributes:
        time_ns: `time.monotonic_ns()` of the sampling.
        time_bound_ns: it was sampled within this of `time_ns`.
        position_rad: turns are counted; counter-clockwise as one looks at the horn, 0 at the encoder's centre.
            NaN in the AX-12A's dead sector.
        velocity_rad_s: NaN in the AX-12A's wheel mode, where it measures none.
        load: fraction of the rated torque, positive counter-clockwise.
        voltage_V: of the supply.
        temperature_degC: inside.
    """

    time_ns: int
    time_bound_ns: int
    position_rad: float
    velocity_rad_s: float
    load: float
    voltage_V: float  # noqa: N815 - volts
    temperature_degC: float  # noqa: N815


@dataclass(frozen=True, slots=True)
class TurnOrder:
    """What the servo was told to do, and where it was when it last got on with it."""

    rate_rad_s: float  # how fast, negative clockwise
    goal_rad: float  # where to; infinite for turning without end
    since_ns: int = 0  # when it last got on with it; 0 before it was seen to
    from_rad: float = math.nan  # where it was then


@dataclass(frozen=True, slots=True)
class Stall:
    """How far it came, and how far it should have; NaN if it stayed in a dead sector."""

    moved_rad: float
    due_rad: float

    def __str__(self) -> str:
        stuck = math.isnan(self.moved_rad)
        moved = "stuck in the dead sector" if stuck else f"moved {math.degrees(self.moved_rad):.1f} deg"
        return f"stall: {moved} instead of {math.degrees(self.due_rad):.1f}"


def follow(order: TurnOrder, state: ServoState, step_rad: float) -> TurnOrder | Stall | None:
    """Return the order with the progress made; None when the goal is reached."""
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
