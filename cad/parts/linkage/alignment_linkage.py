"""Alignment linkage: carries the lidar on the shaft at exactly R_rot_laser, its optical centre on the axis.

Frame: rotation frame at gamma = 0 (`cad/layout/hub.py`), mm. A hub is on the shaft's spigot (blind bore with a flat at
+y, two screws that cross into it); a neck, the convex hull of hub and plate without all free space, leads to the plate
whose upper face is the lidar's seat. Marks: a V in the plate's edge at the lidar's +x (FRONT), a groove in the hub at
+y (index). If a bearing holds the shaft, the wires of the ring's rotor leave its sleeve through a channel of the hub.
Tabs of hub and plate have slots for cable ties. Under a sub-plate (`sub_plate.py`) the plate is lower, with nuts for
its ears and pockets for the heads of its screws. An ear of the hub carries a counterweight.
"""

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import cadquery as cq
import numpy as np

from scanwright.cad import outlines, solids
from scanwright.cad.geometry.blends import foot_blend
from scanwright.cad.geometry.mesh import checked_mesh
from scanwright.cad.layout.cables.obstacles import Shape, shape_of
from scanwright.cad.layout.envelope import BODY_GAP, EAR_REACH, around_axis, slot_ends
from scanwright.cad.layout.joints import screws
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE, LIDAR, LIDAR_BODY
from scanwright.cad.layout.placement import Placement
from scanwright.cad.layout.rotor.cross_screws import cross_joint
from scanwright.cad.layout.rotor.free_space import in_hull
from scanwright.cad.layout.rotor.linkage import AlignmentLinkage, neck_corners
from scanwright.cad.parts.linkage.fins import FAR, fins_of
from scanwright.cad.parts.linkage.linkage_hub import hub, hub_cuts, tie_lug, tie_slots
from scanwright.cad.parts.linkage.sub_plate import OF_LIDAR, front_mark, lidar_joint
from scanwright.cad.parts.part_spec import PartSpec, Step
from scanwright.cad.screws import Trap
from scanwright.cad.solids import building
from scanwright.design.arrays import Array
from scanwright.design.errors import BuildError

RETRIES = 5
WIDER = 0.03  # of the paths of drivers, in each attempt: they may graze the rim of the hub
TRAP_LENGTH = 15.0  # below the plate: the neck may begin there
MARK_LENGTH = 8.0  # of the mark beyond the plate: a neck that is thicker there keeps a wall
DRIVER_LENGTH = 150.0
DRIVER_DEEP = 8.0  # below the plate: height at which the wall next to a driver is measured, since the neck tapers
DRIVER_WALL = 3.0  # a thinner wall next to a driver is removed


def linkage_spec(place: Placement) -> PartSpec:
    """Return the linkage of one scanner; its step is in the spec of its shaft."""
    p = place.linkage
    shapes = {"printer.fit_clearance_mm": f"the bore of {ALIGNMENT_LINKAGE}"}
    if p.screw_travel > 0:
        slots = f"the slots of {ALIGNMENT_LINKAGE}, in which a screw may be {p.screw_travel:.2g} mm nearer or farther"
        shapes["lidar.holes"] = slots
    return PartSpec(
        name=ALIGNMENT_LINKAGE,
        turns=True,
        make=partial(alignment_linkage, p),
        shaped_by=OF_LIDAR,
        shapes=shapes,
        angles="laser",
        seat=p.top,
        joints=(
            cross_joint(p, place.drive.shaft),
            *([] if p.ears is not None else [lidar_joint(place, ALIGNMENT_LINKAGE, p.plate)]),
        ),
        avoid=tuple(_around(place)),
        steps={LIDAR: _lidar_step(p)},
    )


def _lidar_step(p: AlignmentLinkage) -> Step:
    return Step(
        "Lidar on its seat",
        "On the bench: put the lidar on its seat, its front towards the V in the edge (FRONT), its cables to the other "
        f"side. {'Press it onto the seat while you tighten. ' if p.walls else ''}{screws(LIDAR_BODY)}",
        "no light shows under the lidar: a gap of 0.1 mm tilts its plane by about a tenth of a degree",
    )


def _around(place: Placement) -> Iterator[Shape]:
    """Yield the hub, tabs, and the neck, from which the channels of the cables are cut."""
    p, stack = place.linkage, place.stack
    yield shape_of(around_axis(stack.hub_radius, stack.shoulder, -stack.h))
    for tie in p.plate_ties:
        yield shape_of(tie.corners(tie.inner) @ stack.R().T)
    if p.hub_tie is not None:
        yield shape_of(p.hub_tie.corners(stack.hub_radius))
    yield shape_of(place.neck, carved=True)


def alignment_linkage(p: AlignmentLinkage) -> cq.Solid:
    """Make the linkage.

    A sliver between two cuts can open the mesh of a valid solid; further attempts leave the blends out, then turn the
    neck a little and widen the paths of drivers. The frame chain does not change.

    Raises:
        BuildError: no attempt gave one valid watertight solid.
    """
    fault = None
    for attempt, blended in ((0, True), *((each, False) for each in range(RETRIES + 1))):
        try:
            return _attempt(p, attempt, blended)
        except BuildError as error:
            fault = fault or error
    raise BuildError(f"{fault} (after {RETRIES + 2} attempts)")


@dataclass(frozen=True, slots=True)
class Shapes:
    """The shapes of the linkage, in place: `alignment_linkage` and the preview join them in the same order.

    Plate and neck, without free space and fins, of which the body of the plate is kept; with the hub, without the free
    space; without the holes.
    """

    plate: cq.Shape
    neck: cq.Shape
    blends: list[cq.Shape]  # of neck and plate
    free_space: list[cq.Shape]  # of the lidar, its cables, and the drivers of its screws
    fins: list[cq.Shape]  # the fan, and fins of the neck
    hub: cq.Shape
    holes: list[cq.Shape]  # and marks


def shapes_of(p: AlignmentLinkage, attempt: int = 0, blended: bool = True) -> Shapes:
    """Return the shapes, with or without blends; `attempt` turns the neck a little, and widens the paths of drivers."""
    with building(ALIGNMENT_LINKAGE, "plate and neck", "tilt", _tilt(p)):
        laser = solids.location(p.stack.R())
        fan = [solids.sector(min(p.half_x, p.half_y), FAR, start, end, *p.fan_z) for start, end in p.fan]
        corners = neck_corners(p, attempt)
        neck = corners @ p.stack.R()
        fins = fins_of(p.top, p.body, p.cables, neck)
        if p.ears is not None:  # those of the sub-plate lie on them
            fins = [fin.cut(_ears(p)) for fin in fins]
        fins = [*fan, *fins, *_opened(p, neck)]
        marked = [*_holes(p), _plate_mark(p, neck), *(slot for tie in p.plate_ties for slot in tie_slots(tie))]
        return Shapes(
            plate=_plate(p).moved(laser),
            neck=solids.hull(corners),
            blends=[solids.hull(each) for each in blends_of(p, corners)] if blended else [],
            free_space=[shape.moved(laser) for shape in (*_lidar_space(p), *_drivers(p, attempt))],
            fins=[shape.moved(laser) for shape in fins],
            hub=hub(p),
            holes=[*(shape.moved(laser) for shape in marked), *hub_cuts(p)],
        )


def _attempt(p: AlignmentLinkage, attempt: int, blended: bool) -> cq.Solid:
    tilt, stack, shapes = _tilt(p), p.stack, shapes_of(p, attempt, blended)
    with building(ALIGNMENT_LINKAGE, "plate and neck", "tilt", tilt) as checked:
        body: cq.Shape = checked(shapes.plate.fuse(shapes.neck, *shapes.blends))
    with building(ALIGNMENT_LINKAGE, "free space of lidar, cables and fan", "tilt", tilt):
        # small loose pieces next to the plate are dropped
        body = _largest(body.cut(*shapes.free_space, *shapes.fins))
    with building(ALIGNMENT_LINKAGE, "hub", "h", f"{stack.h} mm") as checked:
        body = checked(body.fuse(shapes.hub).cut(*shapes.free_space))
    with building(ALIGNMENT_LINKAGE, "holes and marks", "h", f"{stack.h} mm") as checked:
        linkage = checked(body.cut(*shapes.holes).clean())
    bottom = linkage.BoundingBox().zmin
    if abs(bottom - stack.shoulder) > 1e-3:
        raise BuildError(
            f"{ALIGNMENT_LINKAGE}: hub: h = {stack.h} mm: the part reaches down to {bottom:.3f}, below the hub"
        )
    checked_mesh(linkage, ALIGNMENT_LINKAGE)
    return linkage


def _tilt(p: AlignmentLinkage) -> str:
    return f"{math.degrees(math.acos(min(1.0, p.stack.R()[2, 2]))):.3f} deg"


def _lidar_space(p: AlignmentLinkage) -> list[cq.Solid]:
    """Return the space for inserting the lidar along its z: body and cables, swept upwards."""
    over = [box for box in (p.body, p.ears) if box is not None]
    boxes = [*(((x, y, p.top), high) for (x, y, _), high in over), *p.cables]
    return [solids.box(low, (x, y, FAR)) for low, (x, y, _) in boxes]


def _plate(p: AlignmentLinkage) -> cq.Shape:
    """Return the plate with its tabs, and under a sub-plate its ears."""
    low = p.top - p.plate
    plate: cq.Shape = solids.plate(p.half_x, p.half_y, p.chamfer, low, p.top)
    if p.plate_ties:
        plate = plate.fuse(*(tie_lug(tie) for tie in p.plate_ties))
    if p.ears is None:
        return plate
    return plate.fuse(_ears(p))


def blends_of(p: AlignmentLinkage, neck: Array) -> list[Array]:
    """Return the corners of the blends of a neck (n, 3) with the plate's lower face."""
    below = p.stack.R() @ np.diag([1.0, -1.0, -1.0])  # the laser frame upside down
    outline = outlines.octagon(p.half_x, p.half_y, p.chamfer)
    return [each @ below.T for each in foot_blend(neck @ below, p.plate - p.top, outline)]


def _ears(p: AlignmentLinkage) -> cq.Solid:
    """Return the ears under those of the sub-plate, and the plate between them."""
    assert p.ears is not None
    (x0, y0, _), (x1, y1, _) = p.ears
    low, high = p.top - p.plate, p.top
    corners = (x0 + BODY_GAP, y0 + BODY_GAP, low), (x1 - BODY_GAP, y1 - BODY_GAP, high)
    return solids.slab(*corners, outlines.HAND)


def _drivers(p: AlignmentLinkage, attempt: int) -> list[cq.Shape]:
    """Return heads and drivers of the base screws, from the plate's lower face along -z of the laser frame."""
    if p.ears is not None:
        return []
    low = p.top - p.plate
    return _for_screws(p, p.screw.driver_radius + WIDER * attempt, low - DRIVER_LENGTH, low)


def _opened(p: AlignmentLinkage, neck: Array) -> list[cq.Shape]:
    """Return cuts outwards from drivers or heads near the surface, which would leave a skin."""
    low, high = p.top - p.plate - DRIVER_LENGTH, p.top - p.plate
    below = high - DRIVER_DEEP
    if p.ears is not None:
        low, high = _pockets(p)
        below = low
    opened = []
    for place in p.holes:
        out = np.array(place) / math.hypot(*place)
        fins = np.array([[*(place + (p.screw.driver_radius + DRIVER_WALL) * out), below]])
        if not in_hull(fins, neck, 0.0).any():
            end = place + 2 * max(p.half_x, p.half_y) * out
            opened.append(solids.slot(p.screw.driver_radius, place, end.tolist(), low, high))
    return opened


def _pockets(p: AlignmentLinkage) -> tuple[float, float]:
    """Return heights of the pockets for the heads of the lidar's screws, under a sub-plate."""
    return p.top - p.screw.head_height - 0.5, p.top + 1.0


def _for_screws(p: AlignmentLinkage, radius: float, low: float, high: float) -> list[cq.Shape]:
    """Return cuts for the base screws: round ones, or as long as their slots."""
    return [solids.slot(radius, *slot_ends(place, p.screw_travel), low, high) for place in p.holes]


def _holes(p: AlignmentLinkage) -> list[cq.Shape]:
    """Return holes of the base screws; under a sub-plate pockets for their heads, and threads for the ears."""
    if p.ears is None:
        return _for_screws(p, p.screw_hole / 2, p.top - p.plate - 2.0, p.top + 1.0)
    pockets = _for_screws(p, p.screw.driver_radius, *_pockets(p))
    low = p.top - p.plate - 1.0
    traps = [] if p.ear_thread.trap is None else [_ear_trap(p, p.ear_thread.trap, hole) for hole in p.ear_screws]
    return pockets + traps + [solids.upright(p.ear_thread.hole / 2, low, p.top + 1.0, *hole) for hole in p.ear_screws]


def _ear_trap(p: AlignmentLinkage, trap: Trap, hole: tuple[float, float]) -> cq.Solid:
    """Return the pocket of a nut in the plate's lower face, its flats towards the ends of the ear."""
    outline = outlines.polygon(trap.corner, 6, 0.0 if p.stack.sub_plate == "x" else math.pi / 2) + hole
    low = p.top - p.plate
    return solids.prism(outline, low - TRAP_LENGTH, low + trap.depth)


def _plate_mark(p: AlignmentLinkage, neck: Array) -> cq.Solid:
    """Return FRONT: a V in the edge at +x, half the plate deep, and through the neck there. Laser frame."""
    x = p.half_x if p.stack.sub_plate != "x" else p.half_x + EAR_REACH
    low, high = p.top - p.plate / 2, p.top + 1.0
    beyond = np.arange(2.0, MARK_LENGTH, 0.5)
    ends = np.array(list(itertools.product(x + beyond, (-4.0, 0.0, 4.0), (low, high))))
    free = ~in_hull(ends, neck, 0.1).reshape(len(beyond), -1).any(axis=1)
    return solids.prism(front_mark(x, float(beyond[np.argmax(free)])), low, high)


def _largest(shape: cq.Shape) -> cq.Shape:
    """Return the body that holds the plate; pieces under 2 % of it are dropped, a larger one is a broken neck."""
    bodies = sorted(shape.Solids(), key=lambda solid: -solid.Volume())
    if len(bodies) > 1 and bodies[1].Volume() < 0.02 * bodies[0].Volume():
        return bodies[0]
    return shape
