"""Sub-plate between lidar and linkage, used if the hub would cover a screw of the lidar, or no thread is in its base.

Frame: made in the laser frame, returned in the rotation frame at gamma = 0 (`cad/layout/hub.py`), mm. It is screwed to
the lidar on the bench; then its two ears are screwed to the linkage from the lidar's side. The heads of screws in the
base are in pockets of the linkage. A lidar with threads in its sides or rear is held there, by walls of the sub-plate.
"""

from functools import partial

import cadquery as cq
import numpy as np

from scanwright.cad import solids
from scanwright.cad.layout.envelope import (
    EAR_REACH,
    EAR_SCREW,
    cables_of,
    ear_corner,
    ear_screws,
    lidar_thread_mm,
    screw_travel_mm,
    side_walls,
    slot_ends,
    sub_plate_mm,
)
from scanwright.cad.layout.hub import Axis, Hub
from scanwright.cad.layout.joints import Joint, ScrewAxis, fixing_in, fixing_of, placed_axes, screws, upright_axes
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE, LIDAR_BODY, SUB_PLATE
from scanwright.cad.layout.placement import Placement
from scanwright.cad.parts.part_spec import PartSpec, Step
from scanwright.cad.screws import SCREWS, passing_hole
from scanwright.cad.solids import building
from scanwright.design.arrays import Array
from scanwright.design.scanner import Scanner

CHAMFER = 3.0
ABOVE = 200.0  # of the openings for cables: the lidar is put between the walls from above
OF_LIDAR = (
    "lidar.body_mm",
    "lidar.optical_height_mm",
    "lidar.window_z_mm",
    "lidar.holes",
    "lidar.ears_mm",
    "lidar.cable_y_mm",
    "lidar.cable_z_mm",
    "lidar.cable_diameter_mm",
    "lidar.cable_straight_mm",
)
"""Values that shape what carries it."""


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
        grip_mm=sub_plate_mm(scanner.lidar),
        thread_mm=p.plate - (0.0 if thread.trap is None else thread.trap.depth),
        thread=thread,
    )
    why = "the lidar has its threads in its sides" if p.walls else "the hub covers one of the lidar's screws"
    words = (
        f"{why.capitalize()}, so the lidar is on a separate plate: put this plate on the "
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
        shaped_by=OF_LIDAR if p.walls else (),
        joints=(lidar_joint(place, SUB_PLATE, sub_plate_mm(scanner.lidar)), on_linkage),
    )


def lidar_joint(place: Placement, part: str, grip: float) -> Joint:
    """Return the joint of the lidar with the linkage, or with its sub-plate."""
    p = place.linkage
    axes, heel = upright_axes(p.holes, p.seat - grip, 1.0), min(place.scanner.lidar.half_mm)
    if p.walls:
        inwards = [(-wall.outwards[0], -wall.outwards[1], 0.0) for wall in p.walls]
        axes = tuple(ScrewAxis(at, along) for wall, along in zip(p.walls, inwards, strict=True) for at in wall.screws)
        grip = max(wall.grip_mm for wall in p.walls)
        if len(p.walls) == 1:  # over the floor, or over the wall's upper edge
            heights = [z for _, _, z in p.walls[0].screws]
            heel = min(p.walls[0].box[1][2] - max(heights), min(heights) - p.seat)
    slot = (p.screw_hole, p.screw_hole + 2 * p.screw_travel) if p.screw_travel > 0 else None
    lidar = place.scanner.lidar
    return Joint(
        part,
        LIDAR_BODY,
        fixing_of(next(iter(lidar.held.values()))),
        p.screw,
        placed_axes(axes, p.stack.R()),
        grip_mm=grip,
        thread_mm=lidar_thread_mm(lidar),
        slot_mm=slot,
        heel_mm=heel if len(axes) == 2 else None,
    )


def sub_plate(scanner: Scanner, stack: Hub, axis: Axis) -> cq.Solid:
    """Make the sub-plate, its ears along an axis of the laser frame."""
    lidar, printer, walls = scanner.lidar, scanner.printer, side_walls(scanner.lidar)
    half_x, half_y = lidar.half_mm
    low, high = -lidar.optical_height_mm - sub_plate_mm(lidar), -lidar.optical_height_mm
    screw, ear_hole = SCREWS[next(iter(lidar.held.values())).screw], passing_hole(EAR_SCREW, printer) / 2
    hole = passing_hole(screw, printer) / 2
    with building(SUB_PLATE, "plate and holes", "ears along", axis) as checked:
        body: cq.Shape = solids.plate(half_x, half_y, CHAMFER, low, high)
        body = body.fuse(solids.plate(*ear_corner(lidar, axis), CHAMFER, low, high))
        for wall in walls:
            body = body.fuse(solids.box(*wall.box), solids.box(*wall.root))
        ends = [] if walls else [slot_ends(place, screw_travel_mm(lidar)) for place in lidar.base.places]
        cuts: list[cq.Shape] = [solids.slot(hole, *each, low - 1.0, high + 1.0) for each in ends]
        for wall in walls:
            outside = np.array(wall.outwards)
            length = sub_plate_mm(lidar) + 2.0
            cuts += [solids.cylinder(hole, at + outside, -outside, length) for at in np.array(wall.screws)]
        if "-x" in lidar.sides:
            cuts += [solids.box(corner, (x, y, ABOVE)) for corner, (x, y, _) in cables_of(lidar)]
        cuts += [solids.upright(ear_hole, low - 1.0, high + 1.0, *at) for at in ear_screws(lidar, axis)]
        front_x = max([half_x, *(wall.box[1][0] for wall in walls)])
        front = front_mark(front_x + (EAR_REACH if axis == "x" else 0.0))
        cuts.append(solids.prism(front, low - 1.0, high + 1.0))
        body = checked(body.cut(*cuts).clean())
    return body.moved(solids.location(stack.R()))


def front_mark(x: float, beyond: float = 2.0) -> Array:
    """Return FRONT: outline of a V cut from a plate that ends at x, continued beyond."""
    return np.array([[x - 3.0, 0.0], [x + 1.0, -4.0], [x + beyond, -4.0], [x + beyond, 4.0], [x + 1.0, 4.0]])
