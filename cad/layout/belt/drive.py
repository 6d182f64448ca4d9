"""The servo next to the axis, for capsule rings, as a `DriveLayout`: belt, hollow shaft, tower."""

from collections.abc import Iterator
from functools import partial
from typing import Literal

import numpy as np

from scanwright.cad.layout import names
from scanwright.cad.layout.belt.loads import SEAT_N_PER_M, belt_limits, belt_shaft_bend
from scanwright.cad.layout.belt.plate import THIN_GAP, plate_of, pulley_foot_radius
from scanwright.cad.layout.belt.sizing import belt_stack
from scanwright.cad.layout.belt.stack import (
    BOSS,
    DISC,
    FOOT,
    FOOT_HALF,
    FOOT_HOLE,
    FOOT_SCREW,
    PLATE,
    SHELF,
    BeltStack,
    case_corners,
    drive_corners,
)
from scanwright.cad.layout.belt.tower import UNDER_FOOT_NUT, shelf_corners, tower_corners, tower_foot_of
from scanwright.cad.layout.drive import (
    Body,
    Bundle,
    Cuboid,
    DriveLayout,
    LeadExit,
    Mounted,
    Rod,
    Station,
    StatorExit,
    servo_limit,
)
from scanwright.cad.layout.envelope import Envelope, box_corners
from scanwright.cad.layout.hub import BEARING_STEP, BUNDLE_GAP
from scanwright.cad.layout.tie_seat import TieSeat
from scanwright.cad.screws import Thread
from scanwright.design.arrays import Array
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.left_out import LeftOut
from scanwright.design.scanner import Scanner

WINDOW_BELOW = 8.3  # the hub's lower end: middle of the windows of a hollow shaft
BUILT = (
    names.SLIP_RING_ADAPTER,
    names.BEARING_TOWER,
    names.SHAFT_PULLEY,
    names.MAIN_SHAFT,
    names.SHAFT_RING,
    names.RING,
    names.DRIVE_PLATE,
    names.DRIVE_PULLEY,
    names.BASE_MOUNT,
    names.FIXED_CABLES,
    names.LIDAR,
    names.SUB_PLATE,
    names.ALIGNMENT_LINKAGE,
    names.ROTOR_LEADS,
)


def belt_drive(scanner: Scanner, envelope: Envelope) -> DriveLayout:
    """Return the drive of a scanner with a capsule ring.

    Raises:
        BuildError: it cannot be laid out.
    """
    stack, ring = belt_stack(scanner, envelope), scanner.slip_ring
    assert ring is not None
    plate, mounted = plate_of(scanner), _mounted(stack, tower_foot_of(scanner.printer, stack))
    return DriveLayout(
        envelope=envelope,
        stack=stack,
        stations=tuple(_stations(stack, ring)),
        records=(stack, plate),
        shaft=names.MAIN_SHAFT,
        bend=belt_shaft_bend(stack),
        gives=belt_shaft_bend(stack, 1 / SEAT_N_PER_M),
        mounted=mounted,
        servo_pose=(stack.turn(), stack.servo_origin()),
        floor=stack.pulley_top,
        ceiling=stack.tower_top - SHELF,
        lead_exits=partial(_lead_exits, stack),
        leads_leave="by the shaft's window",
        tied_to="shaft",
        no_hub_tie="the leads leave the hollow shaft below the hub: they are tied around it",
        stator_exit=StatorExit(np.array([0.0, 0.0, stack.ring_bottom]), stack.ring_bottom - mounted.rear, stiff=False),
        bears=_bears,
        limits=(servo_limit(scanner.servo), *belt_limits(scanner, stack)),
        built=BUILT,
        left_out=(LeftOut(names.BEARING_CAGE, "the two bearings of the tower carry the axis", 1, "parts"),),
        plain=plate.opening > pulley_foot_radius(scanner.servo) + THIN_GAP,
        borne=((names.SHAFT_RING, names.BEARING_TOWER),),
    )


def _bears(_bar_g: float, _bar_z: float) -> bool:
    """Return the bearings carry a counterweight, not the horn."""
    return True


def _stations(stack: BeltStack, ring: SlipRing) -> Iterator[Station]:
    def round_one(name: str, body: Body, radius: float, low: float, high: float) -> Station:
        return Station(name=name, body=body, z_mm=(low, high), radius_mm=radius)

    def bearing(place: Literal["_upper", "_lower"], low: float, high: float, middle: float) -> Station:
        half = stack.carrier.width_mm / 2
        rod = Rod(stack.carrier.outer_mm / 2, middle - half, middle + half)
        return Station(
            name=names.BEARING,
            body="base",
            place=place,
            z_mm=(low, high),
            radius_mm=rod.radius,
            product=stack.carrier,
            box=rod.cuboid(),
            turning=0.5,
        )

    corners = case_corners(stack)
    case = _cuboid(corners.min(axis=0), corners.max(axis=0))
    capsule = Rod(stack.ring_radius, stack.ring_bottom, stack.ring_top)
    yield round_one(names.SLIP_RING_ADAPTER, "base", stack.chamber_radius, stack.disc_top - DISC, stack.disc_top)
    yield Station(
        name=names.RING,
        body="base",
        z_mm=(capsule.low, capsule.high),
        radius_mm=capsule.radius,
        product=ring,
        box=capsule.cuboid(),
        turning=0.5,
        shape=capsule,
    )
    low = stack.collar_low
    yield round_one(names.SHAFT_RING, "rotor", stack.boss_radius, low, low + BOSS + BEARING_STEP)
    yield round_one(names.BEARING_TOWER, "base", stack.wide_radius, stack.tower_bottom, stack.tower_top)
    width = stack.carrier.width_mm
    yield bearing("_upper", stack.tower_top - width, stack.tower_top, stack.upper_middle)
    yield bearing("_lower", stack.lower_bottom, stack.lower_bottom + width, stack.lower_middle)
    yield round_one(names.MAIN_SHAFT, "rotor", stack.collar_radius, stack.shaft_bottom, stack.spigot_top)
    yield Station(
        name=names.SERVO,
        body="base",
        z_mm=(case.low[2], case.high[2]),
        radius_mm=max(*map(abs, stack.servo.case_min_mm[:2]), *stack.servo.case_max_mm[:2]),
        product=stack.servo,
        box=case,
        shape=case,
    )
    yield round_one(names.DRIVE_PLATE, "base", stack.plate_x, stack.tower_top, stack.tower_top + PLATE)
    yield round_one(names.DRIVE_PULLEY, "horn", stack.rim_radius, stack.horn, stack.teeth_top)
    half = stack.belt.width_mm / 2
    yield Station(
        name=names.BELT,
        body="rotor",
        z_mm=(stack.belt_middle - half, stack.belt_middle + half),
        radius_mm=stack.belt_radius,
        product=stack.belt,
        box=_around_belt(stack),
        order=f"{stack.belt.name}, {stack.belt_teeth} teeth, {stack.belt_teeth * stack.belt.pitch_mm:g} mm",
    )
    yield round_one(names.SHAFT_PULLEY, "rotor", stack.rim_radius, stack.teeth_low, stack.pulley_top)
    yield round_one(names.ALIGNMENT_LINKAGE, "rotor", stack.hub_radius, stack.shoulder, -stack.h)


def _mounted(stack: BeltStack, thread: Thread) -> Mounted:
    foot = [(x, y, stack.tower_bottom) for x in (-FOOT_HALF, FOOT_HALF) for y in (-FOOT_HALF, FOOT_HALF)]
    rim = stack.rim_radius
    pulleys = box_corners(((-rim, -rim, stack.teeth_low), (stack.centre + rim, rim, stack.pulley_top)))
    return Mounted(
        onto=names.BEARING_TOWER,
        rear=stack.tower_bottom,
        ears=stack.tower_bottom,
        screw=FOOT_SCREW,
        holes=tuple((a * FOOT_HOLE, b * FOOT_HOLE) for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))),
        fixing="nut",
        corners=np.concatenate([drive_corners(stack), np.array(foot)]),
        bodies=(*tower_corners(stack), shelf_corners(stack), case_corners(stack), pulleys @ stack.turn().T),
        discs=((stack.wide_radius, stack.tower_bottom), (stack.wide_radius, stack.tower_top)),
        on_flat_deck=False,
        thread_mm=FOOT - 1.0 if thread.trap is None else UNDER_FOOT_NUT,
        thread=thread,
    )


def _lead_exits(stack: BeltStack, bundle: Bundle, tie: TieSeat | None, _azimuth: float) -> Iterator[LeadExit]:
    """Yield the path of the leads up the bore and out by its two windows."""
    low, middle = stack.ring_top + stack.rotor.length_mm, stack.hub_bottom - WINDOW_BELOW
    ends = []
    for sign in (1.0, -1.0) if bundle.count == 1 else (1.0 - 2.0 * (bundle.number % 2),):
        side = sign * (bundle.half + BUNDLE_GAP)
        ends.append((np.array([[side, 0.0, low], [side, 0.0, middle]]), np.array([sign, 0.0, 0.0])))
    yield tie, tuple(ends)


def _around_belt(stack: BeltStack) -> Cuboid:
    corner = stack.turn() @ [stack.centre + stack.belt_radius, stack.belt_radius, 0.0]
    start = stack.turn() @ [-stack.belt_radius, -stack.belt_radius, 0.0]
    width = np.array([0.0, 0.0, stack.belt.width_mm / 2])
    middle = np.array([0.0, 0.0, stack.belt_middle])
    return _cuboid(np.minimum(corner, start) + middle - width, np.maximum(corner, start) + middle + width)


def _cuboid(low: Array, high: Array) -> Cuboid:
    (x0, y0, z0), (x1, y1, z1) = low.tolist(), high.tolist()
    return Cuboid((x0, y0, z0), (x1, y1, z1))
