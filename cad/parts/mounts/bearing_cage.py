"""Bearing cage: holds a thin-section bearing around the shaft's sleeve if the axis is tilted too far for the horn.

Frame: rotation frame at gamma = 0 (`cad/layout/direct/stack.py`), mm. Two parts, since the cage is put over the ring:

    cage_base     thick plate on the ears of the servo's front, with a boss that centres the cage; with a ring it is
                  the plate of `slip_ring_adapter`
    bearing_cage  a bell around ring and adapter: legs between windows, a roof of 45 deg, the bearing's seat

Order: shaft, base, ring and its tie, sleeve, bell with the bearing; the four radial screws of the bell last, when the
bearing is centred on the sleeve. The sleeve slides in the bearing: the horn alone carries axial loads.
"""

import math
from functools import partial

import cadquery as cq
import numpy as np

from scanwright.cad import outlines, solids
from scanwright.cad.layout.cables.obstacles import Shape, shape_of
from scanwright.cad.layout.direct.cage import (
    CAGE_SCREW,
    FOOT_RADIUS,
    SCREW_DEPTH,
    SEAT_GAP,
    UNDER_HEAD,
    WINDOW_HALF_WIDTH,
    BearingCage,
)
from scanwright.cad.layout.direct.frame import OVER_HEADS
from scanwright.cad.layout.direct.stack import CAGE_LIP, CAGE_SEAT_WALL, WINDOWS_REACH, DirectStack
from scanwright.cad.layout.drive import Ears
from scanwright.cad.layout.envelope import around_axis, box_corners
from scanwright.cad.layout.joints import ALL_SCREWS, Joint, fixing_in, inward_axes, round_wall_mm, screws, upright_axes
from scanwright.cad.layout.names import BEARING, BEARING_CAGE, CAGE_BASE, SLIP_RING_ADAPTER
from scanwright.cad.layout.placement import Placement
from scanwright.cad.parts.part_spec import ON_CASE, PartSpec, Step, printed_seat
from scanwright.cad.screws import Screw, Trap
from scanwright.cad.solids import building
from scanwright.design.catalogue.servo import Servo

PLUG_CORNER = 1.0  # radius: plugs have as much clearance
BELL_GAP = 0.7  # around the bell's foot
WINDOW_CORNERS = (outlines.NOTCH, outlines.NOTCH, outlines.NOTCH, 1.0, outlines.NOTCH)  # the fourth is the ridge
UNDER_CAGE_HEAD = 3.5  # of a leg
TRAP_WALL = 3.0  # of the boss outside a nut


def bell_spec(place: Placement) -> PartSpec | None:
    """Return the bell of one scanner; None if no bearing carries its axis."""
    p = place.drive.of(BearingCage)
    if p is None:
        return None
    heads = p.stack.cage_inner + UNDER_CAGE_HEAD
    joint = Joint(
        BEARING_CAGE,
        CAGE_BASE if place.scanner.slip_ring is None else SLIP_RING_ADAPTER,
        fixing_in(p.thread),
        CAGE_SCREW,
        inward_axes(p.legs, heads, (p.foot + p.high) / 2),
        grip_mm=round_wall_mm(p.stack.cage_inner, heads, p.cage_hole),
        thread_mm=SCREW_DEPTH - p.fit / 2 if p.thread.trap is None else TRAP_WALL,
        thread=p.thread,
    )
    leads = "pass the plugs of the ring's leads up through it and " if place.scanner.slip_ring else ""
    words = (
        "Press the bearing into its seat, down to the lip; if it is loose there, print the cage with a smaller "
        f"fit_clearance_mm. Then {leads}lower the cage over the sleeve onto its base. "
        f"Put the screws of the cage in loosely: {ALL_SCREWS} Turn the shaft once around by hand, so that the bearing "
        "centres on the sleeve, tighten the screws crosswise, and turn it once more."
    )
    return PartSpec(
        name=BEARING_CAGE,
        turns=False,
        make=partial(bearing_cage, p),
        step=Step(
            "Bearing and cage",
            words,
            "the bearing has no play in its seat, and the shaft turns without a tight spot",
            (BEARING,),
        ),
        fits=(printed_seat(p.bearing, p.fit),),
        joints=(joint,),
        avoid=(shape_of(around_axis(p.stack.cage_outer, p.low, p.stack.cage_top)),),
    )


def base_spec(place: Placement) -> PartSpec | None:
    """Return the base as a separate part; None if it is part of the adapter, or not needed."""
    p = place.drive.of(BearingCage)
    if p is None or place.scanner.slip_ring is not None:
        return None
    return PartSpec(
        name=CAGE_BASE,
        turns=False,
        make=partial(cage_base, p),
        step=Step(
            "Base of the cage on the servo",
            f"Lower the base over the shaft. {screws(p.ears.onto)}",
            "the shaft turns a full turn without touching the base",
        ),
        shaped_by=ON_CASE,
        joints=(on_ears(p.stack, p.ears, CAGE_BASE),),
        avoid=(around_base(place.scanner.servo, p),),
    )


def on_ears(stack: DirectStack, ears: Ears, part: str) -> Joint:
    """Return the joint of a plate on the front of the servo's case, or on its frame."""
    heads = stack.horn + ears.front + SEAT_GAP + UNDER_HEAD
    return Joint(
        part,
        ears.onto,
        ears.fixing,
        ears.screw,
        upright_axes(ears.holes, heads, -1.0),
        grip_mm=heads - (stack.horn + ears.seats),
        thread_mm=ears.thread_mm,
        thread=ears.thread,
    )


def around_base(servo: Servo, p: BearingCage) -> Shape:
    """Return the shape of the base next to the bell."""
    wide, back = p.ears.half_x, servo.case_min_mm[1]
    return shape_of(box_corners(((-wide, back, p.low), (wide, 0.0, p.stack.ring_bottom))))


def bearing_cage(p: BearingCage) -> cq.Solid:
    """Make the bell."""
    stack = p.stack
    size = f"{p.bearing.outer_mm:g}"
    with building(BEARING_CAGE, "bell", "outer_mm", size) as checked:
        seat = p.bearing.outer_mm / 2 + p.fit / 4
        lip = p.bearing.outer_mm / 2 - CAGE_LIP
        rim = p.bearing.outer_mm / 2 + CAGE_SEAT_WALL
        roof = stack.cage_roof
        profile = [
            (stack.cage_outer, p.foot),
            (stack.cage_outer, roof),
            (rim, roof + stack.cage_outer - rim),
            (rim, stack.cage_top),
            (seat, stack.cage_top),
            (seat, stack.cage_seat),
            (lip, stack.cage_seat),
            (lip, stack.cage_seat - CAGE_LIP),
            (stack.cage_inner, roof),
            (stack.cage_inner, p.foot),
        ]
        body: cq.Shape = checked(solids.lathe(profile))
    with building(BEARING_CAGE, "windows and screw holes", "outer_mm", size) as checked:
        cuts = _windows(p) if stack.ring_length > 0 else []
        for azimuth in p.legs:
            middle, heads = (p.foot + p.high) / 2, stack.cage_inner + UNDER_CAGE_HEAD
            cuts.append(solids.radial(p.cage_hole / 2, azimuth, middle))
            cuts.append(solids.radial(CAGE_SCREW.driver_radius, azimuth, middle, heads))
        return checked(body.cut(*cuts).clean())


def cage_base(p: BearingCage) -> cq.Solid:
    """Make the plate on the servo."""
    stack, ears = p.stack, p.ears
    seats = stack.horn + ears.seats
    last = min(y for _, y in ears.holes) - FOOT_RADIUS - 1.5
    with building(CAGE_BASE, "plate and boss", "holes", ears.holes) as checked:
        reaches_out = -last > stack.cage_outer + BELL_GAP + 2 * FOOT_RADIUS
        high_edge = (ears.half_x, 0.0, p.high if reaches_out else p.foot)
        tail = solids.slab((-ears.half_x, last, p.low), high_edge, outlines.HAND)
        around = solids.upright(stack.cage_outer + BELL_GAP, p.foot, p.high + 1.0)
        boss = solids.upright(stack.cage_inner - p.fit / 2, p.low, p.high)
        body = solids.upright(stack.cage_outer, p.low, p.foot).fuse(tail).cut(around).fuse(boss)
        half, reach = p.lead_hole
        leads = [solids.slab((-half, 0.0, p.low - 1.0), (half, reach, p.high + 1.0), PLUG_CORNER)] if half else []
        body = checked(body.cut(solids.upright(ears.opening, p.low - 1.0, p.high + 1.0), *leads))
    with building(CAGE_BASE, "feet and screw holes", "holes", ears.holes) as checked:
        feet = [solids.upright(FOOT_RADIUS, seats, p.low + 1.0, x, y) for x, y in ears.holes]
        body = body.fuse(*feet)
        cuts: list[cq.Shape] = [solids.upright(ears.opening, stack.horn + ears.front, p.high + 1.0)]
        for x, y in ears.holes:
            cuts.append(solids.upright(ears.hole / 2, seats - 1.0, p.high + 1.0, x, y))
            cuts.append(head_recess(ears, ears.screw, x, y, p.low + UNDER_HEAD, p.high + 1.0))
        for x, y, screw in ears.covers:
            top = stack.horn + ears.front + screw.head_height + OVER_HEADS
            cuts.append(head_recess(ears, screw, x, y, p.low - 1.0, top))
        for azimuth in p.legs:
            middle, start = (p.foot + p.high) / 2, stack.cage_inner - SCREW_DEPTH
            cuts.append(solids.radial(p.thread.hole / 2, azimuth, middle, start, SCREW_DEPTH + 1.0))
            if p.thread.trap is not None:
                cuts.append(_slot(p, p.thread.trap, azimuth))
        return checked(body.cut(*cuts).clean())


def _slot(p: BearingCage, trap: Trap, azimuth: float) -> cq.Solid:
    """Return the slot in the boss for a nut, inserted from above before ring and bell."""
    middle, half = (p.foot + p.high) / 2, trap.across / 2
    outer = p.stack.cage_inner - p.fit / 2 - TRAP_WALL
    slot = solids.box((outer - trap.depth, -half, middle - trap.corner), (outer, half, p.high + 1.0))
    return slot.rotate(cq.Vector(0, 0, 0), cq.Vector(0, 0, 1), math.degrees(azimuth))


def head_recess(ears: Ears, screw: Screw, x: float, y: float, low: float, high: float) -> cq.Shape:
    """Return the recess of one screw's head; next to the opening it is open, since a sliver would remain."""
    radius = screw.driver_radius
    recess: cq.Shape = solids.upright(radius, low, high, x, y)
    reach = math.hypot(x, y)
    if reach - radius > ears.opening + 1.0:
        return recess
    channel = solids.box((0.0, -radius, low), (reach, radius, high))
    return recess.fuse(channel.rotate(cq.Vector(0, 0, 0), cq.Vector(0, 0, 1), math.degrees(math.atan2(y, x))))


def _windows(p: BearingCage) -> list[cq.Solid]:
    """Return the windows: at +-x open below, for the adapter's arms; at +-y closed, which joins the legs in pairs."""
    cuts = []
    for k in range(4):
        out = np.array([1.0, 0.0, 0.0]) if k % 2 == 0 else np.array([0.0, 1.0, 0.0])
        out = out if k < 2 else -out
        up = np.array([0.0, 0.0, 1.0])
        low = p.foot - 5.0 if k % 2 == 0 else p.high + 2.0
        outline = outlines.gable(WINDOW_HALF_WIDTH, low, p.stack.cage_roof + WINDOWS_REACH)
        frame = np.stack([np.cross(up, out), up, out], axis=1)
        cuts.append(solids.prism(outline, 0.0, 80.0, WINDOW_CORNERS).moved(solids.location(frame)))
    return cuts
