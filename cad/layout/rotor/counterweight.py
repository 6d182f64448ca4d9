"""The counterweight of a tilted axis: section, length and place of a bar. Rotation frame, mm and grams.

Gravity turns the unbalanced rotor of a tilted axis back and forth, and the gears change flank through their backlash. A
piece of steel bar, screwed to an ear of the hub on the other side, prevents that. It must stay clear of lidar, cables,
screws, neck, deck and fan wherever its slots let it slide; if no bar does, there is none.

The bar is chosen before there are solids, from an estimate of the imbalance; its length is then cut to the solids.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from scanwright.cad.layout.deck import FREE, Deck
from scanwright.cad.layout.drive import DriveLayout
from scanwright.cad.layout.loads import STEEL_G_CM3, friction_nm, tilt_sine
from scanwright.cad.layout.names import COUNTERWEIGHT
from scanwright.cad.layout.rotor.free_space import behind_screws, in_box, in_fan, in_hull, swept
from scanwright.cad.layout.rotor.imbalance import backlash_matters, keeps_flank, torque_nm
from scanwright.cad.layout.rotor.linkage import AlignmentLinkage, Ear
from scanwright.cad.layout.tie_seat import TieSeat
from scanwright.cad.screws import SCREWS
from scanwright.design.arrays import Array
from scanwright.design.errors import BuildError
from scanwright.design.left_out import LeftOut
from scanwright.design.scanner import Scanner

# sections of bright steel bar on sale (EN 10278), across and along the axis, lightest first
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
    (50, 15),
    (40, 20),
    (30, 30),
    (40, 30),
)
SCREW = SCREWS["M4"]
UPRIGHT = 1e-6  # sine of the tilt
EAR_ABOVE_CROSS = 0.5  # of the paths of the cross screws
EAR_BELOW_TOP = 0.5  # of the hub
FROM_HUB = 1.0
TRIM = 5.0  # travel of the bar in either direction: a lidar's centre of mass is undocumented
SCREWS_AT = (9.0, 25.0)  # from the inner end of the bar
LEAST_LENGTH = 32.0  # covers the screws
LONGER = 2.0  # than estimated the bar may become (measured: 1.5)
GAP = 1.0
ESTIMATED = 0.9  # of an estimated torque is sure: linkage within 3 %, the lidar's centre within 2 mm
STEP = 2.0  # of the points in a bar
SAW = 0.5  # lengths are cut to this


@dataclass(frozen=True, slots=True, kw_only=True)
class Counterweight:
    """A bar along a radius, on the ear of the hub, its screws in the middle of their slots."""

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
        """Mass of the bar with its screws, which fill its threads."""
        return _grams_per_mm(self.section) * self.length

    @property
    def stock(self) -> str:
        """Bar stock and length."""
        return f"bright steel bar {self.section[0]:g} x {self.section[1]:g}, sawn to {self.length:g}"

    @property
    def screws(self) -> tuple[float, ...]:
        """Distances of its screws from the axis."""
        return tuple((first + last) / 2 for first, last in self.ear.slots)

    def balancing(self, moment: Array) -> Counterweight:
        """Return the bar, cut to balance a moment of all else that turns, shape (2,) [g mm]."""
        needed = max(0.0, -float(moment @ _direction(self.ear.azimuth)))
        length = math.sqrt(self.start**2 + 2 * needed / _grams_per_mm(self.section)) - self.start
        return replace(self, length=SAW * round(length / SAW))


def counterweight_of(
    scanner: Scanner,
    drive: DriveLayout,
    deck: Deck,
    linkage: AlignmentLinkage,
    plate_ties: tuple[TieSeat, ...],
    neck: Array,
    moment: Array,
) -> Counterweight | LeftOut:
    """Return the lightest bar that balances the rotor and fits, or why there is none.

    `neck` has shape (n, 3), `moment` is that of `estimated_moment`, shape (2,).

    Raises:
        BuildError: there is none, and servo or belt cannot hold the rotor.
    """
    torque, limit = torque_nm(scanner, float(np.linalg.norm(moment))), min(drive.limits)
    free = _FreeSpace(drive, deck, linkage, plate_ties, neck)
    found = _found(scanner, linkage, moment, free, required=torque > limit.nm)
    if isinstance(found, LeftOut) and ESTIMATED * torque > limit.nm:
        raise BuildError(
            f"{COUNTERWEIGHT}: gravity turns the rotor with {torque:.2f} N m, {limit.by} allows {limit.nm:.2f}, and "
            f"{found.why}; take {limit.instead}, a lighter lidar, or other angles"
        )
    return found


def _found(
    scanner: Scanner, linkage: AlignmentLinkage, moment: Array, free: _FreeSpace, *, required: bool
) -> Counterweight | LeftOut:
    if not required and not backlash_matters(scanner):
        return _without(f"the backlash of {scanner.servo.name} is less than the noise of {scanner.lidar.name}")
    if tilt_sine(scanner) < UPRIGHT:
        return _without("gravity does not turn an upright axis")
    least, _ = friction_nm(scanner)
    if torque_nm(scanner, float(np.linalg.norm(moment))) <= least:
        return _without(f"gravity turns the rotor with no more than the friction of bearing and ring, {least:g} N m")
    if not required and keeps_flank(scanner, moment):
        return _without("gravity keeps the gears on one flank during the entire sweep")
    azimuth = math.radians(round(math.degrees(math.atan2(-moment[1], -moment[0]))))
    fault = ""
    for section in SECTIONS:
        bar = _bar(scanner, linkage, azimuth, section)
        ear, density = bar.ear, scanner.printer.density_g_cm3 / 1000
        across = 2 * ear.half_width * (ear.high - ear.low) * density
        of_ear = across * (ear.end**2 - linkage.stack.hub_radius**2) / 2 * _direction(ear.azimuth)
        bar = bar.balancing(moment + of_ear)
        if bar.length < LEAST_LENGTH:
            fault = fault or "would be shorter than its screws need"
            break
        fault = free.fault(scanner, bar)
        if not fault:
            return bar
    return _without(f"the rotor is out of balance, but the bar that would balance it {fault}")


def _without(why: str) -> LeftOut:
    return LeftOut(COUNTERWEIGHT, why, 1, "parts")


def _direction(azimuth: float) -> Array:
    return np.array([math.cos(azimuth), math.sin(azimuth)])


def _grams_per_mm(section: tuple[float, float]) -> float:
    return section[0] * section[1] * STEEL_G_CM3 / 1000


def _bar(scanner: Scanner, linkage: AlignmentLinkage, azimuth: float, section: tuple[float, float]) -> Counterweight:
    stack = linkage.stack
    start = stack.hub_radius + FROM_HUB + TRIM
    ear = Ear(
        azimuth=azimuth,
        half_width=max(section[0] / 2, SCREW.driver_radius + TRIM / 2),
        end=start + SCREWS_AT[-1] + TRIM + SCREW.driver_radius,
        low=stack.cross + stack.cross_screw.path + EAR_ABOVE_CROSS,
        high=-stack.h - EAR_BELOW_TOP,
        slots=tuple((start + at - TRIM, start + at + TRIM) for at in SCREWS_AT),
        slot_width=SCREW.nominal + scanner.printer.screw_clearance_mm,
    )
    return Counterweight(ear=ear, section=section, start=start, length=LEAST_LENGTH)


@dataclass(frozen=True, slots=True)
class _FreeSpace:
    """Everything that a bar and its ear must stay clear of."""

    drive: DriveLayout
    deck: Deck
    linkage: AlignmentLinkage
    plate_ties: tuple[TieSeat, ...]
    neck: Array

    def fault(self, scanner: Scanner, bar: Counterweight) -> str:
        """Return what a bar with its ear would collide with wherever it slides; empty if nothing."""
        linkage = self.linkage
        ear, half, stack = bar.ear, bar.section[0] / 2, linkage.stack
        inner, outer = bar.start - TRIM, bar.end + TRIM + LONGER
        if math.hypot(bar.end, half) > self.drive.envelope.radius(stack.sub_plate):
            return "would extend beyond the lidar"
        rims = ((math.hypot(outer, half), ear.high), (math.hypot(ear.end, ear.half_width), ear.low - SCREW.head_height))
        if _height_over(self.deck, rims) < self.deck.foot_mm + FREE / 2:
            return "would be too near to the deck"
        if not self.drive.bears(bar.mass_g, bar.ear.high + bar.section[1] / 2):
            return f"would be too heavy for the horn of {scanner.servo.name} alone"
        of_bar = _points((inner, -half, ear.high), (outer, half, ear.high + bar.section[1]), ear.azimuth)
        of_ear = _points((inner, -ear.half_width, ear.low), (ear.end, ear.half_width, ear.high), ear.azimuth)
        placed, put_in = of_bar @ stack.R(), of_ear @ stack.R()  # the bar comes last, when the lidar is in its place
        boxes = [linkage.body, *linkage.cables, *([] if linkage.ears is None else [linkage.ears])]
        if any(in_box(placed, box, GAP).any() or in_box(put_in, swept(box), GAP).any() for box in boxes):
            return "would meet the lidar or its cables"
        tabs = [np.sort(tie.corners(tie.inner)[[0, -1]], axis=0) for tie in self.plate_ties]
        if any(in_box(points, (low, high), GAP).any() for low, high in tabs for points in (placed, put_in)):
            return "would meet a slotted tab of the plate"
        both = np.concatenate([placed, put_in])
        if in_fan(both, linkage, GAP).any():
            return "would be in the fan"
        if behind_screws(both, linkage).any():
            return "would block the screws of the lidar"
        return "would meet the neck of the linkage" if in_hull(of_bar, self.neck, GAP).any() else ""


def _height_over(deck: Deck, rims: tuple[tuple[float, float], ...]) -> float:
    """Return the least height over the deck of circles about the axis, each a radius and a z."""
    normal = np.array(deck.normal)
    lean = math.hypot(normal[0], normal[1])
    return float(min(z * normal[2] - around * lean for around, z in rims) - np.array(deck.centre) @ normal)


def _points(low: tuple[float, float, float], high: tuple[float, float, float], azimuth: float) -> Array:
    """Return points of a box whose first axis has an azimuth, rotation frame, shape (n, 3)."""
    axes = [np.linspace(a, b, max(2, math.ceil((b - a) / STEP) + 1)) for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    out = _direction(azimuth)
    sideways = np.array([-out[1], out[0]])
    return np.column_stack([points[:, :1] * out + points[:, 1:2] * sideways, points[:, 2]])
