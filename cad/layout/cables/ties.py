"""Where leads are tied to the parts, so that a pull on one ends there.

The hub has a tongue over the way out of the ring's leads, rotation frame; the plate one under each cable of the lidar,
laser frame; the foot of the mount slots at its sides, frame of the deck. Millimetres. No kernel.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from scanwright.cad.layout.balance.free_space import behind_screws, in_box, in_fan, in_hull, swept
from scanwright.cad.layout.belt.stack import BeltStack
from scanwright.cad.layout.cables.tie_seat import SLOT_ACROSS, SLOT_ALONG, SLOT_WALL, TieSeat
from scanwright.cad.layout.deck import FOOT_THICKNESS, PAD_HALF, Deck
from scanwright.cad.layout.envelope import PLATE_THICKNESS
from scanwright.cad.layout.linkage import AlignmentLinkage, neck_corners
from scanwright.cad.layout.names import HUB_TIE, PLATE_TIE
from scanwright.design.arrays import Array
from scanwright.design.catalogue.products import Lidar
from scanwright.design.left_out import LeftOut
from scanwright.design.scanner import Scanner

CHANNEL_LOW = 4.2  # height over the hub's lower face that the leads of a bearing's sleeve leave by
LEAD = 3.75  # room of a bundle between the slots
THICK = 4.0  # of a tongue of the hub with nothing over it
ROOT = 3.0  # of it inside the hub
FROM_SIDE = 1.2  # of the slots, from hub or plate
TIE_OVER = 3.0  # room for a tie and for the fingers that close it
UNDER_BAR = 0.5  # of a tongue that is one with the ear of a counterweight, so that the bar lies on the ear
BESIDE_EAR = math.radians(60.0)
GAP = 0.5
BEAM = 4.0  # around the scan plane: a tongue may stand before the window beside its beams
STEP = 1.5  # of the points that stand for a tongue
PLATE_LOW, BELOW_SEAT = 5.0, 0.5  # lower and upper face of a tongue of the plate, below the plate's
FOOT_ROOM = 5.5  # half of the room between the slots of the foot: two leads lie side by side
FROM_DECK_SCREW = 9.0  # between the slots of the foot and the middle of a deck's screw, at least


def plate_ties_of(lidar: Lidar, p: AlignmentLinkage) -> tuple[TieSeat, ...] | LeftOut:
    """A tongue below each cable of the lidar, laser frame, or why there is none."""
    if p.stack.sub_plate == "x" or not lidar.cable_y_mm:
        return _without(PLATE_TIE, "an ear of the sub-plate, or no cable, is where it would be")
    seats = tuple(
        TieSeat(
            azimuth=math.pi,
            aside=-y,
            inner=p.half_x - 2.0,
            first=p.half_x + FROM_SIDE,
            low=p.top - PLATE_LOW,
            high=p.top - BELOW_SEAT,
            half=lidar.cable_diameter_mm / 2 + 0.2,
        )
        for y in lidar.cable_y_mm
    )
    if seats[0].end > lidar.body_mm[0] / 2 + lidar.cable_straight_mm:
        return _without(PLATE_TIE, f"the cable of {lidar.name} bends before it")
    neck = neck_corners(p, 0) @ p.stack.R()
    for seat in seats:
        if float((seat.corners(p.half_x) @ p.stack.R()[2]).min()) < p.stack.shoulder + GAP:
            return _without(PLATE_TIE, "it would reach below the hub")
        tie = _filled(seat, seat.first, seat.last, seat.half + SLOT_ACROSS, (seat.low - TIE_OVER, seat.low))
        if in_hull(tie, neck, GAP).any():
            return _without(PLATE_TIE, "the neck lies under the place where it would be")
    return seats


def foot_ties_of(deck: Deck) -> tuple[TieSeat, ...]:
    """At the middle of each side of the foot, frame of the deck, but where a screw is; the groove is below."""
    if deck.flat:
        return ()
    x, y, _ = deck.foot
    seats = [
        TieSeat(
            azimuth=turn * math.pi / 2,
            inner=PAD_HALF,
            first=half - SLOT_WALL - SLOT_ALONG,
            low=0.0,
            high=FOOT_THICKNESS,
            half=FOOT_ROOM,
            grooved=True,
            below=True,
        )
        for turn, half in enumerate((x, y, x, y))
    ]
    return tuple(seat for seat in seats if seat.first > PAD_HALF + 1.0 and not _near_screw(seat, deck))


def _near_screw(seat: TieSeat, deck: Deck) -> bool:
    across = np.linspace(-1.0, 1.0, 9) * (seat.half + SLOT_ACROSS)
    slots = seat.points(np.array([seat.first, seat.last]), across, np.zeros(1))[:, None, :2]
    return bool((np.linalg.norm(slots - np.array(deck.deck_holes), axis=2) < FROM_DECK_SCREW).any())


def hub_tie_of(scanner: Scanner, p: AlignmentLinkage) -> TieSeat | LeftOut:
    """The tongue of the hub, rotation frame, or why there is none.

    Args:
        scanner: angles and products.
        p: the linkage, with the ear of a counterweight if it has one.
    """
    count = len(scanner.lidar.cable_y_mm)
    if scanner.slip_ring is None or count == 0:
        return _without(HUB_TIE, "no leads leave a ring below the hub")
    if isinstance(p.stack, BeltStack):
        return _without(HUB_TIE, "the leads leave the hollow shaft below the hub: they are tied around it")
    neck = neck_corners(p, 0)
    seats = _candidates(p, count)
    found = next((seat for seat in seats if _has_room(seat, p, neck)), None)
    return found or _without(HUB_TIE, "plate, fan or the way of what is put in is where it would be")


def _without(which: str, why: str) -> LeftOut:
    return LeftOut(which, why, 1, "tongues")


def _candidates(p: AlignmentLinkage, count: int) -> Iterator[TieSeat]:
    """Between the cross screws, where the leads of a bearing's sleeve leave; else on the free sides of these too."""
    stack, free = p.stack, sum(p.cross_azimuths) / 2
    wired = stack.bearing is not None
    low = stack.shoulder + (CHANNEL_LOW if wired else 0.0)
    for turn in (0.0,) if wired else (0.0, math.pi / 2, -math.pi / 2, math.pi):
        ear, high = p.ear, low + THICK
        beside = ear is not None and abs((ear.azimuth - free - turn + math.pi) % (2 * math.pi) - math.pi) < BESIDE_EAR
        if ear is not None and beside:
            high = ear.high - UNDER_BAR
        yield TieSeat(
            azimuth=free + turn,
            inner=stack.hub_radius - ROOT,
            first=stack.hub_radius + FROM_SIDE,
            low=low,
            high=high,
            half=count * LEAD / 2 + 0.15,
            grooved=beside,
        )


def _has_room(seat: TieSeat, p: AlignmentLinkage, neck: Array) -> bool:
    """Whether a tongue of the hub is out of the way of all else, and a tie reaches around it."""
    body = _filled(seat, seat.first - FROM_SIDE, seat.end, seat.half_width, (seat.low, seat.high))
    over = (seat.high + 0.1, seat.high + TIE_OVER)
    tie = _filled(seat, seat.first, seat.last, seat.half + SLOT_ACROSS, over)
    both = body if seat.grooved else np.concatenate([body, tie])
    of_laser = both @ p.stack.R()
    boxes = [p.body, *p.cables, *([] if p.ears is None else [p.ears])]
    plate = (-p.half_x, -p.half_y, p.top - PLATE_THICKNESS), (p.half_x, p.half_y, p.top)
    return not (
        any(in_box(of_laser, swept(box), GAP).any() for box in boxes)
        or in_box(of_laser, plate, GAP).any()
        or in_fan(of_laser, replace(p, fan_z=(-BEAM, BEAM)), GAP).any()
        or behind_screws(of_laser, p).any()
        or (not seat.grooved and in_hull(tie, neck, GAP).any())
    )


def _filled(seat: TieSeat, start: float, end: float, half: float, heights: tuple[float, float]) -> Array:
    spans = ((start, end), (-half, half), heights)
    along, across, z = (np.linspace(a, b, max(2, math.ceil((b - a) / STEP) + 1)) for a, b in spans)
    return seat.points(along, across, z)
