"""Sizes of the direct drive: shaft and flange by ring and horn, the hub by the lidar, and the bearing. mm."""

import math
from dataclasses import replace

from scanwright.cad.layout.direct.cage import LEAST_BOSS, ears_of, fork_holes
from scanwright.cad.layout.direct.cup import cup_stack
from scanwright.cad.layout.direct.frame import needs_frame
from scanwright.cad.layout.direct.loads import bearing_for, horn_bears
from scanwright.cad.layout.direct.misalignment import with_waist
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.drive import Ears
from scanwright.cad.layout.envelope import Envelope, hub_height, hub_wall_mm, lidar_pose, rows_of, sub_plate_of
from scanwright.cad.layout.hub import CROSS_M3, HUB_GAP, HUB_WALL, CrossScrew
from scanwright.cad.layout.names import SERVO_SHAFT
from scanwright.cad.screws import SCREWS
from scanwright.design.arrays import Array
from scanwright.design.catalogue.servo import Servo
from scanwright.design.errors import BuildError
from scanwright.design.scanner import Scanner

SHAFT_PLAIN = 12.0  # without a ring, if it fits between the heads of the horn's screws
SHAFT_LOOSE = 1.0  # most clearance in a ring, if no thicker shaft fits between these heads
SHAFT_SLIDES = 0.05  # in the bore of a ring, whose set screws hold it, on the diameter
SHAFT_MIN = 8.0
LEAST_BORE = SHAFT_MIN + SHAFT_SLIDES
COLLAR_WALL, COLLAR_WALL_MIN = 2.4, 1.4  # around the horn's boss; less if the heads next to it are close


def direct_stack(scanner: Scanner, envelope: Envelope, cross: CrossScrew) -> tuple[DirectStack, Ears | None]:
    """Lay out the stack of one scanner with its servo on the axis, and the ears of a bearing's cage.

    Raises:
        BuildError: the ring has no bore, a bore too small for a shaft, the case has no holes for a cage, or the lidar
            would hang upside down.
    """
    R = lidar_pose(scanner)
    stack = _without_sub_plate(scanner, envelope, R, cross)
    if (axis := sub_plate_of(scanner.lidar, stack)) is not None:
        h = hub_height(envelope, R, stack.hub_radius, stack.rims, axis, stack.cross_screw)
        stack = replace(stack, h=h, sub_plate=axis)
    if stack.bearing is None:
        return stack, None
    ears = ears_of(scanner, stack)
    stack = replace(stack, cage_least=ears.opening + LEAST_BOSS)
    return with_waist(scanner, stack, ears), ears


def _without_sub_plate(scanner: Scanner, envelope: Envelope, R: Array, cross: CrossScrew) -> DirectStack:
    """Return the stack, a cup if neither ring nor bearing needs a turned shaft.

    Its cross screws are at least CROSS_M3 in a turned shaft.
    """
    cup = cup_stack(scanner, envelope, R, cross) if scanner.slip_ring is None else None
    if cup is not None and horn_bears(scanner, cup):
        return cup
    cross = max(cross, CROSS_M3, key=lambda one: one.washer)
    ring, count = scanner.slip_ring, max(1, len(scanner.lidar.cable_y_mm))
    shaft, length, radius, bore = _ring(scanner)
    flange_radius, flange_thickness, collar_radius, collar_height = _flange(scanner.servo, shaft)
    wall = hub_wall_mm(scanner.lidar, shaft)
    alone = DirectStack(
        h=hub_height(envelope, R, shaft / 2 + wall, [(radius, cross.hub_height + HUB_GAP)], cross=cross),
        R_rot_laser=rows_of(R),
        ring_length=length,
        ring_radius=radius,
        ring_bore=bore,
        ring_collar=0.0 if ring is None or ring.rotor is None else ring.rotor.length_mm,
        lead_count=count,
        lead_diameter=0.0 if ring is None else ring.leads_mm(count),
        lead_radius=0.0 if ring is None else ring.lead_bend_radius_mm or 0.0,
        shaft_diameter=shaft,
        cross_screw=cross,
        hub_wall=wall,
        flange_radius=flange_radius,
        flange_thickness=flange_thickness,
        collar_radius=collar_radius,
        collar_height=collar_height,
        waist_length=0.0,
        waist_diameter=shaft,
        bearing=None,
        sub_plate=None,
    )
    bearing = None
    forked = needs_frame(scanner.servo) or bool(fork_holes(scanner.servo, alone))
    # the horn is not rated for the rotor, or only the base of a cage has holes for the adapter of a ring
    if not horn_bears(scanner, alone) or (ring is not None and not forked):
        h = hub_height(envelope, R, shaft / 2 + HUB_WALL, alone.rims, cross=cross)
        alone = replace(alone, h=h, hub_wall=HUB_WALL)  # wider than the bore of a bearing
        try:
            bearing = bearing_for(scanner, alone)
        except BuildError:
            ears_of(scanner, alone)  # its error comes first: no other ring corrects it
            raise
    if bearing is None:
        return cup or alone
    stack = replace(alone, bearing=bearing)
    return replace(stack, h=hub_height(envelope, R, stack.hub_radius, stack.rims, cross=cross))


def _ring(scanner: Scanner) -> tuple[float, float, float, float]:
    """Return the shaft diameter, and the ring's length, radius and bore (0 without a ring)."""
    ring = scanner.slip_ring
    if ring is None:
        shaft = min(SHAFT_PLAIN, math.floor(4 * _radius_on_horn(scanner.servo)) / 2)  # between the heads of its screws
        return max(SHAFT_MIN, shaft), 0.0, 0.0, 0.0
    if ring.bore_mm == 0:
        raise BuildError(
            f"slip_ring {ring.name}: bore_mm = 0: direct drive needs a ring with a through bore: the shaft from horn "
            f"to lidar would have to pass the stator of a capsule; take a ring with bore_mm >= {LEAST_BORE:.1f}"
        )
    shaft = round(ring.bore_mm - SHAFT_SLIDES, 2)
    if shaft / 2 > _radius_on_horn(scanner.servo) > (ring.bore_mm - SHAFT_LOOSE) / 2:
        shaft = math.floor(4 * _radius_on_horn(scanner.servo)) / 2  # the ring's set screws centre it
    if shaft < SHAFT_MIN:
        raise BuildError(
            f"slip_ring {ring.name}: bore_mm = {ring.bore_mm:g}: a shaft of {shaft:g} mm bends under the lidar; "
            f"take a ring with bore_mm >= {LEAST_BORE:.1f}"
        )
    if ring.bore_mm + 4.0 > ring.outer_diameter_mm:
        raise BuildError(
            f"slip_ring {ring.name}: bore_mm = {ring.bore_mm:g}: leaves no ring in outer_diameter_mm = "
            f"{ring.outer_diameter_mm:g}"
        )
    return shaft, ring.length_mm, ring.outer_diameter_mm / 2, ring.bore_mm


def _radius_on_horn(servo: Servo) -> float:
    """Return the radius inside the heads of the horn's screws."""
    return (servo.horn_circle_mm - SCREWS[servo.horn_screw].head_diameter) / 2


def _flange(servo: Servo, shaft_diameter: float) -> tuple[float, float, float, float]:
    """Return the radius and thickness of the horn flange, radius and height of the collar over the horn's boss."""
    screw = SCREWS[servo.horn_screw]
    circle = servo.horn_circle_mm / 2
    radius = max(servo.horn_diameter_mm / 2, circle + screw.head_diameter / 2 + 0.5)
    inside, boss = _radius_on_horn(servo), servo.horn_boss_diameter_mm / 2
    collar = max(shaft_diameter / 2, min(boss + COLLAR_WALL, max(inside, boss + COLLAR_WALL_MIN)))
    if collar > inside:
        mark = servo.caution("horn_circle_mm")
        raise BuildError(
            f"{SERVO_SHAFT}: collar radius = {collar:g} mm: the heads of the horn's {screw.name} screws on a circle of "
            f"{servo.horn_circle_mm:g} mm{mark} leave {inside:g} mm; use a ring with a smaller bore, a capsule, or none"
        )
    thickness = 4.0
    return radius, thickness, collar, max(servo.horn_boss_height_mm + 4.0, thickness + screw.head_height)
