"""The leads between lidar and slip ring, and their paths.

The jacket of the lidar's cable ends behind its straight piece. Its wires bend like the leads of the ring, and meet them
in a joint. Both turn with the lidar and do not flex.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from scanwright.cad.layout.cables.lead_joint import JOINT_LENGTH, TUBE_WALL, LeadJoint, first_with_place, joint_of
from scanwright.cad.layout.cables.obstacles import Shape, clear_of, farther, shape_of
from scanwright.cad.layout.cables.route import Ending, Path, lattice_about_axis, short_path
from scanwright.cad.layout.deck import Deck
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.drive import Bundle
from scanwright.cad.layout.envelope import Box, around_axis, box_corners
from scanwright.cad.layout.hub import BUNDLE_GAP
from scanwright.cad.layout.placement import Placement
from scanwright.cad.layout.tie_seat import TieSeat
from scanwright.design.arrays import Array, Mask
from scanwright.design.catalogue.lidar import Lidar

SAMPLE = 1.5  # mm between the points of a lead
OUT: tuple[float, ...] = (10.0, 14.0, 20.0, 28.0)  # of the hub, before the first bend
CLAMPED = 1.0  # beyond the face at its exit, and its own radius
BACK = (4.0, 5.5, 8.0, 13.0, 20.0, 30.0)  # from the lidar's stub, before the first bend
MORE = (0.5, 6.0, 12.0)  # than a joint, and the arc of a right angle behind it
LEAD_G_CM3 = 1.5  # calculated: five wires of 1.3 mm over 0.14 mm2 of copper, 2.9 g/m each, in a bundle of 3.5 mm
BEAM = 3.0 + 1.0  # around the scan plane: the beam is assumed to be 6 mm wide, and it widens


@dataclass(frozen=True, slots=True)
class RotorSpace:
    """Space for a lead on the rotor."""

    shapes: tuple[Shape, ...]  # convex shapes that turn
    channels: tuple[Box, ...]  # cut from the neck, from their lower ends upwards, in the laser frame
    R_rot_laser: Array  # shape (3, 3)
    bearings_rad: tuple[float, float] | None  # first and last beam; None if a lead may be in the fan
    hidden_half_angle: float  # of the cone about -z in which all beams are hidden [rad]
    floor: float  # height of all that does not turn under the rotor
    deck: Deck  # that the rotor turns over
    others: tuple[Array, float]  # middles of earlier leads, shape (n, 3), and the distance from them

    def free(self, points: Array, half: float, gap: float) -> Mask:
        """Return whether a ball of radius `half` at each point (n, 3) keeps `gap` to everything, shape (n,)."""
        apart = half + gap
        clear = (points[:, 2] > self.floor + apart) & self._over_deck(points, apart)
        for is_clear in (  # the cheapest first, and of what is left only
            lambda some: ~self._in_fan(some, apart),
            lambda some: clear_of(self.shapes, some, apart, lambda inside: self._carved(inside, apart)),
            self.clear_of_others,
        ):
            left = np.flatnonzero(clear)
            clear[left] = is_clear(points[left])
        return np.asarray(clear)

    def clear_of_others(self, points: Array) -> Mask:
        """Return whether each point, shape (n, 3), is far enough from earlier leads, shape (n,)."""
        return farther(points, *self.others)

    def _carved(self, points: Array, apart: float) -> Mask:
        """Return whether points are in the linkage's channels for the cables and for inserting the lidar."""
        at = points @ self.R_rot_laser
        inside = [
            (at > np.array(low) + apart).all(axis=1) & (at[:, :2] < np.array(high[:2]) - apart).all(axis=1)
            for low, high in self.channels
        ]
        return np.asarray(np.any(inside, axis=0))

    def _over_deck(self, points: Array, apart: float) -> Mask:
        """Return whether points are over the foot of the mount in every position of the turn."""
        normal = np.array(self.deck.normal)
        lowest = points[:, 2] * normal[2] - np.hypot(points[:, 0], points[:, 1]) * math.hypot(normal[0], normal[1])
        return np.asarray(lowest - np.array(self.deck.centre) @ normal > self.deck.foot_mm + apart)

    def _in_fan(self, points: Array, half: float) -> Mask:
        """Return whether a lead at points would meet a beam; both turn together."""
        if self.bearings_rad is None:
            return np.zeros(len(points), dtype=bool)
        x, y, z = (points @ self.R_rot_laser).T
        wide = (half + BEAM) / np.maximum(np.hypot(x, y), half + BEAM)
        first, last = self.bearings_rad
        bearing = (np.arctan2(y, x) - first + wide) % (2 * math.pi)
        distance = np.linalg.norm(points, axis=1)
        polar = np.arccos(np.clip(-points[:, 2] / distance, -1.0, 1.0)) + np.arcsin(np.minimum(1.0, half / distance))
        near = (np.abs(z) < half + BEAM) & (bearing < last - first + 2 * wide)
        return np.asarray(near & (polar > self.hidden_half_angle))


def rotor_space_of(place: Placement, avoid: Iterable[Shape]) -> RotorSpace:
    """Return the space on the rotor of one scanner, without leads; `avoid` are shapes of parts that turn."""
    stack, envelope, lidar = place.stack, place.drive.envelope, place.scanner.lidar
    R, sub_plate = stack.R(), stack.sub_plate
    boxes = (envelope.body, envelope.plate(sub_plate), envelope.under(sub_plate), *_stubs(lidar))
    bearings = lidar.bearings_rad()
    return RotorSpace(
        shapes=(*(shape_of(box_corners(box) @ R.T) for box in boxes), *_round(place), *avoid),
        channels=envelope.cables,
        R_rot_laser=R,
        bearings_rad=(float(bearings.min()), float(bearings.max())),
        hidden_half_angle=stack.sure_half_angle,
        floor=place.drive.floor,
        deck=place.deck,
        others=(np.zeros((0, 3)), 0.0),
    )


def _round(place: Placement) -> Iterator[Shape]:
    """Yield the shaft below the hub, and the rotor of a ring around it."""
    stack, direct, ring = place.stack, place.drive.of(DirectStack), place.scanner.slip_ring
    yield shape_of(around_axis(stack.shaft_diameter / 2, place.drive.floor, stack.shoulder))
    if direct is not None and ring is not None and ring.rotor is not None:
        yield shape_of(around_axis(ring.rotor.diameter_mm / 2, direct.ring_top, direct.ring_top + ring.rotor.length_mm))


def _stubs(lidar: Lidar) -> list[Box]:
    """Return the straight pieces of its cables, in the laser frame."""
    half, back, z = lidar.cable_diameter_mm / 2, -lidar.body_mm[0] / 2, lidar.cable_z_mm - lidar.optical_height_mm
    return [
        ((back - lidar.cable_straight_mm, y - half, z - half), (back, y + half, z + half)) for y in lidar.cable_y_mm
    ]


@dataclass(frozen=True, slots=True)
class RotorLead:
    """The lead to one outlet of the lidar."""

    y: float  # of the outlet in the lidar's frame
    diameter: float  # of the bundle
    radius: float  # least bend radius
    path: Path | None  # its middle from the ring to the lidar, rotation frame at gamma = 0; None if there is none
    joint: LeadJoint | None = None  # of its wires with the ring's; None if no straight piece is long enough

    @property
    def mass_g(self) -> float:
        """Return the mass of a bundle along a path; 0 without one."""
        return mass_g(self.path, self.diameter)


def mass_g(path: Path | None, diameter: float) -> float:
    """Return the mass of a bundle along a path; 0 without one."""
    return 0.0 if path is None else math.pi / 4 * diameter**2 * path.length() * LEAD_G_CM3 / 1000


def leads_of(place: Placement, avoid: Iterable[Shape]) -> tuple[RotorLead, ...]:
    """Return one lead for each outlet of the lidar; none if the catalogue does not describe leads of the ring.

    `avoid` are shapes of the parts that turn.
    """
    scanner = place.scanner
    ring, lidar = scanner.slip_ring, scanner.lidar
    if ring is None or ring.lead_diameter_mm is None or ring.lead_bend_radius_mm is None:
        return ()
    numbers, radius, space = range(len(lidar.cable_y_mm)), ring.lead_bend_radius_mm, rotor_space_of(place, avoid)
    half = ring.leads_mm(len(numbers)) / 2
    best: tuple[RotorLead, ...] = ()
    # the first lead takes the short path, and may block it for the others: then other orders and places are tried
    for places, order in product((numbers, numbers[::-1]), repeat=2):
        bundles = [Bundle(number, len(numbers), half, radius) for number in places]
        leads = _laid(place, space, bundles, order)
        if not best or _laid_count(leads) > _laid_count(best):
            best = leads
        if _laid_count(best) == len(numbers) or leads[order[0]].path is None:
            break  # the first has all the space: without a path then, there is none
    return _jointed(replace(space, bearings_rad=None), best)  # a path may be in the fan, and then its joint


def _jointed(space: RotorSpace, leads: tuple[RotorLead, ...]) -> tuple[RotorLead, ...]:
    """Return the leads with joints, each clear of the other leads and of earlier joints."""
    points = [np.zeros((0, 3)) if lead.path is None else lead.path.points(SAMPLE) for lead in leads]
    jointed: list[RotorLead] = []
    for i, lead in enumerate(leads):
        apart = lead.diameter + TUBE_WALL + BUNDLE_GAP / 2
        others = [(middles, apart) for k, middles in enumerate(points) if k != i]
        others += [(other.joint.points(), apart + TUBE_WALL) for other in jointed if other.joint is not None]
        joint = None if lead.path is None else joint_of(lead.path, lead.diameter / 2, space, others)
        jointed.append(replace(lead, joint=joint))
    return tuple(jointed)


def tied_mm(lead: RotorLead, seat: TieSeat) -> float | None:
    """Return the distance of a lead from the hub's slotted tab above it; None if it is not below the tab."""
    if lead.path is None:
        return None
    points = lead.path.points(SAMPLE / 3)
    out = seat.direction()
    along, across = points @ out, points @ [-out[1], out[0], 0.0] - seat.aside
    under = (along > seat.first) & (along < seat.last) & (np.abs(across) < seat.half) & (points[:, 2] < seat.low)
    return float(seat.low - points[under, 2].max() - lead.diameter / 2) if under.any() else None


def _laid_count(leads: Sequence[RotorLead]) -> int:
    return sum(lead.path is not None for lead in leads)


def _laid(
    place: Placement, space: RotorSpace, bundles: Sequence[Bundle], order: Sequence[int]
) -> tuple[RotorLead, ...]:
    """Return the leads by outlet, laid in `order`, each from its bundle at the ring."""
    linkage, outlets, hub = place.linkage, place.scanner.lidar.cable_y_mm, place.stack.hub_radius
    leads: dict[int, RotorLead] = {}
    for i in order:
        bundle, path, half = bundles[i], None, bundles[i].half
        start = outlet_mm(place, outlets[i], place.scanner.lidar.cable_straight_mm)
        outlet = Ending(start[None], -place.stack.R()[:, 0], BACK, 0.0, half + CLAMPED)
        long = tuple(JOINT_LENGTH + bundle.radius + more for more in MORE)
        ways = [(OUT, outlet), *((OUT, replace(outlet, lengths=(each,))) for each in long)]
        if len(bundles) == 1:  # several leave the hub side by side, without place between them
            ways.append((tuple(half + each for each in long), outlet))
        exits = place.drive.lead_exits(bundle, linkage.hub_tie, linkage.free_azimuth)
        # tied if possible; a path in the fan, where its shadow counts, is better than none
        for within, (tie, ends) in product((space, replace(space, bearings_rad=None)), exits):
            starts = [Ending(np.array(corners), along, OUT, bundle.radius, 0.0) for corners, along in ends]
            clear = [start for start in starts if space.clear_of_others(start.corners).all()]
            path = first_with_place(
                _path(within, [_from_hub(start, hub, half, tie, out) for start in clear], behind, bundle, hub)
                for out, behind in ways
            )
            if path is not None:
                break
        leads[i] = RotorLead(outlets[i], 2 * half, bundle.radius, path)
        if path is not None:
            middles = np.concatenate([path.points(SAMPLE), space.others[0]])
            space = replace(space, others=(middles, 2 * half + BUNDLE_GAP / 2))
    return tuple(leads[i] for i in sorted(leads))


def _path(space: RotorSpace, starts: Sequence[Ending], outlet: Ending, bundle: Bundle, hub: float) -> Path | None:
    lattice = lattice_about_axis(space.floor, bundle.half, hub, [*starts, outlet])
    return short_path(space, starts, [outlet], bundle.half, bundle.radius, lattice)


def outlet_mm(place: Placement, y: float, out: float) -> Array:
    """Return a point at a distance behind the lidar on the axis of the cable at a y, shape (3,)."""
    lidar, T = place.scanner.lidar, place.scanner.angles.T_rot_laser()
    at = [-lidar.body_mm[0] / 2 - out, y, lidar.cable_z_mm - lidar.optical_height_mm]
    return np.asarray(place.stack.R() @ at + T[:3, 3] * 1000)


def _from_hub(start: Ending, hub: float, half: float, seat: TieSeat | None, out: Iterable[float]) -> Ending:
    """Return the end with its lengths `out` counted from the hub's rim; straight below a slotted tab."""
    inside = hub - float(np.hypot(*start.corners[-1, :2]))
    start = replace(start, lengths=tuple(inside + each for each in out), clamped=inside + half + CLAMPED)
    if seat is None:
        return start
    clamped = start.clamped + seat.end - hub
    return replace(start, clamped=clamped, used=max(start.used, clamped - CLAMPED))  # the bend before it may be longer
