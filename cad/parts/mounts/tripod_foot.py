"""Tripod foot: a plate under the mount, with a nut 1/4-20 UNC for a tripod's screw.

Frame: rotation frame at gamma = 0, mm; its numbers are those of `cad/layout/deck.py`. It is below the
mount's foot and has its outline. The tripod's nut is in a pocket that the mount closes; those of the mount's screws in
pockets from below.
"""

import math
from collections.abc import Iterator
from functools import partial

import cadquery as cq
import numpy as np

from scanwright.cad import outlines, solids
from scanwright.cad.layout.deck import OVER_NUTS, Deck, TripodFoot
from scanwright.cad.layout.joints import DECK_MM, Joint, fixing_in, placed_axes, screws, upright_axes
from scanwright.cad.layout.names import BASE_MOUNT, TRIPOD, TRIPOD_FOOT
from scanwright.cad.layout.placement import Placement
from scanwright.cad.parts.part_spec import PartSpec, Step
from scanwright.cad.screws import TRIPOD_SCREW
from scanwright.cad.solids import building
from scanwright.design.left_out import LeftOut

FLOOR = 2.0  # under the tripod's nut: its screw protrudes little
PROTRUDES = 4.5  # of the screws of tripods, the short ones: ISO 1222, from memory; longer ones fit
HEEL = 19.0  # half the width of the narrowest plate of a tripod's head: assumed


def tripod_foot_spec(place: Placement) -> PartSpec | LeftOut:
    """Return the plate of one scanner, if the task requires it."""
    p = place.deck.tripod
    if p is None:
        return LeftOut(TRIPOD_FOOT, f"the task does not require it (modules.{TRIPOD_FOOT})", 1, "parts")
    nut = "Lay the nut 1/4-20 into the pocket in the middle of the plate. " if p.tripod.trap is not None else ""
    words = (
        f"{nut}Put the plate under the foot of the mount, over its holes. {screws(TRIPOD_FOOT, BASE_MOUNT)} When the "
        f"scanner is finished, turn the screw of the tripod in by hand. {screws(TRIPOD_FOOT, TRIPOD)} One screw alone "
        "prevents turning by friction only: use a head or a quick-release plate with a rubber or cork face."
    )
    return PartSpec(
        name=TRIPOD_FOOT,
        turns=False,
        make=partial(tripod_foot, place.deck, p),
        step=Step("Tripod foot", words, "no screw protrudes below the plate, and the nut does not turn"),
        after=BASE_MOUNT,
        lifted="deck",
        joints=tuple(_joints(place.deck, p)),
    )


def _joints(deck: Deck, p: TripodFoot) -> Iterator[Joint]:
    """Yield the joints of the plate with mount and tripod."""
    R = deck.rotation()
    yield Joint(
        BASE_MOUNT,
        TRIPOD_FOOT,
        fixing_in(p.mount),
        deck.screw,
        placed_axes(upright_axes(deck.deck_holes, deck.foot_mm, -1.0), R, deck.centre),
        grip_mm=deck.foot_mm,
        thread_mm=p.thickness if p.mount.trap is None else OVER_NUTS,
        thread=p.mount,
    )
    yield Joint(
        TRIPOD,
        TRIPOD_FOOT,
        fixing_in(p.tripod),
        TRIPOD_SCREW,
        placed_axes(upright_axes([(0.0, 0.0)], -p.thickness - DECK_MM, 1.0), R, deck.centre),
        grip_mm=DECK_MM,
        thread_mm=p.thickness if p.tripod.trap is None else FLOOR,
        thread=p.tripod,
        protrudes_mm=PROTRUDES,
        heel_mm=HEEL,
    )


def tripod_foot(deck: Deck, p: TripodFoot) -> cq.Solid:
    """Make the plate."""
    with building(TRIPOD_FOOT, "plate and pockets", "deck.screw", deck.screw.name) as checked:
        plate = solids.plate(*deck.foot, -p.thickness, 0.0, radius=deck.foot[2])
        cuts = [solids.upright(p.tripod.hole / 2, -p.thickness - 1.0, 1.0)]
        if p.tripod.trap is not None:
            cuts.append(solids.prism(outlines.polygon(p.tripod.trap.corner, 6), FLOOR - p.thickness, 1.0))
        for x, y in deck.deck_holes:
            cuts.append(solids.upright(p.mount.hole / 2, -p.thickness - 1.0, 1.0, x, y))
            if p.mount.trap is not None:
                turn = math.atan2(y, x) + math.pi / 6  # a flat towards the middle of the plate
                nut = np.array([x, y]) + outlines.polygon(p.mount.trap.corner, 6, turn)
                cuts.append(solids.prism(nut, -p.thickness - 1.0, -OVER_NUTS))
        return checked(plate.cut(*cuts).clean().moved(solids.location(deck.rotation(), deck.centre)))
