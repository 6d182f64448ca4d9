"""The leads between lidar and slip ring: where they begin and end on this scanner, and the way that each one takes.

Behind the straight piece that its maker draws, the jacket of the lidar's cable is taken off; its wires go on, bend like
the leads of the ring, and meet them in a joint on a straight piece. Both turn with the lidar: they bend when
they are laid, and then no more.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from scanwright.cad.layout.belt.stack import BeltStack
from scanwright.cad.layout.cables import joint as joints
from scanwright.cad.layout.cables.joint import LeadJoint, joint_of
from scanwright.cad.layout.cables.path import Path
from scanwright.cad.layout.cables.room import RotorRoom, room_of
from scanwright.cad.layout.cables.tie_seat import TieSeat
from scanwright.cad.layout.cables.way import Ending, lattice_about_axis, short_way
from scanwright.cad.layout.direct.loads import JOURNAL_WALL
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.layout import Layout
from scanwright.design.arrays import Array
from scanwright.design.catalogue.products import SlipRing

SAMPLE = 1.5  # mm between the points that stand for a lead that is laid
BESIDE = 0.25  # between two leads, and a lead and its channel's wall
ABOVE_CAGE = 1.9  # height of a lead over the lower face of the hub where it leaves through the hub's channel
BELOW_HUB = 0.85  # between the lower face of the hub's tongue and a lead that leaves under it
WINDOW_BELOW = 8.3  # the hub's lower end: middle of the windows of a hollow shaft
OUT = (10.0, 14.0, 20.0, 28.0)  # of the hub, before the first bend
HELD = 1.0  # beyond the face that a lead leaves by, and its own radius
BACK = (4.0, 5.5, 8.0, 13.0, 20.0, 30.0)  # from the lidar's stub, before the first bend
ASIDE = 15.0  # deg between two azimuths that a ring's lead may leave at
LEAD_G_CM3 = 1.5  # reckoned: five wires of 1.3 mm over 0.14 mm2 of copper are 2.9 g/m each, in a bundle of 3.5 mm


@dataclass(frozen=True, slots=True)
class RotorLead:
    """The lead to one outlet of the lidar.

    Attributes:
        y: of the outlet in the lidar's frame, which tells it from the others.
        diameter: of the bundle.
        radius: least one that it may be bent to.
        path: its middle from the ring to the lidar, rotation frame at gamma = 0; None where there is no way.
        joint: where its wires meet the ring's; None where no straight piece is long enough.
    """

    y: float
    diameter: float
    radius: float
    path: Path | None
    joint: LeadJoint | None = None

    @property
    def mass_g(self) -> float:
        """Of the wires between ring and jacket; 0 where there is no way."""
        return mass_g(self.path, self.diameter)


def mass_g(path: Path | None, diameter: float) -> float:
    """What a bundle weighs along a path; 0 without one."""
    return 0.0 if path is None else math.pi / 4 * diameter**2 * path.length() * LEAD_G_CM3 / 1000


def leads_of(layout: Layout) -> tuple[RotorLead, ...]:
    """One lead for each outlet of the lidar; none without a ring, or where nobody tells what its leads are like."""
    scanner = layout.scanner
    ring, lidar = scanner.slip_ring, scanner.lidar
    if ring is None or ring.lead_diameter_mm is None or ring.lead_bend_radius_mm is None:
        return ()
    numbers = range(len(lidar.cable_y_mm))
    found: tuple[RotorLead, ...] = ()
    # who comes first takes the short way, and may bar it to the others: then they come first, or change places
    for places, order in product((numbers, numbers[::-1]), repeat=2):
        leads = _laid(layout, ring, order, places)
        if not found or _ways(leads) > _ways(found):
            found = leads
        if _ways(found) == len(numbers) or leads[order[0]].path is None:
            break  # the first has all the room: what has no way then has none
    return _jointed(layout, found)


def _jointed(layout: Layout, leads: tuple[RotorLead, ...]) -> tuple[RotorLead, ...]:
    """The leads with their joints, each beside the other leads and the joints before it."""
    room = replace(room_of(layout), bearings_rad=None)  # a way may be in the fan; its joint is then, too
    points = [np.zeros((0, 3)) if lead.path is None else lead.path.points(SAMPLE) for lead in leads]
    found: list[RotorLead] = []
    for i, lead in enumerate(leads):
        apart = lead.diameter + joints.WALL + BESIDE / 2
        others = [(middles, apart) for k, middles in enumerate(points) if k != i]
        others += [(other.joint.points(), apart + joints.WALL) for other in found if other.joint is not None]
        joint = None if lead.path is None else joint_of(lead.path, lead.diameter / 2, room, others)
        found.append(replace(lead, joint=joint))
    return tuple(found)


def tied_mm(lead: RotorLead, seat: TieSeat) -> float | None:
    """Room between a lead and the tongue of the hub that it leaves under; None where it leaves elsewhere."""
    if lead.path is None:
        return None
    points = lead.path.points(SAMPLE / 3)
    out = seat.direction()
    along, across = points @ out, points @ [-out[1], out[0], 0.0] - seat.aside
    under = (along > seat.first) & (along < seat.last) & (np.abs(across) < seat.half) & (points[:, 2] < seat.low)
    return float(seat.low - points[under, 2].max() - lead.diameter / 2) if under.any() else None


def _ways(leads: Sequence[RotorLead]) -> int:
    return sum(lead.path is not None for lead in leads)


def _laid(layout: Layout, ring: SlipRing, order: Sequence[int], places: Sequence[int]) -> tuple[RotorLead, ...]:
    """The leads in the order of the outlets, laid in an order, each from its place among those that leave the ring."""
    assert ring.lead_diameter_mm is not None and ring.lead_bend_radius_mm is not None
    half, radius, room = ring.lead_diameter_mm / 2, ring.lead_bend_radius_mm, room_of(layout)
    hub, outlets = layout.stack.hub_radius, layout.scanner.lidar.cable_y_mm
    leads: dict[int, RotorLead] = {}
    for i in order:
        outlet, path = _outlet(layout, outlets[i], half), None
        # tied if it can be; rather in the fan, where its shadow counts, than not at all
        ways = product((room, replace(room, bearings_rad=None)), _exits(layout, ring, places[i], len(outlets)))
        for within, (seat, exits) in ways:
            starts = [Ending(np.array(corners), out, OUT, radius, 0.0) for corners, out in exits]
            starts = [_from_hub(start, hub, half, seat) for start in starts if room.beside_others(start.corners).all()]
            lattice = lattice_about_axis(room.floor, half, hub, [*starts, outlet])
            path = short_way(within, starts, [outlet], half, radius, lattice)
            if path is not None:
                break
        leads[i] = RotorLead(outlets[i], 2 * half, radius, path)
        if path is not None:
            room = _with(room, path, 2 * half + BESIDE / 2)
    return tuple(leads[i] for i in sorted(leads))


def outlet_mm(layout: Layout, y: float, out: float) -> Array:
    """Point at a distance behind the lidar on the middle of the cable that leaves at a y, shape (3,)."""
    scanner = layout.scanner
    lidar, T = scanner.lidar, scanner.angles.T_rot_laser()
    at = [-lidar.body_mm[0] / 2 - out, y, lidar.cable_z_mm - lidar.optical_height_mm]
    return np.asarray(layout.stack.R() @ at + T[:3, 3] * 1000)


def _outlet(layout: Layout, y: float, half: float) -> Ending:
    """Behind the straight piece of the lidar's cable."""
    start = outlet_mm(layout, y, layout.scanner.lidar.cable_straight_mm)
    return Ending(start[None], -layout.stack.R()[:, 0], BACK, 0.0, half + HELD)


def _from_hub(start: Ending, hub: float, half: float, seat: TieSeat | None) -> Ending:
    """The same end with its lengths counted from beside the hub; straight as far as it lies under a tongue."""
    inside = hub - float(np.hypot(*start.corners[-1, :2]))
    start = replace(start, lengths=tuple(inside + out for out in OUT), held=inside + half + HELD)
    if seat is None:
        return start
    held = start.held + seat.end - hub
    return replace(start, held=held, used=held - HELD)


def _exits(
    layout: Layout, ring: SlipRing, number: int, count: int
) -> Iterator[tuple[TieSeat | None, list[tuple[Array, Array]]]]:
    """Where a lead may be tied, and then the exits there: the best place first."""
    seat = layout.linkage.hub_tie
    if isinstance(layout.stack, BeltStack) or layout.stack.bearing is not None:
        yield seat, list(_held_exits(layout, ring, number, count))
        return
    if seat is not None:
        yield seat, [_tied_exit(layout.stack, ring, seat, number, count)]
    yield None, list(_open_exits(layout.stack, ring))


def _held_exits(layout: Layout, ring: SlipRing, number: int, count: int) -> Iterator[tuple[Array, Array]]:
    """Corners from the ring's rotor to where the lead turns outwards, and the direction in which it does."""
    stack, half = layout.stack, (ring.lead_diameter_mm or 0.0) / 2
    if isinstance(stack, BeltStack):
        # up the bore and out by its two windows
        assert ring.rotor is not None
        middle = stack.hub_bottom - WINDOW_BELOW
        for sign in (1.0, -1.0) if count == 1 else (1.0 - 2.0 * (number % 2),):
            low, side = stack.ring_top + ring.rotor.length_mm, sign * (half + BESIDE)
            yield np.array([[side, 0.0, low], [side, 0.0, middle]]), np.array([sign, 0.0, 0.0])
        return
    aside = (2 * half + BESIDE) * (number - (count - 1) / 2)
    inner = stack.shaft_diameter / 2 + JOURNAL_WALL + half + BESIDE
    points = np.array([[inner, aside, stack.ring_top], [inner, aside, stack.shoulder + ABOVE_CAGE]])
    yield _turned(points, sum(layout.linkage.cross_azimuths) / 2)


def _tied_exit(stack: DirectStack, ring: SlipRing, seat: TieSeat, number: int, count: int) -> tuple[Array, Array]:
    """Beside the others under the tongue of an open hub, as near to it as a lead can bend."""
    half, radius = (ring.lead_diameter_mm or 0.0) / 2, ring.lead_bend_radius_mm or 0.0
    aside = (2 * half + BESIDE) * (number - (count - 1) / 2)
    inner, low = _on_rotor(stack, half), stack.ring_top
    high = max(low + radius, seat.low - BELOW_HUB - half)
    return _turned(np.array([[inner, aside, low], [inner, aside, high]]), seat.azimuth)


def _open_exits(stack: DirectStack, ring: SlipRing) -> Iterator[tuple[Array, Array]]:
    """All around the axis, between ring and hub."""
    half, radius = (ring.lead_diameter_mm or 0.0) / 2, ring.lead_bend_radius_mm or 0.0
    for azimuth in np.radians(np.arange(0.0, 360.0, ASIDE)).tolist():
        inner = _on_rotor(stack, half)
        points = np.array([[inner, 0.0, stack.ring_top], [inner, 0.0, stack.ring_top + radius]])
        yield _turned(points, azimuth)


def _on_rotor(stack: DirectStack, half: float) -> float:
    """Distance from the axis at which a lead leaves the rotor of a through-bore ring."""
    return stack.ring_bore / 2 + half + BESIDE


def _turned(points: Array, azimuth: float) -> tuple[Array, Array]:
    c, s = math.cos(azimuth), math.sin(azimuth)
    return points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]), np.array([c, s, 0.0])


def _with(room: RotorRoom, path: Path, apart: float) -> RotorRoom:
    """The room that is left beside a lead."""
    return replace(room, others=(np.concatenate([path.points(SAMPLE), room.others[0]]), apart))
