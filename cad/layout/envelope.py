"""Boxes around the lidar: they give the height of the hub, and are cut from the linkage. No kernel, mm.

The same boxes do both, so the two cannot disagree.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scanwright.cad.layout.hub import CROSS_M3, HUB_WALL, Axis, CrossScrew, Hub
from scanwright.cad.layout.joints import fixing_of, shank_mm
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE
from scanwright.cad.screws import SCREWS, Screw
from scanwright.design.arrays import Array
from scanwright.design.catalogue.holes import Face, HolePattern
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import BuildError
from scanwright.design.scanner import Scanner
from scanwright.design.task.equivalent_settings import BOUNDS, advice

HEAVY_G = 370.0  # mass of a lidar (UTM-30LX) from which on plate, neck and hub have their full size
PLATE_MM = (4.0, 8.0)  # thickness of the plate: least that prints flat and stiff, and full
PLATE_STEP = 0.5
UNDER_SUB_PLATE = 6.0  # least of that with pockets for the lidar's screws, and nuts or inserts for the ears
HUB_WALL_MIN = 6.0  # around a shaft: under the washers of the cross screws
BODY_GAP = 0.6  # around the lidar's body
CABLE_GAP = 2.0  # around its cables
SUB_PLATE_THICKNESS = 4.0  # without walls
WALL_SHARE = 0.1  # thickness of walls and floor, over the height of their highest screw: stiffness
WALL_STEP = 0.5  # of that thickness
WALL_GAP = 0.4  # to a lidar between two walls; against a single one it is pushed
WALL_AROUND = 3.0  # of a wall around the heads of its screws
WALL_ROOT = 8.0  # of a wall inside the floor's edge
UNDER_WINDOW = 2.0  # from a wall to the window above it
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
class SideWall:
    """A wall of the sub-plate at a side of the lidar, with one joint's screws; laser frame."""

    outwards: tuple[float, float, float]  # unit vector from the lidar
    box: Box  # from the floor's lower face upwards
    root: Box  # that joins it with the floor
    screw: Screw
    screws: tuple[tuple[float, float, float], ...]  # places of their heads
    grip_mm: float  # from the heads to the lidar's threads


@dataclass(frozen=True, slots=True)
class Envelope:
    """A lidar with gaps as boxes (low corner, high corner) in the laser frame."""

    lidar: Lidar  # the product
    body: Box  # its body, and the walls of its sub-plate
    cables: tuple[Box, ...]  # their straight pieces

    def plate(self, sub_plate: Axis | None) -> Box:
        """Return the plate of the linkage, with a sub-plate if there is one."""
        (x, y), seat = self.lidar.half_mm, -self.lidar.optical_height_mm
        lower = seat - (0.0 if sub_plate is None else sub_plate_mm(self.lidar)) - plate_mm(self.lidar, sub_plate)
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


def sub_plate_of(lidar: Lidar, stack: Hub) -> Axis | None:
    """Return the laser's axis along which the ears of a sub-plate stick out; None if there is no need for one.

    They are clear of its walls and of the heads in them; without walls they reach no lower than the lidar's corners.
    """
    if lidar.sides:
        return "x" if "+y" in lidar.sides else "y"
    leaning = np.abs(stack.R()[2])
    return None if not covered_screws(lidar, stack) else "x" if leaning[0] <= leaning[1] else "y"


def load_share(lidar: Lidar) -> float:
    """Return the mass of a lidar as a share of HEAVY_G, at most 1.

    A beam under a load keeps its natural frequency if its stiffness is proportional to the mass: the thickness of a
    plate to the cube root of it, the diameter of a rod to the fourth root.
    """
    return min(1.0, lidar.mass_g / HEAVY_G)


def plate_mm(lidar: Lidar, sub_plate: Axis | None) -> float:
    """Return the thickness of the linkage's plate: by the load, and for screws of a standard length."""
    least, full = PLATE_MM
    thin = max(least, UNDER_SUB_PLATE if sub_plate else 0.0, full * math.cbrt(load_share(lidar)))
    sizes = np.arange(PLATE_STEP * math.ceil(thin / PLATE_STEP - 1e-9), full + PLATE_STEP / 2, PLATE_STEP).tolist()
    if sub_plate is not None or lidar.sides or fixing_of(lidar.base) == "nut":
        return float(sizes[0])
    screw, depth = SCREWS[lidar.base.screw], lidar_thread_mm(lidar)
    engaged = [shank_mm(screw, size, "thread", depth) - size for size in sizes]
    return float(next(size for size, thread in zip(sizes, engaged, strict=True) if thread >= engaged[-1] - 1e-9))


def hub_wall_mm(lidar: Lidar, shaft_diameter: float) -> float:
    """Return the thickness of the hub around a turned shaft, by the load."""
    full = shaft_diameter / 2 + HUB_WALL
    wall = full * load_share(lidar) ** 0.25 - shaft_diameter / 2
    return float(np.clip(PLATE_STEP * math.ceil(wall / PLATE_STEP - 1e-9), HUB_WALL_MIN, HUB_WALL))


def sub_plate_mm(lidar: Lidar) -> float:
    """Return the thickness of a sub-plate and of its walls."""
    highest = max((z for side in lidar.sides.values() for _, z in side.places), default=0.0)
    return max(SUB_PLATE_THICKNESS, WALL_STEP * math.ceil(WALL_SHARE / WALL_STEP * highest - 1e-9))


def sub_plate_cm3(lidar: Lidar) -> float:
    """Return the volume of walls and the floor between them; 0 without walls."""
    walls = side_walls(lidar)
    if not walls:
        return 0.0
    floor = 4 * lidar.half_mm[0] * lidar.half_mm[1] * sub_plate_mm(lidar)
    return (floor + sum(float(np.prod(np.subtract(wall.box[1], wall.box[0]))) for wall in walls)) / 1000


def lidar_thread_mm(lidar: Lidar) -> float:
    """Return the drawn depth of the threads that hold a lidar, or the thickness of its ears."""
    if lidar.sides:
        return min(side.depth_mm for side in lidar.sides.values())
    return min(lidar.base.depth_mm, lidar.window_z_mm[0] - 1.0)


def side_walls(lidar: Lidar) -> tuple[SideWall, ...]:
    """Return the walls that hold a lidar by threads in its sides; none if it is held by its base.

    Raises:
        BuildError: the head of a screw would be in front of the window, or at a cable.
    """
    return tuple(_side_wall(lidar, face, pattern) for face, pattern in lidar.sides.items())


def _side_wall(lidar: Lidar, face: Face, pattern: HolePattern) -> SideWall:
    across, sign = "xy".index(face[1]), 1.0 if face[0] == "+" else -1.0
    seat, thick, head = -lidar.optical_height_mm, sub_plate_mm(lidar), SCREWS[pattern.screw].driver_radius
    sideways, heights = zip(*pattern.places, strict=True)
    top = min(max(heights) + head + WALL_AROUND, lidar.window_z_mm[0] - UNDER_WINDOW)
    place = f"{ALIGNMENT_LINKAGE}: seat: holes: the {pattern.screw} of {lidar.name} in {face}"
    if max(heights) + head > top:
        raise BuildError(
            f"{place}: {max(heights):g} mm over the base: a head of {2 * head:g} mm needs a wall up to "
            f"{UNDER_WINDOW:g} mm below the window at {lidar.window_z_mm[0]:g} mm; take another lidar"
        )
    near = lidar.cable_diameter_mm / 2 + CABLE_GAP + head
    if face == "-x" and any(abs(at - y) < near for at in sideways for y in lidar.cable_y_mm):
        raise BuildError(f"{place}: a head is within {near:g} mm of the cables at cable_y_mm; take another lidar")
    half = lidar.half_mm[across]
    inner = half + (WALL_GAP if len(lidar.sides) > 1 else 0.0)
    outer, around = inner + thick, head + WALL_AROUND
    ends = min(sideways) - around, max(sideways) + around

    def at(away: float, aside: float, height: float) -> tuple[float, float, float]:
        return (sign * away, aside, seat + height) if across == 0 else (aside, sign * away, seat + height)

    return SideWall(
        outwards=(sign, 0.0, 0.0) if across == 0 else (0.0, sign, 0.0),
        box=_box(at(inner, ends[0], -thick), at(outer, ends[1], top)),
        root=_box(at(half - WALL_ROOT, ends[0], -thick), at(outer, ends[1], 0.0)),
        screw=SCREWS[pattern.screw],
        screws=tuple(at(outer, *place) for place in pattern.places),
        grip_mm=outer - abs(pattern.z_mm),
    )


def _box(one: Sequence[float], other: Sequence[float]) -> Box:
    """Return the box between two opposite corners."""
    (x0, y0, z0), (x1, y1, z1) = np.sort([one, other], axis=0).tolist()
    return (x0, y0, z0), (x1, y1, z1)


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
    line = np.array([*hole, -lidar.optical_height_mm - plate_mm(lidar, None)]) @ R.T - depth[:, None] * R[:, 2]
    reach = np.hypot(line[:, 0], line[:, 1]) - driver
    hub = (line[:, 2] > stack.shoulder - driver) & (line[:, 2] < driver - stack.h)
    journal = (line[:, 2] > stack.sleeve_low - driver) & (line[:, 2] < stack.sleeve_low + stack.journal)
    radius = 0.0 if stack.bearing is None else stack.bearing.bore_mm / 2
    return bool((reach > stack.shaft_diameter / 2 + 3.0)[hub].all() and (reach > radius)[journal].all())


def cables_of(lidar: Lidar) -> tuple[Box, ...]:
    """Return the boxes of the straight pieces of its cables, in the laser frame."""
    half_x, seat = lidar.half_mm[0], -lidar.optical_height_mm
    half = lidar.cable_diameter_mm / 2 + CABLE_GAP
    back = -half_x - lidar.cable_straight_mm - lidar.cable_diameter_mm
    return tuple(
        (
            (back, y - half, seat + max(lidar.cable_z_mm - half, 0.5)),
            (1.0 - half_x, y + half, seat + lidar.cable_z_mm + half),
        )
        for y in lidar.cable_y_mm
    )


def envelope_of(lidar: Lidar) -> Envelope:
    """Return the boxes of one lidar (origin at the optical centre)."""
    half_x, half_y = lidar.half_mm
    seat = -lidar.optical_height_mm
    corners: list[Sequence[float]] = [
        (-half_x, -half_y, seat),
        (half_x, half_y, lidar.body_mm[2] - lidar.optical_height_mm),
    ]
    for wall in side_walls(lidar):
        heads = np.array(wall.screws) + wall.screw.head_height * np.array(wall.outwards)
        corners += [*wall.box, *heads.tolist()]
    (x0, y0, low), (x1, y1, top) = np.min(corners, axis=0).tolist(), np.max(corners, axis=0).tolist()
    gap = BODY_GAP
    return Envelope(lidar, ((x0 - gap, y0 - gap, low), (x1 + gap, y1 + gap, top)), cables_of(lidar))


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
    envelope: Envelope,
    R: Array,
    hub_radius: float,
    rims: Sequence[tuple[float, float]] = (),
    sub_plate: Axis | None = None,
    cross: CrossScrew = CROSS_M3,
) -> float:
    """Return h, rounded up to 0.25 mm: the hub's top is at z = -h.

    `rims` are radius and depth below the hub's top of round bodies that hide beams anyway: ring, seat of a bearing.
    """
    lowest = [float((box_corners(box) @ R[2]).min()) for box in (envelope.body, *envelope.cables)]
    plate = float((box_corners(envelope.plate(sub_plate)) @ R[2]).min())
    heads = float((box_corners(envelope.under(sub_plate)) @ R[2]).min())
    heights = [1.0 - z for z in lowest]
    heights.append(1.0 - heads - cross.hub_height)
    heights.append(1.0 - plate - (cross.hub_height - cross.above_bottom - 3.0))  # a driver reaches the cross screws
    # the hub stays inside one of their cones
    cones = [hub_radius * depth / (radius - hub_radius) for radius, depth in rims if radius > hub_radius]
    heights.append(min(cones, default=0.0))
    tilt = math.degrees(math.acos(min(1.0, R[2, 2])))
    low, high = H_FLOOR
    heights.append(low + (high - low) * min(1.0, max(0.0, (tilt - 45.0) / 15.0)))
    return math.ceil(max(heights) * 4 - 1e-6) / 4
