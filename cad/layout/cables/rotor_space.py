"""Space for a lead on the rotor: clear of all that turns, above all that does not, out of the fan. Rotation frame, mm.

Rotation frame at gamma = 0, mm.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from scanwright.cad.layout.cables.obstacles import Shape, clear_of, farther, shape_of
from scanwright.cad.layout.deck import Deck
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.envelope import Box, around_axis, box_corners
from scanwright.cad.layout.placement import Placement
from scanwright.design.arrays import Array, Mask
from scanwright.design.catalogue.lidar import Lidar

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
