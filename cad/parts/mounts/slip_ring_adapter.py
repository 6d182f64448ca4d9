"""Slip-ring adapter: keeps the ring's stator from turning, from the servo's front holes.

Frame: rotation frame at gamma = 0 (`cad/layout/direct/stack.py`), mm. The rotor of the ring is clamped to the shaft and
carries the ring; two arms, compliant towards the axis and stiff around it, hold the stator with a cable tie in their
groove. A stiff bracket would load the ring's bearings. The fork is open at +y: it slides around the horn flange from -y
after the shaft is on, then the ring is lowered over the spigot between the arms.

Under the cage of a bearing (`bearing_cage.py`) it is a thick closed plate with a boss that centres the cage, held by
every pair of ears outside the flange; it is lowered over the shaft. Without a ring it has no arms and is `cage_base`.
"""

from collections.abc import Iterator
from functools import partial

import cadquery as cq

from scanwright.cad import outlines, solids
from scanwright.cad.layout.cables.obstacles import Shape, shape_of
from scanwright.cad.layout.direct.cage import FOOT_RADIUS, SEAT_GAP, UNDER_HEAD, BearingCage
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.drive import Ears
from scanwright.cad.layout.envelope import box_corners
from scanwright.cad.layout.joints import screws
from scanwright.cad.layout.names import RING, SLIP_RING_ADAPTER
from scanwright.cad.layout.placement import Placement
from scanwright.cad.parts.mounts.bearing_cage import around_base, cage_base, on_ears
from scanwright.cad.parts.part_spec import CRIMPS, ON_CASE, PartSpec, Row, Step
from scanwright.cad.solids import building
from scanwright.design.catalogue.servo import Servo

RING_STEP = Step(
    "Slip ring",
    "Pass the plugs of the stator's leads down on the side of the index groove, and lower the slip ring over the "
    "shaft, its collar upwards. Clamp its collar to the shaft with the set screws that are in it. Turn the stator "
    "until its leads hang straight, and hold it by a cable tie in the grooves of the adapter, its head on an arm: it "
    "can move a little, but must not turn.",
    "turned by hand, the shaft turns the rotor, not the stator; no lead is pulled",
)
OF_RING = ("slip_ring.outer_diameter_mm", "slip_ring.length_mm", "slip_ring.lead_diameter_mm", "slip_ring.plug_mm")
ARM_GAP = 0.25  # between arm and stator, on the radius
ARM = 5.0
ARM_HALF_WIDTH = 10.0
ARM_CORNERS = (0.0, outlines.NOTCH, outlines.NOTCH, 0.0)  # radii of the one at +x
TONGUE_HALF_WIDTH, TONGUE_GROOVE = 3.5, 2.5  # of an arm under a cage, from the tie on, and depth of its groove
UNDER_ROOF = 12.0  # from the arms' ends to the ring's top, under a cage
PLATE = 6.0


def adapter_spec(place: Placement) -> PartSpec | None:
    """Return the adapter of one scanner; None without a ring."""
    stack, fork, cage = place.drive.of(DirectStack), place.drive.of(Ears), place.drive.of(BearingCage)
    if stack is None or place.scanner.slip_ring is None:
        return None
    how = (
        "Lower the adapter over the shaft, its arms upwards."
        if fork is None
        else "Slide the fork around the flange of the shaft."
    )
    ears = fork if cage is None else cage.ears
    assert ears is not None  # a fork, or the base of a cage
    servo = place.scanner.servo
    return PartSpec(
        name=SLIP_RING_ADAPTER,
        turns=False,
        make=partial(slip_ring_adapter, stack, ears, cage),
        step=Step("Adapter on the servo", f"{how} {screws(ears.onto)}", "the shaft turns a full turn without touching"),
        shaped_by=(*ON_CASE, *OF_RING),
        joints=(on_ears(stack, ears, SLIP_RING_ADAPTER),),
        avoid=tuple(_around(servo, stack, ears)) if cage is None else (around_base(servo, cage),),
        rows=(Row("wiring", "cable tie", "cable tie around the ring's stator", "groove of the adapter"), CRIMPS),
        steps={RING: RING_STEP},
    )


def _around(servo: Servo, stack: DirectStack, fork: Ears) -> Iterator[Shape]:
    """Yield arms and fork."""
    front = stack.horn + fork.front + SEAT_GAP
    outer = max(stack.ring_radius + ARM_GAP + ARM, fork.half_x)
    yield shape_of(box_corners(((-outer, -ARM_HALF_WIDTH, front), (outer, ARM_HALF_WIDTH, stack.ring_top))))
    yield shape_of(box_corners(((-outer, servo.case_min_mm[1], front), (outer, ARM_HALF_WIDTH, front + PLATE))))


def slip_ring_adapter(stack: DirectStack, ears: Ears, cage: BearingCage | None) -> cq.Solid:
    """Make the adapter: the fork, or the base of a cage, and the arms."""
    inner = stack.ring_radius + ARM_GAP
    outer, root = inner + ARM, inner - 4.0
    if cage is None:
        body, top = _fork(stack, ears, outer), stack.horn + ears.front + SEAT_GAP + PLATE
    else:
        body, top = cage_base(cage), cage.foot
    high_end = stack.ring_bottom + min(30.0, stack.ring_length - (5.0 if cage is None else UNDER_ROOF))
    with building(SLIP_RING_ADAPTER, "arms", "outer_diameter_mm", 2 * stack.ring_radius) as checked:
        arms: list[cq.Shape] = [
            solids.slab((low, -ARM_HALF_WIDTH, top - 1.0), (high, ARM_HALF_WIDTH, high_end), radii)
            for low, high, radii in ((root, outer, ARM_CORNERS), (-outer, -root, ARM_CORNERS[2:] + ARM_CORNERS[:2]))
        ]
        drivers = [  # pass the roots of the arms
            solids.upright(ears.screw.driver_radius, top - 2.0, stack.ring_bottom, x, y)
            for x, y in ears.holes
            if abs(x) + ears.screw.driver_radius > root and abs(y) - ears.screw.driver_radius < ARM_HALF_WIDTH
        ]
        if drivers:
            arms = [arm.cut(*drivers) for arm in arms]
        body = body.fuse(*arms).cut(solids.upright(inner, stack.ring_bottom - 1.0, high_end + 9.0))
        body = checked(body)
    with building(SLIP_RING_ADAPTER, "tie groove", "outer_diameter_mm", 2 * stack.ring_radius) as checked:
        tie, depth = (stack.ring_bottom + high_end) / 2, 1.5 if cage is None else TONGUE_GROOVE
        low = tie - 3.0
        cuts = [
            solids.box((near, -99.0, low), (far, 99.0, tie + 3.0))
            for near, far in ((outer - depth, outer + 5.0), (-outer - 5.0, depth - outer))
        ]
        if cage is not None:  # a tie around the whole width would meet the legs of the cage
            cuts += [
                solids.box((-99.0, near, low), (99.0, far, high_end + 1.0))
                for near, far in ((TONGUE_HALF_WIDTH, 99.0), (-99.0, -TONGUE_HALF_WIDTH))
            ]
        return checked(body.cut(*cuts).clean())


def _fork(stack: DirectStack, p: Ears, outer: float) -> cq.Shape:
    """Return the plate on the servo, open at +y."""
    low, seats = stack.horn + p.front + SEAT_GAP, stack.horn + p.seats
    top = low + PLATE
    ys = [y for _, y in p.holes]
    first, last = max(ys) + FOOT_RADIUS + 1.5, min(ys) - FOOT_RADIUS - 1.5
    slot_end = -p.opening - 0.5
    wider = outlines.HAND if p.half_x > outer else 0.0  # the tail or the prongs have free corners where they meet
    with building(SLIP_RING_ADAPTER, "fork", "holes", p.holes) as checked:
        tail = solids.slab((-p.half_x, last, low), (p.half_x, first, top), (outlines.HAND, outlines.HAND, wider, wider))
        corners = (outlines.HAND - wider, outlines.HAND - wider, outlines.NOTCH, outlines.NOTCH)
        prongs = solids.slab((-outer, min(first, slot_end - 12.0), low), (outer, ARM_HALF_WIDTH, top), corners)
        feet = [solids.upright(FOOT_RADIUS, seats, low + 1.0, x, y) for x, y in p.holes]
        cuts = [solids.slab((-p.opening, slot_end, low - 9), (p.opening, 99.0, top + 9), outlines.HAND)]
        for x, y in p.holes:
            cuts.append(solids.upright(p.hole / 2, seats - 1.0, top + 1.0, x, y))
            cuts.append(solids.upright(p.screw.driver_radius, low + UNDER_HEAD, top + 1.0, x, y))
        return checked(tail.fuse(prongs, *feet).cut(*cuts))
