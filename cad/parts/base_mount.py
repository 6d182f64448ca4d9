"""Base mount: holds the servo case, or the tower of a belt, on a deck with the rotation axis where the angles want it.

Frame: rotation frame at gamma = 0 (`cad/layout/hub.py`), mm; the deck is that of `cad/layout/deck.py`. Two
rails with feet take the case by its rear holes and leave a channel for the plugs; a back plate behind them, a strut
that stays wholly behind the back plate's front face (nothing of servo and rotor is there), and a foot with the deck's
holes: four M4 on 80 x 80 mm unless the task names others. Screws: first the case from behind through the strut, then
the foot on the deck.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import cadquery as cq
import numpy as np

from cad import outlines, solids
from cad.layout.belt.stack import BeltStack
from cad.layout.deck import BACK_THICKNESS, FOOT_THICKNESS, PAD_HALF, PLUG_GAP, UNDER_MOUNT_HEAD, Deck
from cad.layout.joints import screws
from cad.layout.layout import Layout
from cad.layout.names import BASE_MOUNT, BEARING_TOWER, DECK, SERVO_CASE
from cad.parts.part_spec import PartSpec, Step
from cad.screws import Screw, passing_hole
from cad.solids import building, checked
from design.frames import Array

OF_SERVO = (
    "servo.case_min_mm",
    "servo.case_max_mm",
    "servo.case_screw",
    "servo.case_rear_holes_mm",
    "servo.case_rear_holes_z_mm",
)
RAIL_HALF_WIDTH = 4.0  # least
RAIL_WALL = 1.3  # of a rail beside the heads of its screws
FOOT_RADIUS = 3.0
SEAT_GAP = 0.2  # the feet carry, not the rails


@dataclass(frozen=True, slots=True, kw_only=True)
class BaseMount:
    """Lengths in mm."""

    deck: Deck
    rear: float  # z of the case's rear face
    ears: float  # z of the planes around the rear holes
    screw: Screw
    hole: float  # diameter, of the case screws
    deck_hole: float


def mount_spec(layout: Layout) -> PartSpec | None:
    """The mount of one scanner; None where the servo stands on the deck."""
    if layout.deck.flat:
        return None
    step = Step(
        "Servo into the mount",
        f"Put the case between the rails of the base mount, plugs to the channel behind it. {screws(SERVO_CASE)} "
        f"Connect the servo's cable now. {screws(DECK)}",
    )
    if isinstance(layout.stack, BeltStack):
        step = Step(
            "Tower on the mount",
            "Put the tower on the rails of the base mount, the stator's leads into the channel behind it. "
            f"{screws(BEARING_TOWER)} {screws(DECK)}",
        )
    return PartSpec(
        name=BASE_MOUNT,
        turns=False,
        make=partial(base_mount, mount_of(layout)),
        step=step,
        shaped_by=() if isinstance(layout.stack, BeltStack) else OF_SERVO,
        angles="rot",
    )


def mount_of(layout: Layout) -> BaseMount:
    """Parameters of the mount of one scanner."""
    mounted, deck, printer = layout.drive.mounted, layout.deck, layout.scanner.printer
    return BaseMount(
        deck=deck,
        rear=mounted.rear,
        ears=mounted.ears,
        screw=mounted.screw,
        hole=passing_hole(mounted.screw, printer),
        deck_hole=passing_hole(deck.screw, printer),
    )


def base_mount(p: BaseMount) -> cq.Solid:
    """Make the mount.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    deck = p.deck
    axis = f"({deck.normal[0]:.4f}, {deck.normal[1]:.4f}, {deck.normal[2]:.4f})"
    frame = deck.rotation()
    on_deck = solids.location(frame, deck.centre)
    back = np.array(deck.back_centre)
    with building(BASE_MOUNT, "strut and foot", "deck normal", axis):
        foot = solids.prism(outlines.octagon(*deck.foot), 0.0, FOOT_THICKNESS).moved(on_deck)
        body: cq.Shape = _back_plate(p).fuse(foot, _strut(p, frame))
        body = checked(body, BASE_MOUNT, "strut and foot", "deck normal", axis)
    with building(BASE_MOUNT, "rails and screw holes", "deck normal", axis):
        rails = [_rail(p, side) for side in (1.0, -1.0)]
        feet = [solids.upright(FOOT_RADIUS, p.rear - 1.0, p.ears, x, y) for x, y in deck.rear_holes]
        body = body.fuse(*rails, *feet)
        cuts = []
        for x, y in deck.rear_holes:
            cuts.append(solids.upright(p.hole / 2, back[2] - 20.0, p.ears + 1.0, x, y))
            cuts.append(solids.upright(p.screw.head_room, back[2] - 400.0, p.ears - UNDER_MOUNT_HEAD, x, y))
        for x, y in deck.deck_holes:
            cuts.append(solids.upright(p.deck_hole / 2, -1.0, FOOT_THICKNESS + 1.0, x, y).moved(on_deck))
        return checked(body.cut(*cuts).clean(), BASE_MOUNT, "rails and screw holes", "deck normal", axis)


def _back_plate(p: BaseMount) -> cq.Solid:
    x, y = p.deck.back_half
    _, cy, cz = p.deck.back_centre
    return solids.prism(outlines.octagon(x, y, 3.0, cy), cz - BACK_THICKNESS, cz)


def _strut(p: BaseMount, frame: Array) -> cq.Shape:
    """Hull of back plate and a pad in the foot, behind the front of the back plate."""
    x, y = p.deck.back_half
    _, cy, cz = p.deck.back_centre
    plate = outlines.octagon(x - 0.4, y - 0.4, 3.0, cy)
    pad = outlines.octagon(PAD_HALF, PAD_HALF, 8.0)
    layers = [np.column_stack([plate, np.full(8, z)]) for z in (cz - 0.6, cz - BACK_THICKNESS + 0.7)]
    for z in (0.8, FOOT_THICKNESS - 0.9):
        layers.append(np.column_stack([pad, np.full(8, z)]) @ frame.T + np.array(p.deck.centre))
    whole = solids.hull(np.concatenate(layers))
    return whole.cut(solids.box((-400.0, -400.0, cz - 0.3), (400.0, 400.0, cz + 400.0)))


def _rail(p: BaseMount, side: float) -> cq.Solid:
    x = side * p.deck.rear_holes[0][0]
    _, cy, cz = p.deck.back_centre
    y = p.deck.back_half[1] - 0.8
    half = max(RAIL_HALF_WIDTH, p.screw.head_room + RAIL_WALL)
    low = (x - half, cy - y, cz - BACK_THICKNESS / 2)
    return solids.box(low, (x + half, cy + y, cz + PLUG_GAP - SEAT_GAP))
