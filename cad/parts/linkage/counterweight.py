"""Counterweight: a piece of steel bar on the ear of the linkage's hub, with two threads (`cad/layout/rotor/`).

Frame: rotation frame at gamma = 0, mm. It lies along a radius; its screws come from below, through slots of the ear.
"""

import math
from collections.abc import Iterator
from functools import partial

import cadquery as cq

from scanwright.cad import solids
from scanwright.cad.layout.cables.obstacles import Shape, shape_of
from scanwright.cad.layout.drive import towards
from scanwright.cad.layout.envelope import box_corners
from scanwright.cad.layout.joints import Joint, screws, upright_axes
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE, COUNTERWEIGHT, SUB_PLATE
from scanwright.cad.layout.placement import Placement
from scanwright.cad.layout.rotor.counterweight import LONGER, SCREW, Counterweight
from scanwright.cad.parts.part_spec import PartSpec, Step
from scanwright.cad.solids import building
from scanwright.design.left_out import LeftOut


def counterweight_spec(place: Placement) -> PartSpec | LeftOut:
    """Return the bar of one scanner, or why it has none."""
    bar = place.counterweight
    return bar if isinstance(bar, LeftOut) else bar_spec(place, bar)


def bar_spec(place: Placement, bar: Counterweight) -> PartSpec:
    """Return the spec of a bar, whose length may differ from the layout's estimate."""
    tie, ear = place.linkage.hub_tie, bar.ear
    x, y, slide = math.cos(ear.azimuth), math.sin(ear.azimuth), ear.slots[0]
    joint = Joint(
        ALIGNMENT_LINKAGE,
        COUNTERWEIGHT,
        "thread",
        SCREW,
        upright_axes(((at * x, at * y) for at in bar.screws), ear.low, 1.0),
        grip_mm=ear.high - ear.low,
        thread_mm=bar.section[1],
        slot_mm=(ear.slot_width, slide[1] - slide[0] + ear.slot_width),
    )
    first = (
        ""
        if tie is None or not tie.grooved
        else "First lay a cable tie into the groove next to the hub, for the leads. "
    )
    leads = "The leads of the ring pass below their heads. " if place.scanner.slip_ring else ""
    words = (
        f"{first}Put the {COUNTERWEIGHT} on the ear of the hub, its threads over the slots, and drive the screws "
        f"from below, in the middle of the slots. {screws(COUNTERWEIGHT, ALIGNMENT_LINKAGE)} {leads}A lidar's centre "
        "of mass is undocumented: when the scanner turns, slide the bar along its slots until `scanwright scan` "
        "prints the least ripple."
    )
    return PartSpec(
        name=COUNTERWEIGHT,
        turns=True,
        make=partial(counterweight, bar),
        step=Step("Counterweight on the linkage", words, "no screw protrudes from the bar, which is flat on the ear"),
        after=SUB_PLATE,
        process="sawn",
        material=bar.stock,
        work=f"{len(bar.screws)} threads {SCREW.name}",
        shaped_by=("lidar.mass_g",),
        shapes={"servo.backlash_deg": f"whether there is a {COUNTERWEIGHT}"},
        lifted="radius",
        joints=(joint,),
        avoid=tuple(_around(bar)),
    )


def _around(bar: Counterweight) -> Iterator[Shape]:
    """Yield the bar on its ear, and the heads of its screws wherever it slides."""
    ear, half = bar.ear, max(bar.ear.half_width, bar.section[0] / 2)
    above, below = ear.high + bar.section[1], ear.low - SCREW.head_height
    wide = SCREW.head_diameter / 2
    boxes = [((0.0, -half, ear.low), (max(bar.end + LONGER, ear.end), half, above))]
    boxes += [((first - wide, -wide, below), (last + wide, wide, ear.low)) for first, last in ear.slots]
    for box in boxes:
        yield shape_of(towards(box_corners(box), ear.azimuth)[0])


def counterweight(p: Counterweight) -> cq.Solid:
    """Make the bar."""
    half, low, high = p.section[0] / 2, p.ear.high, p.ear.high + p.section[1]
    with building(COUNTERWEIGHT, "bar and threads", "length", f"{p.length:g} mm") as checked:
        threads = [solids.upright(SCREW.core / 2, low - 1.0, high + 1.0, at, 0.0) for at in p.screws]
        bar = checked(solids.box((p.start, -half, low), (p.end, half, high)).cut(*threads))
    return bar.moved(solids.about_axis(p.ear.azimuth))
