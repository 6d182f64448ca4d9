"""The leads between lidar and slip ring, and their paths.

The jacket of the lidar's cable ends behind its straight piece. Its wires bend like the leads of the ring, and meet them
in a joint. Both turn with the lidar and do not flex.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from scanwright.cad.layout.cables import joint as joints
from scanwright.cad.layout.cables.joint import LeadJoint, joint_of
from scanwright.cad.layout.cables.obstacles import Shape
from scanwright.cad.layout.cables.path import Path
from scanwright.cad.layout.cables.rotor_space import RotorSpace, rotor_space_of
from scanwright.cad.layout.cables.route import Ending, lattice_about_axis, short_path
from scanwright.cad.layout.drive import Bundle
from scanwright.cad.layout.hub import BUNDLE_GAP
from scanwright.cad.layout.placement import Placement
from scanwright.cad.layout.tie_seat import TieSeat
from scanwright.design.arrays import Array

SAMPLE = 1.5  # mm between the points of a lead
OUT = (10.0, 14.0, 20.0, 28.0)  # of the hub, before the first bend
CLAMPED = 1.0  # beyond the face at its exit, and its own radius
BACK = (4.0, 5.5, 8.0, 13.0, 20.0, 30.0)  # from the lidar's stub, before the first bend
LEAD_G_CM3 = 1.5  # calculated: five wires of 1.3 mm over 0.14 mm2 of copper, 2.9 g/m each, in a bundle of 3.5 mm


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
        apart = lead.diameter + joints.WALL + BUNDLE_GAP / 2
        others = [(middles, apart) for k, middles in enumerate(points) if k != i]
        others += [(other.joint.points(), apart + joints.WALL) for other in jointed if other.joint is not None]
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
        exits = place.drive.lead_exits(bundle, linkage.hub_tie, sum(linkage.cross_azimuths) / 2)
        # tied if possible; a path in the fan, where its shadow counts, is better than none
        for within, (tie, ends) in product((space, replace(space, bearings_rad=None)), exits):
            starts = [Ending(np.array(corners), out, OUT, bundle.radius, 0.0) for corners, out in ends]
            clear = [start for start in starts if space.clear_of_others(start.corners).all()]
            starts = [_from_hub(start, hub, half, tie) for start in clear]
            lattice = lattice_about_axis(space.floor, half, hub, [*starts, outlet])
            path = short_path(within, starts, [outlet], half, bundle.radius, lattice)
            if path is not None:
                break
        leads[i] = RotorLead(outlets[i], 2 * half, bundle.radius, path)
        if path is not None:
            middles = np.concatenate([path.points(SAMPLE), space.others[0]])
            space = replace(space, others=(middles, 2 * half + BUNDLE_GAP / 2))
    return tuple(leads[i] for i in sorted(leads))


def outlet_mm(place: Placement, y: float, out: float) -> Array:
    """Return a point at a distance behind the lidar on the axis of the cable at a y, shape (3,)."""
    lidar, T = place.scanner.lidar, place.scanner.angles.T_rot_laser()
    at = [-lidar.body_mm[0] / 2 - out, y, lidar.cable_z_mm - lidar.optical_height_mm]
    return np.asarray(place.stack.R() @ at + T[:3, 3] * 1000)


def _from_hub(start: Ending, hub: float, half: float, seat: TieSeat | None) -> Ending:
    """Return the end with its lengths counted from the hub's rim; straight below a slotted tab."""
    inside = hub - float(np.hypot(*start.corners[-1, :2]))
    start = replace(start, lengths=tuple(inside + out for out in OUT), clamped=inside + half + CLAMPED)
    if seat is None:
        return start
    clamped = start.clamped + seat.end - hub
    return replace(start, clamped=clamped, used=clamped - CLAMPED)
