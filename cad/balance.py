"""The counterweight of a tilted axis: how heavy, how long, and where it has room. Rotation frame, mm and grams.

Lidar and linkage hang on one side of the axis. Where that is tilted, gravity turns the rotor to and fro, and twice a
turn the gears change their flank by the play between them. A piece of bright bar, screwed to an ear of the hub on the
other side, takes that away. It must leave the lidar, its cables and screws, and the fan alone: where no bar does, there
is none.

Only the length of the bar waits for the solids: the moment of lidar and linkage is estimated beforehand by counting
cells, true to 1.5 % and 1 deg (`tests/test_balance.py`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from cad.deck import FOOT_THICKNESS, FREE, deck_of
from cad.drives.direct_sizing import PLATE_THICKNESS, Box, Stack, rotor_radius
from cad.drives.head import Head
from cad.loads import STANDARD_GRAVITY, horn_bears, tilt_sine
from cad.parts.linkage_sizing import AlignmentLinkage, Ear, neck_corners
from cad.screws import SCREWS
from design.frames import Array
from design.left_out import LeftOut
from design.scanner import Scanner

PART = "counterweight"
STEEL_G_CM3 = 7.85
# bright steel bar as it is sold (EN 10278), across and along the axis, lightest first
SECTIONS = (
    (8, 8),
    (10, 10),
    (12, 12),
    (20, 10),
    (16, 16),
    (30, 10),
    (20, 20),
    (40, 10),
    (30, 15),
    (25, 20),
    (50, 10),
    (40, 15),
    (25, 25),
    (30, 25),
    (40, 20),
    (50, 15),
    (30, 30),
    (40, 30),
)
SCREW = SCREWS["M4"]
RUBS_NM = 5e-3  # what bearing and ring rub with at least: assumed, no data sheet of theirs says it
FAR_MM = 10_000.0  # where play is compared with the noise of the ranges
UPRIGHT = 1e-6  # sine of the tilt
EAR_ABOVE_SHOULDER = 7.5  # clear of the wires' way out, and of a driver for the radial screws
EAR_BELOW_TOP = 1.0  # of the hub
FROM_HUB = 1.0
TRIM = 5.0  # that the bar can be moved either way: nobody tells where a lidar's centre of mass is
SCREWS_AT = (9.0, 25.0)  # from the inner end of the bar
LEAST_LENGTH = 32.0  # covers the screws
GAP = 1.0  # to lidar, cables and fan
CELL = 2.0
SAW = 0.5  # lengths are cut to this
FAR_ABOVE = 1e3

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Counterweight:
    """A bar along a radius, on the ear of the hub."""

    ear: Ear
    section: tuple[float, float]  # across, and along the axis
    start: float  # distance of its inner end from the axis
    length: float

    @property
    def end(self) -> float:
        """Distance of its outer end from the axis."""
        return self.start + self.length

    @property
    def mass_g(self) -> float:
        """Of the bar: what is drilled out of it comes back as screws."""
        return _grams_per_mm(self.section) * self.length

    @property
    def stock(self) -> str:
        """What to saw it from."""
        return f"bright steel bar {self.section[0]:g} x {self.section[1]:g}, sawn to {self.length:g}"

    @property
    def screws(self) -> tuple[float, ...]:
        """Distances of its screws from the axis, in the middle of their slots."""
        return tuple((first + last) / 2 for first, last in self.ear.slots)

    def balancing(self, moment: Array) -> Counterweight:
        """The same bar, cut to balance a moment of all else that turns, shape (2,) [g mm]."""
        needed = -float(moment @ _direction(self.ear.azimuth))
        return replace(self, length=SAW * round(_length(needed, self.section, self.start) / SAW))


def counterweight_of(scanner: Scanner, linkage: AlignmentLinkage) -> Counterweight | LeftOut:
    """The lightest bar that balances the rotor and has room, or why there is none.

    Args:
        scanner: angles and products.
        linkage: without an ear.
    """
    if not play_matters(scanner):
        return _without(f"the play of {scanner.servo.name} is less than the noise of {scanner.lidar.name}")
    if tilt_sine(scanner) < UPRIGHT:
        return _without("gravity does not turn an upright axis")
    moment = _estimated_moment(scanner, linkage)
    size = float(np.linalg.norm(moment))
    torque = torque_nm(scanner, size)
    if torque <= RUBS_NM:
        return _without(f"gravity turns the rotor with {torque:.2g} N m only: ring and bearing rub with as much")
    azimuth, fault = math.atan2(-moment[1], -moment[0]), ""
    for section in SECTIONS:
        bar = _bar(scanner, linkage, azimuth, section)
        bar = bar.balancing(moment + _ear_moment(scanner, linkage, bar.ear))
        if bar.length < LEAST_LENGTH:
            fault = fault or "would be shorter than its screws need"
            break
        fault = _fault(scanner, linkage, bar)
        if not fault:
            return bar
    return _without(f"the rotor is out of balance, but the bar that would mend it {fault}")


def play_matters(scanner: Scanner) -> bool:
    """Whether the play of the servo's gears shows in a cloud; where nobody tells it, it does."""
    play = scanner.servo.backlash_deg
    return play is None or math.radians(play) * FAR_MM > scanner.lidar.range_sigma_mm


def torque_nm(scanner: Scanner, moment: float) -> float:
    """Largest torque of gravity about the axis for an imbalance [g mm]."""
    return moment * 1e-6 * STANDARD_GRAVITY * tilt_sine(scanner)


def _without(why: str) -> LeftOut:
    return LeftOut(PART, why, 1, "parts")


def _direction(azimuth: float) -> Array:
    return np.array([math.cos(azimuth), math.sin(azimuth)])


def _grams_per_mm(section: tuple[float, float]) -> float:
    return section[0] * section[1] * STEEL_G_CM3 / 1000


def _length(moment: float, section: tuple[float, float], start: float) -> float:
    """Of a bar that begins at `start` and has this moment about the axis."""
    return math.sqrt(start**2 + 2 * max(moment, 0.0) / _grams_per_mm(section)) - start


def _bar(scanner: Scanner, linkage: AlignmentLinkage, azimuth: float, section: tuple[float, float]) -> Counterweight:
    stack = linkage.stack
    start = stack.hub_radius + FROM_HUB
    ear = Ear(
        azimuth=azimuth,
        half_width=max(section[0] / 2, SCREW.head_room + TRIM / 2),
        end=start + SCREWS_AT[-1] + TRIM + SCREW.head_room,
        low=stack.shoulder + EAR_ABOVE_SHOULDER,
        high=-stack.h - EAR_BELOW_TOP,
        slots=tuple((start + at - TRIM, start + at + TRIM) for at in SCREWS_AT),
        slot_width=SCREW.nominal + scanner.printer.screw_clearance_mm,
    )
    return Counterweight(ear=ear, section=section, start=start, length=LEAST_LENGTH)


def _ear_moment(scanner: Scanner, linkage: AlignmentLinkage, ear: Ear) -> Array:
    across = 2 * ear.half_width * (ear.high - ear.low) * scanner.printer.density_g_cm3 / 1000
    return across * (ear.end**2 - linkage.stack.hub_radius**2) / 2 * _direction(ear.azimuth)


def _fault(scanner: Scanner, linkage: AlignmentLinkage, bar: Counterweight) -> str:
    """What a bar and its ear would meet; empty where nothing."""
    ear, half = bar.ear, bar.section[0] / 2
    deck = deck_of(scanner, linkage.stack)
    centre, normal = np.array(deck.centre), np.array(deck.normal)
    rims = ((math.hypot(bar.end, half), ear.high), (ear.end, ear.low))
    if rims[0][0] > rotor_radius(scanner.lidar, linkage.stack.sub_plate):
        return "would reach further than the lidar"
    lowest = min(z * normal[2] - around * math.hypot(normal[0], normal[1]) for around, z in rims)
    if lowest - centre @ normal < FOOT_THICKNESS + FREE:
        return "would come too near to the deck"
    of_bar = _cells((bar.start, -half, ear.high), (bar.end, half, ear.high + bar.section[1]), ear.azimuth)
    of_ear = _cells((bar.start, -ear.half_width, ear.low), (ear.end, ear.half_width, ear.high), ear.azimuth)
    R = linkage.stack.R()
    held, put_in = of_bar @ R, of_ear @ R  # the bar comes last, when the lidar is in its place
    boxes = [linkage.body, *linkage.cables, *([] if linkage.ears is None else [linkage.ears])]
    if _overloads_horn(scanner, linkage.stack, bar):
        return f"would be more than the horn of {scanner.servo.name} bears alone"
    if any(_in_box(held, box).any() or _in_box(put_in, _swept(box)).any() for box in boxes):
        return "would meet the lidar or its cables"
    both = np.concatenate([held, put_in])
    if _in_fan(both, linkage, GAP).any():
        return "would stand in the fan"
    if _behind_screws(both, linkage).any():
        return "would stand before the screws of the lidar"
    if _in_hull(of_bar, neck_corners(linkage, 0)).any():
        return "would meet the neck of the linkage"
    return ""


def _overloads_horn(scanner: Scanner, stack: Head, bar: Counterweight) -> bool:
    if not isinstance(stack, Stack) or stack.bearing is not None:
        return False
    return not horn_bears(scanner, stack, bar.mass_g, bar.ear.high + bar.section[1] / 2)


def _estimated_moment(scanner: Scanner, linkage: AlignmentLinkage) -> Array:
    """Of lidar, linkage and sub-plate: mass times distance from the axis, shape (2,) [g mm]."""
    p, lidar = linkage, scanner.lidar
    R, stack = p.stack.R(), p.stack
    neck = neck_corners(p, 0)
    plate = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (0.0, 1.0)])
    plate = plate * [p.half_x, p.half_y, p.seat - p.top + PLATE_THICKNESS] + [0.0, 0.0, p.top - PLATE_THICKNESS]
    r = stack.hub_radius
    corners = np.concatenate([neck, plate @ R.T, [[-r, -r, stack.shoulder], [r, r, -stack.h]]])
    axes = [np.arange(low + CELL / 2, high, CELL) for low, high in zip(corners.min(0), corners.max(0), strict=True)]
    cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    seen = cells @ R
    x, y, z = np.abs(seen[:, 0]), np.abs(seen[:, 1]), seen[:, 2]
    on_plate = (x < p.half_x) & (y < p.half_y) & (x + y < p.half_x + p.half_y - p.chamfer)
    solid = (on_plate & (z > p.top - PLATE_THICKNESS) & (z < p.top)) | _in_hull(cells, neck)
    around = np.hypot(cells[:, 0], cells[:, 1])
    room = np.any([_in_box(seen, _swept(box), 0.0) for box in (p.body, *p.cables)], axis=0)
    solid &= ~_in_fan(seen, p, 0.0) & ~_behind_screws(seen, p)
    solid |= (around < stack.hub_radius) & (cells[:, 2] > stack.shoulder) & (cells[:, 2] < -stack.h)
    solid &= ~room & ~((around < stack.shaft_diameter / 2) & (cells[:, 2] < stack.spigot_top))
    solid |= on_plate & (z > p.top) & (z < p.seat)  # the sub-plate
    printed = CELL**3 * scanner.printer.density_g_cm3 / 1000 * cells[solid, :2].sum(axis=0)
    return printed + lidar.mass_g * (lidar.body_mm[2] / 2 - lidar.optical_height_mm) * R[:2, 2]


def _cells(low: tuple[float, float, float], high: tuple[float, float, float], azimuth: float) -> Array:
    """Points of a box whose first axis has an azimuth, its faces included, in the rotation frame, shape (n, 3)."""
    axes = [np.linspace(a, b, max(2, math.ceil((b - a) / CELL) + 1)) for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    out = _direction(azimuth)
    sideways = np.array([-out[1], out[0]])
    return np.column_stack([points[:, :1] * out + points[:, 1:2] * sideways, points[:, 2]])


def _in_box(points: Array, box: Box, gap: float = GAP) -> Mask:
    return np.asarray(((points > np.array(box[0]) - gap) & (points < np.array(box[1]) + gap)).all(axis=1))


def _swept(box: Box) -> Box:
    """The way on which something is put in from above."""
    low, (x, y, _) = box
    return low, (x, y, FAR_ABOVE)


def _in_fan(points: Array, p: AlignmentLinkage, gap: float) -> Mask:
    """Points of the laser frame that the linkage must leave free for its beams."""
    bearing = np.arctan2(points[:, 1], points[:, 0])
    in_slab = (points[:, 2] > p.fan_z[0] - gap) & (points[:, 2] < p.fan_z[1] + gap)
    in_slab &= np.hypot(points[:, 0], points[:, 1]) > min(p.half_x, p.half_y) - gap
    return np.asarray(in_slab & np.any([(bearing - first) % (2 * math.pi) < last - first for first, last in p.fan], 0))


def _behind_screws(points: Array, p: AlignmentLinkage) -> Mask:
    """Points of the laser frame where the drivers of the lidar's screws come from."""
    below = points[:, 2] < p.top - PLATE_THICKNESS
    if p.ears is not None:
        return np.zeros_like(below)
    near = [np.hypot(points[:, 0] - x, points[:, 1] - y) < p.screw.head_room for x, y in p.holes]
    return np.asarray(below & np.any(near, axis=0))


def _in_hull(points: Array, corners: Array) -> Mask:
    planes = ConvexHull(corners).equations
    return np.asarray((points @ planes[:, :3].T + planes[:, 3]).max(axis=1) < 0)
