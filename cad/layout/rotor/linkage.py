"""Numbers of the alignment linkage. Rotation frame at gamma = 0, mm."""

import math
from dataclasses import dataclass

import numpy as np

from scanwright.cad import outlines
from scanwright.cad.layout.envelope import (
    BODY_GAP,
    EAR_SCREW,
    Box,
    Envelope,
    SideWall,
    box_corners,
    ear_screws,
    load_share,
    plate_mm,
    screw_travel_mm,
    side_walls,
    slot_ends,
    sub_plate_mm,
)
from scanwright.cad.layout.hub import Hub
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE
from scanwright.cad.layout.tie_seat import TieSeat
from scanwright.cad.screws import SCREWS, Screw, Thread, passing_hole, thread_in_part
from scanwright.design.arrays import Array
from scanwright.design.catalogue.holes import what_holds
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import BuildError
from scanwright.design.scanner import Scanner

CROSS_AT = tuple(math.radians(azimuth) for azimuth in (45.0, 135.0, 225.0, 315.0))  # tapped holes of every shaft
CHAMFER = 4.0  # of the plate's corners, without lugs
NECK_SHARE = 0.6  # least of the neck's width at the plate: the plate extends beyond it
HEEL = 8.0  # of the neck below a lying plate
BACK = 6.0  # of the neck behind its lower half: a bracket, thick at its foot
RING_MARGIN = 0.03  # rad, between the sector of a full fan and the sector that the ring hides
FIN_HALF = 0.06  # rad, half of a sector in which the neck would be a fin


@dataclass(frozen=True, slots=True)
class Ear:
    """Lug of the hub for a counterweight, with slots along the radius: lengths in mm, `azimuth` in rad."""

    azimuth: float
    half_width: float
    end: float  # distance of its end from the axis
    low: float
    high: float
    slots: tuple[tuple[float, float], ...]  # first and last place of a screw, as distances from the axis
    slot_width: float


@dataclass(frozen=True, slots=True, kw_only=True)
class AlignmentLinkage:
    """Hub, neck and plate with attachments: lengths in mm, angles in rad, directions in the rotation frame."""

    stack: Hub
    seat: float  # z of the lidar's base in the laser frame
    top: float  # z of the plate's upper face: the seat, or below a sub-plate
    plate: float  # thickness of the plate
    neck_share: float  # width of the neck at the plate, over that of the plate
    half_x: float
    half_y: float
    chamfer: float
    body: Box
    walls: tuple[SideWall, ...]  # of a sub-plate
    ears: Box | None  # space of a sub-plate's ears
    ear_screws: tuple[tuple[float, float], ...]
    ear_thread: Thread
    cables: tuple[Box, ...]
    fan_z: tuple[float, float]  # the window's edges in the laser frame
    fan: tuple[tuple[float, float], ...]  # ranges of bearings that the linkage must leave free
    screw: Screw  # of the lidar
    screw_hole: float  # diameter
    holes: tuple[tuple[float, float], ...]  # in the base; none if walls hold the lidar
    screw_travel: float  # of the screws to either side, in slots
    fit: float  # diametral clearance of the spigot
    cross_hole: float  # diameter, in the hub
    cross_azimuths: tuple[float, ...]  # two neighbours of CROSS_AT
    cross_thread: Thread | None  # of a printed shaft; None in metal
    ear: Ear | None = None
    hub_tie: TieSeat | None = None  # rotation frame
    plate_ties: tuple[TieSeat, ...] = ()  # laser frame

    @property
    def free_azimuth(self) -> float:
        """Azimuth [rad] between the two cross screws, where the leads of a ring leave."""
        return sum(self.cross_azimuths) / 2


def linkage_body_of(scanner: Scanner, envelope: Envelope, stack: Hub) -> AlignmentLinkage:
    """Return the linkage of one scanner, before anything is attached.

    Raises:
        BuildError: the screw holes come too near to the plate's edge.
    """
    lidar, printer = scanner.lidar, scanner.printer
    held, walls = next(iter(lidar.held.values())), side_walls(lidar)
    screw = SCREWS[held.screw]
    hole = passing_hole(screw, printer)
    half_x, half_y, _ = envelope.plate(stack.sub_plate)[1]
    holes = () if walls else held.places
    if len(holes) < 2 and not walls:
        sunk = "" if all(hole.at_mm[2] == 0 for hole in lidar.holes if hole.axis == "-z") else ", some not in its face"
        raise BuildError(
            f"{ALIGNMENT_LINKAGE}: seat: holes: {lidar.name} has fewer than two equal threads or through holes in the "
            f"face of its base, and no equal threads in two opposite sides or its rear "
            f"({what_holds(lidar.holes)}{sunk}); take another one"
        )
    travel = screw_travel_mm(lidar)
    outermost = [slot_ends(place, travel)[1] for place in holes]
    edge = min((min(half_x - abs(x), half_y - abs(y)) for x, y in outermost), default=math.inf) - hole / 2
    if edge < printer.min_wall_mm:
        raise BuildError(
            f"{ALIGNMENT_LINKAGE}: seat: holes at {list(lidar.base.places)}: leaves a wall of {edge:.2f} mm "
            f"at the edge of the plate, {lidar.name} with {printer.name} needs min_wall_mm = {printer.min_wall_mm:g}"
        )
    # the cut corner leaves the wall that the straight edge leaves
    corner = min((half_x + half_y - abs(x) - abs(y) for x, y in outermost), default=math.inf)
    chamfer = float(np.clip(corner - math.sqrt(2) * (edge + hole / 2), 0.5, _free_corner(lidar))) if holes else CHAMFER
    low, high = lidar.window_z_mm
    return AlignmentLinkage(
        stack=stack,
        seat=-lidar.optical_height_mm,
        top=-lidar.optical_height_mm - (0.0 if stack.sub_plate is None else sub_plate_mm(lidar)),
        plate=plate_mm(lidar, stack.sub_plate),
        neck_share=_neck_share(lidar, stack),
        half_x=half_x,
        half_y=half_y,
        chamfer=chamfer,
        body=envelope.body,
        walls=walls,
        ears=None if stack.sub_plate is None else _grown(envelope.under(stack.sub_plate)),
        ear_screws=() if stack.sub_plate is None else ear_screws(lidar, stack.sub_plate),
        ear_thread=thread_in_part(EAR_SCREW, printer, carries=True),
        cables=envelope.cables,
        fan_z=(low - lidar.optical_height_mm, high - lidar.optical_height_mm),
        fan=_free_bearings(stack, lidar.bearings_rad()),
        screw=screw,
        screw_hole=hole,
        holes=holes,
        screw_travel=travel,
        fit=printer.fit_clearance_mm,
        cross_hole=passing_hole(stack.cross_screw.screw, printer),
        cross_azimuths=_cross_azimuths(stack.R()[:, 2]),
        cross_thread=thread_in_part(stack.cross_screw.screw, printer, carries=True) if stack.cup_bore > 0 else None,
    )


def _neck_share(lidar: Lidar, stack: Hub) -> float:
    """Return the width of the neck at the plate over that of the plate: by the load, in full below a lying plate."""
    normal, light = stack.R()[:, 2], max(NECK_SHARE, load_share(lidar) ** 0.25)
    return light + (1 - light) * math.hypot(normal[0], normal[1]) ** 4


def _free_corner(lidar: Lidar) -> float:
    """Return the chamfer of a plate that cuts no more than CHAMFER from the lidar's body itself, without its lugs."""
    lugs = sum(half - size / 2 for half, size in zip(lidar.half_mm, lidar.body_mm, strict=False))
    return min(CHAMFER + lugs, max(CHAMFER, min(lidar.half_mm) / 3))


def neck_corners(p: AlignmentLinkage, attempt: int) -> Array:
    """Return corners of the neck's hull, shape (n, 3): the hub's core, raised to just under the lidar, and the plate.

    For safe booleans no facet coincides with hub, plate or body.
    """
    stack = p.stack
    turn = math.radians(0.7 + 1.9 * attempt)
    ring = outlines.polygon(stack.neck_radius - 0.05 * attempt, 24, turn)
    R = stack.R()
    under_body = float((box_corners(p.body) @ R[2]).min()) - 0.8
    top = min(max(-stack.h, under_body), 40.0 - stack.h)
    layers = [np.column_stack([ring, np.full(24, z)]) for z in (stack.shoulder + 1.5, top)]
    share = p.neck_share
    outline = outlines.octagon(share * p.half_x - 0.5, share * p.half_y - 0.5, share * p.chamfer)
    for z in (p.top - 0.2, p.top - p.plate + 0.5):
        layers.append(np.column_stack([outline, np.full(8, z)]) @ R.T)
    layers.append(_foot(np.concatenate(layers[2:]), stack))
    return np.concatenate(layers)


def _foot(plate: Array, stack: Hub) -> Array:
    """Return the lower half of the plate's corners, moved down and back: it thickens the neck of a lying plate."""
    lower = plate[plate[:, 2] < plate[:, 2].mean() - 1e-6]
    if len(lower) == 0:
        return plate
    normal = stack.R()[:, 2]
    lying = math.hypot(normal[0], normal[1]) ** 2
    free = max(0.0, float(lower[:, 2].min()) - stack.shoulder - 2.0)
    heel = lower - [0.0, 0.0, min(HEEL * lying, free)]
    return np.concatenate([heel, lower - min(BACK * lying, free / max(normal[2], 1e-6)) * normal])


def _grown(box: Box) -> Box:
    """Return a box with the lidar's gap around its sides."""
    (x0, y0, z0), (x1, y1, z1) = box
    return (x0 - BODY_GAP, y0 - BODY_GAP, z0), (x1 + BODY_GAP, y1 + BODY_GAP, z1)


def _free_bearings(stack: Hub, bearings: Array) -> tuple[tuple[float, float], ...]:
    """Return the fan without the sector that the ring hides: a lying linkage needs the material there.

    A full fan is closed at its start.
    """
    first, last = float(bearings.min()), float(bearings.max())
    pieces = [(first, last)]
    if last - first > 2 * (math.pi - FIN_HALF):
        middle, end = first + math.pi, first + 2 * math.pi
        pieces = [(first - FIN_HALF, middle + FIN_HALF), (middle - FIN_HALF, end + FIN_HALF)]
    q = stack.R()[2]
    tilt_sine = math.hypot(q[0], q[1])
    cosine = math.cos(stack.shadow_half_angle)
    half = math.acos(min(1.0, cosine / max(tilt_sine, 1e-12)))
    if half < FIN_HALF:
        return tuple(pieces)
    if len(pieces) > 1:  # a full fan has beams on both sides of the sector, and those next to the ring must be free
        half = max(FIN_HALF, half - RING_MARGIN)
    centre = math.atan2(-q[1], -q[0])
    for turn in (-2 * math.pi, 0.0, 2 * math.pi):
        low, high = centre + turn - half, centre + turn + half
        pieces = [
            piece
            for start, end in pieces
            for piece in ((start, min(end, low)), (max(start, high), end))
            if piece[1] - piece[0] > 1e-3
        ]
    return tuple(pieces)


def _cross_azimuths(normal: Array) -> tuple[float, ...]:
    """Return the two of CROSS_AT on the side away from the plate."""
    towards = math.atan2(normal[1], normal[0]) if math.hypot(normal[0], normal[1]) > 1e-6 else 0.0
    middle = round(towards / (math.pi / 2) - 1e-6) * (math.pi / 2)
    return middle - math.pi / 4, middle + math.pi / 4
