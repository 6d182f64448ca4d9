"""The servo next to the axis, for capsule rings, as a `DriveLayout`: belt, hollow shaft, tower."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from scanwright.cad.layout import names
from scanwright.cad.layout.belt.loads import SEAT_N_PER_M, belt_limits, belt_shaft_bend
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
    THIN_GAP,
    UNDER_FOOT_NUT,
    BeltStack,
    case_corners,
    drive_corners,
    plate_of,
    pulley_foot_radius,
    shelf_corners,
    tower_corners,
    tower_foot_of,
)
from scanwright.cad.layout.drive import Bundle, DriveLayout, LeadExit, Mounted, Rod, Station, StatorExit, servo_limit
from scanwright.cad.layout.envelope import Box, Envelope, box_corners
from scanwright.cad.layout.hub import BEARING_STEP, BUNDLE_GAP, CrossScrew
from scanwright.cad.layout.joints import triple
from scanwright.cad.layout.tie_seat import TieSeat
from scanwright.cad.screws import Thread
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


def belt_drive(scanner: Scanner, envelope: Envelope, cross: CrossScrew) -> DriveLayout:
    """Return the drive of a scanner with a capsule ring."""
    stack, ring = belt_stack(scanner, envelope, cross), scanner.slip_ring
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
    corners, width = case_corners(stack), stack.carrier.width_mm
    case = triple(corners.min(axis=0)), triple(corners.max(axis=0))
    disc, low = (stack.disc_top - DISC, stack.disc_top), stack.collar_low
    yield Station(names.SLIP_RING_ADAPTER, "base", disc, stack.chamber_radius)
    yield Station.half_turning(ring, Rod(stack.ring_radius, stack.ring_bottom, stack.ring_top))
    yield Station(names.SHAFT_RING, "rotor", (low, low + BOSS + BEARING_STEP), stack.boss_radius)
    yield Station(names.BEARING_TOWER, "base", (stack.tower_bottom, stack.tower_top), stack.wide_radius)
    upper = Rod(stack.carrier.outer_mm / 2, stack.tower_top - width, stack.tower_top)
    yield Station.half_turning(stack.carrier, upper, "_upper")
    lower = Rod(stack.carrier.outer_mm / 2, stack.lower_bottom, stack.lower_bottom + width)
    yield Station.half_turning(stack.carrier, lower, "_lower")
    yield Station(names.MAIN_SHAFT, "rotor", (stack.shaft_bottom, stack.spigot_top), stack.collar_radius)
    yield Station(
        names.SERVO,
        "base",
        (case[0][2], case[1][2]),
        max(*map(abs, stack.servo.case_min_mm[:2]), *stack.servo.case_max_mm[:2]),
        product=stack.servo,
        box=case,
        shape=case,
    )
    yield Station(names.DRIVE_PLATE, "base", (stack.tower_top, stack.tower_top + PLATE), stack.plate_x)
    yield Station(names.DRIVE_PULLEY, "horn", (stack.horn, stack.teeth_top), stack.rim_radius)
    half = stack.belt.width_mm / 2
    yield Station(
        names.BELT,
        "rotor",
        (stack.belt_middle - half, stack.belt_middle + half),
        stack.belt_radius,
        product=stack.belt,
        box=_around_belt(stack),
        order=f"{stack.belt.name}, {stack.belt_teeth} teeth, {stack.belt_teeth * stack.belt.pitch_mm:g} mm",
    )
    yield Station(names.SHAFT_PULLEY, "rotor", (stack.teeth_low, stack.pulley_top), stack.rim_radius)
    yield Station(names.ALIGNMENT_LINKAGE, "rotor", (stack.shoulder, -stack.h), stack.hub_radius)


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
    low, middle = stack.ring_top + stack.rotor.length_mm, stack.shoulder - WINDOW_BELOW
    ends = []
    for sign in (1.0, -1.0) if bundle.count == 1 else (1.0 - 2.0 * (bundle.number % 2),):
        side = sign * (bundle.half + BUNDLE_GAP)
        ends.append((np.array([[side, 0.0, low], [side, 0.0, middle]]), np.array([sign, 0.0, 0.0])))
    yield tie, tuple(ends)


def _around_belt(stack: BeltStack) -> Box:
    corner = stack.turn() @ [stack.centre + stack.belt_radius, stack.belt_radius, 0.0]
    start = stack.turn() @ [-stack.belt_radius, -stack.belt_radius, 0.0]
    width = np.array([0.0, 0.0, stack.belt.width_mm / 2])
    middle = np.array([0.0, 0.0, stack.belt_middle])
    return triple(np.minimum(corner, start) + middle - width), triple(np.maximum(corner, start) + middle + width)
