"""The servo beside the axis, for capsule rings, as a `DriveLayout`: belt, hollow shaft, tower."""

from __future__ import annotations

import numpy as np

from scanwright.cad.layout import names
from scanwright.cad.layout.belt.sizing import belt_stack
from scanwright.cad.layout.belt.stack import (
    FOOT,
    FOOT_HALF,
    FOOT_HOLE,
    FOOT_SCREW,
    BeltStack,
    case_corners,
    drive_corners,
)
from scanwright.cad.layout.drive import Cuboid, DriveLayout, Mass, Mounted, Need, Rod
from scanwright.design.arrays import Array
from scanwright.design.left_out import LeftOut
from scanwright.design.scanner import Scanner

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
    names.TRIPOD_FOOT,
    names.STANDING_LEADS,
    names.LIDAR,
    names.SUB_PLATE,
    names.COUNTERWEIGHT,
    names.ALIGNMENT_LINKAGE,
    names.ROTOR_LEADS,
)
STACKED = (
    names.BASE_MOUNT,
    names.SLIP_RING_ADAPTER,
    names.RING,
    names.SHAFT_RING,
    names.BEARING_TOWER,
    names.BEARING,
    names.MAIN_SHAFT,
    names.SERVO,
    names.DRIVE_PLATE,
    names.DRIVE_PULLEY,
    names.BELT,
    names.SHAFT_PULLEY,
    names.ALIGNMENT_LINKAGE,
)
SOFT_TUBE = "a soft tube, 10 mm long, from the shaft's bore to the stub of the capsule's rotor: {:g} x {:g} mm"
RUBBER = "mounting instructions of capsule rings: drive the rotor by rubber tubing"


def belt_drive(scanner: Scanner) -> DriveLayout:
    """The drive of a scanner with a capsule ring.

    Raises:
        BuildError: it cannot be laid out.
    """
    stack, ring = belt_stack(scanner), scanner.slip_ring
    assert ring is not None
    corners = case_corners(stack)
    case = _cuboid(corners.min(axis=0), corners.max(axis=0))
    capsule = Rod(stack.ring_radius, stack.ring_bottom, stack.ring_top)
    outer, half = stack.carrier.outer_mm / 2, stack.carrier.width_mm / 2
    bearings = [Rod(outer, middle - half, middle + half) for middle in (stack.upper_middle, stack.lower_middle)]
    return DriveLayout(
        stack=stack,
        shaft=names.MAIN_SHAFT,
        products=(stack.carrier, stack.carrier, stack.belt),
        mounted=_mounted(stack),
        masses=(
            Mass(names.SERVO, stack.servo.mass_g, case),
            Mass(names.BELT, stack.belt.mass_g, _around_belt(stack)),
            Mass(names.RING, ring.mass_g, capsule.cuboid(), turning=0.5),
            *(Mass(names.BEARING, stack.carrier.mass_g, bearing.cuboid(), turning=0.5) for bearing in bearings),
        ),
        shapes=(case, capsule),
        built=BUILT,
        stacked=STACKED,
        left_out=(LeftOut(names.BEARING_CAGE, "the two bearings of the tower carry the axis", 1, "parts"),),
        borne=((names.SHAFT_RING, names.BEARING_TOWER),),
        needs=(Need("wiring", "soft tube", SOFT_TUBE.format(stack.shaft_bore, stack.rotor.diameter_mm), RUBBER),),
    )


def _mounted(stack: BeltStack) -> Mounted:
    """The tower."""
    foot = [(x, y, stack.tower_bottom) for x in (-FOOT_HALF, FOOT_HALF) for y in (-FOOT_HALF, FOOT_HALF)]
    return Mounted(
        onto=names.BEARING_TOWER,
        rear=stack.tower_bottom,
        ears=stack.tower_bottom,
        screw=FOOT_SCREW,
        holes=tuple((a * FOOT_HOLE, b * FOOT_HOLE) for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))),
        fixing="nut",
        ear_mm=FOOT,
        corners=np.concatenate([drive_corners(stack), np.array(foot)]),
        discs=((stack.wide_radius, stack.tower_bottom), (stack.wide_radius, stack.tower_top)),
        stands_alone=False,
    )


def _around_belt(stack: BeltStack) -> Cuboid:
    corner = stack.turn() @ [stack.centre + stack.belt_radius, stack.belt_radius, 0.0]
    start = stack.turn() @ [-stack.belt_radius, -stack.belt_radius, 0.0]
    width = np.array([0.0, 0.0, stack.belt.width_mm / 2])
    middle = np.array([0.0, 0.0, stack.belt_middle])
    return _cuboid(np.minimum(corner, start) + middle - width, np.maximum(corner, start) + middle + width)


def _cuboid(low: Array, high: Array) -> Cuboid:
    (x0, y0, z0), (x1, y1, z1) = low.tolist(), high.tolist()
    return Cuboid((x0, y0, z0), (x1, y1, z1))
