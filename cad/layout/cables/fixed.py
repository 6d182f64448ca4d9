"""The cables that do not turn: the servo's, and the leads of the ring's stator, each from its device to the deck.

Their exits are assumed, as the catalogue states. They end tied to a side of the mount's foot, or on the deck next to
the servo. Rotation frame at gamma = 0, mm.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from scanwright.cad.layout.cables.leads import SAMPLE, mass_g
from scanwright.cad.layout.cables.obstacles import Shape, clear_of, farther, shape_of
from scanwright.cad.layout.cables.route import Ending, Path, short_path
from scanwright.cad.layout.deck import Deck
from scanwright.cad.layout.drive import Mounted, Rod
from scanwright.cad.layout.envelope import around_axis, box_corners
from scanwright.cad.layout.joints import triple
from scanwright.cad.layout.names import SERVO_CABLE, STATOR_LEADS
from scanwright.cad.layout.placement import Placement
from scanwright.design.arrays import Array, Mask

LEAVES = (6.5, 8.0, 11.0, 16.0, 24.0)  # from its device to the first bend
ON_FOOT = 1.0  # between foot or deck and a cable on it
BEYOND = 8.0  # from the edge of the foot to the end of a cable
CLEAR = 1.0  # of its device, in addition to its radius
LONGER = (2.0, 8.0, 12.0, 16.0)  # from the foot to the last bend
STEP = 9.0  # of the lattice of corners
AROUND = 20.0  # of the lattice beyond the ends
FROM_CASE = 24.0  # from the case to the end of a cable on a flat deck
THROUGH_DECK = 15.0
FROM_SLOT = 0.2


@dataclass(frozen=True, slots=True)
class FixedSpace:
    """Space for a cable that does not turn."""

    shapes: tuple[Shape, ...]  # convex shapes to avoid
    ceiling: float  # height below all that turns
    deck: Deck  # that it lies on
    others: tuple[Array, float]  # middles of earlier cables, shape (n, 3), and the largest radius of one

    def free(self, points: Array, half: float, gap: float) -> Mask:
        """Return whether a ball of radius `half` at each point (n, 3) keeps `gap` to everything, shape (n,)."""
        apart = half + gap
        over_deck = (points - np.array(self.deck.centre)) @ np.array(self.deck.normal)
        clear = (points[:, 2] < self.ceiling - apart) & (over_deck > half)
        middles, radius = self.others
        left = np.flatnonzero(clear)
        clear[left] = clear_of(self.shapes, points[left], apart) & farther(points[left], middles, radius + apart)
        return np.asarray(clear)

    def with_cable(self, middles: Array, radius: float) -> FixedSpace:
        """Return the space that a cable leaves."""
        return replace(self, others=(np.concatenate([middles, self.others[0]]), max(radius, self.others[1])))


@dataclass(frozen=True, slots=True)
class FixedCable:
    """One cable that does not turn."""

    name: str  # of its body
    device: str  # at its start
    diameter: float  # of it
    radius: float  # least bend radius
    path: Path | None  # its middle from its device to the edge of foot or deck; None if there is none

    @property
    def mass_g(self) -> float:
        """Mass of the drawn part; 0 without a path."""
        return mass_g(self.path, self.diameter)


@dataclass(frozen=True, slots=True)
class Leaving:
    """A cable before it has a path: its exit, and its length inside of the parts around its device."""

    name: str
    device: str
    diameter: float
    radius: float
    start: Array
    out: Array
    inside: float = 0.0
    stiff: bool = False  # whether it is straight there


def fixed_cables_of(place: Placement, avoid: Iterable[Shape]) -> tuple[FixedCable, ...]:
    """Return the cables that the catalogue describes, clear of the shapes to avoid."""
    products = [
        around_axis(shape.radius, shape.low, shape.high) if isinstance(shape, Rod) else box_corners(shape)
        for shape in (station.shape for station in place.drive.stations)
        if shape is not None
    ]
    shapes = (*map(shape_of, products), *avoid)
    space, cables = FixedSpace(shapes, place.drive.ceiling, place.deck, (np.zeros((0, 3)), 0.0)), []
    for lane, leaving in enumerate(_leaving(place)):
        path = _path(place, space, leaving, lane)
        cables.append(FixedCable(leaving.name, leaving.device, leaving.diameter, leaving.radius, path))
        if path is not None:
            space = space.with_cable(path.points(SAMPLE), leaving.diameter / 2)
    return tuple(cables)


def _leaving(place: Placement) -> Iterator[Leaving]:
    servo, ring, stator = place.scanner.servo, place.scanner.slip_ring, place.drive.stator_exit
    at, out, wide, radius = servo.cable_exit_mm, servo.cable_out, servo.cable_diameter_mm, servo.cable_bend_radius_mm
    if at is not None and out is not None and wide is not None and radius is not None:
        R, t = place.drive.servo_pose
        yield Leaving(SERVO_CABLE, servo.name, wide, radius, R @ np.array(at) + t, R @ np.array(out))
    if ring is None or stator is None or ring.lead_diameter_mm is None or ring.lead_bend_radius_mm is None:
        return
    wide, radius, down = ring.lead_diameter_mm, ring.lead_bend_radius_mm, np.array([0.0, 0.0, -1.0])
    yield Leaving(STATOR_LEADS, ring.name, wide, radius, stator.start, down, stator.inside, stator.stiff)


def _path(place: Placement, space: FixedSpace, leaving: Leaving, lane: int) -> Path | None:
    deck, half = place.deck, leaving.diameter / 2
    start, out, normal = leaving.start, leaving.out, np.array(deck.normal)
    on_deck = deck.flat and (start - np.array(deck.centre)) @ normal < half
    if on_deck and out @ normal < -0.5:  # by a hole of the deck
        return Path((triple(start), triple(start + THROUGH_DECK * out)), leaving.radius)
    lengths, clamped = tuple(leaving.inside + length for length in LEAVES), leaving.inside + half + CLEAR
    used = clamped if leaving.stiff else 0.0
    starts = [Ending(start[None], out, lengths, used, clamped)]
    goals = _next_to_case(place.drive.mounted, half) if deck.flat else _on_foot(deck, half, lane)
    if not goals:
        return None
    tips = np.concatenate([end.tips() for end in (*starts, *goals)])
    axes = []
    for axis in range(3):  # through the first place that a cable may bend at
        low, high, through = tips[:, axis].min() - AROUND, tips[:, axis].max() + AROUND, tips[0, axis]
        axes.append(
            through + STEP * np.arange(-math.ceil((through - low) / STEP), math.ceil((high - through) / STEP) + 1)
        )
    lattice = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return short_path(space, starts, goals, half, leaving.radius, lattice)


def _on_foot(deck: Deck, half: float, lane: int) -> list[Ending]:
    """Return ends over the slots at each side of the foot, outwards, two cables side by side."""
    ends = []
    for seat in deck.ties:
        aside = (2 * lane - 1) * (seat.half - half - FROM_SLOT)
        z = np.array([deck.foot_mm + half + ON_FOOT])
        (end,) = seat.points(np.array([seat.end + BEYOND]), np.array([aside]), z) @ deck.rotation().T + np.array(
            deck.centre
        )
        clamped = seat.end + BEYOND - seat.first + half
        lengths = tuple(clamped + length for length in LONGER)
        ends.append(Ending(end[None], -deck.rotation() @ seat.direction(), lengths, clamped, clamped))
    return ends


def _next_to_case(mounted: Mounted, half: float) -> list[Ending]:
    """Return ends on a flat deck, next to the case, outwards."""
    corners, z, ends = mounted.corners, mounted.rear + half + ON_FOOT, []
    for axis, sign in ((0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)):
        out = sign * np.eye(3)[axis]
        reach = float((corners @ out).max()) + FROM_CASE
        end = reach * out + np.array([0.0, 0.0, z])
        ends.append(Ending(end[None], -out, (9.0, 14.0, 19.0), half, half))
    return ends
