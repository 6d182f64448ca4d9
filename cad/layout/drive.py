"""How the servo turns the shaft, as data: stations along the axis, and numbers of each kind of drive.

Rotation frame at gamma = 0, mm. `drive_of` in `cad/layout/placement.py` selects the drive; each fills a `DriveLayout`
in its folder (`direct/`, `belt/`), which all other code reads.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeVar

import numpy as np

from scanwright.cad.layout.envelope import Box, Envelope
from scanwright.cad.layout.hub import Hub
from scanwright.cad.layout.joints import Fixing, fixing_of
from scanwright.cad.layout.loads import ShaftBend
from scanwright.cad.layout.names import BASE_MOUNT, BEARING, RING, SERVO_CASE
from scanwright.cad.layout.tie_seat import TieSeat
from scanwright.cad.screws import SCREWS, Screw, Thread, passing_hole
from scanwright.design.arrays import Array
from scanwright.design.catalogue.product_base import Product
from scanwright.design.catalogue.products import Bearing, Belt
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.left_out import LeftOut
from scanwright.design.scanner import Scanner

HEAD_WALL = 2.0  # of a plate on the servo, next to the recess of a head
Body = Literal["base", "rotor", "horn"]
Place = Literal["", "_upper", "_lower"]
Point = tuple[float, float, float]
Record = TypeVar("Record")


@dataclass(frozen=True, slots=True)
class Rod:
    """A cylinder about the rotation axis."""

    radius: float
    low: float
    high: float

    def box(self) -> Box:
        """Return the box around it."""
        r = self.radius
        return (-r, -r, self.low), (r, r, self.high)


@dataclass(frozen=True, slots=True)
class Station:
    """A part or a bought product, and its place in the stack from the deck to the linkage."""

    name: str  # of the part, or of the product
    body: Body  # that it moves with; for a ring or a bearing that of the outer half
    z_mm: tuple[float, float]  # heights of its lower and upper end
    radius_mm: float  # of the cylinder or the box around it, from its own axis
    product: Servo | SlipRing | Bearing | Belt | None = None  # if it is bought
    box: Box | None = None  # homogeneous box with the product's mass
    turning: float = 0.0  # share of that mass that turns about the axis
    shape: Box | Rod | None = None  # simple body of a fixed product, for the URDF
    # which one it is, if there are two; the lower one is inserted from below
    place: Place = ""
    order: str = ""  # order name, if that is not the name of the product

    @classmethod
    def half_turning(cls, product: SlipRing | Bearing, rod: Rod, place: Place = "") -> Station:
        """Return a ring or a bearing about the axis, whose inner half turns."""
        ring = isinstance(product, SlipRing)
        return cls(
            name=RING if ring else BEARING,
            body="base",
            z_mm=(rod.low, rod.high),
            radius_mm=rod.radius,
            product=product,
            box=rod.box(),
            turning=0.5,
            shape=rod if ring else None,
            place=place,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Ears:
    """The holes of a servo's case or frame that a plate is screwed to, from above.

    Heights above the horn; x and y of the servo's frame.
    """

    onto: str  # body that has the holes
    front: float  # of its face below the plate
    seats: float  # of the planes around the holes
    opening: float  # radius, or half width of a fork, around the horn
    half_x: float  # of the plate
    screw: Screw
    hole: float  # diameter, in the plate
    holes: tuple[tuple[float, float], ...]
    fixing: Fixing
    thread_mm: float  # of thread, or of material before the nut
    thread: Thread | None = None  # of a printed one
    # from the line of a pair to the edge over which the plate tips, which then lies on the entire face; None for others
    heel_mm: float | None = None
    covers: tuple[tuple[float, float, Screw], ...] = ()  # heads of a frame's own screws under the plate, in pockets


def ears_on(scanner: Scanner, opening: float, holes: tuple[tuple[float, float], ...]) -> Ears:
    """Return holes in the front of a servo's case with the numbers of a plate on them."""
    servo, screw = scanner.servo, SCREWS[scanner.servo.front.screw]
    return Ears(
        onto=SERVO_CASE,
        front=servo.case_max_mm[2],
        seats=servo.front.z_mm,
        opening=opening,
        half_x=max(servo.case_max_mm[0], max(x for x, _ in servo.front.places) + screw.driver_radius + HEAD_WALL),
        screw=screw,
        hole=passing_hole(screw, scanner.printer),
        holes=holes,
        fixing=fixing_of(servo.front),
        thread_mm=servo.front.depth_mm,
    )


@dataclass(frozen=True, slots=True)
class Mounted:
    """Load of a base mount: the servo's case or frame, or a tower, above the mount's rails."""

    onto: str  # body that its screws end in
    rear: float  # height of its face towards the mount
    ears: float  # height of the faces around its holes
    screw: Screw  # through the mount into them
    holes: tuple[tuple[float, float], ...]  # x and y of the four
    fixing: Fixing  # of the screws: a nut behind the holes, or their thread
    corners: Array  # of boxes around all that does not turn, shape (n, 3)
    bodies: tuple[Array, ...]  # corners of convex shapes of all that is on the mount when it is screwed to the deck
    # radius and height of other circles about the axis that must stay clear of the deck
    discs: tuple[tuple[float, float], ...]
    on_flat_deck: bool  # whether it may be screwed to a flat deck without a mount if the axis is upright
    thread_mm: float  # of thread, or of material before the nut, behind its holes
    thread: Thread | None = None  # of a printed one


class TorqueLimit(NamedTuple):
    """A limit of the torque that a drive can hold."""

    nm: float
    by: str  # product and property
    instead: str  # what has a higher one


LeadExit = tuple[TieSeat | None, tuple[tuple[Array, Array], ...]]
"""An exit for the leads of the ring's rotor: its tie, and alternative corners (k, 3) with a direction outwards (3,)."""


@dataclass(frozen=True, slots=True)
class Bundle:
    """Leads of the ring's rotor, one for each cable of the lidar."""

    number: int  # of this one
    count: int  # of all
    half: float  # radius of one
    radius: float  # least bend radius


@dataclass(frozen=True, slots=True)
class StatorExit:
    """Exit of the leads of the ring's stator at its end, along -z."""

    start: Array  # shape (3,)
    inside: float  # their length inside of the parts around the ring
    stiff: bool  # whether they are straight there


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveLayout:
    """One layout of one scanner below its hub."""

    envelope: Envelope  # of the lidar
    stack: Hub  # every number along the axis
    stations: tuple[Station, ...]  # from the deck to the linkage, the order of the exploded view
    records: tuple[object, ...]  # numbers of its parts, a record for each kind of part
    shaft: str  # the part that carries the linkage
    bend: ShaftBend  # of the shaft at the hub
    gives: ShaftBend  # the same with the compliance of the servo's horn or the bearings' seats
    mounted: Mounted  # load of the base mount
    # of the servo's frame in the rotation frame: rotation (3, 3) and origin (3,), on the horn's face
    servo_pose: tuple[Array, Array]
    floor: float  # height of all below the rotor that does not turn, or is as wide
    ceiling: float  # height below all that turns
    # exits for the leads of the ring's rotor, the best first, by the tie of the hub and the azimuth between the cross
    # screws
    lead_exits: Callable[[Bundle, TieSeat | None, float], Iterator[LeadExit]]
    leads_leave: str  # the exit as text
    tied_to: Literal["shaft", "neck"]  # part that they are tied to without a tie of the hub
    no_hub_tie: str  # why the hub has no seat for a tie; empty if it may have one
    stator_exit: StatorExit | None  # of the leads of the ring's stator, if the catalogue states it
    # whether the servo bears a counterweight of a mass [g] at a height in addition to the rotor
    bears: Callable[[float, float], bool]
    limits: tuple[TorqueLimit, ...]  # of the torque about its axis in work
    built: tuple[str, ...]  # parts and products in assembly order; other parts state which one they follow
    left_out: tuple[LeftOut, ...]  # parts that this scanner does not need
    plain: bool  # whether two pairs of front holes, away from all that turns, carry the parts on the servo
    # parts that another one fixes along the axis without a screw, by a bearing or a clamped ring
    borne: tuple[tuple[str, str], ...] = ()

    def of(self, kind: type[Record]) -> Record | None:
        """Return the record of one kind of part; None if this drive has none."""
        return next((record for record in self.records if isinstance(record, kind)), None)

    @property
    def stacked(self) -> tuple[str, ...]:
        """Parts and products from the deck to the linkage, in which the exploded view lifts them."""
        return tuple(dict.fromkeys((BASE_MOUNT, *(each.name for each in self.stations))))

    @property
    def products(self) -> tuple[Bearing | Belt, ...]:
        """What is bought besides lidar, servo and ring, as often as it is needed."""
        return tuple(each.product for each in self.stations if isinstance(each.product, Bearing | Belt))

    @property
    def masses(self) -> tuple[tuple[Station, float, Box], ...]:
        """Stations of the bought products, with mass [g] and box."""
        stations = ((each, each.product, each.box) for each in self.stations)
        return tuple((each, product.mass_g, box) for each, product, box in stations if product and box)


def servo_limit(servo: Servo) -> TorqueLimit:
    """Return the limit of a servo."""
    return TorqueLimit(servo.continuous_torque_nm, f"a fifth of the stall torque of {servo.name}", "a stronger servo")


def towards(points: Array, azimuth: float) -> tuple[Array, Array]:
    """Return points (n, 3) turned about the axis by an azimuth [rad], and the unit vector at that azimuth."""
    c, s = math.cos(azimuth), math.sin(azimuth)
    return points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]), np.array([c, s, 0.0])


def products_of(scanner: Scanner, drive: DriveLayout) -> list[Product]:
    """Return every product that shapes parts, each once."""
    products: list[Product | None] = [scanner.lidar, scanner.servo, scanner.slip_ring, *drive.products, scanner.printer]
    return list({product.name: product for product in products if product is not None}.values())
