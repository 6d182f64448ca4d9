"""The servo on the axis, as a `DriveLayout`: horn, shaft through the ring, hub."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from scanwright.cad.layout import names
from scanwright.cad.layout.direct.frame import FOOT, FOOT_SCREW, frame_of, needs_frame, no_rear_holes
from scanwright.cad.layout.direct.sizing import direct_stack
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.drive import Cuboid, DriveLayout, Mass, Mounted, Need, Rod
from scanwright.cad.layout.joints import fixing_of
from scanwright.cad.screws import SCREWS
from scanwright.design.left_out import LeftOut
from scanwright.design.scanner import Scanner

# The order that always works: what comes over the shaft follows what carries it.
BUILT = (
    names.SERVO_FRAME,
    names.BASE_MOUNT,
    names.TRIPOD_FOOT,
    names.DECK,
    names.SERVO_SHAFT,
    names.HORN_CUP,
    names.SLIP_RING_ADAPTER,
    names.CAGE_BASE,
    names.RING,
    names.JOURNAL_SLEEVE,
    names.BEARING_CAGE,
    names.STANDING_LEADS,
    names.LIDAR,
    names.SUB_PLATE,
    names.COUNTERWEIGHT,
    names.ALIGNMENT_LINKAGE,
    names.ROTOR_LEADS,
)
STACKED = (
    names.BASE_MOUNT,
    names.SERVO,
    names.SERVO_FRAME,
    names.SERVO_SHAFT,
    names.HORN_CUP,
    names.CAGE_BASE,
    names.SLIP_RING_ADAPTER,
    names.RING,
    names.BEARING_CAGE,
    names.BEARING,
    names.JOURNAL_SLEEVE,
    names.ALIGNMENT_LINKAGE,
)
ADAPTER_ARMS = 8.0  # beyond the ring
CAGE_HEADS = 4.0  # of the screws of the cage, beyond it


def direct_drive(scanner: Scanner) -> DriveLayout:
    """The drive of a scanner whose ring lets the shaft through, or that has none.

    Raises:
        BuildError: it cannot be laid out.
    """
    stack, ring = direct_stack(scanner), scanner.slip_ring
    (x0, y0, z0), (x1, y1, z1) = scanner.servo.case_min_mm, scanner.servo.case_max_mm
    case = Cuboid((x0, y0, stack.horn + z0), (x1, y1, stack.horn + z1))
    masses = [Mass(names.SERVO, scanner.servo.mass_g, Cuboid(case.low, (x1, y1, stack.horn)))]  # with its horn
    rods: list[Rod] = []
    if ring is not None:
        rods.append(Rod(stack.ring_radius, stack.ring_bottom, stack.ring_top))
        masses.append(Mass(names.RING, ring.mass_g, rods[0].cuboid(), turning=0.5))
    if stack.bearing is not None:
        top = stack.bearing_top
        bearing = Rod(stack.bearing.outer_mm / 2, top - stack.bearing.width_mm, top)
        masses.append(Mass(names.BEARING, stack.bearing.mass_g, bearing.cuboid(), turning=0.5))
    return DriveLayout(
        stack=stack,
        shaft=stack.shaft,
        products=() if stack.bearing is None else (stack.bearing,),
        mounted=_mounted(scanner, stack),
        masses=tuple(masses),
        shapes=(case, *rods),
        built=BUILT,
        stacked=STACKED,
        left_out=tuple(_left_out(scanner, stack)),
        borne=() if stack.bearing is None else ((names.JOURNAL_SLEEVE, names.SERVO_SHAFT),),
        needs=tuple(_needs(scanner, stack)),
    )


def _needs(scanner: Scanner, stack: DirectStack) -> Iterator[Need]:
    if scanner.slip_ring is not None:
        yield Need("wiring", "cable tie", "cable tie around the ring's stator", "groove of the adapter")
    if stack.bearing is not None:
        ring = f"retaining ring DIN 471 - {stack.retaining_ring}"
        compound = "retaining compound for metal, medium strength"
        yield Need("consumable", "retaining ring", ring, "groove of the shaft, under the bearing's sleeve")
        yield Need("consumable", "retaining compound", compound, "sleeve on the shaft")
        yield Need("consumable", "epoxy", "two-component epoxy, slow", "bearing in its printed seat")


def _mounted(scanner: Scanner, stack: DirectStack) -> Mounted:
    """The servo's case, or the frame that holds it.

    Raises:
        BuildError: it has no holes that may carry it.
    """
    servo = scanner.servo
    if len(servo.rear.places) < 4 and not needs_frame(servo):
        raise no_rear_holes(servo)
    xs, ys, zs = zip(servo.case_min_mm, servo.case_max_mm, strict=True)
    around, top = max(stack.ring_radius + ADAPTER_ARMS, stack.hub_radius), max(stack.ring_top, stack.horn)
    if stack.bearing is not None:
        around, top = stack.cage_outer + CAGE_HEADS, stack.cage_top
    discs = ((around, stack.horn), (around, top))
    if needs_frame(servo):
        p = frame_of(scanner, stack)
        frame = [(x, y, z) for x in (-p.reach_x, p.reach_x) for y in p.ends_y for z in (p.low, p.high)]
        return Mounted(
            onto=names.SERVO_FRAME,
            rear=p.low,
            ears=p.low,
            screw=FOOT_SCREW,
            holes=p.feet,
            fixing="nut",
            ear_mm=FOOT,
            corners=np.array(frame),
            discs=discs,
            stands_alone=True,
        )
    return Mounted(
        onto=names.SERVO_CASE,
        rear=stack.horn + servo.case_min_mm[2],
        ears=stack.horn + servo.rear.z_mm,
        screw=SCREWS[servo.rear.screw],
        holes=_corner_holes(servo.rear.places),
        fixing=fixing_of(servo.rear),
        ear_mm=servo.rear.depth_mm,
        corners=np.array([(x, y, stack.horn + z) for x in xs for y in ys for z in zs]),
        discs=discs,
        stands_alone=True,
    )


def _left_out(scanner: Scanner, stack: DirectStack) -> Iterator[LeftOut]:
    if scanner.slip_ring is None:
        yield LeftOut(names.SLIP_RING_ADAPTER, "this scanner has no slip ring", 1, "parts")
    if not needs_frame(scanner.servo):
        yield LeftOut(names.SERVO_FRAME, f"{scanner.servo.name} is held by the holes in its rear", 1, "parts")
    if stack.bearing is None:
        servo = scanner.servo
        why = f"the horn of {servo.name} carries an axis this upright alone"
        if servo.radial_load_n is None:
            why = f"{why}, by what such a horn is trusted with: its maker rates none"
        yield LeftOut(names.BEARING_CAGE, why, 1, "parts")


def _corner_holes(holes: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    """The four holes of the widest column pair that lie furthest apart along y."""
    widest = max(x for x, _ in holes)
    ys = sorted(y for x, y in holes if x == widest)
    return ((widest, ys[-1]), (-widest, ys[-1]), (-widest, ys[0]), (widest, ys[0]))
