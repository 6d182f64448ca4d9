"""Sizes of the belt drive: bearings by the capsule, pulleys by the boss, the belt by the servo's place. mm."""

import math
from dataclasses import replace

from scanwright.cad.layout.belt.stack import (
    CASE_GAP,
    CHAMBER_GAP,
    FOOT_HOLE,
    FOOT_SCREW,
    HORN_BOSS_GAP,
    PULLEY_GAP,
    TRAVEL,
    BeltStack,
    drive_corners,
)
from scanwright.cad.layout.envelope import Envelope, hub_height, lidar_pose, rows_of, sub_plate_of
from scanwright.cad.layout.hub import CROSS_M3, HUB_WALL, CrossScrew
from scanwright.cad.layout.names import BEARING_TOWER, DRIVE_PULLEY
from scanwright.cad.screws import SCREWS
from scanwright.design.catalogue.products import Bearing, Belt, Printer
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.errors import BuildError
from scanwright.design.scanner import Scanner

SPIGOT_DIAMETER = 12.0  # as in direct drive: a wider hub would hide more
SHAFT_WALL = 4.0  # least, around the bore
TUBE_WALL = 2.5  # of the soft tube between rotor and bore
SWEEP_MARGIN = 3.0  # between the turning lidar and the deck
TEETH_STEP = 10
TEETH_LEAST = 80  # a smaller pulley makes more of its run-out
QUARTERS = (3, 2, 0)  # not 1: there the shelf would hide the index groove at +y


def belt_stack(scanner: Scanner, envelope: Envelope, cross: CrossScrew) -> BeltStack:
    """Lay out the scanner of a capsule ring, with cross screws of CROSS_M3 or larger.

    Raises:
        BuildError: no bearing or belt of the catalogue fits the capsule, the horn is above the belt, the heads of
            its screws leave no wall, or the lidar would hang upside down.
    """
    cross = max(cross, CROSS_M3, key=lambda one: one.washer)
    ring, servo, R = scanner.slip_ring, scanner.servo, lidar_pose(scanner)
    assert ring is not None and ring.flange is not None and ring.rotor is not None  # of every capsule
    bore = ring.rotor.diameter_mm + 2 * TUBE_WALL
    carrier = _carrier(scanner, ring, bore + 2 * SHAFT_WALL)
    belt = _belt(scanner, ring)
    hub = SPIGOT_DIAMETER / 2 + HUB_WALL
    alone = BeltStack(
        h=hub_height(envelope, R, hub, cross=cross),
        R_rot_laser=rows_of(R),
        ring_length=ring.length_mm,
        ring_radius=ring.outer_diameter_mm / 2,
        shaft_diameter=SPIGOT_DIAMETER,
        cross_screw=cross,
        shaft_bore=bore,
        bearing=None,
        sub_plate=None,
        carrier=carrier,
        belt=belt,
        belt_teeth=belt.teeth[-1],
        teeth=TEETH_LEAST,
        centre=0.0,
        quarter=0,
        flange=ring.flange,
        rotor=ring.rotor,
        servo=servo,
    )
    _check_tower(alone, ring, scanner)
    teeth = TEETH_LEAST
    while replace(alone, teeth=teeth).tip_radius - belt.tooth_height_mm < alone.boss_radius + 1.0:
        teeth += TEETH_STEP
    alone = replace(alone, teeth=teeth)
    _check_horn(alone)
    _check_heads(alone, scanner.printer)
    least = _least_centre(alone, servo)
    stock = sorted(n for n in belt.teeth if centre_of(n, teeth, belt.pitch_mm) >= least)
    if not stock:
        raise BuildError(
            f"{DRIVE_PULLEY}: centre distance >= {least:.1f} mm: the longest {belt.name} of the catalogue has "
            f"{max(belt.teeth)} teeth and reaches {centre_of(max(belt.teeth), teeth, belt.pitch_mm):.1f}; add a longer "
            "one to its teeth"
        )
    stack = replace(alone, belt_teeth=stock[0], centre=centre_of(stock[0], teeth, belt.pitch_mm))
    if (axis := sub_plate_of(scanner.lidar, stack)) is not None:
        stack = replace(stack, h=hub_height(envelope, R, hub, sub_plate=axis, cross=cross), sub_plate=axis)
    return replace(stack, quarter=_quarter(scanner, stack, envelope.radius(stack.sub_plate)))


def centre_of(belt_teeth: int, teeth: int, pitch_mm: float) -> float:
    """Return the centre distance at which a belt is tight around two equal pulleys."""
    return (belt_teeth - teeth) * pitch_mm / 2


def _carrier(scanner: Scanner, ring: SlipRing, least: float) -> Bearing:
    fitting = next((bearing for bearing in scanner.bearings if bearing.bore_mm >= least), None)
    if fitting is None:
        most = max((bearing.bore_mm for bearing in scanner.bearings), default=0.0)
        raise BuildError(
            f"{BEARING_TOWER}: slip_ring {ring.name}: rotor.diameter_mm = {least - 2 * (TUBE_WALL + SHAFT_WALL):g}: "
            f"its shaft needs bearings with bore_mm >= {least:g}, the largest of the catalogue has {most:g}; add one, "
            "or take a smaller capsule"
        )
    return fitting


def _belt(scanner: Scanner, ring: SlipRing) -> Belt:
    if not scanner.belts:
        raise BuildError(
            f"{DRIVE_PULLEY}: slip_ring {ring.name}: bore_mm = 0: a capsule needs a belt next to the axis, and the "
            "catalogue has none; add a product of kind = 'belt'"
        )
    return scanner.belts[0]


def _check_tower(stack: BeltStack, ring: SlipRing, scanner: Scanner) -> None:
    """Check that the screws of the tower's foot are outside the capsule's chamber."""
    corner = math.sqrt(2) * FOOT_HOLE - FOOT_SCREW.nominal / 2 - scanner.printer.min_wall_mm
    if stack.chamber_radius > corner:
        most = 2 * (corner - CHAMBER_GAP)
        raise BuildError(
            f"{BEARING_TOWER}: slip_ring {ring.name}: flange.diameter_mm = {stack.flange.diameter_mm:g}: does not fit "
            f"between the screws of the tower's foot; at most {most:.1f}: take a smaller capsule"
        )


def _check_horn(stack: BeltStack) -> None:
    """Check that the pulley's foot reaches down to the horn."""
    most = stack.teeth_low - stack.horn - stack.servo.case_max_mm[2]
    if stack.horn > stack.teeth_low:
        servo = stack.servo
        raise BuildError(
            f"{DRIVE_PULLEY}: foot: case_max_mm = {list(servo.case_max_mm)}{servo.caution('case_max_mm')}: the horn of "
            f"{servo.name} is {-servo.case_max_mm[2]:g} mm above its case, and the belt {most:g}; take a hub or a "
            "servo whose horn lies lower"
        )


def _check_heads(stack: BeltStack, printer: Printer) -> None:
    """Check the wall below the teeth, and around the horn's boss, at the heads of the horn's screws."""
    servo = stack.servo
    screw = SCREWS[servo.horn_screw]
    place = f"{DRIVE_PULLEY}: heads: horn_circle_mm = {servo.horn_circle_mm:g}"
    heads = f"the heads of the {screw.name} screws of {servo.name}"
    middle, around = servo.horn_circle_mm / 2, screw.driver_radius + printer.min_wall_mm
    if middle + around > stack.tip_radius - stack.belt.tooth_height_mm:
        raise BuildError(
            f"{place}: {heads} reach into the teeth of a pulley of {stack.teeth}; take a servo with a smaller horn"
        )
    boss = servo.horn_boss_diameter_mm
    over_boss = stack.pulley_seat - stack.horn - servo.horn_boss_height_mm - HORN_BOSS_GAP
    if over_boss < printer.min_wall_mm and middle - around < boss / 2:
        raise BuildError(f"{place}: {heads} leave no wall around its boss of {boss:g} mm")


def _least_centre(stack: BeltStack, servo: Servo) -> float:
    """Return the shortest centre distance with the case next to the tower and the belt mounted."""
    case = stack.wide_radius - servo.case_min_mm[0] + CASE_GAP
    return TRAVEL + max(case, 2 * stack.rim_radius + PULLEY_GAP, stack.carrier.outer_mm / 2 + stack.plate_x + CASE_GAP)


def _quarter(scanner: Scanner, stack: BeltStack, rotor_radius: float) -> int:
    """Return the side of the servo that allows the lowest deck; of equal ones, the one at the side of the axis."""
    up = scanner.angles.T_world_rot(0.0)[2, :3]
    normal = up if up[2] >= -1e-6 else -up
    rotor = rotor_radius + SWEEP_MARGIN

    def needs(quarter: int) -> tuple[float, float]:
        turned = replace(stack, quarter=quarter)
        below = max(rotor, float((drive_corners(turned) @ -normal).max()))
        return round(below, 3), round(abs(float(turned.turn()[:, 0] @ normal)), 3)

    return min(QUARTERS, key=needs)
