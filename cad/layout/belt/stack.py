"""The layout for capsule rings, which let no shaft through: a belt turns a hollow shaft. No kernel: plain numpy.

The servo is next to the shaft; its belt is toothed and 1:1, so that its absolute angle is that of the axis.

Rotation frame at gamma = 0, mm, from the hub of `cad/layout/hub.py` downwards:

    shoulder          the shaft's spigot begins, which ends in the hub as in direct drive
    pulley_top        LEADS_GAP below: the leads leave the shaft between
    teeth_top         a boss with grub screws holds the pulley on the shaft
    teeth_low         the pulley's lower face lies on a collar of the shaft
    tower_top         the collar lies on the upper bearing; the plate of the servo slides on the tower next to it
    lower_bottom      lower face of the lower bearing; a ring with grub screws holds the shaft up
    shaft_bottom      a soft tube joins the shaft's bore to the stub of the capsule's rotor
    flange_top        the capsule's flange, screwed to a disc in the tower
    ring_bottom       the capsule's lower end
    tower_bottom      on the base mount

The servo's frame has the directions of the rotation frame turned by `quarter` about z. Its belt pulls along the line of
centres, on which the plate slides: `centre` is the distance at which the belt is tight.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from scanwright.cad import outlines
from scanwright.cad.layout.drive import Ears, ears_on
from scanwright.cad.layout.envelope import around_axis, box_corners
from scanwright.cad.layout.hub import BEARING_STEP, Hub
from scanwright.cad.layout.joints import shank_mm
from scanwright.cad.layout.names import DRIVE_PLATE
from scanwright.cad.screws import SCREWS, Thread, passing_hole, thread_in_part
from scanwright.design.arrays import Array
from scanwright.design.catalogue.products import Bearing, Belt, Printer
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import Flange, Rotor
from scanwright.design.errors import BuildError
from scanwright.design.scanner import Scanner

RING_SCREW = SCREWS["M3"]  # of the ring under the lower bearing, into threads of the shaft: they hold up the lidar
RING_SCREWS_DEG = (45.0, 135.0)
PLATE_SCREW = SCREWS["M4"]
FOOT_SCREW = SCREWS["M3"]  # between tower and mount
LEADS_GAP = 14.0  # between hub and pulley
SLIDES = 0.04  # of the shaft in its bearings: the lower end of f7, which slides in by hand
SPAN = 30.0  # between the middles of the two bearings
BOSS = 9.0  # height of the pulley's boss, and of the ring under the lower bearing
BOSS_WALL = 9.0  # around the shaft: length of the screws
RIM = 1.5  # thickness of a pulley's rims
RIM_ABOVE_BELT = 0.5
BELT_SIDE_GAP = 0.5  # on each side of the belt
PULLEY_GAP = 2.0  # between plate and pulleys
PLATE = 5.0  # of the servo
HORN_BOSS_GAP = 0.5  # over the boss of the horn, in the foot of the drive pulley
UNDER_HORN_HEAD = 4.0  # of the drive pulley: at least
SEAT_GAP = 0.2  # the feet carry, not the plate
INNER_RING = 1.45  # width of a bearing's inner ring that a shoulder may touch
SEAT_WALL = 5.0  # of the tower
CHAMBER_GAP = 1.5  # around flange and ring in the tower
CAPSULE_GAP = 1.5  # between shaft and capsule, and the nuts of its flange and the ring on the shaft
DISC = 8.0  # thickness, of the capsule's holder
LEADS = 6.0  # between capsule and mount
SHELF = 12.0  # thickness of the tower's arms
PLATE_GRIP = 7.5  # of an arm above the nut of a screw of the plate
SHELF_WALL = 4.0  # of an arm next to the heads of the plate's screws
TRAVEL = 3.0  # of the plate to either side
CASE_GAP = 2.0  # around the servo's case, beyond the travel
FOOT = 10.0  # thickness of the tower's foot
FOOT_HALF = 32.0  # of its square
FOOT_HOLE = 24.0  # x and y of its screws
DISC_SCREW = SCREWS["M3"]
DISC_SCREWS = 3
SCREW_DEPTH = 10.0  # of a radial screw in the disc
UNDER_FOOT_NUT = 4.0  # of the foot
HORN_GAP = 1.5  # around the foot of the pulley
THIN_GAP = 0.5  # the same if the servo's screws are close to it


@dataclass(frozen=True, slots=True, kw_only=True)
class BeltStack(Hub):
    """The hollow shaft along its axis, and the servo next to it. Lengths in mm."""

    shaft_bore: float
    carrier: Bearing  # two of them
    belt: Belt
    belt_teeth: int
    teeth: int  # of each pulley
    centre: float
    quarter: int  # quarter turns of the servo's frame about z
    flange: Flange
    rotor: Rotor
    servo: Servo

    @property
    def tube_diameter(self) -> float:
        """Diameter of the shaft below the hub: that of its bearings."""
        return self.carrier.bore_mm

    @property
    def seat_diameter(self) -> float:
        """Diameter of the shaft in its bearings."""
        return self.tube_diameter - SLIDES

    @property
    def pulley_top(self) -> float:
        """Height of the upper end of the boss."""
        return self.shoulder - LEADS_GAP

    @property
    def teeth_top(self) -> float:
        """Height of the upper rim's upper face, of both pulleys."""
        return self.pulley_top - BOSS

    @property
    def teeth_low(self) -> float:
        """Height of the lower rim's lower face, of both pulleys."""
        return self.teeth_top - self.belt.width_mm - 2 * (BELT_SIDE_GAP + RIM)

    @property
    def belt_middle(self) -> float:
        """Height of the belt's middle."""
        return (self.teeth_top + self.teeth_low) / 2

    @property
    def pitch_radius(self) -> float:
        """Radius of the belt's cords on a pulley."""
        return self.teeth * self.belt.pitch_mm / (2 * math.pi)

    @property
    def tip_radius(self) -> float:
        """Radius of the pulleys' teeth."""
        return self.pitch_radius - self.belt.pitch_line_mm

    @property
    def belt_radius(self) -> float:
        """Radius of the belt's back on a pulley."""
        return self.tip_radius + self.belt.thickness_mm - self.belt.tooth_height_mm

    @property
    def rim_radius(self) -> float:
        """Radius of the pulleys' rims, the largest of the pulleys."""
        return self.belt_radius + RIM_ABOVE_BELT

    @property
    def boss_radius(self) -> float:
        """Radius of the boss, and of the ring under the lower bearing."""
        return self.tube_diameter / 2 + BOSS_WALL

    @property
    def collar_radius(self) -> float:
        """Radius of the shaft's collar, which touches the inner ring only."""
        return self.tube_diameter / 2 + INNER_RING

    @property
    def tower_top(self) -> float:
        """Height of tower, shelf and upper bearing."""
        return self.teeth_low - PULLEY_GAP - PLATE

    @property
    def upper_middle(self) -> float:
        """Height of the upper bearing's balls."""
        return self.tower_top - self.carrier.width_mm / 2

    @property
    def lower_middle(self) -> float:
        """Height of the lower bearing's balls."""
        return self.upper_middle - SPAN

    @property
    def lower_bottom(self) -> float:
        """Height of the lower bearing's lower face."""
        return self.lower_middle - self.carrier.width_mm / 2

    @property
    def collar_low(self) -> float:
        """Height of the lower end of the ring that holds the shaft up."""
        return self.lower_bottom - BEARING_STEP - BOSS

    @property
    def ring_screws(self) -> float:
        """Height of its screws."""
        return self.collar_low + BOSS / 2

    @property
    def ring_seat(self) -> float:
        """Distance from the axis of the faces that their heads bear on: sunk flush."""
        return self.boss_radius - RING_SCREW.head_height

    @property
    def shaft_bottom(self) -> float:
        """Height of the shaft's lower end."""
        return self.collar_low - 1.0

    @property
    def ring_top(self) -> float:
        """Height of the capsule's body towards its rotor."""
        return self.shaft_bottom - self.capsule_gap

    @property
    def capsule_gap(self) -> float:
        """Distance of shaft and capsule, for the nuts on its flange below the ring on the shaft."""
        grip = DISC + self.flange.thickness_mm
        over_flange = shank_mm(SCREWS[self.flange.screw], DISC, "nut", self.flange.thickness_mm) - grip
        below_ring = self.collar_low - self.shaft_bottom + self.flange.below_top_mm
        return max(CAPSULE_GAP, over_flange + CAPSULE_GAP - below_ring)

    @property
    def flange_top(self) -> float:
        """Height of the flange's face towards the rotor."""
        return self.ring_top - self.flange.below_top_mm

    @property
    def disc_top(self) -> float:
        """Height of the disc that the flange lies on."""
        return self.flange_top - self.flange.thickness_mm

    @property
    def ring_bottom(self) -> float:
        """Height of the capsule's lower end."""
        return self.ring_top - self.ring_length

    @property
    def tower_bottom(self) -> float:
        """Height of the tower's foot."""
        return min(self.ring_bottom, self.disc_top - DISC) - LEADS

    @property
    def tower_radius(self) -> float:
        """Outer radius of the tower around the bearings."""
        return self.carrier.outer_mm / 2 + SEAT_WALL

    @property
    def chamber_radius(self) -> float:
        """Inner radius of the tower around flange and ring."""
        return max(self.flange.diameter_mm / 2, self.boss_radius) + CHAMBER_GAP

    @property
    def wide_radius(self) -> float:
        """Outer radius of the tower there."""
        return self.chamber_radius + SEAT_WALL

    @property
    def horn(self) -> float:
        """Height of the servo's horn face."""
        return self.tower_top - SEAT_GAP - self.servo.case_max_mm[2]

    @property
    def pulley_seat(self) -> float:
        """Height of the faces that the heads of the horn's screws lie on: lower, and the foot's wall would be thin."""
        return max(self.horn + UNDER_HORN_HEAD, self.teeth_low)

    @property
    def plate_x(self) -> float:
        """Half extent of the servo's plate along the line of centres."""
        return max(self.servo.case_max_mm[0], -self.servo.case_min_mm[0]) + 8.0

    @property
    def slot_x(self) -> float:
        """Distance of the plate's screws from the horn's axis along the line of centres."""
        return self.plate_x - TRAVEL - PLATE_SCREW.driver_radius - 1.0

    @property
    def arms_y(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Inner side of the two arms along the case, and the line of the plate's screws on them; servo's frame."""
        low, high = self.servo.case_min_mm[1], self.servo.case_max_mm[1]
        beyond = self.rim_radius + PLATE_SCREW.driver_radius + 0.6  # a driver passes pulley and belt
        wall = SHELF_WALL + PLATE_SCREW.driver_radius
        inner = low - CASE_GAP, high + CASE_GAP
        return (inner[0], min(inner[0] - wall, -beyond)), (inner[1], max(inner[1] + wall, beyond))

    @property
    def plate_y(self) -> tuple[float, float]:
        """Extent of plate and arms across the line of centres, servo's frame."""
        (_, low), (_, high) = self.arms_y
        wall = SHELF_WALL + PLATE_SCREW.driver_radius
        return low - wall, high + wall

    @property
    def shadow_half_angle(self) -> float:
        """Half angle [rad] of the cone about -z that hub and pulley hide."""
        return max(math.atan2(self.hub_radius, -self.pulley_top), math.atan2(self.rim_radius, -self.teeth_top))

    @property
    def sure_half_angle(self) -> float:
        """Half angle [rad] of a cone inside it: of the rim, which is round."""
        return math.atan2(self.rim_radius - 0.1, -self.teeth_top)

    def turn(self) -> Array:
        """Return the rotation from the servo's frame to the rotation frame, shape (3, 3): whole quarter turns."""
        c, s = ((1, 0), (0, 1), (-1, 0), (0, -1))[self.quarter % 4]
        return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]], dtype=float)

    def servo_origin(self) -> Array:
        """Return the centre of the horn's face, rotation frame, shape (3,)."""
        return self.turn() @ [self.centre, 0.0, self.horn]

    @property
    def horn_axis(self) -> tuple[float, float]:
        """Where the horn's axis meets the plane z = 0."""
        return float(self.servo_origin()[0]), float(self.servo_origin()[1])


def case_corners(stack: BeltStack) -> Array:
    """Return corners of the servo's case at its place, rotation frame, shape (8, 3)."""
    low, high = stack.servo.case_min_mm, stack.servo.case_max_mm
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    return corners @ stack.turn().T + stack.servo_origin()


def drive_corners(stack: BeltStack) -> Array:
    """Return corners of boxes around case, plate, arms and servo's pulley, rotation frame, shape (n, 3)."""
    rim, (low, high) = stack.rim_radius, stack.plate_y
    reach = stack.centre + stack.plate_x + TRAVEL
    shelf = [(x, y, z) for x in (0.0, reach) for y in (low, high) for z in (stack.tower_top - SHELF, stack.tower_top)]
    pulley = [(stack.centre + a * rim, b * rim, stack.teeth_top) for a in (1, -1) for b in (1, -1)]
    return np.concatenate([case_corners(stack), np.array([*shelf, *pulley]) @ stack.turn().T])


def plate_of(scanner: Scanner) -> Ears:
    """Return the holes for the plate of one scanner: two pairs outside the pulley, or all close to a thinner foot.

    Raises:
        BuildError: the case has no two front holes next to the horn.
    """
    servo, printer = scanner.servo, scanner.printer
    opening = max(pulley_foot_radius(servo), servo.horn_diameter_mm / 2) + HORN_GAP
    least = opening + passing_hole(SCREWS[servo.front.screw], printer) / 2 + printer.min_wall_mm
    free = [(x, y) for x, y in servo.front.places if math.hypot(x, y) >= least]
    widest = max((x for x, _ in free), default=0.0)
    ys = sorted(y for x, y in free if x == widest and (-x, y) in free)
    if len(ys) >= 2:
        return ears_on(scanner, opening, tuple((side * widest, y) for y in (ys[0], ys[-1]) for side in (1.0, -1.0)))
    places = servo.front.places
    thin = (servo.horn_circle_mm + passing_hole(SCREWS[servo.horn_screw], printer)) / 2 + printer.min_wall_mm
    opening = max(thin, servo.horn_diameter_mm / 2) + THIN_GAP
    least = opening + passing_hole(SCREWS[servo.front.screw], printer) / 2 + printer.min_wall_mm
    if len(places) < 2 or min(math.hypot(x, y) for x, y in places) < least:
        caution = servo.caution("holes")
        raise BuildError(
            f"{DRIVE_PLATE}: ears: holes = {list(places)} in front{caution}: {servo.name} needs two or more front "
            f"holes, all at least {least:.2f} mm from its axis, outside of the pulley"
        )
    ears = ears_on(scanner, opening, places)
    middle = sum(y for _, y in places) / len(places)
    heel = min(middle - servo.case_min_mm[1], servo.case_max_mm[1] - middle)
    return replace(ears, heel_mm=heel if len(places) == 2 else None)


def pulley_foot_radius(servo: Servo, opening: float = math.inf) -> float:
    """Return the radius of the drive pulley's foot on the horn, in the opening of a plate."""
    return min(servo.horn_circle_mm / 2 + SCREWS[servo.horn_screw].nominal / 2 + 2.0, opening - THIN_GAP)


def tower_corners(stack: BeltStack) -> tuple[Array, Array]:
    """Return the corners of a cylinder around the tower, shape (n, 3), and of a box around its foot, shape (8, 3)."""
    flares = max(0.0, math.sqrt(2) * FOOT_HALF - stack.wide_radius)  # the cone on the foot, at 45 deg
    low, high = stack.tower_bottom, stack.tower_bottom + FOOT + flares
    foot = box_corners(((-FOOT_HALF, -FOOT_HALF, low), (FOOT_HALF, FOOT_HALF, high)))
    return around_axis(stack.wide_radius, low, stack.tower_top), foot


def shelf_corners(stack: BeltStack) -> Array:
    """Return the corners of a box around plate and arms, shape (8, 3)."""
    corners = drive_corners(stack)[:, :2]
    (x0, y0), (x1, y1) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    return box_corners(((x0, y0, stack.tower_top - SHELF), (x1, y1, stack.tower_top + PLATE)))


def tower_foot_of(printer: Printer, stack: BeltStack) -> Thread:
    """Return the thread of the mount's screws in the foot; nuts are inserted from its corners."""
    foot = thread_in_part(FOOT_SCREW, printer, carries=True)
    free = math.sqrt(2) * FOOT_HOLE - printer.min_wall_mm - stack.chamber_radius
    fits = foot.trap is None or foot.trap.corner <= free
    return foot if fits else thread_in_part(FOOT_SCREW, printer, nut_fits=False, carries=True)


def disc_azimuths(stack: BeltStack) -> list[float]:
    """Return azimuths [rad] of the radial screws of the capsule's disc, servo's frame, between those of its flange."""
    return [math.pi / stack.flange.holes + 2 * math.pi * k / DISC_SCREWS + math.pi / 2 for k in range(DISC_SCREWS)]


def flange_centres(flange: Flange) -> list[tuple[float, float]]:
    """Return centres of the flange's holes, servo's frame; one at its +y."""
    centres = outlines.polygon(flange.circle_mm / 2, flange.holes, math.pi / 2)
    return [(float(x), float(y)) for x, y in centres]
