"""Sub-plate: between lidar and linkage where the hub would cover one of the lidar's screws.

Frame: made in the laser frame, returned in the rotation frame at gamma = 0 (`cad/layout/hub.py`), mm. On the
bench it is screwed to the lidar from below; then its two ears are screwed to the linkage from the lidar's side, where
nothing is in the way. The heads of the lidar's screws stand in pockets of the linkage.
"""

from __future__ import annotations

from functools import partial

import cadquery as cq
import numpy as np

from scanwright.cad import outlines, solids
from scanwright.cad.layout.drive import Stack
from scanwright.cad.layout.envelope import (
    EAR_REACH,
    EAR_SCREW,
    SUB_PLATE_THICKNESS,
    ear_corner,
    ear_screws,
    screw_travel_mm,
    slot_ends,
)
from scanwright.cad.layout.hub import Axis
from scanwright.cad.layout.joints import screws
from scanwright.cad.layout.layout import Layout
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE, SUB_PLATE
from scanwright.cad.parts.part_spec import PartSpec, Step
from scanwright.cad.screws import SCREWS, passing_hole
from scanwright.cad.solids import building
from scanwright.design.arrays import Array
from scanwright.design.scanner import Scanner

CHAMFER = 3.0


def sub_plate_spec(layout: Layout) -> PartSpec | None:
    """The sub-plate of one scanner; None where a driver reaches all screws of the lidar."""
    scanner, axis = layout.scanner, layout.stack.sub_plate
    if axis is None:
        return None
    words = (
        "The hub covers one of the lidar's screws, so the lidar came on a plate of its own: put this plate on the "
        "linkage, FRONT over FRONT, and drive the screws of its ears from the lidar's side. "
        f"{screws(ALIGNMENT_LINKAGE)}"
    )
    return PartSpec(
        name=SUB_PLATE,
        turns=True,
        make=partial(sub_plate, scanner, layout.stack, axis),
        step=Step("Lidar and sub-plate on the linkage", words, "the two plates meet without a gap"),
        angles="laser",
        seat=layout.linkage.seat,
        lifted="lidar",
    )


def sub_plate(scanner: Scanner, stack: Stack, axis: Axis) -> cq.Solid:
    """Make the sub-plate, its ears along an axis of the laser frame.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    lidar, printer = scanner.lidar, scanner.printer
    half_x, half_y = lidar.half_mm
    low, high = -lidar.optical_height_mm - SUB_PLATE_THICKNESS, -lidar.optical_height_mm
    hole, ear_hole = passing_hole(SCREWS[lidar.base.screw], printer) / 2, passing_hole(EAR_SCREW, printer) / 2
    with building(SUB_PLATE, "plate and holes", "ears along", axis) as checked:
        body: cq.Shape = solids.prism(outlines.octagon(half_x, half_y, CHAMFER), low, high)
        body = body.fuse(solids.prism(outlines.octagon(*ear_corner(lidar, axis), CHAMFER), low, high))
        ends = [slot_ends(place, screw_travel_mm(lidar)) for place in lidar.base.places]
        cuts = [solids.slot(hole, *each, low - 1.0, high + 1.0) for each in ends]
        cuts += [solids.upright(ear_hole, low - 1.0, high + 1.0, *at) for at in ear_screws(lidar, axis)]
        front = front_mark(half_x + (EAR_REACH if axis == "x" else 0.0))
        cuts.append(solids.prism(front, low - 1.0, high + 1.0))
        body = checked(body.cut(*cuts).clean())
    return body.moved(solids.location(stack.R()))


def front_mark(x: float, beyond: float = 2.0) -> Array:
    """FRONT: outline of a V that is cut from a plate where it ends at x, and goes on beyond."""
    return np.array([[x - 3.0, 0.0], [x + 1.0, -4.0], [x + beyond, -4.0], [x + beyond, 4.0], [x + 1.0, 4.0]])
