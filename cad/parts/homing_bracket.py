"""Homing bracket: carries the optical switch that the linkage's flag passes, on the cage or on an arm of the adapter.

Frame: rotation frame at gamma = 0, mm; its numbers are those of `cad/layout/modules/homing_flag.py`. A foot against
what it stands on and a shelf with slots, in which the switch slides along the radius until the vane is in its middle.
"""

from __future__ import annotations

from functools import partial

import cadquery as cq

from scanwright.cad import solids
from scanwright.cad.layout.joints import screws
from scanwright.cad.layout.layout import Layout
from scanwright.cad.layout.linkage import AlignmentLinkage
from scanwright.cad.layout.modules.homing_flag import (
    ARM_HALF,
    ARM_HIGH,
    BESIDE,
    COLUMN,
    COLUMN_HALF,
    SCREW,
    SHELF,
    SLIDE,
    VANE,
    VANE_HALF,
    HomingBracket,
    bracket_of,
    passes_at_deg,
    vane_half_deg,
)
from scanwright.cad.layout.names import HOMING_BRACKET, SWITCH, SWITCH_BODY
from scanwright.cad.parts.part_spec import PartSpec, Step
from scanwright.cad.solids import building
from scanwright.design.left_out import LeftOut

BEYOND = 1.0


def bracket_spec(layout: Layout) -> PartSpec | None:
    """The bracket of one scanner; None without one."""
    p, flag = bracket_of(layout.scanner, layout.stack), layout.linkage.flag
    if isinstance(p, LeftOut) or flag is None:
        return None
    words = (
        f"Hold the bracket against {p.onto.replace('_', ' ')}. {screws(p.onto)} Put the switch on its shelf, slot "
        f"upwards. {screws(SWITCH_BODY)} Leave these loose until the linkage is on: then slide the switch until the "
        "vane runs in the middle of its slot, and tighten them. The vane is in the light at "
        f"{passes_at_deg(p, flag):.1f} deg of the servo from where the index marks meet, and darkens it for "
        f"{vane_half_deg(flag):.1f} deg to both sides; `scanwright scan` does not read the switch, the servo knows "
        "its angle: it is for a look by your own program that nothing has slipped."
    )
    return PartSpec(
        name=HOMING_BRACKET,
        turns=False,
        make=partial(homing_bracket, p),
        step=Step("Bracket of the homing switch", words, "the light of the switch goes on as a card passes", (SWITCH,)),
        shaped_by=tuple(
            f"slot_switch.{field}" for field in ("body_mm", "flange_mm", "hole_pitch_mm", "beam_height_mm", "screw")
        ),
    )


def homing_bracket(p: HomingBracket) -> cq.Solid:
    """Make the bracket.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    near = p.face + BESIDE
    with building(HOMING_BRACKET, "foot and shelf", "radius", f"{p.radius:g} mm") as checked:
        inside = near if p.flat else near - 3.0
        foot = solids.box((inside, -COLUMN_HALF, p.low), (near + COLUMN, COLUMN_HALF, p.seat))
        body: cq.Shape = foot.fuse(
            solids.box((near, -COLUMN_HALF, p.seat - SHELF), (p.outer, COLUMN_HALF, p.seat)),
        )
        if not p.flat:
            body = body.cut(solids.upright(near, p.low - BEYOND, p.seat + BEYOND))
        body = checked(body)
    with building(HOMING_BRACKET, "screw holes and slots", "radius", f"{p.radius:g} mm") as checked:
        cuts: list[cq.Shape] = [solids.radial(p.hole / 2, 0.0, z) for z in p.heights]
        for side in (1.0, -1.0):
            middle = p.radius + side * p.switch.hole_pitch_mm / 2
            ends = (middle - SLIDE, 0.0), (middle + SLIDE, 0.0)
            cuts.append(solids.slot(p.switch_hole / 2, *ends, p.seat - SHELF - BEYOND, p.seat + BEYOND))
        return checked(body.cut(*cuts).clean().moved(solids.about_axis(p.azimuth)))


def bracket_threads(p: HomingBracket | LeftOut, part: str) -> list[cq.Solid]:
    """What the screws of a bracket take from a part: their threads, if they end in it."""
    if isinstance(p, LeftOut) or p.onto != part:
        return []
    start = p.face - p.depth - BEYOND
    return [solids.radial(SCREW.core / 2, p.azimuth, z, start, p.depth + 2 * BEYOND) for z in p.heights]


def flag_on_hub(p: AlignmentLinkage) -> list[cq.Shape]:
    """Arm and vane; nothing where no flag is asked for."""
    flag = p.flag
    if flag is None:
        return []
    outer, top = flag.radius + VANE / 2, flag.base + ARM_HIGH
    arm = solids.box((p.stack.shaft_diameter / 2 + 3.0, -ARM_HALF, flag.base), (outer - 0.3, ARM_HALF, top))
    tube = solids.upright(outer, flag.low, top).cut(solids.upright(outer - VANE, flag.low - BEYOND, top + BEYOND))
    vane = tube.intersect(solids.box((0.0, -VANE_HALF, flag.low - BEYOND), (outer + BEYOND, VANE_HALF, top + BEYOND)))
    return [shape.moved(solids.about_axis(flag.azimuth)) for shape in (arm, vane)]
