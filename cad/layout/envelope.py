"""Boxes around the lidar: they give the height of the hub, and are cut from the linkage. No kernel, mm.

The same boxes do both, so the two cannot disagree.
"""

import math
from dataclasses import dataclass

import numpy as np

from scanwright.cad.layout.hub import CROSS_ABOVE_BOTTOM, HUB_GAP, HUB_HEIGHT, Axis, Hub
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE
from scanwright.cad.screws import SCREWS
from scanwright.design.arrays import Array
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import BuildError
from scanwright.design.scanner import Scanner
from scanwright.design.task.equivalent_settings import BOUNDS, advice

PLATE_THICKNESS = 8.0
BODY_GAP = 0.6  # around the lidar's body
SUB_PLATE_THICKNESS = 4.0
SLOT_TRAVEL = 2.0  # to either side of the unverified place of a screw of the lidar
SLOT_WALL = 2.0  # of such a slot at the edge of the plate, around a normal hole
EAR_REACH = 9.0  # of the sub-plate's ears beyond the lidar
EAR_HALF_WIDTH = 10.0
EAR_SCREW = SCREWS["M3"]
EAR_SCREW_OFFSET = 5.5  # half the distance of the two screws of an ear
H_FLOOR = (45.0, 58.0)  # for an upright lidar and from 60 deg of tilt: stiffness and shadow (measured study)
SIDES = 24  # of the prism around a cylinder

Box = tuple[tuple[float, float, float], tuple[float, float, float]]


@dataclass(frozen=True, slots=True)
class Envelope:
    """A lidar with gaps as boxes (low corner, high corner) in the laser frame."""

    lidar: Lidar  # the product
    body: Box  # its body
    cables: tuple[Box, ...]  # their straight pieces

    def plate(self, sub_plate: Axis | None) -> Box:
        """Return the plate of the linkage, with a sub-plate if there is one."""
        (x, y), seat = self.lidar.half_mm, -self.lidar.optical_height_mm
        lower = seat - (0.0 if sub_plate is None else SUB_PLATE_THICKNESS) - PLATE_THICKNESS
        return (-x, -y, lower), (x, y, seat)

    def under(self, sub_plate: Axis | None) -> Box:
        """Return heads of the lidar's screws below the plate, or the ears of the sub-plate."""
        (x0, y0, lower), (x1, y1, seat) = self.plate(sub_plate)
        if sub_plate is None:
            return (x0, y0, lower - SCREWS[self.lidar.base.screw].head_height - 0.5), (x1, y1, lower)
        x, y = ear_corner(self.lidar, sub_plate)
        return (-x, -y, lower), (x, y, seat)

    def radius(self, sub_plate: Axis | None) -> float:
        """Return the radius of the sphere about the optical centre that lidar, cables and plate sweep."""
        boxes = (self.body, *self.cables, self.plate(sub_plate), self.under(sub_plate))
        return float(max(np.linalg.norm(box_corners(box), axis=1).max() for box in boxes))


def lidar_pose(scanner: Scanner) -> Array:
    """Return the laser in the rotation frame, shape (3, 3).

    Raises:
        BuildError: the lidar would hang upside down.
    """
    R = exact(scanner.angles.R_rot_laser())
    if R[2, 2] < -1e-9:
        tilt = math.degrees(math.acos(R[2, 2]))
        setting = {name: (angle, angle) for name, angle in scanner.angles.angles_deg.model_dump().items()}
        instead = next((text for name in BOUNDS if (text := advice(setting, name))), "")
        raise BuildError(
            f"{ALIGNMENT_LINKAGE}: tilt = {tilt:.2f} deg: the lidar would hang upside down over the ring; at most 90"
            f"{instead}"
        )
    return R


def rows_of(R: Array) -> tuple[tuple[float, float, float], ...]:
    """Return a matrix (3, 3) as tuples."""
    return tuple((float(row[0]), float(row[1]), float(row[2])) for row in R)


def leaning_least(R: Array) -> Axis:
    """Return the laser's axis along which a sub-plate's ears reach no lower than the lidar's corners."""
    return "x" if abs(R[2, 0]) <= abs(R[2, 1]) else "y"


def screw_travel_mm(lidar: Lidar) -> float:
    """Return the travel of a screw of the lidar in its slot, towards the optical axis; 0 for round holes.

    Holes of the lidar that are not verified get slots, unless all are on one line.
    """
    lines = {round(math.atan2(y, x) % math.pi, 2) for x, y in lidar.base.places}
    if "holes" not in lidar.unverified() or len(lines) < 2:
        return 0.0
    hole = SCREWS[lidar.base.screw].nominal + 0.4
    rooms = [
        (half - abs(at) - hole / 2 - SLOT_WALL) * math.hypot(*place) / abs(at)
        for place in lidar.base.places
        for half, at in zip(lidar.half_mm, place, strict=True)
        if abs(at) > 1e-6
    ]
    return max(0.0, min(SLOT_TRAVEL, *rooms))


def slot_ends(place: tuple[float, float], travel: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the nearest and the furthest place of a screw in its slot."""
    x, y = place
    away = math.hypot(x, y)
    share = travel / away if away > travel else 0.0  # a screw under the optical axis has no line to it
    return (x - share * x, y - share * y), (x + share * x, y + share * y)


def covered_screws(lidar: Lidar, stack: Hub) -> list[int]:
    """Return the lidar's screws (index into `base.places`) that the hub hides from a driver below the plate."""
    travel = screw_travel_mm(lidar)
    return [
        i
        for i, place in enumerate(lidar.base.places)
        if not all(_driver_passes(lidar, stack, end) for end in slot_ends(place, travel))
    ]


def _driver_passes(lidar: Lidar, stack: Hub, hole: tuple[float, float]) -> bool:
    """Return whether a driver misses hub and journal, or passes through the hub's rim only."""
    R, driver = stack.R(), SCREWS[lidar.base.screw].driver_radius
    depth = np.linspace(0.0, 150.0, 601)
    line = np.array([*hole, -lidar.optical_height_mm - PLATE_THICKNESS]) @ R.T - depth[:, None] * R[:, 2]
    reach = np.hypot(line[:, 0], line[:, 1]) - driver
    hub = (line[:, 2] > stack.shoulder - driver) & (line[:, 2] < driver - stack.h)
    journal = (line[:, 2] > stack.hub_bottom - driver) & (line[:, 2] < stack.hub_bottom + stack.journal)
    radius = 0.0 if stack.bearing is None else stack.bearing.bore_mm / 2
    return bool((reach > stack.shaft_diameter / 2 + 3.0)[hub].all() and (reach > radius)[journal].all())


def envelope_of(lidar: Lidar) -> Envelope:
    """Return the boxes of one lidar (origin at the optical centre)."""
    half_x, half_y = lidar.half_mm
    seat = -lidar.optical_height_mm
    half = lidar.cable_diameter_mm / 2 + 2.0
    back = -half_x - lidar.cable_straight_mm - lidar.cable_diameter_mm
    cables = tuple(
        (
            (back, y - half, seat + max(lidar.cable_z_mm - half, 0.5)),
            (1.0 - half_x, y + half, seat + lidar.cable_z_mm + half),
        )
        for y in lidar.cable_y_mm
    )
    top, gap = lidar.body_mm[2] - lidar.optical_height_mm, BODY_GAP
    return Envelope(lidar, ((-half_x - gap, -half_y - gap, seat), (half_x + gap, half_y + gap, top)), cables)


def ear_corner(lidar: Lidar, sub_plate: Axis) -> tuple[float, float]:
    """Return the half extents of the strip that holds the two ears of a sub-plate."""
    half_x, half_y = lidar.half_mm
    if sub_plate == "x":
        return half_x + EAR_REACH, EAR_HALF_WIDTH
    return EAR_HALF_WIDTH, half_y + EAR_REACH


def ear_screws(lidar: Lidar, axis: Axis) -> tuple[tuple[float, float], ...]:
    """Return centres of the ears' screws: their heads are clear of the lidar's body."""
    half = lidar.half_mm[0 if axis == "x" else 1]
    away = half + BODY_GAP + EAR_SCREW.driver_radius + 0.5
    along = [(sign * away, side * EAR_SCREW_OFFSET) for sign in (1, -1) for side in (1, -1)]
    return tuple(along if axis == "x" else [(y, x) for x, y in along])


def box_corners(box: Box) -> Array:
    """Return the eight corners, shape (8, 3)."""
    low, high = box
    return np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])


def around_axis(radius: float, low: float, high: float) -> Array:
    """Return corners around a cylinder about the axis, shape (n, 3)."""
    turn = 2 * math.pi * np.arange(SIDES) / SIDES
    around = radius / math.cos(math.pi / SIDES)
    ring = around * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return np.concatenate([np.column_stack([ring, np.full(SIDES, z)]) for z in (low, high)])


def exact(R: Array) -> Array:
    """Return a rotation with cosines of 90 deg as 0, not 6e-17: right angles then stay planar in the kernel."""
    return np.where(np.abs(R) < 1e-12, 0.0, R)


def hub_height(
    envelope: Envelope, R: Array, hub_radius: float, ring_radius: float, sub_plate: Axis | None = None
) -> float:
    """Return h, rounded up to 0.25 mm: the hub's top is at z = -h."""
    lowest = [float((box_corners(box) @ R[2]).min()) for box in (envelope.body, *envelope.cables)]
    plate = float((box_corners(envelope.plate(sub_plate)) @ R[2]).min())
    heads = float((box_corners(envelope.under(sub_plate)) @ R[2]).min())
    heights = [1.0 - z for z in lowest]
    heights.append(1.0 - heads - HUB_HEIGHT)
    heights.append(1.0 - plate - (HUB_HEIGHT - CROSS_ABOVE_BOTTOM - 3.0))  # a driver reaches the cross screws
    if ring_radius > hub_radius:
        # the hub stays inside the cone that the ring hides anyway
        heights.append(hub_radius * (HUB_HEIGHT + HUB_GAP) / (ring_radius - hub_radius))
    tilt = math.degrees(math.acos(min(1.0, R[2, 2])))
    low, high = H_FLOOR
    heights.append(low + (high - low) * min(1.0, max(0.0, (tilt - 45.0) / 15.0)))
    return math.ceil(max(heights) * 4 - 1e-6) / 4
