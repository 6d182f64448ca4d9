"""Counterweight: a piece of steel bar on the ear of the linkage's hub, with two threads (`cad/layout/balance/`).

Frame: rotation frame at gamma = 0, mm. It lies along a radius; its screws come from below, through slots of the ear.
"""

from __future__ import annotations

from functools import partial

import cadquery as cq

from scanwright.cad import solids
from scanwright.cad.layout.balance.counterweight import SCREW, Counterweight
from scanwright.cad.layout.joints import screws
from scanwright.cad.layout.layout import Layout
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE, COUNTERWEIGHT
from scanwright.cad.parts.part_spec import PartSpec, Step
from scanwright.cad.solids import building
from scanwright.design.left_out import LeftOut


def counterweight_spec(layout: Layout) -> PartSpec | None:
    """The bar of one scanner; None where nothing is to be balanced, or nothing can."""
    bar = layout.counterweight
    if isinstance(bar, LeftOut):
        return None
    tie = layout.linkage.hub_tie
    first = (
        ""
        if tie is None or not tie.grooved
        else "First lay a cable tie into the groove beside the hub: it waits for the leads. "
    )
    words = (
        f"{first}Lay the bar on the ear of the hub, its threads over the slots, and drive the screws from below, in "
        f"the middle of the slots. {screws(COUNTERWEIGHT, ALIGNMENT_LINKAGE)} The leads of the ring pass below their "
        "heads. Nobody tells where a lidar's centre of mass is: when the scanner turns, slide the bar along its slots "
        "to where `scanwright scan` prints the least ripple."
    )
    return PartSpec(
        name=COUNTERWEIGHT,
        turns=True,
        make=partial(counterweight, bar),
        step=Step(
            "Counterweight on the linkage", words, "no screw stands out above the bar, which lies flat on the ear"
        ),
        process="sawn",
        material=bar.stock,
        work=f"{len(bar.screws)} threads {SCREW.name}",
        shaped_by=("lidar.mass_g",),
        shapes={"servo.backlash_deg": f"whether there is a {COUNTERWEIGHT}"},
        lifted="radius",
    )


def counterweight(p: Counterweight) -> cq.Solid:
    """Make the bar.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    half, low, high = p.section[0] / 2, p.ear.high, p.ear.high + p.section[1]
    with building(COUNTERWEIGHT, "bar and threads", "length", f"{p.length:g} mm") as checked:
        threads = [solids.upright(SCREW.core / 2, low - 1.0, high + 1.0, at, 0.0) for at in p.screws]
        bar = checked(solids.box((p.start, -half, low), (p.end, half, high)).cut(*threads))
    return bar.moved(solids.about_axis(p.ear.azimuth))
