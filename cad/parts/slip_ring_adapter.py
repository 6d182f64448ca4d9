"""Slip-ring adapter: keeps the ring's stator from turning, from the servo's front holes.

Frame: rotation frame at gamma = 0 (`cad/layout/direct_stack.py`), mm. The rotor of the ring is clamped to the shaft
and carries the ring; two arms, compliant towards the axis and stiff around it, hold the stator with a cable tie in
their groove. A stiff bracket would load the ring's bearings. The fork is open at +y: it slides round the horn flange
from -y after the shaft is on, then the ring comes down over the spigot between the arms.

Under the cage of a bearing (`bearing_cage.py`) it is a thick closed plate with a boss that centres the cage, held by
every pair of ears beside the flange; it comes down over the shaft. Without a ring it has no arms and is `cage_base`.
"""

from __future__ import annotations

from dataclasses import dataclass

import cadquery as cq

from cad import solids
from cad.layout.direct_stack import Stack
from cad.parts.bearing_cage import FOOT_RADIUS, SEAT_GAP, UNDER_HEAD, BearingCage, cage_base, cage_of, plate_half_x
from cad.screws import SCREWS, Screw
from cad.solids import building, checked
from design.errors import BuildError
from design.scanner import Scanner

PART = "slip_ring_adapter"
PLATE = 6.0
PLAY = 0.25  # between arm and stator, on the radius
ARM = 5.0
ARM_HALF_WIDTH = 10.0
UNDER_ROOF = 12.0  # how far the arms end below the ring's top, under a cage


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipRingAdapter:
    """Lengths in mm; the servo's x and y are those of the rotation frame."""

    stack: Stack
    front: float  # z of the case's front
    ears: float  # z of the planes around the front holes
    opening: float  # half width of the fork
    half_x: float
    screw: Screw
    hole: float  # diameter
    holes: tuple[tuple[float, float], ...]
    cage: BearingCage | None


def adapter_of(scanner: Scanner, stack: Stack) -> SlipRingAdapter:
    """Parameters of the adapter of one scanner.

    Raises:
        BuildError: the case has no four holes beside the turning flange.
    """
    servo = scanner.servo
    screw = SCREWS[servo.case_screw]
    hole = screw.nominal + scanner.printer.screw_clearance_mm
    opening = stack.flange_radius + 1.5
    behind = sorted({y for _, y in servo.case_holes_mm if y < -opening + 2.0 - FOOT_RADIUS}, reverse=True)
    rows = [sorted(h for h in servo.case_holes_mm if h[1] == y) for y in behind]
    widest = max((row[-1][0] for row in rows), default=0.0)
    rows = [row for row in rows if len(row) == 2 and row[-1][0] == widest]
    if len(rows) < 2:
        raise BuildError(
            f"{PART}: fork: case_holes_mm = {list(servo.case_holes_mm)}: {servo.name} needs two pairs of front holes "
            f"at y < {-opening + 2.0 - FOOT_RADIUS:g}, behind the turning flange"
        )
    return SlipRingAdapter(
        stack=stack,
        front=stack.horn + servo.case_max_mm[2],
        ears=stack.horn + servo.case_holes_z_mm,
        opening=opening,
        half_x=plate_half_x(servo, screw),
        screw=screw,
        hole=hole,
        holes=(*rows[0], *rows[-1]),
        cage=cage_of(scanner, stack),
    )


def slip_ring_adapter(p: SlipRingAdapter) -> cq.Solid:
    """Make the adapter.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    stack = p.stack
    inner = stack.ring_radius + PLAY
    outer = inner + ARM
    if p.cage is None:
        body, top, reach = _fork(p, outer), p.front + SEAT_GAP + PLATE, stack.ring_length - 5.0
    else:
        body, top, reach = cage_base(p.cage), p.cage.foot, stack.ring_length - UNDER_ROOF
    arm_top = stack.ring_bottom + min(30.0, reach)
    with building(PART, "arms", "outer_diameter_mm", 2 * stack.ring_radius):
        root = min(inner - 4.0, outer - 4.0)
        arms = [
            solids.box(
                (min(side * root, side * outer), -ARM_HALF_WIDTH, top - 1.0),
                (max(side * root, side * outer), ARM_HALF_WIDTH, arm_top),
            )
            for side in (1, -1)
        ]
        body = body.fuse(*arms).cut(solids.upright(inner, stack.ring_bottom - 1.0, arm_top + 9.0))
        body = checked(body, PART, "arms", "outer_diameter_mm", 2 * stack.ring_radius)
    with building(PART, "tie groove", "outer_diameter_mm", 2 * stack.ring_radius):
        tie = (stack.ring_bottom + arm_top) / 2
        cuts = []
        for side in (1, -1):
            edges = sorted((side * (outer - 1.5), side * (outer + 5.0)))
            cuts.append(solids.box((edges[0], -99.0, tie - 3.0), (edges[1], 99.0, tie + 3.0)))
        return checked(body.cut(*cuts).clean(), PART, "tie groove", "outer_diameter_mm", 2 * stack.ring_radius)


def _fork(p: SlipRingAdapter, outer: float) -> cq.Shape:
    """The plate on the servo, open at +y."""
    low = p.front + SEAT_GAP
    top = low + PLATE
    ys = [y for _, y in p.holes]
    first, last = max(ys) + FOOT_RADIUS + 1.5, min(ys) - FOOT_RADIUS - 1.5
    slot_end = -p.opening - 0.5
    with building(PART, "fork", "case_holes_mm", p.holes):
        tail = solids.box((-p.half_x, last, low), (p.half_x, first, top))
        prongs = solids.box((-outer, min(first, slot_end - 12.0), low), (outer, ARM_HALF_WIDTH, top))
        feet = [solids.upright(FOOT_RADIUS, p.ears, low + 1.0, x, y) for x, y in p.holes]
        cuts = [solids.box((-p.opening, slot_end, low - 9), (p.opening, 99.0, top + 9))]
        for x, y in p.holes:
            cuts.append(solids.upright(p.hole / 2, p.ears - 1.0, top + 1.0, x, y))
            cuts.append(solids.upright(p.screw.head_room, low + UNDER_HEAD, top + 1.0, x, y))
        return checked(tail.fuse(prongs, *feet).cut(*cuts), PART, "fork", "case_holes_mm", p.holes)
