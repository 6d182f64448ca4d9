"""Numbers of the slip-ring adapter's fork on the servo's ears. No kernel."""

from __future__ import annotations

from dataclasses import dataclass

from scanwright.cad.layout.direct.cage import FOOT_RADIUS, Ears, plate_half_x
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.names import SLIP_RING_ADAPTER
from scanwright.cad.screws import SCREWS, passing_hole
from scanwright.design.catalogue.servo import Servo
from scanwright.design.errors import BuildError
from scanwright.design.scanner import Scanner

PLATE = 6.0
ARM_GAP = 0.25  # between arm and stator, on the radius
ARM = 5.0
ARM_HALF_WIDTH = 10.0
UNDER_ROOF = 12.0  # how far the arms end below the ring's top, under a cage


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipRingAdapter:
    """The arms around the ring, and their fork, unless that is the base of a cage."""

    stack: DirectStack
    fork: Ears | None


def adapter_of(scanner: Scanner, stack: DirectStack) -> SlipRingAdapter | None:
    """Return the adapter of one scanner; None without a ring.

    Raises:
        BuildError: no bearing carries the axis, and the case has no four holes beside the turning flange.
    """
    if scanner.slip_ring is None:
        return None
    if stack.bearing is not None:
        return SlipRingAdapter(stack=stack, fork=None)
    servo = scanner.servo
    screw = SCREWS[servo.front.screw]
    holes = fork_holes(servo, stack)
    if not holes:
        caution = servo.caution("holes")
        raise BuildError(
            f"{SLIP_RING_ADAPTER}: fork: holes = {list(servo.front.places)} in front{caution}: {servo.name} needs two "
            f"pairs of front holes at y < {_behind(stack):g}, behind the turning flange"
        )
    fork = Ears(
        front=servo.case_max_mm[2],
        seats=servo.front.z_mm,
        opening=_opening(stack),
        half_x=plate_half_x(servo, screw),
        screw=screw,
        hole=passing_hole(screw, scanner.printer),
        holes=holes,
    )
    return SlipRingAdapter(stack=stack, fork=fork)


def arm_top(p: SlipRingAdapter) -> float:
    """Return the height of the arms' upper ends."""
    return p.stack.ring_bottom + min(30.0, p.stack.ring_length - (UNDER_ROOF if p.fork is None else 5.0))


def fork_holes(servo: Servo, stack: DirectStack) -> tuple[tuple[float, float], ...]:
    """Return the nearest and the furthest pair of front holes behind the turning flange; none without two pairs."""
    behind = sorted({y for _, y in servo.front.places if y < _behind(stack)}, reverse=True)
    rows = [sorted(hole for hole in servo.front.places if hole[1] == y) for y in behind]
    widest = max((row[-1][0] for row in rows), default=0.0)
    rows = [row for row in rows if len(row) == 2 and row[-1][0] == widest]
    return (*rows[0], *rows[-1]) if len(rows) > 1 else ()


def _opening(stack: DirectStack) -> float:
    return stack.flange_radius + 1.5


def _behind(stack: DirectStack) -> float:
    return 2.0 - FOOT_RADIUS - _opening(stack)
