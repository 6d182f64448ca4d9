"""Joints: screws between two bodies, their places, lengths and patterns. Rotation frame at gamma = 0, mm.

Each part declares its own (`PartSpec.joints`); parts list, steps, drawings and checks read them. Lengths are the
shortest sufficient ones of the standards.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from scanwright.cad.layout.names import DECK, LIDAR_BODY, RING_STATOR, SERVO_CASE, SERVO_HORN, SERVO_OUTPUT
from scanwright.cad.outlines import polygon
from scanwright.cad.screws import SCREWS, Screw, Thread
from scanwright.design.arrays import Array
from scanwright.design.catalogue.holes import HolePattern
from scanwright.design.catalogue.servo import Servo

# ISO 4762 and ISO 4026
LENGTHS = {
    "M1.6": (3, 4, 5, 6, 8, 10, 12, 16),
    "M2": (3, 4, 5, 6, 8, 10, 12, 16, 20),
    "M2.5": (4, 5, 6, 8, 10, 12, 16, 20, 25),
    "M3": (4, 5, 6, 8, 10, 12, 16, 20, 25, 30),
    "M4": (5, 6, 8, 10, 12, 16, 20, 25, 30, 35, 40),
    "M5": (6, 8, 10, 12, 16, 20, 25, 30, 35, 40),
    "M6": (8, 10, 12, 16, 20, 25, 30, 35, 40),
    "M8": (10, 12, 16, 20, 25, 30, 35, 40),
}
HOLDS = 2.0  # diameters of thread that are sufficient
NUT = 1.0  # diameters: a nut, 0.8, and the protruding thread
THREAD_FREE = 0.5  # that a screw may not bottom
DECK_MM = 5.0  # thickness of the robot's deck, assumed
ALL_SCREWS = "{*}"  # mark for all screws of a step's part

Fixing = Literal["thread", "trap", "nut", "deck", "grub"]
DEVICES = (LIDAR_BODY, SERVO_HORN, SERVO_OUTPUT, SERVO_CASE, RING_STATOR, DECK)


@dataclass(frozen=True, slots=True)
class ScrewAxis:
    """One screw: place of its head, or start of its hole, and the unit vector from there to its thread."""

    start: tuple[float, float, float]
    along: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Joint:
    """Equal screws between two bodies."""

    part: str  # that the screws go through, or are in if they are grub screws
    onto: str  # the body that they fix it to; a deck is that of the robot
    # kind of thread: in the body itself, a nut in a pocket of the body, a nut, a nut under the deck, or in the part
    # (grub screws)
    fixing: Fixing
    screw: Screw  # the size
    axes: tuple[ScrewAxis, ...]  # of each screw
    grip_mm: float  # length of the shank before its thread engages
    thread_mm: float  # of thread, or of material before the nut
    thread: Thread | None = None  # in a printed part; None for another body, or a nut
    slot_mm: tuple[float, float] | None = None  # width and length of slots; None for holes
    # length outside of `part` of screws that belong to it; None if they are bought by length
    protrudes_mm: float | None = None
    washer_mm: float | None = None  # diameter of the washers under their heads; None without washers
    # from a single screw, or the line of a pair, to the edge over which the part tips; None for others
    heel_mm: float | None = None
    loose: bool = False  # whether the bodies must still move a little: its screws are not tightened

    @property
    def count(self) -> int:
        """Number of screws."""
        return len(self.axes)

    @property
    def length_mm(self) -> int:
        """Length of a screw's shank."""
        if self.protrudes_mm is not None:
            return round(self.grip_mm + self.protrudes_mm)
        return shank_mm(self.screw, self.grip_mm, self.fixing, self.thread_mm)

    @property
    def number(self) -> str:
        """The standard's designation."""
        if self.protrudes_mm is not None:
            return f"{self.screw.name} of the {self.part}"
        return f"ISO {4026 if self.fixing == 'grub' else 4762} {self.screw.name} x {self.length_mm}"

    @property
    def inserts(self) -> bool:
        """Whether each screw holds in a heat-set insert."""
        return self.thread is not None and self.thread.insert

    @property
    def traps(self) -> bool:
        """Whether each screw holds in a nut that a part carries."""
        return self.thread is not None and self.thread.trap is not None

    @property
    def holder(self) -> str:
        """The body that holds the thread."""
        return self.part if self.fixing == "grub" else self.onto


def shank_mm(screw: Screw, grip: float, fixing: Fixing, depth: float) -> int:
    """Return the shortest sufficient standard length; in a shallow thread the longest that does not bottom.

    `grip` is the length before the thread, `depth` that of the thread, or of the material before the nut, or of the
    groove that the point of a grub screw enters: that screw does not stand out of its part if a shorter one exists.
    """
    known = LENGTHS[screw.name]
    if fixing == "grub" and depth > 0:
        return max((n for n in known if n <= grip + depth + 1e-6), default=known[0])
    if fixing == "grub":
        return next((n for n in known if n >= grip - 0.1), known[-1])
    if fixing == "trap":  # the hole ends at the nut, and there is space behind it
        return next((n for n in known if n >= grip + depth + screw.nut_height - 0.1), known[-1])
    if fixing == "thread":
        most = [n for n in known if n <= grip + depth - THREAD_FREE + 1e-6]
        wanted = [n for n in most if n >= grip + HOLDS * screw.nominal]
        return wanted[0] if wanted else max(most, default=known[0])
    return next((n for n in known if n >= grip + depth + NUT * screw.nominal), known[-1])


def fixing_in(thread: Thread) -> Fixing:
    """Return how a screw is fixed in a printed part."""
    return "thread" if thread.trap is None else "trap"


def upright_axes(points: Iterable[Sequence[float]], z: float, up: float) -> tuple[ScrewAxis, ...]:
    """Return axes of screws parallel to the rotation axis that start at a height and go up (1) or down (-1)."""
    return tuple(ScrewAxis((float(x), float(y), z), (0.0, 0.0, up)) for x, y in points)


def inward_axes(azimuths: Iterable[float], radius: float, z: float) -> tuple[ScrewAxis, ...]:
    """Return axes of screws towards the rotation axis that start at a radius."""
    outwards = [(math.cos(azimuth), math.sin(azimuth)) for azimuth in azimuths]
    return tuple(ScrewAxis((radius * x, radius * y, z), (-x, -y, 0.0)) for x, y in outwards)


def placed_axes(
    axes: Iterable[ScrewAxis], R: Array, t: Sequence[float] | Array = (0.0, 0.0, 0.0)
) -> tuple[ScrewAxis, ...]:
    """Return axes in the rotation frame; R and t are the pose of their frame in it."""
    return tuple(ScrewAxis(triple(R @ axis.start + np.asarray(t)), triple(R @ axis.along)) for axis in axes)


def round_wall_mm(inner_radius: float, outer: float, hole: float) -> float:
    """Return the length of a radial hole of a diameter between the inside of a tube and a distance from its axis."""
    return outer - math.sqrt(inner_radius**2 - (hole / 2) ** 2)


def screws(onto: str, part: str = "") -> str:
    """Return the mark for the screws of a step's part, or of another one, that end in a body."""
    return f"{{{part}>{onto}}}" if part else f"{{{onto}}}"


def fixing_of(pattern: HolePattern) -> Fixing:
    """Return how a screw is fixed in the holes of a bought device: by their thread, or a nut behind them."""
    return "nut" if pattern.kind == "through" else "thread"


def front_joint(
    servo: Servo, part: str, case: str, axes: tuple[ScrewAxis, ...], grip: float, heel: float | None = None
) -> Joint:
    """Return the joint of a part on the front of a servo's case; `heel` as for `Joint`."""
    fixing, screw = fixing_of(servo.front), SCREWS[servo.front.screw]
    return Joint(part, case, fixing, screw, axes, grip_mm=grip, thread_mm=servo.front.depth_mm, heel_mm=heel)


def horn_centres(servo: Servo) -> Array:
    """Return centres of the horn's holes, servo's frame, shape (n, 2)."""
    return polygon(servo.horn_circle_mm / 2, servo.horn_holes, math.radians(90.0 + servo.horn_first_hole_deg))


def horn_joint(servo: Servo, part: str, onto: str, heads: float, grip: float) -> Joint:
    """Return the joint of a part on a servo's horn, heads at a height, in the frame of the servo's axis."""
    axes = upright_axes(horn_centres(servo), heads, -1.0)
    screw = SCREWS[servo.horn_screw]
    return Joint(part, onto, "thread", screw, axes, grip_mm=grip, thread_mm=servo.horn_thread_depth_mm)


def triple(v: Array) -> tuple[float, float, float]:
    """Return a vector as a tuple."""
    return float(v[0]), float(v[1]), float(v[2])


@dataclass(frozen=True, slots=True)
class ScrewPattern:
    """Equal screws in one face of a device."""

    device: str  # body that has the holes
    part: str  # that is screwed to it
    screw: Screw  # the size
    places: tuple[tuple[float, float], ...]  # middle of each hole for a viewer who looks at the face, about the origin
    origin: str  # description of (0, 0)


def screw_patterns(joints: Sequence[Joint], R_rot_lidar: Array) -> list[ScrewPattern]:
    """Return the patterns in the order of `DEVICES`, each once; R_rot_lidar has shape (3, 3)."""
    patterns: dict[ScrewPattern, None] = {}
    for device in DEVICES:
        for joint in joints:
            if device not in (joint.part, joint.onto) or joint.fixing == "grub":
                continue
            for along in dict.fromkeys(axis.along for axis in joint.axes):  # a face each
                in_face = replace(joint, axes=tuple(axis for axis in joint.axes if axis.along == along))
                patterns[_pattern(in_face, device, R_rot_lidar if device == LIDAR_BODY else np.eye(3))] = None
    return list(patterns)


def _pattern(joint: Joint, device: str, axes: Array) -> ScrewPattern:
    towards = -np.array(joint.axes[0].along)  # the viewer looks along the screws
    right = next(axis - (axis @ towards) * towards for axis in axes.T if abs(axis @ towards) < 0.9)
    right /= np.linalg.norm(right)
    places = np.array([axis.start for axis in joint.axes]) @ np.stack([right, np.cross(towards, right)], axis=1)
    on_axis = device in (LIDAR_BODY, SERVO_HORN) and abs(abs(axes[:, 2] @ towards) - 1) < 1e-6
    if not on_axis:
        places -= (places.min(axis=0) + places.max(axis=0)) / 2
    origin = {LIDAR_BODY: "the optical axis", SERVO_HORN: "the axis of the horn"}[device] if on_axis else "the middle"
    rounded = tuple((float(x), float(y)) for x, y in np.round(places, 3) + 0.0)
    other = joint.part if device == joint.onto else joint.onto
    return ScrewPattern(device, other, joint.screw, rounded, origin)
