"""Pose of the deck that the scanner is screwed to. No kernel.

World frame: origin on the face of the deck, in the centre of the mount's deck holes; z up. The deck is below the
scanner (face at z = 0, scanner at z > 0), or above it if the axis points down (scanner at z < 0). Everything is in the
rotation frame at gamma = 0, mm, unless its name contains world.
"""

import math
from dataclasses import dataclass

import numpy as np

from scanwright.cad import outlines
from scanwright.cad.layout.drive import DriveLayout, Mounted
from scanwright.cad.layout.joints import DECK_MM, Joint, triple, upright_axes
from scanwright.cad.layout.modules.tripod_foot import TripodFoot, tripod_foot_of
from scanwright.cad.layout.names import BASE_MOUNT, DECK
from scanwright.cad.layout.tie_seat import SLOT_ACROSS, SLOT_ALONG, SLOT_WALL, TieSeat
from scanwright.cad.screws import SCREWS, Screw
from scanwright.design.arrays import Array
from scanwright.design.catalogue.products import Printer
from scanwright.design.deck_holes import Circle, Rectangle
from scanwright.design.errors import BuildError
from scanwright.design.scanner import Scanner

FOOT_THICKNESS = 6.0
TIES_HALF = 5.5  # half of the distance of two slots of the foot: two leads fit side by side
FROM_DECK_SCREW = 9.0  # between the slots of the foot and the middle of a deck's screw, at least
PLUG_GAP = 12.0  # between the case and the mount's back plate, for the servo's plugs
BACK_THICKNESS = 8.0
UNDER_MOUNT_HEAD = 5.0  # of the mount, to its load
BACK_MARGIN = 5.0  # of the back plate around the rear holes, at least
RAIL_INSET = 0.8  # of the ends of a rail from those of the back plate
RAIL_WALL = 1.3  # of a rail around the heads of its screws, at least
USUAL = Rectangle(shape="rectangle", size_mm=(80.0, 80.0), screw="M4")  # holes of a mount, unless the task states some
PAD_HALF = 26.0  # of the strut on the foot
STRUT_BEHIND = 0.3  # of the strut's front behind that of the back plate
HOLE_MARGIN = 10.0  # of the foot around a hole
FOOT_SHIFTS = (0.0, 6.0, -6.0, 12.0, -12.0, 18.0, -18.0)
FREE = 5.0  # above the foot, for everything except the mount
SWEEP_MARGIN = 3.0  # around the turning lidar


@dataclass(frozen=True, slots=True)
class Deck:
    """The deck in the rotation frame: `T_world_rot` at gamma = 0 is [R_world_rot | t_world_rot]."""

    normal: tuple[float, float, float]  # from the deck towards the scanner
    along: tuple[float, float, float]  # world x
    centre: tuple[float, float, float]  # of the holes, on the lower face of the mount: world origin but for a plate
    flat: bool  # the axis points up from a flat deck without stated holes: no mount is needed
    t_world_rot: tuple[float, float, float]
    back_centre: tuple[float, float, float]  # middle of the back plate's front face
    back_half: tuple[float, float]  # x, y
    screw: Screw  # that holds the mount on the deck
    deck_holes: tuple[tuple[float, float], ...]  # along the first two axes of `rotation`
    tripod: TripodFoot | None  # plate under the mount
    foot: tuple[float, float, float]  # half extents along world x and y, and cut of the corners
    ties: tuple[TieSeat, ...]  # slots at the sides of the foot, frame of the deck
    joints: tuple[Joint, ...]  # of a servo or frame on a flat deck without a mount

    def rotation(self) -> Array:
        """Return axes of the deck as columns: world x, left of it, and from the deck towards the scanner."""
        along, normal = np.array(self.along), np.array(self.normal)
        return np.stack([along, np.cross(normal, along), normal], axis=1)


def deck_of(scanner: Scanner, drive: DriveLayout) -> Deck:
    """Lay the deck so that rotor, ring, case and mount stay clear of it, rounded up to whole millimetres."""
    mounted, pattern = drive.mounted, scanner.deck or USUAL
    screw = SCREWS[pattern.screw]
    R = scanner.angles.T_world_rot(0.0)[:3, :3]
    R = np.where(np.abs(R) < 1e-12, 0.0, R)
    hangs = bool(R[2, 2] < -1e-6)
    normal = -R[2] if hangs else R[2]
    deck_holes = tuple((x, -y if hangs else y) for x, y in pattern.holes())  # left of x, seen from the scanner
    along = R[0]
    holes = mounted.holes
    xs, ys = [x for x, _ in holes], [y for _, y in holes]
    margin = max(BACK_MARGIN, mounted.screw.driver_radius + rail_wall(scanner.printer) + RAIL_INSET)
    half = (max(xs) + margin, (max(ys) - min(ys)) / 2 + margin)
    back = np.array([0.0, (max(ys) + min(ys)) / 2, mounted.rear - PLUG_GAP])
    tripod = tripod_foot_of(screw, scanner.printer, FOOT_THICKNESS) if scanner.modules.tripod_foot else None
    bare = scanner.deck is None and tripod is None
    flat = mounted.on_flat_deck and bare and bool(R[2, 2] > 1.0 - 1e-9)
    if flat:
        centre = np.array([0.0, 0.0, mounted.rear])
    else:
        rotor_radius = drive.envelope.radius(drive.stack.sub_plate)
        height = _height_of_back(rotor_radius, mounted, normal, back, half)
        centre = back - height * normal + _foot_shift(scanner, mounted, deck_holes, back, normal, R[0], height)
    axes, depth = upright_axes(mounted.holes, mounted.rear - DECK_MM, 1.0), mounted.thread_mm
    joints = (Joint(DECK, mounted.onto, mounted.fixing, mounted.screw, axes, grip_mm=DECK_MM, thread_mm=depth),)
    foot = _foot(pattern, screw)
    offset = R @ ((0.0 if tripod is None else tripod.thickness) * normal - centre)
    offset[np.abs(offset) < 1e-9] = 0.0
    return Deck(
        normal=triple(normal),
        along=triple(along),
        centre=triple(centre),
        flat=flat,
        t_world_rot=triple(np.round(offset, 6)),
        back_centre=triple(back),
        back_half=half,
        screw=screw,
        deck_holes=deck_holes,
        tripod=tripod,
        foot=foot,
        ties=() if flat else _foot_ties(foot, deck_holes),
        joints=joints if flat else (),
    )


def _foot_ties(foot: tuple[float, float, float], deck_holes: tuple[tuple[float, float], ...]) -> tuple[TieSeat, ...]:
    """Return seats at the middle of each side of the foot, unless a screw is there; the groove is below."""
    x, y, _ = foot
    seats = [
        TieSeat(
            azimuth=turn * math.pi / 2,
            inner=PAD_HALF,
            first=half - SLOT_WALL - SLOT_ALONG,
            low=0.0,
            high=FOOT_THICKNESS,
            half=TIES_HALF,
            grooved=True,
            below=True,
        )
        for turn, half in enumerate((x, y, x, y))
    ]
    return tuple(seat for seat in seats if seat.first > PAD_HALF + 1.0 and not _near_screw(seat, deck_holes))


def _near_screw(seat: TieSeat, deck_holes: tuple[tuple[float, float], ...]) -> bool:
    across = np.linspace(-1.0, 1.0, 9) * (seat.half + SLOT_ACROSS)
    slots = seat.points(np.array([seat.first, seat.last]), across, np.zeros(1))[:, None, :2]
    return bool((np.linalg.norm(slots - np.array(deck_holes), axis=2) < FROM_DECK_SCREW).any())


def strut_corners(deck: Deck) -> Array:
    """Return corners of back plate and a pad in the foot, shape (n, 3): the strut is their hull behind the plate.

    No facet coincides with plate or foot.
    """
    x, y = deck.back_half
    _, cy, cz = deck.back_centre
    plate = outlines.octagon(x - 0.4, y - 0.4, 3.0, cy)
    pad = outlines.octagon(PAD_HALF, PAD_HALF, 8.0)
    layers = [np.column_stack([plate, np.full(8, z)]) for z in (cz - 0.6, cz - BACK_THICKNESS + 0.7)]
    for z in (0.8, FOOT_THICKNESS - 0.9):
        layers.append(np.column_stack([pad, np.full(8, z)]) @ deck.rotation().T + np.array(deck.centre))
    return np.concatenate(layers)


def rail_wall(printer: Printer) -> float:
    """Return the wall of a rail around the heads of its screws."""
    return max(RAIL_WALL, printer.min_wall_mm)


def _height_of_back(
    rotor_radius: float, mounted: Mounted, normal: Array, back: Array, half: tuple[float, float]
) -> float:
    """Return the height of the back plate's centre above the deck that keeps everything FREE above the foot."""
    plate = [
        (sx * half[0], back[1] + sy * half[1], back[2] - depth)
        for sx in (1, -1)
        for sy in (1, -1)
        for depth in (0.0, BACK_THICKNESS)
    ]
    below = [float(-(np.array(point) @ normal)) for point in (*mounted.corners, *plate)]
    sideways = float(np.hypot(normal[0], normal[1]))
    below += [around * sideways - z * float(normal[2]) for around, z in mounted.discs]
    below.append(rotor_radius + SWEEP_MARGIN)
    return float(np.ceil(max(below) + float(back @ normal) + FOOT_THICKNESS + FREE))


def _foot_shift(
    scanner: Scanner,
    mounted: Mounted,
    deck_holes: tuple[tuple[float, float], ...],
    back: Array,
    normal: Array,
    along: Array,
    height: float,
) -> Array:
    """Return the least shift of the foot that keeps the drivers of the case screws off the deck screws.

    The drivers come from behind along z, through the strut and sometimes the foot.
    """
    screw = SCREWS[(scanner.deck or USUAL).screw]
    apart = mounted.screw.driver_radius + screw.driver_radius
    left = np.cross(normal, along)
    shifts = sorted(((a, b) for a in FOOT_SHIFTS for b in FOOT_SHIFTS), key=lambda s: s[0] ** 2 + s[1] ** 2)
    depths = np.linspace(0.0, FOOT_THICKNESS + screw.head_height, 11)

    def clearance(shift: tuple[float, float]) -> float:
        centre = back - height * normal + shift[0] * along + shift[1] * left
        screws = [centre + u * along + v * left + depth * normal for u, v in deck_holes for depth in depths]
        return min(
            float(np.hypot(point[0] - x, point[1] - y)) if point[2] < back[2] else apart
            for point in screws
            for x, y in mounted.holes
        )

    a, b = next((shift for shift in shifts if clearance(shift) >= apart), (0.0, 0.0))
    return a * along + b * left


def _foot(pattern: Rectangle | Circle, screw: Screw) -> tuple[float, float, float]:
    """Return the half extents of an octagon around all holes and the strut's pad, and the cut of its corners.

    Raises:
        BuildError: a hole is under the strut: no driver reaches its screw.
    """
    least = PAD_HALF + screw.driver_radius + 1.0
    near = [hole for hole in pattern.holes() if max(abs(hole[0]), abs(hole[1])) < least]
    if near:
        raise BuildError(
            f"{BASE_MOUNT}: deck.shape = '{pattern.shape}': the hole at ({near[0][0]:g}, {near[0][1]:g}) mm is under "
            f"the strut: {screw.name} needs {least:g} mm from the centre along x or y; take a larger pattern"
        )
    if isinstance(pattern, Circle):  # a regular octagon keeps the margin all around
        half = pattern.diameter_mm / 2 + HOLE_MARGIN
        return half, half, half * (2 - math.sqrt(2))
    x, y = (max(size / 2, PAD_HALF) + HOLE_MARGIN for size in pattern.size_mm)
    return x, y, 12.0
