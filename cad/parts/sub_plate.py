"""Sub-plate: between lidar and linkage where the hub would cover one of the lidar's screws.

Frame: made in the laser frame, returned in the rotation frame at gamma = 0 (`cad/layout/hub.py`), mm. On the
bench it is screwed to the lidar from below; then its two ears are screwed to the linkage from the lidar's side, where
nothing is in the way. The heads of the lidar's screws stand in pockets of the linkage.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import cadquery as cq
import numpy as np

from cad import outlines, solids
from cad.layout.drive import Stack
from cad.layout.envelope import EAR_REACH, EAR_SCREW, SUB_PLATE_THICKNESS, ear_corner, ear_screws
from cad.layout.joints import screws
from cad.layout.layout import Layout
from cad.layout.names import ALIGNMENT_LINKAGE, SUB_PLATE
from cad.parts.part_spec import PartSpec, Step
from cad.screws import SCREWS, passing_hole
from cad.solids import building, checked
from design.arrays import Array
from design.scanner import Scanner

CHAMFER = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SubPlate:
    """Lengths in mm, in the laser frame."""

    stack: Stack
    seat: float
    half_x: float
    half_y: float
    ears: tuple[float, float]  # half extents of the strip of the two ears
    front: float  # x of the edge at the front
    screw_hole: float  # diameter
    holes: tuple[tuple[float, float], ...]
    ear_hole: float  # diameter
    ear_holes: tuple[tuple[float, float], ...]


def sub_plate_spec(layout: Layout) -> PartSpec | None:
    """The sub-plate of one scanner; None where a driver reaches all screws of the lidar."""
    p = sub_plate_of(layout.scanner, layout.stack)
    if p is None:
        return None
    words = (
        "The hub covers one of the lidar's screws, so the lidar came on a plate of its own: put this plate on the "
        "linkage, FRONT over FRONT, and drive the screws of its ears from the lidar's side. "
        f"{screws(ALIGNMENT_LINKAGE)}"
    )
    return PartSpec(
        name=SUB_PLATE,
        turns=True,
        make=partial(sub_plate, p),
        step=Step("Lidar and sub-plate on the linkage", words),
        angles="laser",
        seat=p.seat,
        lifted="lidar",
    )


def sub_plate_of(scanner: Scanner, stack: Stack) -> SubPlate | None:
    """Parameters of the sub-plate of one scanner; None where a driver reaches all screws of the lidar."""
    if stack.sub_plate is None:
        return None
    lidar, printer = scanner.lidar, scanner.printer
    half_x = lidar.body_mm[0] / 2
    return SubPlate(
        stack=stack,
        seat=-lidar.optical_height_mm,
        half_x=half_x,
        half_y=lidar.body_mm[1] / 2,
        ears=ear_corner(lidar, stack.sub_plate),
        front=half_x + (EAR_REACH if stack.sub_plate == "x" else 0.0),
        screw_hole=passing_hole(SCREWS[lidar.mount_screw], printer),
        holes=lidar.mount_holes_mm,
        ear_hole=passing_hole(EAR_SCREW, printer),
        ear_holes=ear_screws(lidar, stack.sub_plate),
    )


def sub_plate(p: SubPlate) -> cq.Solid:
    """Make the sub-plate.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    low, high = p.seat - SUB_PLATE_THICKNESS, p.seat
    ears = f"{p.stack.sub_plate}"
    with building(SUB_PLATE, "plate and holes", "ears along", ears):
        body: cq.Shape = solids.prism(outlines.octagon(p.half_x, p.half_y, CHAMFER), low, high)
        body = body.fuse(solids.prism(outlines.octagon(*p.ears, CHAMFER), low, high))
        cuts = [solids.upright(p.screw_hole / 2, low - 1.0, high + 1.0, *hole) for hole in p.holes]
        cuts += [solids.upright(p.ear_hole / 2, low - 1.0, high + 1.0, *hole) for hole in p.ear_holes]
        cuts += [solids.prism(outline, low - 1.0, high + 1.0) for outline in plate_marks(p.front)]
        body = checked(body.cut(*cuts).clean(), SUB_PLATE, "plate and holes", "ears along", ears)
    return body.moved(solids.location(p.stack.R()))


def plate_marks(x: float) -> tuple[Array, Array]:
    """Outlines cut from a plate that ends at +-x: FRONT, a V at +x; a square notch at -x, below the cables."""
    front = np.array([[x - 3.0, 0.0], [x + 1.0, -4.0], [x + 1.0, 4.0]])
    rear = np.array([[-x - 2.0, -4.0], [3.0 - x, -4.0], [3.0 - x, 4.0], [-x - 2.0, 4.0]])
    return front, rear
