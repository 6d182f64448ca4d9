"""The servo on the axis, as a `DriveLayout`: horn, shaft through the ring, hub."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from scanwright.cad.layout import names
from scanwright.cad.layout.direct.cage import BearingCage, adapter_of, cage_of, stator_leads_y, stiffness_n_per_m
from scanwright.cad.layout.direct.frame import FOOT, FOOT_SCREW, ServoFrame, corner_holes, frame_of, needs_frame
from scanwright.cad.layout.direct.loads import horn_bears, horn_bears_balanced, shaft_bend, shaft_modulus_pa
from scanwright.cad.layout.direct.sizing import direct_stack
from scanwright.cad.layout.direct.stack import BELOW_HUB, DirectStack
from scanwright.cad.layout.drive import (
    Bundle,
    DriveLayout,
    LeadExit,
    Mounted,
    Rod,
    Station,
    StatorExit,
    servo_limit,
    towards,
)
from scanwright.cad.layout.envelope import Envelope, around_axis, box_corners
from scanwright.cad.layout.hub import BUNDLE_GAP, CrossScrew
from scanwright.cad.layout.joints import fixing_of
from scanwright.cad.layout.loads import HORN_TILTS_RAD, trusted_moment_nm
from scanwright.cad.layout.tie_seat import TieSeat
from scanwright.cad.screws import SCREWS
from scanwright.design.arrays import Array
from scanwright.design.catalogue.holes import what_holds
from scanwright.design.catalogue.servo import Servo
from scanwright.design.errors import BuildError
from scanwright.design.left_out import LeftOut
from scanwright.design.scanner import Scanner

# Assembly order: parts over the shaft follow the parts that carry it.
BUILT = (
    names.SERVO_FRAME,
    names.BASE_MOUNT,
    names.DECK,
    names.SERVO_SHAFT,
    names.HORN_CUP,
    names.SLIP_RING_ADAPTER,
    names.CAGE_BASE,
    names.RING,
    names.JOURNAL_SLEEVE,
    names.BEARING_CAGE,
    names.FIXED_CABLES,
    names.LIDAR,
    names.SUB_PLATE,
    names.ALIGNMENT_LINKAGE,
    names.ROTOR_LEADS,
)
ADAPTER_ARMS = 8.0  # beyond the ring
CAGE_HEADS = 4.0  # of the screws of the cage, beyond it
AROUND_DEG = 15.0  # between two azimuths that a ring's lead may leave at


def lead_exits(stack: DirectStack, bundle: Bundle, tie: TieSeat | None, free_azimuth: float) -> Iterator[LeadExit]:
    """Yield paths by the channel of a bearing's sleeve; without a bearing below the hub's tab, else all around."""
    half, low = bundle.half, stack.leads_low
    aside = (2 * half + BUNDLE_GAP) * (bundle.number - (bundle.count - 1) / 2)
    if stack.bearing is not None:
        yield tie, (_upwards(stack.leads_radius, aside, low, stack.leads_corner, free_azimuth),)
        return
    inner = stack.ring_bore / 2 + half + BUNDLE_GAP  # on the rotor of the ring
    if tie is not None:
        high = max(low + bundle.radius, tie.low - BELOW_HUB - half)
        yield tie, (_upwards(inner, aside, low, high, tie.azimuth),)
    around = np.radians(np.arange(0.0, 360.0, AROUND_DEG)).tolist()
    yield None, tuple(_upwards(inner, 0.0, low, low + bundle.radius, azimuth) for azimuth in around)


def _upwards(inner: float, aside: float, low: float, high: float, azimuth: float) -> tuple[Array, Array]:
    """Return a path along the axis between two heights, then outwards at an azimuth [rad]."""
    return towards(np.array([[inner, aside, low], [inner, aside, high]]), azimuth)


def stator_exit(scanner: Scanner, stack: DirectStack, cage: BearingCage | None) -> StatorExit:
    """Return the exit at the index side, next to flange and case, and through the base of a cage."""
    start = np.array([0.0, stator_leads_y(scanner, stack), stack.ring_bottom])
    return StatorExit(start, 0.0 if cage is None else stack.ring_bottom - cage.low, stiff=cage is not None)


def direct_drive(scanner: Scanner, envelope: Envelope, cross: CrossScrew) -> DriveLayout:
    """Return the drive of a scanner with a through-bore ring or without a ring."""
    stack, ears = direct_stack(scanner, envelope, cross)
    adapter = adapter_of(scanner, stack)
    cage = None if ears is None else cage_of(scanner, stack, ears)
    framed = next((each for each in (ears, adapter) if each is not None and each.onto == names.SERVO_FRAME), None)
    frame = frame_of(scanner, stack, framed) if framed is not None or needs_frame(scanner.servo) else None
    mounted = _mounted(scanner.servo, stack, frame)
    leads_leave = "by the channel of the hub" if cage is not None else "under the hub"
    cage_n_per_m = 0.0 if cage is None else stiffness_n_per_m(stack, cage.ears)
    bend = partial(shaft_bend, stack, shaft_modulus_pa(scanner, stack), cage_n_per_m)
    height = stack.ring_top if stack.bearing is None else stack.cage_top
    return DriveLayout(
        envelope=envelope,
        stack=stack,
        stations=tuple(_stations(scanner, stack, frame, cage)),
        records=tuple(record for record in (stack, frame, adapter, cage) if record is not None),
        shaft=stack.shaft,
        bend=bend(),
        gives=bend(horn_rad_per_nm=HORN_TILTS_RAD / trusted_moment_nm(scanner)),
        mounted=mounted,
        servo_pose=(np.eye(3), np.array([0.0, 0.0, stack.horn])),
        floor=height,
        ceiling=height,
        lead_exits=partial(lead_exits, stack),
        leads_leave=leads_leave,
        tied_to="neck",
        no_hub_tie="",
        stator_exit=None if scanner.slip_ring is None else stator_exit(scanner, stack, cage),
        bears=partial(_bears, scanner, stack),
        limits=(servo_limit(scanner.servo),),
        built=BUILT,
        left_out=tuple(_left_out(scanner, stack, frame)),
        plain=framed is None,
    )


def _stations(
    scanner: Scanner, stack: DirectStack, frame: ServoFrame | None, cage: BearingCage | None
) -> Iterator[Station]:
    servo, ring, bearing = scanner.servo, scanner.slip_ring, stack.bearing
    (x0, y0, z0), (x1, y1, z1) = servo.case_min_mm, servo.case_max_mm
    low = (x0, y0, stack.horn + z0)
    yield Station(
        names.SERVO,
        "base",
        (low[2], stack.horn),
        max(-x0, x1, -y0, y1),
        product=servo,
        box=(low, (x1, y1, stack.horn)),  # with its horn
        shape=(low, (x1, y1, stack.horn + z1)),
    )
    if frame is not None:
        yield Station(names.SERVO_FRAME, "base", (frame.low, frame.high), frame.reach_x)
    yield Station(stack.shaft, "horn", (stack.horn, stack.spigot_top), stack.flange_radius)
    if cage is not None and ring is None:
        yield Station(names.CAGE_BASE, "base", (cage.low, cage.high), stack.cage_outer)
    if ring is not None:
        yield Station(names.SLIP_RING_ADAPTER, "base", (stack.horn, stack.ring_top), stack.ring_radius + ADAPTER_ARMS)
        yield Station.half_turning(ring, Rod(stack.ring_radius, stack.ring_bottom, stack.ring_top))
    if cage is not None and bearing is not None:
        yield Station(names.BEARING_CAGE, "base", (cage.foot, stack.cage_top), stack.cage_outer)
        seat = Rod(bearing.outer_mm / 2, stack.bearing_top - bearing.width_mm, stack.bearing_top)
        yield Station.half_turning(bearing, seat)
        yield Station(names.JOURNAL_SLEEVE, "rotor", (stack.sleeve_low, stack.shoulder), bearing.bore_mm / 2)
    yield Station(names.ALIGNMENT_LINKAGE, "rotor", (stack.shoulder, -stack.h), stack.hub_radius)


def _bears(scanner: Scanner, stack: DirectStack, bar_g: float, bar_z: float) -> bool:
    """Return whether the horn bears a bar; with a bearing, or if it is overloaded without the bar, a check decides."""
    if stack.bearing is not None or not horn_bears(scanner, stack):
        return True
    return horn_bears_balanced(scanner, stack, bar_g, bar_z)


def _mounted(servo: Servo, stack: DirectStack, frame: ServoFrame | None) -> Mounted:
    """Return the servo's case, or the frame that holds it, on the mount.

    Raises:
        BuildError: it has no holes that may carry it.
    """
    if frame is None and not corner_holes(servo.rear.places):
        raise BuildError(
            f"{names.SERVO_FRAME}: holes: {servo.name} has no four equal holes in its rear and no two in its front "
            f"({what_holds(servo.holes)}{servo.caution('holes')}): use another servo"
        )
    xs, ys, zs = zip(servo.case_min_mm, servo.case_max_mm, strict=True)
    around, top = max(stack.ring_radius + ADAPTER_ARMS, stack.hub_radius), max(stack.ring_top, stack.horn)
    if stack.bearing is not None:
        around, top = stack.cage_outer + CAGE_HEADS, stack.cage_top
    discs = ((around, stack.horn), (around, top))
    case = box_corners(((xs[0], ys[0], stack.horn + zs[0]), (xs[1], ys[1], stack.horn)))  # with its horn
    boss = servo.horn_boss_diameter_mm / 2, servo.horn_boss_height_mm
    bodies = (case,) if min(boss) <= 0 else (case, around_axis(boss[0], stack.horn, stack.horn + boss[1]))
    if frame is not None:
        x, z = frame.reach_x, (frame.low, frame.high)
        return Mounted(
            onto=names.SERVO_FRAME,
            rear=frame.low,
            ears=frame.low,
            screw=FOOT_SCREW,
            holes=frame.feet,
            fixing="nut",
            corners=np.array([(sign * x, y, height) for sign in (-1, 1) for y in frame.ends_y for height in z]),
            bodies=(*bodies, box_corners(frame.sides()), frame.feet_corners(*frame.ends_y)),
            discs=discs,
            on_flat_deck=True,
            thread_mm=FOOT,
        )
    return Mounted(
        onto=names.SERVO_CASE,
        rear=stack.horn + servo.case_min_mm[2],
        ears=stack.horn + servo.rear.z_mm,
        screw=SCREWS[servo.rear.screw],
        holes=corner_holes(servo.rear.places),
        fixing=fixing_of(servo.rear),
        corners=np.array([(x, y, stack.horn + z) for x in xs for y in ys for z in zs]),
        bodies=bodies,
        discs=discs,
        on_flat_deck=True,
        thread_mm=servo.rear.depth_mm,
    )


def _left_out(scanner: Scanner, stack: DirectStack, frame: ServoFrame | None) -> Iterator[LeftOut]:
    if scanner.slip_ring is None:
        yield LeftOut(names.SLIP_RING_ADAPTER, "this scanner has no slip ring", 1, "parts")
    if frame is None:
        yield LeftOut(names.SERVO_FRAME, f"{scanner.servo.name} is held by the holes in its rear", 1, "parts")
    if stack.bearing is None:
        servo = scanner.servo
        why = f"the horn of {servo.name} alone carries an axis this upright"
        if servo.radial_load_n is None:
            why = f"{why} (rating assumed: its maker states none)"
        yield LeftOut(names.BEARING_CAGE, why, 1, "parts")
