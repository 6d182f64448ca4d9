"""Slip-ring adapter: keeps the ring's stator from turning, from the servo's front holes.

Frame: rotation frame at gamma = 0 (`cad/layout/direct/stack.py`), mm. The rotor of the ring is clamped to the shaft
and carries the ring; two arms, compliant towards the axis and stiff around it, hold the stator with a cable tie in
their groove. A stiff bracket would load the ring's bearings. The fork is open at +y: it slides round the horn flange
from -y after the shaft is on, then the ring comes down over the spigot between the arms.

Under the cage of a bearing (`bearing_cage.py`) it is a thick closed plate with a boss that centres the cage, held by
every pair of ears beside the flange; it comes down over the shaft. Without a ring it has no arms and is `cage_base`.
"""

from __future__ import annotations

from functools import partial

import cadquery as cq

from scanwright.cad import solids
from scanwright.cad.layout.direct.adapter import ARM, ARM_HALF_WIDTH, PLATE, PLAY, SlipRingAdapter, adapter_of, arm_top
from scanwright.cad.layout.direct.cage import FOOT_RADIUS, SEAT_GAP, UNDER_HEAD, BearingCage, cage_of
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.joints import screws
from scanwright.cad.layout.names import SERVO_CASE, SLIP_RING_ADAPTER
from scanwright.cad.parts.bearing_cage import cage_base
from scanwright.cad.parts.part_spec import ON_CASE, PartSpec, Step
from scanwright.cad.solids import building
from scanwright.design.scanner import Scanner

RING = ("slip_ring.outer_diameter_mm", "slip_ring.length_mm")


def adapter_spec(scanner: Scanner, stack: DirectStack) -> PartSpec | None:
    """The adapter of one scanner; None without a ring."""
    if scanner.slip_ring is None:
        return None
    how = (
        "Slide the fork round the flange of the shaft." if stack.bearing is None else "Lower the plate over the shaft."
    )
    return PartSpec(
        name=SLIP_RING_ADAPTER,
        turns=False,
        make=partial(slip_ring_adapter, cage_of(scanner, stack) or adapter_of(scanner, stack)),
        step=Step(
            "Adapter on the servo", f"{how} {screws(SERVO_CASE)}", "the shaft turns a whole turn without touching"
        ),
        shaped_by=(*ON_CASE, *RING),
    )


def slip_ring_adapter(p: SlipRingAdapter | BearingCage) -> cq.Solid:
    """Make the adapter: the fork, or the base of a cage, and the arms.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    stack = p.stack
    inner = stack.ring_radius + PLAY
    outer = inner + ARM
    if isinstance(p, SlipRingAdapter):
        body, top = _fork(p, outer), p.front + SEAT_GAP + PLATE
    else:
        body, top = cage_base(p), p.foot
    high_end = arm_top(stack, p)
    with building(SLIP_RING_ADAPTER, "arms", "outer_diameter_mm", 2 * stack.ring_radius) as checked:
        arms = [
            solids.box((low, -ARM_HALF_WIDTH, top - 1.0), (high, ARM_HALF_WIDTH, high_end))
            for low, high in ((inner - 4.0, outer), (-outer, 4.0 - inner))
        ]
        body = body.fuse(*arms).cut(solids.upright(inner, stack.ring_bottom - 1.0, high_end + 9.0))
        body = checked(body)
    with building(SLIP_RING_ADAPTER, "tie groove", "outer_diameter_mm", 2 * stack.ring_radius) as checked:
        tie = (stack.ring_bottom + high_end) / 2
        cuts = [
            solids.box((low, -99.0, tie - 3.0), (high, 99.0, tie + 3.0))
            for low, high in ((outer - 1.5, outer + 5.0), (-outer - 5.0, 1.5 - outer))
        ]
        return checked(body.cut(*cuts).clean())


def _fork(p: SlipRingAdapter, outer: float) -> cq.Shape:
    """The plate on the servo, open at +y."""
    low = p.front + SEAT_GAP
    top = low + PLATE
    ys = [y for _, y in p.holes]
    first, last = max(ys) + FOOT_RADIUS + 1.5, min(ys) - FOOT_RADIUS - 1.5
    slot_end = -p.opening - 0.5
    with building(SLIP_RING_ADAPTER, "fork", "holes", p.holes) as checked:
        tail = solids.box((-p.half_x, last, low), (p.half_x, first, top))
        prongs = solids.box((-outer, min(first, slot_end - 12.0), low), (outer, ARM_HALF_WIDTH, top))
        feet = [solids.upright(FOOT_RADIUS, p.ears, low + 1.0, x, y) for x, y in p.holes]
        cuts = [solids.box((-p.opening, slot_end, low - 9), (p.opening, 99.0, top + 9))]
        for x, y in p.holes:
            cuts.append(solids.upright(p.hole / 2, p.ears - 1.0, top + 1.0, x, y))
            cuts.append(solids.upright(p.screw.head_room, low + UNDER_HEAD, top + 1.0, x, y))
        return checked(tail.fuse(prongs, *feet).cut(*cuts))
