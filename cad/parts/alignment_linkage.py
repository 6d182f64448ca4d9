"""Alignment linkage: carries the lidar on the shaft at exactly R_rot_laser, its optical centre on the axis.

Frame: rotation frame at gamma = 0 (`cad/layout/hub.py`), mm. A hub clamps the shaft's spigot (blind bore
with a flat at +y, two radial screws on the free side); a neck, the convex hull of hub and plate less all that must
stay free, leads to the plate whose upper face is the lidar's seat. Marks: a V in the plate's edge at the lidar's +x
(FRONT), a square notch at its -x below the cables, a groove in the hub at +y (index). Where a bearing holds the hub,
its lower end is the journal of the bearing, and the wires of the ring's rotor pass the bearing in a channel along the
journal. Under a sub-plate (`sub_plate.py`) the plate lies lower, with threads for its ears and pockets for the heads
of its screws. Where a counterweight balances the rotor, an ear of the hub carries it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import cadquery as cq
import numpy as np

from cad import outlines, solids
from cad.geometry.mesh import checked_mesh
from cad.layout.belt.stack import BeltStack
from cad.layout.direct.loads import JOURNAL_WALL
from cad.layout.envelope import BODY_GAP, EAR_REACH, PLATE_THICKNESS
from cad.layout.fits import OnSheet, printed_journal
from cad.layout.joints import screws
from cad.layout.layout import Layout
from cad.layout.linkage import CLAMP_DRIVER, SPOT_FACE, AlignmentLinkage, Ear, neck_corners
from cad.layout.names import ALIGNMENT_LINKAGE, MAIN_SHAFT, SERVO_SHAFT
from cad.parts.fins import FAR, fins_beside
from cad.parts.part_spec import PartSpec, Step, shapes
from cad.parts.sub_plate import plate_marks
from cad.screws import Trap
from cad.solids import building, checked
from design.errors import BuildError

INNER_RING = 1.2  # how far the hub's face may touch the bearing's inner ring, on the radius
WIRES_HALF_WIDTH = 5.0
WIRES_ABOVE = 7.0  # height of the wires' way out above the bearing
EAR_CORNER = 0.3  # of its half width
RETRIES = 5
TRAP_WAY = 15.0  # below the plate: the neck may begin there
TRAP_WALL = 1.2  # between wires and a nut
BELT_WORDS = (
    "Lower the hub onto the upper end of the shaft until it sits on the end; the flat of the shaft fits one "
    f"way only. {screws(MAIN_SHAFT)} Now set the belt: with the servo still at its centre turn the linkage, and the "
    "shaft in its loose pulley, until the groove of the hub stands over the groove in the edge of the tower's "
    "top, and tighten the pulley's two grub screws. Both pulleys have the same number of teeth and turn the "
    "same way, so from now on the servo's angle is that of the axis."
)


def linkage_spec(layout: Layout) -> PartSpec:
    """The linkage of one scanner."""
    p, stack = layout.linkage, layout.stack
    words = (
        "Lower the hub onto the upper end of the shaft until it sits on the end; the flat of the shaft fits one way "
        f"only, and the groove of the hub then stands above the groove of the flange. {screws(SERVO_SHAFT)}"
    )
    step = Step("Linkage on the shaft", words)
    if isinstance(stack, BeltStack):
        step = Step("Linkage on the shaft, and the belt set", BELT_WORDS)
    of_lidar = ("body_mm", "optical_height_mm", "window_z_mm", "mount_screw", "mount_holes_mm")
    of_cables = ("cable_y_mm", "cable_z_mm", "cable_diameter_mm", "cable_straight_mm")
    return PartSpec(
        name=ALIGNMENT_LINKAGE,
        turns=True,
        make=partial(alignment_linkage, p),
        step=step,
        sheet=OnSheet(() if stack.bearing is None else (printed_journal(stack.bearing, p.fit),)),
        shaped_by=shapes(ALIGNMENT_LINKAGE, *(f"lidar.{field}" for field in (*of_lidar, *of_cables)), "bearing.bore_mm")
        | shapes(f"the bore of {ALIGNMENT_LINKAGE}", "printer.fit_clearance_mm"),
        angles="laser",
        seat=p.top,
    )


def alignment_linkage(p: AlignmentLinkage) -> cq.Solid:
    """Make the linkage.

    A sliver where two cuts nearly meet can open the mesh of a valid solid; the neck, and only the neck, is then
    turned a little and made again, so that the height, and with it the frame chain, stays what `sizing` said.

    Raises:
        BuildError: no attempt gave one valid watertight solid.
    """
    fault = None
    for attempt in range(RETRIES + 1):
        try:
            return _attempt(p, attempt)
        except BuildError as error:
            fault = fault or error
    raise BuildError(f"{fault} (after {RETRIES + 1} attempts)")


@dataclass(frozen=True, slots=True)
class Shapes:
    """What the linkage is made of, each in its place: `alignment_linkage` and the preview put it together.

    Both do it in this order: plate and neck, less room and beside, of which the body of the plate stays; with the hub,
    less the room; less the holes.
    """

    plate: cq.Shape
    neck: cq.Shape
    room: list[cq.Shape]  # of the lidar, its cables, and the drivers of its screws
    beside: list[cq.Shape]  # the fan, and fins of the neck
    hub: cq.Shape
    holes: list[cq.Shape]  # and marks


def shapes_of(p: AlignmentLinkage, attempt: int = 0) -> Shapes:
    """The shapes; `attempt` turns the neck a little.

    Raises:
        BuildError: the kernel fails at one.
    """
    with building(ALIGNMENT_LINKAGE, "plate and neck", "tilt", _tilt(p)):
        laser = solids.location(p.stack.R())
        fan = [solids.sector(min(p.half_x, p.half_y), FAR, start, end, *p.fan_z) for start, end in p.fan]
        neck = neck_corners(p, attempt) @ p.stack.R()
        beside = [*fan, *fins_beside(p.top, p.body, p.cables, neck)]
        marked = [*_holes(p), *_plate_marks(p)]
        round_the_axis = [*_clamps(p), *_wires(p), _index_groove(p), _bore(p), *_ear_slots(p)]
        return Shapes(
            plate=_plate(p).moved(laser),
            neck=_neck(p, attempt),
            room=[shape.moved(laser) for shape in (*_lidar_room(p), *_drivers(p))],
            beside=[shape.moved(laser) for shape in beside],
            hub=_hub(p),
            holes=[*(shape.moved(laser) for shape in marked), *round_the_axis],
        )


def _attempt(p: AlignmentLinkage, attempt: int) -> cq.Solid:
    tilt, stack, shapes = _tilt(p), p.stack, shapes_of(p, attempt)
    with building(ALIGNMENT_LINKAGE, "plate and neck", "tilt", tilt):
        body: cq.Shape = checked(shapes.plate.fuse(shapes.neck), ALIGNMENT_LINKAGE, "plate and neck", "tilt", tilt)
    with building(ALIGNMENT_LINKAGE, "free room of lidar, cables and fan", "tilt", tilt):
        # the slab may leave loose crumbs beside the plate: the load path is what holds the plate
        body = _largest(body.cut(*shapes.room, *shapes.beside))
    with building(ALIGNMENT_LINKAGE, "hub", "h", f"{stack.h} mm"):
        body = checked(body.fuse(shapes.hub).cut(*shapes.room), ALIGNMENT_LINKAGE, "hub", "h", f"{stack.h} mm")
    with building(ALIGNMENT_LINKAGE, "holes and marks", "h", f"{stack.h} mm"):
        linkage = checked(body.cut(*shapes.holes).clean(), ALIGNMENT_LINKAGE, "holes and marks", "h", f"{stack.h} mm")
    bottom = linkage.BoundingBox().zmin
    if abs(bottom - stack.hub_bottom) > 1e-3:
        raise BuildError(
            f"{ALIGNMENT_LINKAGE}: hub: h = {stack.h} mm: the part reaches down to {bottom:.3f}, below the hub"
        )
    checked_mesh(linkage, ALIGNMENT_LINKAGE)
    return linkage


def _tilt(p: AlignmentLinkage) -> str:
    return f"{math.degrees(math.acos(min(1.0, p.stack.R()[2, 2]))):.3f} deg"


def _neck(p: AlignmentLinkage, attempt: int) -> cq.Solid:
    return solids.hull(neck_corners(p, attempt))


def _lidar_room(p: AlignmentLinkage) -> list[cq.Solid]:
    """What must stay free so that the lidar can be put in along its own z: body and cables, swept upwards."""
    (x0, y0, _), (x1, y1, _) = p.body
    room = [solids.box((x0, y0, p.top), (x1, y1, FAR))]
    if p.ears is not None:
        (x0, y0, _), (x1, y1, _) = p.ears
        room.append(solids.box((x0, y0, p.top), (x1, y1, FAR)))
    for (cx0, cy0, cz0), (cx1, cy1, _) in p.cables:
        room.append(solids.box((cx0, cy0, cz0), (cx1, cy1, FAR)))
    return room


def _plate(p: AlignmentLinkage) -> cq.Shape:
    """The plate, and under a sub-plate its ears."""
    low = p.top - PLATE_THICKNESS
    plate: cq.Shape = solids.prism(outlines.octagon(p.half_x, p.half_y, p.chamfer), low, p.top)
    if p.ears is None:
        return plate
    (x0, y0, _), (x1, y1, _) = p.ears
    return plate.fuse(solids.box((x0 + BODY_GAP, y0 + BODY_GAP, low), (x1 - BODY_GAP, y1 - BODY_GAP, p.top)))


def _drivers(p: AlignmentLinkage) -> list[cq.Solid]:
    """Heads and drivers of the base screws, from the plate's lower face along -z of the laser frame."""
    if p.ears is not None:
        return []
    low = p.top - PLATE_THICKNESS
    return [solids.upright(p.screw.head_room, low - 150.0, low, *hole) for hole in p.holes]


def _holes(p: AlignmentLinkage) -> list[cq.Solid]:
    """Of the base screws; under a sub-plate pockets for their heads, and threads for the ears."""
    if p.ears is None:
        low = p.top - PLATE_THICKNESS - 2.0
        return [solids.upright(p.screw_hole / 2, low, p.top + 1.0, *hole) for hole in p.holes]
    pocket = p.top - p.screw.head_height - 0.5
    pockets = [solids.upright(p.screw.head_room, pocket, p.top + 1.0, *hole) for hole in p.holes]
    low = p.top - PLATE_THICKNESS - 1.0
    traps = [] if p.clamp_thread.trap is None else [_ear_trap(p, p.clamp_thread.trap, hole) for hole in p.ear_screws]
    return pockets + traps + [solids.upright(p.ear_thread.hole / 2, low, p.top + 1.0, *hole) for hole in p.ear_screws]


def _ear_trap(p: AlignmentLinkage, trap: Trap, hole: tuple[float, float]) -> cq.Solid:
    """Pocket in the plate's lower face and the nut's way into it; its flats face the ends of the ear."""
    outline = outlines.polygon(trap.corner, 6, 0.0 if p.stack.sub_plate == "x" else math.pi / 2) + hole
    low = p.top - PLATE_THICKNESS
    return solids.prism(outline, low - TRAP_WAY, low + trap.depth)


def _hub(p: AlignmentLinkage) -> cq.Shape:
    """The hub, and below its shoulder the journal of the bearing with a step that only the inner ring touches."""
    stack = p.stack
    hub: cq.Shape = solids.upright(stack.hub_radius, stack.shoulder, -stack.h)
    if p.ear is not None:
        hub = hub.fuse(_ear(p.ear, p.stack.shaft_diameter))
    if stack.bearing is None:
        return hub
    step = solids.upright(stack.bearing.bore_mm / 2 + INNER_RING, stack.bearing_top, stack.shoulder + 1.0)
    return hub.fuse(step, solids.upright(_journal_radius(p), stack.hub_bottom, stack.shoulder + 1.0))


def _ear(ear: Ear, start: float) -> cq.Shape:
    corner = EAR_CORNER * ear.half_width
    middle = np.array([(ear.end + start) / 2, 0.0])
    outline = outlines.octagon(ear.end - middle[0], ear.half_width, corner) + middle
    return solids.prism(outline, ear.low, ear.high).moved(solids.about_axis(ear.azimuth))


def _ear_slots(p: AlignmentLinkage) -> list[cq.Shape]:
    """Slots with round ends, along the radius."""
    if p.ear is None:
        return []
    ear, radius, cuts = p.ear, p.ear.slot_width / 2, []
    low, high = ear.low - 1.0, ear.high + 1.0
    for first, last in ear.slots:
        ends = [solids.upright(radius, low, high, r, 0.0) for r in (first, last)]
        cuts.append(
            solids.box((first, -radius, low), (last, radius, high)).fuse(*ends).moved(solids.about_axis(ear.azimuth))
        )
    return cuts


def _journal_radius(p: AlignmentLinkage) -> float:
    """A light press in the bearing: half of the sliding fit."""
    bearing = p.stack.bearing
    return 0.0 if bearing is None else bearing.bore_mm / 2 - p.fit / 4


def _wires(p: AlignmentLinkage) -> list[cq.Solid]:
    """Channel between the two radial screws: along the journal, inside the bearing, then out over the cage."""
    stack = p.stack
    if stack.bearing is None or stack.ring_length == 0:
        return []
    inner = (stack.shaft_diameter + p.fit) / 2 + JOURNAL_WALL
    if p.clamp_thread.trap is not None:  # clear of the corners of the traps on either side
        beside = _trap_floor(p, p.clamp_thread.trap) + p.clamp_thread.trap.across / 2
        inner = max(inner, beside * math.sqrt(0.5) + TRAP_WALL)
    low = (inner, -WIRES_HALF_WIDTH, stack.hub_bottom - 1.0)
    channel = solids.box(low, (stack.hub_radius + 20.0, WIRES_HALF_WIDTH, stack.shoulder + WIRES_ABOVE))
    return [channel.rotate(cq.Vector(0, 0, 0), cq.Vector(0, 0, 1), math.degrees(_free_side(p)))]


def _free_side(p: AlignmentLinkage) -> float:
    """Azimuth between the two radial screws."""
    return sum(p.clamp_azimuths) / 2


def _clamps(p: AlignmentLinkage) -> list[cq.Solid]:
    stack = p.stack
    cuts = []
    for azimuth in p.clamp_azimuths:
        out = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
        centre = np.array([0.0, 0.0, stack.clamp])
        cuts.append(solids.cylinder(p.clamp_thread.hole / 2, centre, out, 80.0))
        cuts.append(solids.cylinder(CLAMP_DRIVER / 2, centre + (stack.hub_radius - SPOT_FACE) * out, out, 80.0))
        if (
            p.clamp_thread.trap is not None
        ):  # from within the bore, where the shaft holds the nut in and the screw pushes it out
            frame = np.stack([[-out[1], out[0], 0.0], [0.0, 0.0, 1.0], out], axis=1)
            pocket = solids.prism(
                outlines.polygon(p.clamp_thread.trap.corner, 6, math.pi / 2), 0.0, _trap_floor(p, p.clamp_thread.trap)
            )
            cuts.append(pocket.moved(solids.location(frame, centre)))
    return cuts


def _trap_floor(p: AlignmentLinkage, trap: Trap) -> float:
    """Distance from the axis of the floor of a radial screw's nut trap."""
    return (p.stack.shaft_diameter + p.fit) / 2 + trap.depth


def _bore(p: AlignmentLinkage) -> cq.Shape:
    """Room of the spigot: a cylinder with a flat at +y."""
    stack = p.stack
    radius = (stack.shaft_diameter + p.fit) / 2
    round_bore = solids.upright(radius, stack.hub_bottom - 1.0, stack.spigot_top)
    low = (-2 * radius, -2 * radius, stack.hub_bottom - 2.0)
    return round_bore.intersect(solids.box(low, (2 * radius, stack.flat + p.fit / 2, stack.spigot_top + 1.0)))


def _index_groove(p: AlignmentLinkage) -> cq.Solid:
    """At the hub's lower end, or above the wires where they leave at +y; there an ear carries it outwards."""
    stack, ear, y = p.stack, p.ear, p.stack.hub_radius
    low, high = stack.shoulder - 1.0, stack.shoulder + 4.0
    if stack.journal > 0 and math.cos(_free_side(p) - math.pi / 2) > 0.9:
        low, high = -stack.h - 5.0, -stack.h + 1.0
        if ear is not None and _reach_along_y(ear) > y:
            y, low, high = _reach_along_y(ear), ear.low - 1.0, ear.high + 1.0
    return solids.prism(outlines.diamond(1.0, y), low, high)


def _reach_along_y(ear: Ear) -> float:
    """Where +y leaves an ear; 0 where it is on another side."""
    along, across = math.cos(ear.azimuth - math.pi / 2), abs(math.sin(ear.azimuth - math.pi / 2))
    if along <= 0:
        return 0.0
    corner = (ear.end + (1 - EAR_CORNER) * ear.half_width) / (along + across)
    return min(ear.end / along, ear.half_width / max(across, 1e-9), corner)


def _plate_marks(p: AlignmentLinkage) -> list[cq.Solid]:
    """FRONT: a V in the edge at +x; below the cables a square notch at -x. Laser frame; half the plate deep."""
    x = p.half_x if p.stack.sub_plate != "x" else p.half_x + EAR_REACH
    return [solids.prism(outline, p.top - PLATE_THICKNESS / 2, p.top + 1.0) for outline in plate_marks(x)]


def _largest(shape: cq.Shape) -> cq.Shape:
    """The body that holds the plate; crumbs under 2 % of it are dropped, more than that is a broken neck."""
    bodies = sorted(shape.Solids(), key=lambda solid: -solid.Volume())
    if len(bodies) > 1 and bodies[1].Volume() < 0.02 * bodies[0].Volume():
        return bodies[0]
    return shape
