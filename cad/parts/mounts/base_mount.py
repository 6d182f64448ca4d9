"""Base mount: holds the servo case, frame or belt tower on a deck, with the rotation axis at the angles of the task.

Frame: rotation frame at gamma = 0 (`cad/layout/hub.py`), mm; the deck is that of `cad/layout/deck.py`. Two rails with
feet hold the case by its rear holes and leave a channel for the plugs; a back plate behind them, a strut behind the
back plate's front face, and a foot with the deck's holes: four M4 on 80 x 80 mm unless the task states others. Slots at
the sides of the foot are for cable ties. Screws: first the case from behind through the strut, then the foot on the
deck.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import cadquery as cq
import numpy as np

from scanwright.cad import outlines, solids
from scanwright.cad.geometry.blends import BLEND_MM, foot_blend, section
from scanwright.cad.layout.cables.obstacles import Shape, shape_of
from scanwright.cad.layout.deck import (
    PLUG_GAP,
    RAIL_INSET,
    Deck,
    rail_wall,
)
from scanwright.cad.layout.drive import Mounted
from scanwright.cad.layout.envelope import box_corners
from scanwright.cad.layout.joints import DECK_MM, Joint, fixing_in, placed_axes, screws, upright_axes
from scanwright.cad.layout.names import BASE_MOUNT, BEARING_TOWER, DECK, SERVO, SERVO_CASE, SERVO_FRAME
from scanwright.cad.layout.placement import Placement
from scanwright.cad.parts.linkage.linkage_hub import tie_slots
from scanwright.cad.parts.part_spec import PartSpec, Step
from scanwright.cad.screws import passing_hole
from scanwright.cad.solids import building
from scanwright.design.arrays import Array
from scanwright.design.catalogue.products import Printer
from scanwright.design.errors import BuildError
from scanwright.design.left_out import LeftOut

CONNECT = "Connect both cables of the servo now (`wiring.md`, Servo on the bench)."
TIE = "Lay a cable tie into the slots of the foot at the exit of the cables."
SERVO_STEP = Step(
    "Servo into the mount",
    f"Put the case between the rails of the base mount, plugs towards the channel behind it. {screws(SERVO_CASE)} "
    f"{CONNECT} {TIE} "
    f"{screws(DECK)}",
    check="the case does not rock on its four feet, nor the mount on the deck",
    brings=(SERVO,),
)
TOWER_STEP = Step(
    "Tower on the mount",
    "Put the tower on the rails of the base mount, the stator's leads into the channel behind it. "
    f"{screws(BEARING_TOWER)} {TIE} {screws(DECK)}",
    check="the tower does not rock on its four feet, nor the mount on the deck, and no lead is pinched",
)
FRAME_STEP = Step(
    "Frame on the mount",
    f"Put the frame on the rails of the base mount, a nut into the slot of each of its feet. {screws(SERVO_FRAME)} "
    f"{CONNECT} {TIE} {screws(DECK)}",
    check="the frame does not rock on its four feet, nor the mount on the deck",
)
RAIL_HALF = 5.0  # of the mount's rails, at most
OF_SERVO = ("servo.case_min_mm", "servo.case_max_mm", "servo.holes")
RAIL_HALF_WIDTH = 4.0  # least
FOOT_RADIUS = 3.0
SEAT_GAP = 0.2  # the feet carry, not the rails


HANGS = "The scanner hangs under its deck: work with the deck upside down, and turn both over at the end. "
STEPS = {SERVO_CASE: SERVO_STEP, SERVO_FRAME: FRAME_STEP, BEARING_TOWER: TOWER_STEP}
UNDER_MOUNT_HEAD = 5.0  # of the mount, to its load
STRUT_BEHIND = 0.3  # of the strut's front behind that of the back plate


def mount_spec(place: Placement) -> PartSpec | LeftOut:
    """Return the mount of one scanner, or why the servo is screwed to the deck."""
    if place.deck.flat:
        return LeftOut(BASE_MOUNT, "the axis is upright: the servo is screwed flat to the deck", 1, "parts")
    onto = place.drive.mounted.onto
    step = STEPS[onto]
    if place.scanner.angles.T_world_rot(0.0)[2, :3] @ place.deck.normal < 0:
        step = replace(step, words=HANGS + step.words)
    return PartSpec(
        name=BASE_MOUNT,
        turns=False,
        make=partial(base_mount, place),
        step=step,
        shaped_by=OF_SERVO if onto == SERVO_CASE else (),
        angles="rot",
        joints=tuple(_joints(place)),
        avoid=tuple(_around(place.deck, place.drive.mounted)),
    )


def _joints(place: Placement) -> Iterator[Joint]:
    """Yield the joint of mount and load, and of mount and deck unless a plate is between them."""
    mounted, deck = place.drive.mounted, place.deck
    yield Joint(
        BASE_MOUNT,
        mounted.onto,
        mounted.fixing if mounted.thread is None else fixing_in(mounted.thread),
        mounted.screw,
        upright_axes(mounted.holes, mounted.ears - UNDER_MOUNT_HEAD, 1.0),
        grip_mm=UNDER_MOUNT_HEAD,
        thread_mm=mounted.thread_mm,
        thread=mounted.thread,
    )
    if deck.tripod is None:
        axes = placed_axes(upright_axes(deck.deck_holes, deck.foot_mm, -1.0), deck.rotation(), deck.centre)
        yield Joint(BASE_MOUNT, DECK, "deck", deck.screw, axes, grip_mm=deck.foot_mm, thread_mm=DECK_MM)


def _around(deck: Deck, mounted: Mounted) -> Iterator[Shape]:
    """Yield the back plate, rails, strut and foot."""
    (x, y), (_, cy, cz) = deck.back_half, deck.back_centre
    yield shape_of(box_corners(((-x, cy - y, cz - deck.back_mm), (x, cy + y, cz))))
    for side in (1.0, -1.0):
        middle, along = side * abs(mounted.holes[0][0]), y - RAIL_INSET
        low, high = (middle - RAIL_HALF, cy - along, cz), (middle + RAIL_HALF, cy + along, cz + PLUG_GAP)
        yield shape_of(box_corners((low, high)))
    strut = shape_of(_strut_corners(deck))
    front = np.array([[0.0, 0.0, 1.0, STRUT_BEHIND - cz]])
    yield replace(strut, planes=np.concatenate([strut.planes, front]))
    outline = outlines.octagon(*deck.foot)
    layers = [np.column_stack([outline, np.full(8, z)]) for z in (0.0, deck.foot_mm)]
    yield shape_of(np.concatenate(layers) @ deck.rotation().T + np.array(deck.centre))


def base_mount(place: Placement) -> cq.Solid:
    """Make the mount, without its blends if the kernel fails with them."""
    try:
        return _mount(place, blended=True)
    except BuildError:
        return _mount(place, blended=False)


def _mount(place: Placement, blended: bool) -> cq.Solid:
    deck, mounted, printer = place.deck, place.drive.mounted, place.scanner.printer
    hole, deck_hole = passing_hole(mounted.screw, printer) / 2, passing_hole(deck.screw, printer) / 2
    axis = f"({deck.normal[0]:.4f}, {deck.normal[1]:.4f}, {deck.normal[2]:.4f})"
    on_deck = solids.location(deck.rotation(), deck.centre)
    back = deck.back_centre[2]
    with building(BASE_MOUNT, "strut and foot", "deck normal", axis) as checked:
        foot = solids.plate(*deck.foot, 0.0, deck.foot_mm, radius=deck.foot[2]).moved(on_deck)
        strut = _behind(_strut_corners(deck), back - STRUT_BEHIND)
        blends = [solids.hull(each).moved(on_deck) for each in _foot_blends(deck, strut) if blended]
        body: cq.Shape = checked(_back_plate(deck).fuse(foot, solids.hull(strut), *blends))
    with building(BASE_MOUNT, "rails and screw holes", "deck normal", axis) as checked:
        rails = [_rail(deck, mounted, printer, side) for side in (1.0, -1.0)]
        feet = [solids.upright(FOOT_RADIUS, mounted.rear - 1.0, mounted.ears, x, y) for x, y in mounted.holes]
        body = body.fuse(*rails, *feet)
        cuts: list[cq.Shape] = []
        driver, heads = mounted.screw.driver_radius, mounted.ears - UNDER_MOUNT_HEAD
        for x, y in mounted.holes:
            cuts.append(solids.upright(hole, back - 20.0, mounted.ears + 1.0, x, y))
            cuts.append(solids.upright(driver, back - 400.0, heads, x, y))
        for x, y in deck.deck_holes:
            cuts.append(solids.upright(deck_hole, -1.0, deck.foot_mm + 1.0, x, y).moved(on_deck))
        cuts += [cut.moved(on_deck) for seat in deck.ties for cut in tie_slots(seat)]
        return checked(body.cut(*cuts).clean())


def _back_plate(deck: Deck) -> cq.Solid:
    x, y = deck.back_half
    _, cy, cz = deck.back_centre
    return solids.plate(x, y, 3.0, cz - deck.back_mm, cz, y=cy)


def _behind(corners: Array, front: float) -> Array:
    """Return the corners (n, 3) of the part of a convex body below a height."""
    return np.concatenate([corners[corners[:, 2] < front], section(corners, front)])


def _foot_blends(deck: Deck, strut: Array) -> list[Array]:
    """Return the corners of the blends of strut and foot, clear of the heads on the deck; frame of the deck."""
    aside = min(max(abs(x), abs(y)) for x, y in deck.deck_holes)
    free = aside - deck.screw.driver_radius - deck.pad_half
    on_deck = (strut - np.array(deck.centre)) @ deck.rotation()
    return foot_blend(on_deck, deck.foot_mm, outlines.octagon(*deck.foot), min(BLEND_MM, free))


def _rail(deck: Deck, mounted: Mounted, printer: Printer, side: float) -> cq.Solid:
    x = side * mounted.holes[0][0]
    _, cy, cz = deck.back_centre
    y = deck.back_half[1] - RAIL_INSET
    half = max(RAIL_HALF_WIDTH, mounted.screw.driver_radius + rail_wall(printer))
    low = (x - half, cy - y, cz - deck.back_mm / 2)
    return solids.slab(low, (x + half, cy + y, cz + PLUG_GAP - SEAT_GAP), outlines.HAND)


def _strut_corners(deck: Deck) -> Array:
    """Return corners of back plate and a pad in the foot, shape (n, 3): the strut is their hull behind the plate.

    No facet coincides with plate or foot.
    """
    x, y = deck.back_half
    _, cy, cz = deck.back_centre
    plate = outlines.octagon(x - 0.4, y - 0.4, 3.0, cy)
    pad = outlines.octagon(deck.pad_half, deck.pad_half, 8.0)
    layers = [np.column_stack([plate, np.full(8, z)]) for z in (cz - 0.6, cz - deck.back_mm + 0.7)]
    for z in (0.8, deck.foot_mm - 0.9):
        layers.append(np.column_stack([pad, np.full(8, z)]) @ deck.rotation().T + np.array(deck.centre))
    return np.concatenate(layers)
