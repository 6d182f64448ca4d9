"""Tripod foot: a plate under the mount, with a nut 1/4-20 UNC for a tripod's screw.

Frame: rotation frame at gamma = 0, mm; its numbers are those of `cad/layout/modules/tripod_foot.py`. It lies on the
lower face of the mount's foot and has its outline. The tripod's nut lies in a pocket that the mount closes; those of
the mount's screws in pockets from below.
"""

from __future__ import annotations

from functools import partial

import cadquery as cq
import numpy as np

from scanwright.cad import outlines, solids
from scanwright.cad.layout.joints import screws
from scanwright.cad.layout.layout import Layout
from scanwright.cad.layout.modules.tripod_foot import OVER_NUTS, TripodFoot, corner_turn
from scanwright.cad.layout.names import BASE_MOUNT, TRIPOD, TRIPOD_FOOT
from scanwright.cad.parts.part_spec import PartSpec, Step
from scanwright.cad.solids import building


def tripod_foot_spec(layout: Layout) -> PartSpec | None:
    """The plate of one scanner; None where no task asks for it."""
    p = layout.deck.tripod
    if p is None:
        return None
    nut = "Lay the nut 1/4-20 into the pocket in the middle of the plate. " if p.tripod.trap is not None else ""
    words = (
        f"{nut}Put the plate under the foot of the mount, over its holes. {screws(TRIPOD_FOOT, BASE_MOUNT)} When the "
        f"scanner is finished, turn the screw of the tripod in by hand. {screws(TRIPOD_FOOT, TRIPOD)} One screw alone "
        "holds against turning by friction only: take a head or a quick-release plate with a rubber or cork face."
    )
    return PartSpec(
        name=TRIPOD_FOOT,
        turns=False,
        make=partial(tripod_foot, layout, p),
        step=Step("Tripod foot", words, "no screw stands out below the plate, and the nut does not turn"),
        lifted="deck",
    )


def tripod_foot(layout: Layout, p: TripodFoot) -> cq.Solid:
    """Make the plate.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    deck = layout.deck
    with building(TRIPOD_FOOT, "plate and pockets", "deck.screw", deck.screw.name) as checked:
        plate = solids.prism(outlines.octagon(*deck.foot), -p.thickness, 0.0)
        cuts = [solids.upright(p.tripod.hole / 2, -p.thickness - 1.0, 1.0)]
        if p.tripod.trap is not None:
            cuts.append(solids.prism(outlines.polygon(p.tripod.trap.corner, 6), p.nut_floor, 1.0))
        for x, y in deck.deck_holes:
            cuts.append(solids.upright(p.mount.hole / 2, -p.thickness - 1.0, 1.0, x, y))
            if p.mount.trap is not None:
                nut = np.array([x, y]) + outlines.polygon(p.mount.trap.corner, 6, corner_turn((x, y)))
                cuts.append(solids.prism(nut, -p.thickness - 1.0, -OVER_NUTS))
        return checked(plate.cut(*cuts).clean().moved(solids.location(deck.rotation(), deck.centre)))
