"""Base mount: holds the servo case, or the tower of a belt, on a deck with the rotation axis where the angles want it.

Frame: rotation frame at gamma = 0 (`cad/layout/hub.py`), mm; the deck is that of `cad/layout/deck.py`. Two
rails with feet take the case by its rear holes and leave a channel for the plugs; a back plate behind them, a strut
that stays wholly behind the back plate's front face (nothing of servo and rotor is there), and a foot with the deck's
holes: four M4 on 80 x 80 mm unless the task names others. Slots at the sides of the foot take the ties of cables.
Screws: first the case from behind through the strut, then the foot on the deck.
"""

from __future__ import annotations

from functools import partial

import cadquery as cq

from scanwright.cad import outlines, solids
from scanwright.cad.layout.belt.stack import BeltStack
from scanwright.cad.layout.cables.ties import foot_ties_of
from scanwright.cad.layout.deck import (
    BACK_THICKNESS,
    FOOT_THICKNESS,
    PLUG_GAP,
    RAIL_INSET,
    STRUT_BEHIND,
    UNDER_MOUNT_HEAD,
    Deck,
    rail_wall,
    strut_corners,
)
from scanwright.cad.layout.drive import Mounted
from scanwright.cad.layout.joints import screws
from scanwright.cad.layout.layout import Layout
from scanwright.cad.layout.names import BASE_MOUNT, BEARING_TOWER, DECK, SERVO, SERVO_CASE, SERVO_FRAME
from scanwright.cad.parts.linkage_hub import tie_slots
from scanwright.cad.parts.part_spec import PartSpec, Step
from scanwright.cad.screws import passing_hole
from scanwright.cad.solids import building
from scanwright.design.catalogue.products import Printer

OF_SERVO = (
    "servo.case_min_mm",
    "servo.case_max_mm",
    "servo.holes",
)
RAIL_HALF_WIDTH = 4.0  # least
FOOT_RADIUS = 3.0
SEAT_GAP = 0.2  # the feet carry, not the rails


def mount_spec(layout: Layout) -> PartSpec | None:
    """The mount of one scanner; None where the servo stands on the deck."""
    if layout.deck.flat:
        return None
    step = Step(
        "Servo into the mount",
        f"Put the case between the rails of the base mount, plugs to the channel behind it. {screws(SERVO_CASE)} "
        "Connect the servo's cable now, and lay a cable tie into the slots of the foot where it leaves. "
        f"{screws(DECK)}",
        check="the case does not rock on its four feet, nor the mount on the deck",
        brings=(SERVO,),
    )
    onto = layout.drive.mounted.onto
    if onto == SERVO_FRAME:
        step = Step(
            "Frame on the mount",
            f"Put the frame on the rails of the base mount. {screws(SERVO_FRAME)} Connect the servo's cable now, and "
            f"lay a cable tie into the slots of the foot where it leaves. {screws(DECK)}",
            check="the frame does not rock on its four feet, nor the mount on the deck",
        )
    if isinstance(layout.stack, BeltStack):
        step = Step(
            "Tower on the mount",
            "Put the tower on the rails of the base mount, the stator's leads into the channel behind it. "
            f"{screws(BEARING_TOWER)} Lay a cable tie into the slots of the foot where cables leave. {screws(DECK)}",
            check="the tower does not rock on its four feet, nor the mount on the deck, and no lead is pinched",
        )
    return PartSpec(
        name=BASE_MOUNT,
        turns=False,
        make=partial(base_mount, layout),
        step=step,
        shaped_by=OF_SERVO if onto == SERVO_CASE else (),
        angles="rot",
    )


def base_mount(layout: Layout) -> cq.Solid:
    """Make the mount.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    deck, mounted, printer = layout.deck, layout.drive.mounted, layout.scanner.printer
    hole, deck_hole = passing_hole(mounted.screw, printer) / 2, passing_hole(deck.screw, printer) / 2
    axis = f"({deck.normal[0]:.4f}, {deck.normal[1]:.4f}, {deck.normal[2]:.4f})"
    on_deck = solids.location(deck.rotation(), deck.centre)
    back = deck.back_centre[2]
    with building(BASE_MOUNT, "strut and foot", "deck normal", axis) as checked:
        foot = solids.prism(outlines.octagon(*deck.foot), 0.0, FOOT_THICKNESS).moved(on_deck)
        body: cq.Shape = checked(_back_plate(deck).fuse(foot, _strut(deck)))
    with building(BASE_MOUNT, "rails and screw holes", "deck normal", axis) as checked:
        rails = [_rail(deck, mounted, printer, side) for side in (1.0, -1.0)]
        feet = [solids.upright(FOOT_RADIUS, mounted.rear - 1.0, mounted.ears, x, y) for x, y in mounted.holes]
        body = body.fuse(*rails, *feet)
        cuts: list[cq.Shape] = []
        for x, y in mounted.holes:
            cuts.append(solids.upright(hole, back - 20.0, mounted.ears + 1.0, x, y))
            cuts.append(solids.upright(mounted.screw.head_room, back - 400.0, mounted.ears - UNDER_MOUNT_HEAD, x, y))
        for x, y in deck.deck_holes:
            cuts.append(solids.upright(deck_hole, -1.0, FOOT_THICKNESS + 1.0, x, y).moved(on_deck))
        cuts += [cut.moved(on_deck) for seat in foot_ties_of(deck) for cut in tie_slots(seat)]
        return checked(body.cut(*cuts).clean())


def _back_plate(deck: Deck) -> cq.Solid:
    x, y = deck.back_half
    _, cy, cz = deck.back_centre
    return solids.prism(outlines.octagon(x, y, 3.0, cy), cz - BACK_THICKNESS, cz)


def _strut(deck: Deck) -> cq.Shape:
    """Hull of back plate and a pad in the foot, behind the front of the back plate."""
    high = deck.back_centre[2] - STRUT_BEHIND
    return solids.hull(strut_corners(deck)).cut(solids.box((-400.0, -400.0, high), (400.0, 400.0, high + 400.0)))


def _rail(deck: Deck, mounted: Mounted, printer: Printer, side: float) -> cq.Solid:
    x = side * mounted.holes[0][0]
    _, cy, cz = deck.back_centre
    y = deck.back_half[1] - RAIL_INSET
    half = max(RAIL_HALF_WIDTH, mounted.screw.head_room + rail_wall(printer))
    low = (x - half, cy - y, cz - BACK_THICKNESS / 2)
    return solids.box(low, (x + half, cy + y, cz + PLUG_GAP - SEAT_GAP))
