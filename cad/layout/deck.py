"""Pose of the deck that the scanner is screwed to. No kernel.

World frame: origin on the face of the deck, in the centre of the mount's deck holes; z up. The deck is below the
scanner (face at z = 0, scanner at z > 0), or above it if the axis points down (scanner at z < 0). Everything is in the
rotation frame at gamma = 0, mm, unless its name contains world.
"""

import math
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial import ConvexHull

from scanwright.cad.layout.drive import DriveLayout, Mounted
from scanwright.cad.layout.envelope import box_corners
from scanwright.cad.layout.joints import DECK_MM, Joint, shank_mm, triple, upright_axes
from scanwright.cad.layout.names import BASE_MOUNT, DECK
from scanwright.cad.layout.tie_seat import SLOT_ACROSS, SLOT_ALONG, SLOT_WALL, TieSeat
from scanwright.cad.screws import KEYS_MM, SCREWS, TRIPOD_SCREW, Screw, Thread, thread_in_part
from scanwright.design.arrays import Array
from scanwright.design.catalogue.products import Printer
from scanwright.design.deck_holes import Circle, Rectangle
from scanwright.design.errors import BuildError
from scanwright.design.scanner import Scanner

HEAVY_G = 505.0  # mass of lidar, servo and ring (UTM-30LX on an MX-64R) from which on a mount has its full size
FOOT_MM, BACK_MM = (4.0, 6.0), (5.0, 8.0)  # thickness of foot and back plate: least that holds its screws, and full
PAD_HALF = (18.0, 26.0)  # of the strut on the foot: least and full
SIZE_STEP = 0.5
TIES_HALF = 5.5  # half of the distance of two slots of the foot: two leads fit side by side
FROM_DECK_SCREW = 9.0  # between the slots of the foot and the middle of a deck's screw, at least
PLUG_GAP = 12.0  # between the case and the mount's back plate, for the servo's plugs
BACK_MARGIN = 5.0  # of the back plate around the rear holes, at least
RAIL_INSET = 0.8  # of the ends of a rail from those of the back plate
RAIL_WALL = 1.3  # of a rail around the heads of its screws, at least
USUAL = Rectangle(shape="rectangle", size_mm=(80.0, 80.0), screw="M4")  # holes of a mount, unless the task states some
HOLE_MARGIN = 10.0  # of the foot around a hole
FOOT_SHIFTS = (0.0, 6.0, -6.0, 12.0, -12.0, 18.0, -18.0)  # along world x and y
FOOT_DROPS = tuple(6.0 * k for k in range(11))  # from the back plate, beyond the least height
FREE = 5.0  # above the foot, for everything except the mount
SWEEP_MARGIN = 3.0  # around the turning lidar
LEAST_TRIPOD = 8.0  # thickness: the nut and a floor under it
OVER_NUTS = 2.8  # of the mount's screws


@dataclass(frozen=True, slots=True)
class TripodFoot:
    """The plate under the mount's foot; `mount` and `tripod` are the threads of their screws.

    The nut of the tripod's screw is in a pocket that is open towards the mount, on a thin floor that tripod and nut
    clamp: no thread is in plastic.
    """

    thickness: float
    mount: Thread
    tripod: Thread


def tripod_foot_of(screw: Screw, printer: Printer, above: float) -> TripodFoot:
    """Return the plate below a thickness of the mount, so thick that no screw of the mount protrudes."""
    longest = shank_mm(screw, above, "trap", OVER_NUTS)
    mount = thread_in_part(screw, printer, carries=True)
    thickness = max(LEAST_TRIPOD, longest - above) if mount.trap is not None else LEAST_TRIPOD
    return TripodFoot(thickness, mount, thread_in_part(TRIPOD_SCREW, printer, carries=True))


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
    foot_mm: float  # thickness of the foot
    back_mm: float  # thickness of the back plate
    pad_half: float  # of the strut on the foot
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
    foot_mm, back_mm, pad_half = _sizes(scanner)
    tripod = tripod_foot_of(screw, scanner.printer, foot_mm) if scanner.modules.tripod_foot else None
    bare = scanner.deck is None and tripod is None
    flat = mounted.on_flat_deck and bare and bool(R[2, 2] > 1.0 - 1e-9)
    if flat:
        centre = np.array([0.0, 0.0, mounted.rear])
    else:
        rotor_radius = drive.envelope.radius(drive.stack.sub_plate)
        corners = back + box_corners(((-half[0], -half[1], -back_mm), (*half, 0.0)))
        height = _height_of_back(rotor_radius, mounted, normal, back, corners, foot_mm)
        axes = np.stack([along, np.cross(normal, along), normal], axis=1)
        pad = box_corners(((-pad_half, -pad_half, 0.0), (pad_half, pad_half, foot_mm))) @ axes.T
        centre = _foot_centre(screw, mounted, deck_holes, back - height * normal, axes, corners, pad)
    upwards, depth = upright_axes(mounted.holes, mounted.rear - DECK_MM, 1.0), mounted.thread_mm
    joints = (Joint(DECK, mounted.onto, mounted.fixing, mounted.screw, upwards, grip_mm=DECK_MM, thread_mm=depth),)
    foot = _foot(pattern, screw, pad_half)
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
        foot_mm=foot_mm,
        back_mm=back_mm,
        pad_half=pad_half,
        foot=foot,
        ties=() if flat else _foot_ties(foot, foot_mm, pad_half, deck_holes),
        joints=joints if flat else (),
    )


def _sizes(scanner: Scanner) -> tuple[float, float, float]:
    """Return the thickness of foot and back plate, and half the side of the strut's pad, by the load.

    Plates keep their natural frequency under a smaller load with the cube root of it, a strut with the fourth root.
    """
    ring = 0.0 if scanner.slip_ring is None else scanner.slip_ring.mass_g
    share = min(1.0, (scanner.lidar.mass_g + scanner.servo.mass_g + ring) / HEAVY_G)
    foot, back = (
        max(least, SIZE_STEP * math.ceil(full * math.cbrt(share) / SIZE_STEP - 1e-9))
        for least, full in (FOOT_MM, BACK_MM)
    )
    return foot, back, max(PAD_HALF[0], SIZE_STEP * math.ceil(PAD_HALF[1] * share**0.25 / SIZE_STEP - 1e-9))


def _foot_ties(
    foot: tuple[float, float, float], foot_mm: float, pad_half: float, deck_holes: tuple[tuple[float, float], ...]
) -> tuple[TieSeat, ...]:
    """Return seats at the middle of each side of the foot, unless a screw is there; the groove is below."""
    x, y, _ = foot
    seats = [
        TieSeat(
            azimuth=turn * math.pi / 2,
            inner=pad_half,
            first=half - SLOT_WALL - SLOT_ALONG,
            low=0.0,
            high=foot_mm,
            half=TIES_HALF,
            grooved=True,
            below=True,
        )
        for turn, half in enumerate((x, y, x, y))
    ]
    return tuple(seat for seat in seats if seat.first > pad_half + 1.0 and not _near_screw(seat, deck_holes))


def _near_screw(seat: TieSeat, deck_holes: tuple[tuple[float, float], ...]) -> bool:
    across = np.linspace(-1.0, 1.0, 9) * (seat.half + SLOT_ACROSS)
    slots = seat.points(np.array([seat.first, seat.last]), across, np.zeros(1))[:, None, :2]
    return bool((np.linalg.norm(slots - np.array(deck_holes), axis=2) < FROM_DECK_SCREW).any())


def rail_wall(printer: Printer) -> float:
    """Return the wall of a rail around the heads of its screws."""
    return max(RAIL_WALL, printer.min_wall_mm)


def _height_of_back(
    rotor_radius: float, mounted: Mounted, normal: Array, back: Array, plate: Array, foot_mm: float
) -> float:
    """Return the height of the back plate's centre above the deck that keeps everything FREE above the foot."""
    below = [float(-(point @ normal)) for point in (*mounted.corners, *plate)]
    sideways = float(np.hypot(normal[0], normal[1]))
    below += [around * sideways - z * float(normal[2]) for around, z in mounted.discs]
    below.append(rotor_radius + SWEEP_MARGIN)
    return float(np.ceil(max(below) + float(back @ normal) + foot_mm + FREE))


def _foot_centre(
    screw: Screw,
    mounted: Mounted,
    deck_holes: tuple[tuple[float, float], ...],
    below: Array,
    axes: Array,
    plate: Array,
    pad: Array,
) -> Array:
    """Return the centre of the foot nearest to `below` where every driver passes; `below` if there is none.

    The drivers of the load's screws come from behind along z, through the strut and sometimes the foot: they miss the
    deck's screws. The keys of these come along the deck's normal: they miss the load, the back plate and the strut.
    """
    apart = mounted.screw.driver_radius + screw.driver_radius
    radius, length = KEYS_MM[screw.name]
    heads = float((pad @ axes[:, 2]).max()) + screw.head_height
    depths = np.linspace(0.0, heads, 11)
    holes = np.array([(u, v, 0.0) for u, v in deck_holes])
    load = [ConvexHull(corners).equations for corners in mounted.bodies]

    def passes(centre: Array) -> bool:
        screws = (centre + holes @ axes.T)[:, None] + depths[:, None] * axes[:, 2]
        across = np.linalg.norm(screws[:, :, None, :2] - np.array(mounted.holes), axis=3)
        if (across[screws[..., 2] < plate[:, 2].max()] < apart).any():
            return False
        strut = ConvexHull(np.concatenate([plate, centre + pad])).equations
        return not any(_meets(each, screws[:, -1], axes[:, 2], length, radius) for each in (*load, strut))

    moves = sorted(product(FOOT_SHIFTS, FOOT_SHIFTS, FOOT_DROPS), key=lambda move: sum(each**2 for each in move))
    centres = (below + axes @ [a, b, -drop] for a, b, drop in moves)
    return next((centre for centre in centres if passes(centre)), below)


def _meets(planes: Array, starts: Array, along: Array, length: float, radius: float) -> bool:
    """Return whether a key from any of the starts (n, 3) comes nearer to a convex shape than its radius."""
    slope = np.tile(planes[:, :3] @ along, (len(starts), 1))
    slope[np.abs(slope) < 1e-9] = 1e-9
    at = (radius - starts @ planes[:, :3].T - planes[:, 3]) / slope
    enters, leaves = np.where(slope < 0, at, 0.0).max(axis=1), np.where(slope > 0, at, length).min(axis=1)
    return bool((enters < leaves).any())


def _foot(pattern: Rectangle | Circle, screw: Screw, pad_half: float) -> tuple[float, float, float]:
    """Return the half extents of an octagon around all holes and the strut's pad, and the cut of its corners.

    Raises:
        BuildError: a hole is under the strut: no driver reaches its screw.
    """
    least = pad_half + screw.driver_radius + 1.0
    near = [hole for hole in pattern.holes() if max(abs(hole[0]), abs(hole[1])) < least]
    if near:
        raise BuildError(
            f"{BASE_MOUNT}: deck.shape = '{pattern.shape}': the hole at ({near[0][0]:g}, {near[0][1]:g}) mm is under "
            f"the strut: {screw.name} needs {least:g} mm from the centre along x or y; take a larger pattern"
        )
    if isinstance(pattern, Circle):  # a regular octagon keeps the margin all around
        half = pattern.diameter_mm / 2 + HOLE_MARGIN
        return half, half, half * (2 - math.sqrt(2))
    x, y = (max(size / 2, pad_half) + HOLE_MARGIN for size in pattern.size_mm)
    return x, y, 12.0
