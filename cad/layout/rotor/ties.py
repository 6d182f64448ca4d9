"""Slotted tabs for cable ties, which take the pull off the cables.

The hub has one above the exit of the ring's leads, rotation frame; the plate one under each cable of the lidar, laser
frame. Millimetres. No kernel.
"""

import math
from collections.abc import Iterator

import numpy as np

from scanwright.cad.layout.drive import DriveLayout
from scanwright.cad.layout.names import HUB_TIE, PLATE_TIE
from scanwright.cad.layout.rotor.free_space import behind_screws, in_box, in_fan, in_hull, swept
from scanwright.cad.layout.rotor.linkage import AlignmentLinkage, Ear
from scanwright.cad.layout.tie_seat import SLOT_ACROSS, TieSeat
from scanwright.design.arrays import Array
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.left_out import LeftOut
from scanwright.design.scanner import Scanner

OVER_LEADS = 0.55  # between the leads of a bearing's sleeve and a tab
THICK = 4.0  # of a tab of the hub with nothing over it
ROOT = 3.0  # of it inside the hub
FROM_SIDE = 1.2  # of the slots, from hub or plate
TIE_OVER = 3.0  # space for a tie and the fingers that close it
UNDER_BAR = 0.5  # of a tab joined with the ear of a counterweight: the bar is on the ear
NEAR_EAR = math.radians(60.0)
GAP = 0.5
BEAM = 4.0  # around the scan plane: a tab may be in front of the window outside of the beams
STEP = 1.5  # of the points in a tab
PLATE_LOW, BELOW_SEAT = 5.0, 0.5  # lower and upper face of a tab of the plate, below the plate's


def plate_ties_of(lidar: Lidar, p: AlignmentLinkage, neck: Array) -> tuple[TieSeat, ...] | LeftOut:
    """Return a tab below each cable of the lidar, laser frame, or why there is none."""
    if p.stack.sub_plate == "x" or "-x" in lidar.sides or not lidar.cable_y_mm:
        return _without(PLATE_TIE, "an ear or a wall of the sub-plate is in its place, or there is no cable")
    seats = tuple(
        TieSeat(
            azimuth=math.pi,
            aside=-y,
            inner=p.half_x - 2.0,
            first=p.half_x + FROM_SIDE,
            low=p.top - min(PLATE_LOW, p.plate),
            high=p.top - BELOW_SEAT,
            half=lidar.cable_diameter_mm / 2 + 0.2,
        )
        for y in lidar.cable_y_mm
    )
    if seats[0].end > lidar.body_mm[0] / 2 + lidar.cable_straight_mm:
        return _without(PLATE_TIE, f"the cable of {lidar.name} bends before it")
    neck = neck @ p.stack.R()
    for seat in seats:
        if float((seat.corners(p.half_x) @ p.stack.R()[2]).min()) < p.stack.shoulder + GAP:
            return _without(PLATE_TIE, "it would reach below the hub")
        tie = _filled(seat, seat.first, seat.last, seat.half + SLOT_ACROSS, (seat.low - TIE_OVER, seat.low))
        if in_hull(tie, neck, GAP).any():
            return _without(PLATE_TIE, "the neck is below its place")
    return seats


def hub_tie_of(
    scanner: Scanner, drive: DriveLayout, p: AlignmentLinkage, ear: Ear | None, neck: Array
) -> TieSeat | LeftOut:
    """Return the tab of the hub, rotation frame, or why there is none; `neck` has shape (n, 3)."""
    if scanner.slip_ring is None or not scanner.lidar.cable_y_mm:
        return _without(HUB_TIE, "no leads leave a ring below the hub")
    if drive.no_hub_tie:
        return _without(HUB_TIE, drive.no_hub_tie)
    free = next((seat for seat in _candidates(p, ear) if _fits(seat, p, neck)), None)
    return free or _without(HUB_TIE, "plate, fan or the path of an inserted part is in its place")


def _without(which: str, why: str) -> LeftOut:
    return LeftOut(which, why, 1, "slotted tabs")


def _candidates(p: AlignmentLinkage, ear: Ear | None) -> Iterator[TieSeat]:
    """Yield seats between the cross screws; if the leads do not leave by a sleeve, on the other sides too."""
    stack, free = p.stack, p.free_azimuth
    wired = stack.bearing is not None
    low = stack.leads_corner + stack.lead_diameter / 2 + OVER_LEADS if wired else stack.shoulder
    for turn in (0.0,) if wired else (0.0, math.pi / 2, -math.pi / 2, math.pi):
        high = low + THICK
        near = ear is not None and abs((ear.azimuth - free - turn + math.pi) % (2 * math.pi) - math.pi) < NEAR_EAR
        if ear is not None and near:
            high = ear.high - UNDER_BAR
        yield TieSeat(
            azimuth=free + turn,
            inner=stack.hub_radius - ROOT,
            first=stack.hub_radius + FROM_SIDE,
            low=low,
            high=high,
            half=stack.leads_half_width,
            grooved=near,
        )


def _fits(seat: TieSeat, p: AlignmentLinkage, neck: Array) -> bool:
    """Return whether a tab of the hub is clear of all else, with space for a tie around it."""
    body = _filled(seat, seat.first - FROM_SIDE, seat.end, seat.half_width, (seat.low, seat.high))
    over = (seat.high + 0.1, seat.high + TIE_OVER)
    tie = _filled(seat, seat.first, seat.last, seat.half + SLOT_ACROSS, over)
    both = body if seat.grooved else np.concatenate([body, tie])
    of_laser = both @ p.stack.R()
    boxes = [p.body, *p.cables, *([] if p.ears is None else [p.ears])]
    plate = (-p.half_x, -p.half_y, p.top - p.plate), (p.half_x, p.half_y, p.top)
    return not (
        any(in_box(of_laser, swept(box), GAP).any() for box in boxes)
        or in_box(of_laser, plate, GAP).any()
        or in_fan(of_laser, p, GAP, (-BEAM, BEAM)).any()
        or behind_screws(of_laser, p).any()
        or (not seat.grooved and in_hull(tie, neck, GAP).any())
    )


def _filled(seat: TieSeat, start: float, end: float, half: float, heights: tuple[float, float]) -> Array:
    spans = ((start, end), (-half, half), heights)
    along, across, z = (np.linspace(a, b, max(2, math.ceil((b - a) / STEP) + 1)) for a, b in spans)
    return seat.points(along, across, z)
