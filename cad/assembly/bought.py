"""Bodies of bought products and cables: shape, frame, colour. Millimetres, rotation frame at gamma = 0.

The lidar is placed by `T_rot_laser` of the angle set, the same transform as for the point cloud. Its
shapes are in its body frame (origin on the base at the optical axis, x to the front, z up), those of the servo have
its horn's axis as z. Teeth of the belt and balls are not drawn.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Literal

import cadquery as cq
import numpy as np

from scanwright.cad import solids
from scanwright.cad.geometry.mesh import CHORD_ANGLE, CHORD_ERROR, mesh_of
from scanwright.cad.layout import names
from scanwright.cad.layout.belt.stack import BeltStack, flange_centres
from scanwright.cad.layout.cables.fixed import FixedCable
from scanwright.cad.layout.cables.lead_joint import JOINT_LENGTH, TUBE_WALL
from scanwright.cad.layout.cables.leads import RotorLead
from scanwright.cad.layout.cables.route import Path
from scanwright.cad.layout.drive import DriveLayout, Station
from scanwright.cad.layout.envelope import lidar_thread_mm
from scanwright.cad.layout.joints import horn_centres
from scanwright.cad.layout.layout import Layout
from scanwright.cad.layout.names import BELT, RING_STATOR, ROTOR_LEAD
from scanwright.cad.parts.part_spec import STEEL, Colour
from scanwright.cad.screws import SCREWS
from scanwright.cad.solids import building
from scanwright.design.arrays import Array
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.products import Bearing, Belt
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.errors import BuildError

CASE, RING, LIDAR, RUBBER = (0.16, 0.16, 0.19), (0.72, 0.58, 0.20), (0.20, 0.23, 0.27), (0.10, 0.10, 0.11)
WINDOW = (0.35, 0.05, 0.08)
LEAD = (0.62, 0.12, 0.10)


Frame = Literal["servo", "rot", "laser"]
CAP_INSET = 1.5
CHORDS = 0.02  # overlap of the facets of a round seat and its hole: no fit is as wide
EAR_RECESS = 3.6  # radius of the recess around a case hole
HORN_RECESS = 0.3  # around a horn that is sunk into its case: assumed
BELT_GAP = 0.05  # between the tips of the teeth and the belt between its teeth
THROUGH = 0.25  # of a plain hole around its screw
STUB = 0.4  # between the stub of a capsule's rotor and its body
LEAD_CHORDS = (0.1, 0.5)  # of its mesh, in mm and rad: a bundle of wires is not as round as a bore


def lead_solid(lead: RotorLead) -> cq.Solid:
    """Return the wires between ring and lidar with the shrink tube over their joint; its mesh must be closed."""
    assert lead.path is not None
    with building(ROTOR_LEAD, "tube along its path", "diameter", f"{lead.diameter:g} mm") as checked:
        tube: cq.Shape = _tube_along(lead.path, lead.diameter / 2)
        if lead.joint is not None:
            along = lead.joint.along
            start = lead.joint.middle - JOINT_LENGTH / 2 * along
            tube = tube.fuse(solids.cylinder(lead.diameter / 2 + TUBE_WALL, start, along, JOINT_LENGTH))
        return _closed(ROTOR_LEAD, checked(tube))


def cable_solid(cable: FixedCable) -> cq.Solid:
    """Return a cable that does not turn; its mesh must be closed."""
    assert cable.path is not None
    with building(cable.name, "tube along its path", "diameter", f"{cable.diameter:g} mm") as checked:
        return _closed(cable.name, checked(_tube_along(cable.path, cable.diameter / 2)))


def _closed(name: str, solid: cq.Solid) -> cq.Solid:
    if not mesh_of(solid, *LEAD_CHORDS).is_closed():
        raise BuildError(f"{name}: mesh: tolerance = {LEAD_CHORDS[0]} mm: the surface is not closed")
    return solid


def _tube_along(path: Path, half: float) -> cq.Shape:
    corners = np.array(path.corners, dtype=float)
    edges = []
    for piece in path.pieces():
        start, middle, end = (solids.vector(point) for point in (piece.start, piece.middle, piece.end))
        line = cq.Edge.makeLine(start, end) if piece.straight else cq.Edge.makeThreePointArc(start, middle, end)
        edges.append(line)
    wire = cq.Wire.assembleEdges(edges)
    ring = cq.Wire.makeCircle(half, solids.vector(corners[0]), solids.vector(corners[1] - corners[0]))
    return cq.Solid.sweep(ring, [], wire)


def lidar_body(lidar: Lidar) -> cq.Solid:
    """Return the case of a lidar below its window, with its holes."""
    half_x, half_y, low = lidar.body_mm[0] / 2, lidar.body_mm[1] / 2, lidar.window_z_mm[0]
    threads = []
    for face, pattern in lidar.held.items():
        across, sign = "xyz".index(face[1]), 1.0 if face[0] == "+" else -1.0
        radius = SCREWS[pattern.screw].nominal / 2 + (THROUGH if pattern.kind == "through" else 0.0)
        for place in pattern.places:
            start = np.insert(place, across, pattern.z_mm + sign)
            threads.append(solids.cylinder(radius, start, -sign * np.eye(3)[across], lidar_thread_mm(lidar) + 1.0))
    body: cq.Shape = solids.box((-half_x, -half_y, 0.0), (half_x, half_y, low))
    if lidar.ears_mm:
        body = body.fuse(*(solids.box(*ear) for ear in lidar.ears_mm)).clean()
    return body.cut(*threads).Solids()[0]


def lidar_window(lidar: Lidar) -> cq.Solid:
    """Return the window of a lidar, which the beams pass."""
    return solids.upright(lidar.window_radius_mm, *lidar.window_z_mm)


def lidar_cap(lidar: Lidar) -> cq.Solid:
    """Return the part of a lidar above its window."""
    return solids.upright(min(lidar.body_mm[:2]) / 2 - CAP_INSET, lidar.window_z_mm[1], lidar.body_mm[2])


def lidar_cable(lidar: Lidar, y: float) -> cq.Solid:
    """Return the straight stub of the cable at a y of the lidar."""
    start = (-lidar.body_mm[0] / 2, y, lidar.cable_z_mm)
    return solids.cylinder(lidar.cable_diameter_mm / 2, start, (-1.0, 0.0, 0.0), lidar.cable_straight_mm)


def servo_case(servo: Servo, z: float) -> cq.Solid:
    """Return the case, its horn face at height z, with recesses of horn and holes, and threads."""
    (x0, y0, z0), (x1, y1, z1) = servo.case_min_mm, servo.case_max_mm
    recesses = [solids.upright(EAR_RECESS, z + servo.front.z_mm, z + z1 + 1.0, *hole) for hole in servo.front.places]
    recesses += [solids.upright(EAR_RECESS, z + z0 - 1.0, z + servo.rear.z_mm, *hole) for hole in servo.rear.places]
    if (depth := _horn_depth(servo)) > -z1:
        around = servo.horn_diameter_mm / 2 + HORN_RECESS
        recesses.append(solids.upright(around, z - depth - HORN_RECESS, z + z1 + 1.0))
    for pattern, inwards in ((servo.front, -1.0), (servo.rear, 1.0)):
        if pattern.kind != "through":
            low, high = sorted((z + pattern.z_mm, z + pattern.z_mm + inwards * pattern.depth_mm))
            radius = SCREWS[pattern.screw].nominal / 2
            recesses += [solids.upright(radius, low, high, x, y) for x, y in pattern.places]
    return solids.box((x0, y0, z + z0), (x1, y1, z + z1)).cut(*recesses).Solids()[0]


def servo_horn(servo: Servo, z: float) -> cq.Solid:
    """Return the horn's disc with its threaded holes and boss, its face at height z."""
    disc: cq.Shape = solids.upright(servo.horn_diameter_mm / 2, z - _horn_depth(servo), z)
    radius = SCREWS[servo.horn_screw].nominal / 2
    low, centres = z - servo.horn_thread_depth_mm, horn_centres(servo)
    disc = disc.cut(*(solids.upright(radius, low, z + 1.0, float(x), float(y)) for x, y in centres))
    if servo.horn_boss_diameter_mm > 0 and servo.horn_boss_height_mm > 0:
        disc = disc.fuse(solids.upright(servo.horn_boss_diameter_mm / 2, z - 0.5, z + servo.horn_boss_height_mm))
    return disc.Solids()[0]


def _horn_depth(servo: Servo) -> float:
    """Return the height of the horn's disc [mm]: one that is thinner than its threads continues in the case."""
    return max(servo.horn_thickness_mm, servo.horn_thread_depth_mm)


def ring_stator(ring: SlipRing, low: float, high: float) -> cq.Solid:
    """Return the stator of a through-bore ring; the split to its rotor is assumed."""
    stator = solids.upright(ring.outer_diameter_mm / 2, low, high - 1.0)
    return stator.cut(solids.upright(_split(ring), low - 1.0, high + 1.0)).Solids()[0]


def ring_rotor(ring: SlipRing, low: float, high: float) -> cq.Solid:
    """Return the rotor of a through-bore ring."""
    rotor: cq.Shape = solids.upright(_split(ring) - 0.2, low + 1.0, high)
    if ring.rotor is not None:
        high += ring.rotor.length_mm
        rotor = rotor.fuse(solids.upright(ring.rotor.diameter_mm / 2, high - ring.rotor.length_mm, high)).clean()
    return rotor.cut(solids.upright(ring.bore_mm / 2, low - 1.0, high + 1.0)).Solids()[0]


def _split(ring: SlipRing) -> float:
    bore = ring.bore_mm / 2
    return bore + 0.4 * (ring.outer_diameter_mm / 2 - bore)


def bearing_inner(bearing: Bearing, high: float) -> cq.Solid:
    """Return the inner ring, its upper face at a height."""
    inner = bearing.bore_mm / 2
    return _ring_about_axis(inner + CHORDS, inner + _race(bearing), high - bearing.width_mm, high)


def bearing_outer(bearing: Bearing, high: float) -> cq.Solid:
    """Return the outer ring, its upper face at a height."""
    outer = bearing.outer_mm / 2
    return _ring_about_axis(outer - _race(bearing), outer, high - bearing.width_mm, high)


def _race(bearing: Bearing) -> float:
    return 0.3 * (bearing.outer_mm / 2 - bearing.bore_mm / 2)


def _ring_about_axis(inner: float, outer: float, low: float, high: float) -> cq.Solid:
    return solids.lathe([(inner, low), (outer, low), (outer, high), (inner, high)])


def capsule(ring: SlipRing, low: float, high: float, R: Array) -> cq.Solid:
    """Return body and flange of a capsule ring, turned about the axis by R, shape (3, 3)."""
    flange = ring.flange
    assert flange is not None  # as of every capsule
    flange_top = high - flange.below_top_mm
    flange_low = flange_top - flange.thickness_mm
    with building(RING_STATOR, "flange", "flange.diameter_mm", flange.diameter_mm) as checked:
        body = solids.upright(ring.outer_diameter_mm / 2, low, high).fuse(
            solids.upright(flange.diameter_mm / 2, flange_low, flange_top)
        )
        ends = flange_low - 1.0, flange_top + 1.0
        holes = [solids.upright(flange.hole_mm / 2, *ends, x, y) for x, y in flange_centres(flange)]
        capsule = checked(body.cut(*holes))
    return capsule.moved(solids.location(R))


def capsule_rotor(ring: SlipRing, high: float) -> cq.Solid:
    """Return the stub of a capsule's rotor."""
    assert ring.rotor is not None  # as of every capsule
    return solids.upright(ring.rotor.diameter_mm / 2, high + STUB, high + ring.rotor.length_mm)


def belt(stack: BeltStack) -> cq.Solid:
    """Return the back of the belt around both pulleys."""
    half = stack.belt.width_mm / 2
    low, high = stack.belt_middle - half, stack.belt_middle + half
    inner, outer = stack.tip_radius + BELT_GAP, stack.belt_radius + BELT_GAP
    with building(BELT, "loop", "centre distance", stack.centre) as checked:
        loops = []
        for radius, beyond in ((outer, 0.0), (inner, 1.0)):
            ends = [solids.upright(radius, low - beyond, high + beyond, x) for x in (0.0, stack.centre)]
            middle = solids.box((0.0, -radius, low - beyond), (stack.centre, radius, high + beyond))
            loops.append(middle.fuse(*ends).clean())
        back = checked(loops[0].cut(loops[1]))
    return back.moved(solids.location(stack.turn()))


@dataclass(frozen=True, slots=True, kw_only=True)
class BodySpec:
    """One body of a bought product."""

    name: str  # unique in the scanner
    product: str  # that it belongs to, of `cad/layout/names.py`
    frame: Frame  # that it moves with
    colour: Colour  # sRGB
    make: Callable[[], cq.Solid]  # its solid, rotation frame
    meets: str = ""  # moving body that it may touch: the other half of a ring, or a driven part
    clear: bool = False  # whether beams pass it
    from_below: bool = False  # whether it is inserted from below, if its product is used twice
    # tolerance of the mesh [mm], and angle between its facets [rad]
    chords: tuple[float, float] = (CHORD_ERROR, CHORD_ANGLE)

    @property
    def turns(self) -> bool:
        """Whether it turns about the rotation axis."""
        return self.frame != "servo"


def bought_of(layout: Layout) -> list[BodySpec]:
    """Return the bodies of all bought products and cables of one scanner."""
    drawn = [body for station in layout.drive.stations for body in _of_station(layout.drive, station)]
    drawn.sort(key=lambda body: body.product != names.SERVO)
    return [*drawn, *_of_lidar(layout), *_of_cables(layout)]


def _of_station(drive: DriveLayout, station: Station) -> Iterator[BodySpec]:
    product, (low, high) = station.product, station.z_mm
    if isinstance(product, Servo):
        yield from _of_servo(drive, product)
    elif isinstance(product, Bearing):
        yield from _bearing(product, high, station.place)
    elif isinstance(product, SlipRing):
        stator = partial(ring_stator, product, low, high)
        rotor = partial(ring_rotor, product, low, high)
        if product.bore_mm == 0:
            stator = partial(capsule, product, low, high, drive.servo_pose[0])
            rotor = partial(capsule_rotor, product, high)
        yield _ring(names.RING_STATOR, "servo", stator, meets=names.RING_ROTOR)
        yield _ring(names.RING_ROTOR, "rot", rotor)
    elif isinstance(product, Belt):
        stack = drive.of(BeltStack)
        assert stack is not None  # of every belt
        make = partial(belt, stack)
        yield BodySpec(name=BELT, product=BELT, frame="servo", colour=RUBBER, make=make, meets=names.SHAFT_PULLEY)


def _of_servo(drive: DriveLayout, servo: Servo) -> Iterator[BodySpec]:
    """Yield the case and horn; the horn turns with the rotor if it is on its axis."""
    R, t = drive.servo_pose
    case, horn = partial(servo_case, servo, t[2]), partial(servo_horn, servo, t[2])
    if not np.any(t[:2]):
        yield _servo(names.SERVO_CASE, "servo", case, meets=names.SERVO_HORN)
        yield _servo(names.SERVO_HORN, "rot", horn)
        return
    yield _servo(names.SERVO_CASE, "servo", partial(_moved, R, t, case))
    yield _servo(names.SERVO_OUTPUT, "servo", partial(_moved, R, t, horn))


def _servo(name: str, frame: Frame, make: Callable[[], cq.Solid], meets: str = "") -> BodySpec:
    return BodySpec(name=name, product=names.SERVO, frame=frame, colour=CASE, make=make, meets=meets)


def _ring(name: str, frame: Frame, make: Callable[[], cq.Solid], meets: str = "") -> BodySpec:
    return BodySpec(name=name, product=names.RING, frame=frame, colour=RING, make=make, meets=meets)


def _bearing(bearing: Bearing, top: float, place: str) -> Iterator[BodySpec]:
    inner, outer = f"{names.BEARING}_inner{place}", f"{names.BEARING}_outer{place}"
    make = partial(bearing_inner, bearing, top)
    low = place == "_lower"
    yield BodySpec(name=inner, product=names.BEARING, frame="rot", colour=STEEL, make=make, from_below=low)
    make = partial(bearing_outer, bearing, top)
    yield BodySpec(
        name=outer, product=names.BEARING, frame="servo", colour=STEEL, make=make, meets=inner, from_below=low
    )


def _of_lidar(layout: Layout) -> Iterator[BodySpec]:
    """Yield body, window, cap and cables."""
    lidar = layout.scanner.lidar
    makes = {
        names.LIDAR_BODY: partial(lidar_body, lidar),
        names.LIDAR_WINDOW: partial(lidar_window, lidar),
    }
    if lidar.window_z_mm[1] < lidar.body_mm[2]:  # else the window reaches to the top
        makes[names.LIDAR_CAP] = partial(lidar_cap, lidar)
    for i, y in enumerate(lidar.cable_y_mm, start=1):
        makes[f"{names.LIDAR_CABLE}_{i}"] = partial(lidar_cable, lidar, y)
    for name, make in makes.items():
        window = name == names.LIDAR_WINDOW
        yield BodySpec(
            name=name,
            product=names.LIDAR,
            frame="laser",
            colour=WINDOW if window else LIDAR,
            make=partial(_on_axis, layout, make),
            clear=window,
        )


def _of_cables(layout: Layout) -> Iterator[BodySpec]:
    drawn = partial(BodySpec, colour=LEAD, chords=LEAD_CHORDS)
    for i, lead in enumerate(layout.leads, start=1):
        if lead.path is not None:
            name, make = f"{names.ROTOR_LEAD}_{i}", partial(lead_solid, lead)
            yield drawn(name=name, product=names.ROTOR_LEADS, frame="rot", make=make)
    for cable in layout.cables:
        if cable.path is not None:
            yield drawn(name=cable.name, product=names.FIXED_CABLES, frame="servo", make=partial(cable_solid, cable))


def _moved(R: Array, t: Array, make: Callable[[], cq.Solid]) -> cq.Solid:
    """Return a body of a servo that is not on the axis."""
    return make().moved(solids.location(R, t * [1.0, 1.0, 0.0]))


def _on_axis(layout: Layout, make: Callable[[], cq.Solid]) -> cq.Solid:
    """Return a body of the lidar at its pose of the angle set."""
    T = layout.scanner.angles.T_rot_laser()
    base = cq.Location(cq.Vector(0, 0, -layout.scanner.lidar.optical_height_mm))
    return make().moved(solids.location(layout.stack.R(), T[:3, 3] * 1000) * base)
