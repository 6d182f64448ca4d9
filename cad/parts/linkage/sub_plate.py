"""Sub-plate between lidar and linkage, used if the hub would cover one of the lidar's screws.

Frame: made in the laser frame, returned in the rotation frame at gamma = 0 (`cad/layout/hub.py`), mm. It is screwed to
the lidar on the bench; then its two ears are screwed to the linkage from the lidar's side. The heads of the lidar's
screws are in pockets of the linkage.
"""

from functools import partial

import cadquery as cq
import numpy as np

from scanwright.cad import outlines, solids
from scanwright.cad.layout.envelope import (
    EAR_REACH,
    EAR_SCREW,
    PLATE_THICKNESS,
    SUB_PLATE_THICKNESS,
    ear_corner,
    ear_screws,
    screw_travel_mm,
    slot_ends,
)
from scanwright.cad.layout.hub import Axis, Hub
from scanwright.cad.layout.joints import Joint, fixing_in, fixing_of, lidar_thread_mm, placed_axes, screws, upright_axes
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE, LIDAR_BODY, SUB_PLATE
from scanwright.cad.layout.placement import Placement
from scanwright.cad.parts.part_spec import PartSpec, Step
from scanwright.cad.screws import SCREWS, passing_hole
from scanwright.cad.solids import building
from scanwright.design.arrays import Array
from scanwright.design.scanner import Scanner

CHAMFER = 3.0


def sub_plate_spec(place: Placement) -> PartSpec | None:
    """Return the sub-plate of one scanner; None if a driver reaches all screws of the lidar."""
    scanner, axis = place.scanner, place.stack.sub_plate
    if axis is None:
        return None
    p, thread = place.linkage, place.linkage.ear_thread
    on_linkage = Joint(
        SUB_PLATE,
        ALIGNMENT_LINKAGE,
        fixing_in(thread),
        EAR_SCREW,
        placed_axes(upright_axes(p.ear_screws, p.seat, -1.0), p.stack.R()),
        grip_mm=SUB_PLATE_THICKNESS,
        thread_mm=PLATE_THICKNESS - (0.0 if thread.trap is None else thread.trap.depth),
        thread=thread,
    )
    words = (
        "The hub covers one of the lidar's screws, so the lidar is on a separate plate: put this plate on the "
        "linkage, FRONT over FRONT, and drive the screws of its ears from the lidar's side. "
        f"{screws(ALIGNMENT_LINKAGE)}"
    )
    return PartSpec(
        name=SUB_PLATE,
        turns=True,
        make=partial(sub_plate, scanner, place.stack, axis),
        step=Step("Lidar and sub-plate on the linkage", words, "the two plates meet without a gap"),
        angles="laser",
        seat=p.seat,
        lifted="lidar",
        joints=(lidar_joint(place, SUB_PLATE, SUB_PLATE_THICKNESS), on_linkage),
    )


def lidar_joint(place: Placement, part: str, grip: float) -> Joint:
    """Return the joint of the lidar with the linkage, or with its sub-plate."""
    p = place.linkage
    axes = placed_axes(upright_axes(p.holes, p.seat - grip, 1.0), p.stack.R())
    slot = (p.screw_hole, p.screw_hole + 2 * p.screw_travel) if p.screw_travel > 0 else None
    lidar = place.scanner.lidar
    return Joint(
        part,
        LIDAR_BODY,
        fixing_of(lidar.base),
        p.screw,
        axes,
        grip_mm=grip,
        thread_mm=lidar_thread_mm(lidar),
        slot_mm=slot,
        heel_mm=min(lidar.half_mm) if len(p.holes) == 2 else None,
    )


def sub_plate(scanner: Scanner, stack: Hub, axis: Axis) -> cq.Solid:
    """Make the sub-plate, its ears along an axis of the laser frame."""
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
    """Return FRONT: outline of a V cut from a plate that ends at x, continued beyond."""
    return np.array([[x - 3.0, 0.0], [x + 1.0, -4.0], [x + beyond, -4.0], [x + beyond, 4.0], [x + 1.0, 4.0]])
