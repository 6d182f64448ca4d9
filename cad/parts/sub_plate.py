"""Sub-plate: between lidar and linkage where the hub would cover one of the lidar's screws.

Frame: made in the laser frame, returned in the rotation frame at gamma = 0 (`cad/layout/direct_stack.py`), mm. On the
bench it is screwed to the lidar from below; then its two ears are screwed to the linkage from the lidar's side, where
nothing is in the way. The heads of the lidar's screws stand in pockets of the linkage.
"""

from __future__ import annotations

from dataclasses import dataclass

import cadquery as cq
import numpy as np

from cad import solids
from cad.layout.direct_stack import BODY_GAP, EAR_REACH, SUB_PLATE, ear_corner
from cad.layout.head import Axis, Head
from cad.screws import SCREWS
from cad.solids import building, checked
from design.catalogue.products import Lidar
from design.frames import Array
from design.scanner import Scanner

PART = "sub_plate"
EAR_SCREW = SCREWS["M3"]
EAR_SCREW_OFFSET = 5.5  # half the distance of the two screws of an ear
CHAMFER = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SubPlate:
    """Lengths in mm, in the laser frame."""

    stack: Head
    seat: float
    half_x: float
    half_y: float
    ears: tuple[float, float]  # half extents of the strip of the two ears
    front: float  # x of the edge at the front
    screw_hole: float  # diameter
    holes: tuple[tuple[float, float], ...]
    ear_hole: float  # diameter
    ear_holes: tuple[tuple[float, float], ...]


def sub_plate_of(scanner: Scanner, stack: Head) -> SubPlate | None:
    """Parameters of the sub-plate of one scanner; None where a driver reaches all screws of the lidar."""
    if stack.sub_plate is None:
        return None
    lidar, clearance = scanner.lidar, scanner.printer.screw_clearance_mm
    half_x = lidar.body_mm[0] / 2
    return SubPlate(
        stack=stack,
        seat=-lidar.optical_height_mm,
        half_x=half_x,
        half_y=lidar.body_mm[1] / 2,
        ears=ear_corner(lidar, stack.sub_plate),
        front=half_x + (EAR_REACH if stack.sub_plate == "x" else 0.0),
        screw_hole=SCREWS[lidar.mount_screw].nominal + clearance,
        holes=lidar.mount_holes_mm,
        ear_hole=EAR_SCREW.nominal + clearance,
        ear_holes=ear_screws(lidar, stack.sub_plate),
    )


def ear_screws(lidar: Lidar, axis: Axis) -> tuple[tuple[float, float], ...]:
    """Centres of the ears' screws: their heads stand clear of the lidar's body."""
    half = (lidar.body_mm[0] if axis == "x" else lidar.body_mm[1]) / 2
    away = half + BODY_GAP + EAR_SCREW.head_room + 0.5
    along = [(sign * away, side * EAR_SCREW_OFFSET) for sign in (1, -1) for side in (1, -1)]
    return tuple(along if axis == "x" else [(y, x) for x, y in along])


def sub_plate(p: SubPlate) -> cq.Solid:
    """Make the sub-plate.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    low, high = p.seat - SUB_PLATE, p.seat
    ears = f"{p.stack.sub_plate}"
    with building(PART, "plate and holes", "ears along", ears):
        body: cq.Shape = solids.prism(solids.octagon(p.half_x, p.half_y, CHAMFER), low, high)
        body = body.fuse(solids.prism(solids.octagon(*p.ears, CHAMFER), low, high))
        cuts = [solids.upright(p.screw_hole / 2, low - 1.0, high + 1.0, *hole) for hole in p.holes]
        cuts += [solids.upright(p.ear_hole / 2, low - 1.0, high + 1.0, *hole) for hole in p.ear_holes]
        cuts += [solids.prism(outline, low - 1.0, high + 1.0) for outline in plate_marks(p.front)]
        body = checked(body.cut(*cuts).clean(), PART, "plate and holes", "ears along", ears)
    return body.moved(solids.location(p.stack.R()))


def plate_marks(x: float) -> tuple[Array, Array]:
    """Outlines cut from a plate that ends at +-x: FRONT, a V at +x; a square notch at -x, below the cables."""
    front = np.array([[x - 3.0, 0.0], [x + 1.0, -4.0], [x + 1.0, 4.0]])
    rear = np.array([[-x - 2.0, -4.0], [3.0 - x, -4.0], [3.0 - x, 4.0], [-x - 2.0, 4.0]])
    return front, rear
