"""Every number that more than one part needs, derived from a `Scanner` once. No kernel: plain numpy.

Rotation frame at gamma = 0, mm: origin at the optical centre, z the rotation axis out of the servo horn, +y
towards the servo's +Y face, where the index marks meet. Everything that turns stays above the plane of the
ring's top, everything that stands still beside the shaft stays below it: clearance of a whole turn needs no stepping.

    z = 0             optical centre
    -h                top of the linkage's hub
    shoulder          HUB_HEIGHT below: all that turns and is wider than the journal is above it
    hub_bottom        bottom of the hub: the shoulder, or below it the journal that sits in a bearing
    ring_top          HUB_GAP below: the rotor's wires leave here
    ring_bottom       the ring's length below
                      RING_GAP, or the shaft's waist, below: top of the shaft's collar
    horn              the servo's horn face

A tilted axis whose rotor is too heavy for the horn alone gets a bearing on the journal (`cad/layout/loads.py`).

The same boxes of the lidar (`Envelope`) give h and are cut from the linkage, so the two cannot disagree.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from cad.layout.head import CLAMP_ABOVE_BOTTOM, HUB_GAP, HUB_HEIGHT, HUB_WALL, Axis, Head
from cad.layout.loads import WAIST, bearing_of
from cad.screws import SCREWS, Screw
from design.catalogue.products import Lidar, Servo
from design.errors import BuildError
from design.frames import Array
from design.scanner import Scanner

RING_GAP = 3.0
SHAFT_PLAIN = 12.0  # without a ring
SHAFT_RUNNING_GAP = 0.4  # least gap between shaft and bore, on the diameter
SHAFT_MIN = 8.0
PLATE_THICKNESS = 8.0
BODY_GAP = 0.6  # around the lidar's body
SUB_PLATE = 4.0  # thickness
EAR_REACH = 9.0  # of the sub-plate's ears beyond the lidar
EAR_HALF_WIDTH = 10.0
CAGE_MIN = 30.0  # least inner radius of the bearing's cage: heads of the servo's screws
CAGE_WALL = 5.0
CAGE_TIE = 2.0  # between ring and cage: a cable tie around the ring
BEARING_PLAY = 0.3  # along the axis: the horn alone carries along it
CAGE_GAP = 1.0  # between hub and cage
WINDOWS_REACH = 3.0  # of the cage's windows into its roof
CAGE_SEAT_WALL = 4.0  # around the bearing
STRIP = 0.3  # under the top of a ring's stator that its drawing does not vouch for
CAGE_LIP = 1.5  # under the bearing's outer ring, thick and wide
H_FLOOR = (45.0, 58.0)  # for an upright lidar and from 60 deg of tilt: stiffness and shadow (measured study)

Box = tuple[tuple[float, float, float], tuple[float, float, float]]


@dataclass(frozen=True, slots=True)
class Envelope:
    """What belongs to the lidar, as boxes (low corner, high corner) in the laser frame.

    Attributes:
        body: the lidar.
        cables: where they leave, straight.
        plate: of the linkage, with a sub-plate if there is one.
        under: heads of the lidar's screws below the plate, or the ears of the sub-plate.
    """

    body: Box
    cables: tuple[Box, ...]
    plate: Box
    under: Box

    def corners(self) -> Array:
        """Corners of all boxes, shape (n, 3)."""
        return np.concatenate([box_corners(box) for box in (self.body, *self.cables, self.plate, self.under)])


@dataclass(frozen=True, slots=True, kw_only=True)
class Stack(Head):
    """The scanner along its axis with the servo on it: horn, shaft through the ring, hub (rotation frame, mm)."""

    ring_bore: float
    flange_radius: float
    flange_thickness: float
    collar_radius: float
    collar_height: float

    @property
    def bearing_middle(self) -> float:
        """Height of the bearing's balls."""
        return self.bearing_top - (0.0 if self.bearing is None else self.bearing.width_mm / 2)

    @property
    def cage_inner(self) -> float:
        """Inner radius of the bearing's cage, around the ring."""
        return max(self.ring_radius + CAGE_TIE, CAGE_MIN)

    @property
    def cage_outer(self) -> float:
        """Outer radius of the bearing's cage."""
        return self.cage_inner + CAGE_WALL

    @property
    def cage_top(self) -> float:
        """Height of the cage's upper face."""
        return self.shoulder - CAGE_GAP

    @property
    def cage_seat(self) -> float:
        """Height of the lip that the bearing lies on, if it falls down its play."""
        return self.bearing_top - (0.0 if self.bearing is None else self.bearing.width_mm) - BEARING_PLAY

    @property
    def cage_roof(self) -> float:
        """Height at which the cage starts to narrow towards the bearing, at 45 deg."""
        if self.bearing is None:
            return self.cage_seat
        return self.cage_seat - CAGE_LIP - (self.cage_inner - self.bearing.outer_mm / 2 + CAGE_LIP)

    @property
    def ring_top(self) -> float:
        """Height of the ring's upper face."""
        return self.hub_bottom - HUB_GAP

    @property
    def ring_bottom(self) -> float:
        """Height of the ring's lower face."""
        return self.ring_top - self.ring_length

    @property
    def horn(self) -> float:
        """Height of the servo's horn face."""
        return self.ring_bottom - (RING_GAP if self.bearing is None else WAIST) - self.collar_height

    @property
    def shadow_half_angle(self) -> float:
        """Half angle [rad] of the cone about -z that ring, or cage, hide from the optical centre."""
        ring = math.atan2(max(self.ring_radius, self.hub_radius), -self.ring_top)
        if self.bearing is None:
            return ring
        seat = math.atan2(self.bearing.outer_mm / 2 + CAGE_SEAT_WALL, -self.cage_top)
        return max(ring, seat, math.atan2(self.cage_outer, -self.cage_roof))

    @property
    def sure_half_angle(self) -> float:
        """Half angle [rad] of that cone by solids of revolution only, a little inside their edges."""
        rims = []
        if self.ring_radius > 0:
            rims.append((self.ring_radius, self.ring_top - 1.0 - STRIP))
        if self.bearing is not None:
            rims.append((self.bearing.outer_mm / 2 + CAGE_SEAT_WALL, self.cage_top))
            rims.append((self.cage_outer - WINDOWS_REACH, self.cage_roof + WINDOWS_REACH))
        return max((math.atan2(radius, -z) for radius, z in rims), default=0.0)


def stack_of(scanner: Scanner) -> Stack:
    """Lay out the stack of one scanner with its servo on the axis.

    Raises:
        BuildError: the ring has no bore, a bore too small for a shaft, or the lidar would hang upside down.
    """
    R = lidar_pose(scanner)
    shaft, length, radius, bore = _ring(scanner)
    flange_radius, flange_thickness, collar_radius, collar_height = _flange(scanner.servo, shaft)
    h = hub_height(scanner.lidar, R, shaft / 2 + HUB_WALL, radius, None)
    alone = Stack(
        h=h,
        R_rot_laser=rows_of(R),
        ring_length=length,
        ring_radius=radius,
        ring_bore=bore,
        shaft_diameter=shaft,
        flange_radius=flange_radius,
        flange_thickness=flange_thickness,
        collar_radius=collar_radius,
        collar_height=collar_height,
        bearing=None,
        sub_plate=None,
    )
    bearing = bearing_of(scanner, alone)
    stack = replace(alone, bearing=bearing)
    if not covered_screws(scanner.lidar, stack):
        return stack
    axis = leaning_least(R)
    return replace(stack, h=hub_height(scanner.lidar, R, stack.hub_radius, radius, axis), sub_plate=axis)


def lidar_pose(scanner: Scanner) -> Array:
    """Laser in the rotation frame, shape (3, 3).

    Raises:
        BuildError: the lidar would hang upside down.
    """
    R = exact(scanner.angles.R_rot_laser())
    if R[2, 2] < -1e-9:
        tilt = math.degrees(math.acos(R[2, 2]))
        raise BuildError(
            f"alignment_linkage: tilt = {tilt:.2f} deg: the lidar would hang upside down over the ring; at most 90: "
            "keep alpha_laser_deg and beta_laser_deg within -90..90, or reverse the axis"
        )
    return R


def rows_of(R: Array) -> tuple[tuple[float, float, float], ...]:
    """A matrix (3, 3) as a record holds it."""
    return tuple((float(row[0]), float(row[1]), float(row[2])) for row in R)


def leaning_least(R: Array) -> Axis:
    """The laser's axis along which a sub-plate's ears reach no lower than the lidar's corners."""
    return "x" if abs(R[2, 0]) <= abs(R[2, 1]) else "y"


def covered_screws(lidar: Lidar, stack: Head) -> list[int]:
    """Which of the lidar's screws (index into `mount_holes_mm`) the hub hides from a driver below the plate."""
    return [i for i, hole in enumerate(lidar.mount_holes_mm) if not _driver_passes(lidar, stack, hole)]


def _driver_passes(lidar: Lidar, stack: Head, hole: tuple[float, float]) -> bool:
    """Whether the driver's way misses hub and journal, or takes no more than the hub's rim."""
    R, room = stack.R(), SCREWS[lidar.mount_screw].head_room
    depth = np.linspace(0.0, 150.0, 601)
    line = np.array([*hole, -lidar.optical_height_mm - PLATE_THICKNESS]) @ R.T - depth[:, None] * R[:, 2]
    reach = np.hypot(line[:, 0], line[:, 1]) - room
    hub = (line[:, 2] > stack.shoulder - room) & (line[:, 2] < room - stack.h)
    journal = (line[:, 2] > stack.hub_bottom - room) & (line[:, 2] < stack.hub_bottom + stack.journal)
    radius = 0.0 if stack.bearing is None else stack.bearing.bore_mm / 2
    return bool((reach > stack.shaft_diameter / 2 + 3.0)[hub].all() and (reach > radius)[journal].all())


def envelope_of(lidar: Lidar, sub_plate: Axis | None) -> Envelope:
    """The boxes of one lidar, gaps included, in the laser frame (origin at the optical centre)."""
    half_x, half_y = lidar.body_mm[0] / 2, lidar.body_mm[1] / 2
    seat = -lidar.optical_height_mm
    top = lidar.body_mm[2] - lidar.optical_height_mm
    room = lidar.cable_diameter_mm / 2 + 2.0
    back = -half_x - lidar.cable_straight_mm - lidar.cable_diameter_mm
    cables = tuple(
        (
            (back, y - room, seat + max(lidar.cable_z_mm - room, 0.5)),
            (1.0 - half_x, y + room, seat + lidar.cable_z_mm + room),
        )
        for y in lidar.cable_y_mm
    )
    gap = BODY_GAP
    if sub_plate is None:
        lower = seat - PLATE_THICKNESS
        under = (-half_x, -half_y, lower - SCREWS[lidar.mount_screw].head_height - 0.5), (half_x, half_y, lower)
    else:
        lower = seat - SUB_PLATE - PLATE_THICKNESS
        x, y = ear_corner(lidar, sub_plate)
        under = (-x, -y, lower), (x, y, seat)
    return Envelope(
        body=((-half_x - gap, -half_y - gap, seat), (half_x + gap, half_y + gap, top)),
        cables=cables,
        plate=((-half_x, -half_y, lower), (half_x, half_y, seat)),
        under=under,
    )


def ear_corner(lidar: Lidar, sub_plate: Axis) -> tuple[float, float]:
    """Half extents of the strip that holds the two ears of a sub-plate."""
    half_x, half_y = lidar.body_mm[0] / 2, lidar.body_mm[1] / 2
    if sub_plate == "x":
        return half_x + EAR_REACH, EAR_HALF_WIDTH
    return EAR_HALF_WIDTH, half_y + EAR_REACH


def rotor_radius(lidar: Lidar, sub_plate: Axis | None) -> float:
    """Radius of the sphere about the optical centre that lidar, cables and plate sweep."""
    return float(np.linalg.norm(envelope_of(lidar, sub_plate).corners(), axis=1).max())


def box_corners(box: Box) -> Array:
    """The eight corners, shape (8, 3)."""
    low, high = box
    return np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])


def exact(R: Array) -> Array:
    """Cosines of 90 deg are 6e-17 in floating point: make them 0, so that right angles stay planar in the kernel."""
    return np.where(np.abs(R) < 1e-12, 0.0, R)


def horn_screw(servo: Servo) -> Screw:
    """Screw of the horn's pattern."""
    return SCREWS[servo.horn_screw]


def _ring(scanner: Scanner) -> tuple[float, float, float, float]:
    """Shaft diameter, and the ring's length, radius and bore (0 without a ring)."""
    ring = scanner.slip_ring
    if ring is None:
        return SHAFT_PLAIN, 0.0, 0.0, 0.0
    if ring.bore_mm == 0:
        raise BuildError(
            f"slip_ring {ring.name}: bore_mm = 0: direct drive needs a ring with a through bore: the shaft from horn "
            f"to lidar would have to pass the stator of a capsule; take a ring with bore_mm >= {_least_bore():.1f}"
        )
    # half millimetres: bar stock and reamers come in them
    shaft = math.floor((ring.bore_mm - SHAFT_RUNNING_GAP) * 2) / 2
    if shaft < SHAFT_MIN:
        raise BuildError(
            f"slip_ring {ring.name}: bore_mm = {ring.bore_mm:g}: a shaft of {shaft:g} mm bends under the lidar; "
            f"take a ring with bore_mm >= {_least_bore():.1f}"
        )
    if ring.bore_mm + 4.0 > ring.outer_diameter_mm:
        raise BuildError(
            f"slip_ring {ring.name}: bore_mm = {ring.bore_mm:g}: leaves no ring in outer_diameter_mm = "
            f"{ring.outer_diameter_mm:g}"
        )
    return shaft, ring.length_mm, ring.outer_diameter_mm / 2, ring.bore_mm


def _least_bore() -> float:
    return SHAFT_MIN + SHAFT_RUNNING_GAP


def _flange(servo: Servo, shaft_diameter: float) -> tuple[float, float, float, float]:
    """Radius and thickness of the horn flange, radius and height of the collar over the horn's boss."""
    screw = horn_screw(servo)
    circle = servo.horn_circle_mm / 2
    radius = max(servo.horn_diameter_mm / 2, circle + screw.head_diameter / 2 + 0.5)
    collar = max(shaft_diameter / 2, servo.horn_boss_diameter_mm / 2 + 2.4)
    room = circle - screw.head_diameter / 2
    if collar > room:
        raise BuildError(
            f"servo_shaft: collar radius = {collar:g} mm: the heads of the horn's {screw.name} screws on a circle of "
            f"{servo.horn_circle_mm:g} mm leave {room:g} mm; take a ring with a smaller bore"
        )
    thickness = 4.0
    return radius, thickness, collar, max(servo.horn_boss_height_mm + 4.0, thickness + screw.head_height)


def hub_height(lidar: Lidar, R: Array, hub_radius: float, ring_radius: float, sub_plate: Axis | None) -> float:
    """h: the hub's top lies at z = -h. The largest of what each thing asks for, rounded up to 0.25 mm."""
    envelope = envelope_of(lidar, sub_plate)
    lowest = [float((box_corners(box) @ R[2]).min()) for box in (envelope.body, *envelope.cables)]
    plate = float((box_corners(envelope.plate) @ R[2]).min())
    heads = float((box_corners(envelope.under) @ R[2]).min())
    wishes = [1.0 - z for z in lowest]
    wishes.append(1.0 - heads - HUB_HEIGHT)
    wishes.append(1.0 - plate - (HUB_HEIGHT - CLAMP_ABOVE_BOTTOM - 3.0))  # a driver reaches the radial screws
    if ring_radius > hub_radius:
        # the hub stays inside the cone that the ring hides anyway
        wishes.append(hub_radius * (HUB_HEIGHT + HUB_GAP) / (ring_radius - hub_radius))
    tilt = math.degrees(math.acos(min(1.0, R[2, 2])))
    low, high = H_FLOOR
    wishes.append(low + (high - low) * min(1.0, max(0.0, (tilt - 45.0) / 15.0)))
    return math.ceil(max(wishes) * 4 - 1e-6) / 4
