"""Bodies of bought products: shape, frame, colour. Millimetres, rotation frame at gamma = 0.

The lidar is placed by `T_rot_laser` of the angle set, the same transform as for the point cloud.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Literal

import cadquery as cq
import numpy as np

from scanwright.cad import solids
from scanwright.cad.assembly import bought_shapes as draw
from scanwright.cad.assembly.bought_shapes import LEAD_CHORDS, cable_solid, lead_solid
from scanwright.cad.geometry.mesh import CHORD_ANGLE, CHORD_ERROR
from scanwright.cad.layout import names
from scanwright.cad.layout.belt.stack import BeltStack
from scanwright.cad.layout.drive import DriveLayout, Station
from scanwright.cad.layout.layout import Layout
from scanwright.cad.parts.part_spec import STEEL, Colour
from scanwright.design.arrays import Array
from scanwright.design.catalogue.products import Bearing, Belt
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import SlipRing

CASE, RING, LIDAR, RUBBER = (0.16, 0.16, 0.19), (0.72, 0.58, 0.20), (0.20, 0.23, 0.27), (0.10, 0.10, 0.11)
WINDOW = (0.35, 0.05, 0.08)
LEAD = (0.62, 0.12, 0.10)


Frame = Literal["servo", "rot", "laser"]


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
        stator = partial(draw.ring_stator, product, low, high)
        rotor = partial(draw.ring_rotor, product, low, high)
        if product.bore_mm == 0:
            stator = partial(draw.capsule, product, low, high, drive.servo_pose[0])
            rotor = partial(draw.capsule_rotor, product, high)
        yield _ring(names.RING_STATOR, "servo", stator, meets=names.RING_ROTOR)
        yield _ring(names.RING_ROTOR, "rot", rotor)
    elif isinstance(product, Belt):
        stack, belt = drive.of(BeltStack), names.BELT
        assert stack is not None  # of every belt
        make = partial(draw.belt, stack)
        yield BodySpec(name=belt, product=belt, frame="servo", colour=RUBBER, make=make, meets=names.SHAFT_PULLEY)


def _of_servo(drive: DriveLayout, servo: Servo) -> Iterator[BodySpec]:
    """Yield the case and horn; the horn turns with the rotor if it is on its axis."""
    R, t = drive.servo_pose
    case, horn = partial(draw.servo_case, servo, t[2]), partial(draw.servo_horn, servo, t[2])
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
    make = partial(draw.bearing_inner, bearing, top)
    low = place == "_lower"
    yield BodySpec(name=inner, product=names.BEARING, frame="rot", colour=STEEL, make=make, from_below=low)
    make = partial(draw.bearing_outer, bearing, top)
    yield BodySpec(
        name=outer, product=names.BEARING, frame="servo", colour=STEEL, make=make, meets=inner, from_below=low
    )


def _of_lidar(layout: Layout) -> Iterator[BodySpec]:
    """Yield body, window, cap and cables."""
    lidar = layout.scanner.lidar
    makes = {
        names.LIDAR_BODY: partial(draw.lidar_body, lidar),
        names.LIDAR_WINDOW: partial(draw.lidar_window, lidar),
    }
    if lidar.window_z_mm[1] < lidar.body_mm[2]:  # else the window reaches to the top
        makes[names.LIDAR_CAP] = partial(draw.lidar_cap, lidar)
    for i, y in enumerate(lidar.cable_y_mm, start=1):
        makes[f"{names.LIDAR_CABLE}_{i}"] = partial(draw.lidar_cable, lidar, y)
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
