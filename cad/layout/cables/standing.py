"""The cables that stand still: the servo's, and the leads of the ring's stator, each from where it leaves to the deck.

Nobody draws where either leaves: the catalogue assumes it, and says so. They end tied to a side of the mount's foot, or
on the deck beside a servo that stands on it. Rotation frame at gamma = 0, mm.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from scanwright.cad.layout.belt.stack import BeltStack
from scanwright.cad.layout.cables.leads import SAMPLE, mass_g
from scanwright.cad.layout.cables.path import Path
from scanwright.cad.layout.cables.standing_room import StandingRoom, standing_room_of
from scanwright.cad.layout.cables.ties import foot_ties_of
from scanwright.cad.layout.cables.way import Ending, short_way
from scanwright.cad.layout.deck import FOOT_THICKNESS, Deck
from scanwright.cad.layout.direct.stack import STATOR_EXIT
from scanwright.cad.layout.joints import triple
from scanwright.cad.layout.layout import Layout
from scanwright.cad.layout.names import SERVO_CABLE, STATOR_LEADS
from scanwright.design.arrays import Array

BUNDLED = 1.2  # diameter of a bundle of bundles, over that of one and the root of their number
LEAVES = (6.5, 8.0, 11.0, 16.0, 24.0)  # of its device, before the first bend
ON_FOOT = 1.0  # between foot or deck and a cable that lies on it
BEYOND = 8.0  # the edge of the foot, where a cable ends
CLEAR = 1.0  # of what it leaves, beside its own radius
LONGER = (2.0, 8.0, 16.0)  # than a cable lies on the foot, before its last bend
STEP = 12.0  # of the points that a cable may turn at
AROUND = 20.0  # of these, beyond the ends
BESIDE_CASE = 20.0  # where a cable ends on a flat deck
THROUGH_DECK = 15.0
BESIDE_SLOT = 0.2


@dataclass(frozen=True, slots=True)
class StandingLead:
    """One cable that stands still.

    Attributes:
        name: of its body.
        device: that it leaves.
        diameter: of it.
        radius: least one that it may be bent to.
        path: its middle from its device to the edge of foot or deck; None where there is no way.
    """

    name: str
    device: str
    diameter: float
    radius: float
    path: Path | None

    @property
    def mass_g(self) -> float:
        """As far as it is drawn; 0 where there is no way."""
        return mass_g(self.path, self.diameter)


@dataclass(frozen=True, slots=True)
class Leaving:
    """A cable before it has a way: from where it leaves, one of some places with their directions.

    `inside` is how far it runs inside of what surrounds its device, and `stiff` whether it is straight there.
    """

    name: str
    device: str
    diameter: float
    radius: float
    places: tuple[tuple[Array, Array], ...]
    inside: float = 0.0
    stiff: bool = False


def standing_leads_of(layout: Layout) -> tuple[StandingLead, ...]:
    """Those that the catalogue tells of."""
    room, found = standing_room_of(layout), []
    for lane, leaving in enumerate(_leaving(layout)):
        path = _way(layout, room, leaving, lane)
        found.append(StandingLead(leaving.name, leaving.device, leaving.diameter, leaving.radius, path))
        if path is not None:
            room = room.beside(path.points(SAMPLE), leaving.diameter / 2)
    return tuple(found)


def _leaving(layout: Layout) -> Iterator[Leaving]:
    servo, ring, stack = layout.scanner.servo, layout.scanner.slip_ring, layout.stack
    exit_mm, out, wide, radius = (
        servo.cable_exit_mm,
        servo.cable_out,
        servo.cable_diameter_mm,
        servo.cable_bend_radius_mm,
    )
    if exit_mm is not None and out is not None and wide is not None and radius is not None:
        place, along = np.array(exit_mm), np.array(out)
        if isinstance(stack, BeltStack):
            place, along = stack.turn() @ place + stack.beside(), stack.turn() @ along
        else:
            place[2] += stack.horn
        yield Leaving(SERVO_CABLE, servo.name, wide, radius, ((place, along),))
    if ring is None or ring.stator_exit is None or ring.lead_diameter_mm is None or ring.lead_bend_radius_mm is None:
        return
    radius, count = ring.lead_bend_radius_mm, max(1, len(layout.scanner.lidar.cable_y_mm))
    wide = round(ring.lead_diameter_mm * (1.0 if count == 1 else BUNDLED * math.sqrt(count)), 2)
    if isinstance(stack, BeltStack) or ring.stator_exit == "end":
        end = (np.array([0.0, 0.0, stack.ring_bottom]), np.array([0.0, 0.0, -1.0]))
        yield Leaving(STATOR_LEADS, ring.name, wide, radius, (end,), stack.ring_bottom - layout.drive.mounted.rear)
    else:
        # by a window of the cage, or between the arms of the adapter
        z, start = stack.ring_bottom + STATOR_EXIT, stack.ring_radius + 0.2
        out_of = max(stack.ring_radius, 0.0 if stack.bearing is None else stack.cage_outer)
        places = tuple((np.array([0.0, side * start, z]), np.array([0.0, side, 0.0])) for side in (-1.0, 1.0))
        yield Leaving(STATOR_LEADS, ring.name, wide, radius, places, out_of - start, stiff=True)


def _way(layout: Layout, room: StandingRoom, leaving: Leaving, lane: int) -> Path | None:
    deck, half = layout.deck, leaving.diameter / 2
    place, out = leaving.places[0]
    if deck.flat and out @ np.array(deck.normal) < -0.5:  # by a hole of the deck
        return Path((triple(place), triple(place + THROUGH_DECK * out)), leaving.radius)
    lengths, held = tuple(leaving.inside + length for length in LEAVES), leaving.inside + half + CLEAR
    used = held if leaving.stiff else 0.0
    starts = [Ending(place[None], out, lengths, used, held) for place, out in leaving.places]
    goals = _beside_case(layout, half) if deck.flat else _on_foot(deck, half, lane)
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
    return short_way(room, starts, goals, half, leaving.radius, lattice)


def _on_foot(deck: Deck, half: float, lane: int) -> list[Ending]:
    """Over the slots at each side of the foot, outwards, two cables side by side."""
    found = []
    for seat in foot_ties_of(deck):
        aside = (2 * lane - 1) * (seat.half - half - BESIDE_SLOT)
        z = np.array([FOOT_THICKNESS + half + ON_FOOT])
        (end,) = seat.points(np.array([seat.end + BEYOND]), np.array([aside]), z) @ deck.rotation().T + np.array(
            deck.centre
        )
        held = seat.end + BEYOND - seat.first + half
        lengths = tuple(held + length for length in LONGER)
        found.append(Ending(end[None], -deck.rotation() @ seat.direction(), lengths, held, held))
    return found


def _beside_case(layout: Layout, half: float) -> list[Ending]:
    """On a flat deck, beside the case, outwards."""
    corners = layout.drive.mounted.corners
    z = layout.drive.mounted.rear + half + ON_FOOT
    found = []
    for axis, sign in ((0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)):
        out = sign * np.eye(3)[axis]
        reach = float((corners @ out).max()) + BESIDE_CASE
        end = reach * out + np.array([0.0, 0.0, z])
        found.append(Ending(end[None], -out, (9.0, 14.0), half, half))
    return found
