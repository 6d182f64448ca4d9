"""Slots: two half cylinders that close one hole, and what a drawing says of them. Rotation frame, mm."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import cadquery as cq
import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.TopAbs import TopAbs_REVERSED

from cad.drawings.patterns import number
from cad.geometry.holes import Piercing
from design.arrays import Array

HALF_TURN = 0.02  # rad, from half a turn
SAME = 1e-3


@dataclass(frozen=True, slots=True)
class Slot:
    """A slot with round ends that goes through.

    Attributes:
        width: diameter of its ends.
        length: over both ends.
        direction: unit vector that it goes through along.
        middle: of the slot.
    """

    width: float
    length: float
    direction: Array
    middle: Array


@dataclass(frozen=True, slots=True)
class _End:
    """Half a cylinder, hollow: diameter, axis, middle of the axis, from there to the middle of the arc, and length."""

    diameter: float
    axis: Array
    centre: Array
    outwards: Array
    depth: float


def slots_of(solid: cq.Solid) -> list[list[Slot]]:
    """All slots, equal ones together, in a fixed order."""
    piercing = Piercing(solid)
    groups: dict[tuple[float, ...], list[Slot]] = {}
    for one, other in itertools.combinations(_ends(solid), 2):
        between = other.centre - one.centre
        apart = float(np.linalg.norm(between))
        alike = abs(one.diameter - other.diameter) < SAME and abs(one.depth - other.depth) < SAME
        if not alike or apart < SAME or abs(abs(float(one.axis @ other.axis)) - 1) > SAME:
            continue
        faces_away = float(np.linalg.norm(one.outwards + between / apart)) < SAME
        if not faces_away or float(np.linalg.norm(other.outwards - between / apart)) > SAME:
            continue
        middle = (one.centre + other.centre) / 2
        reach = (one.depth / 2 + 0.05) * one.axis
        if piercing.between(middle - reach, middle + reach) or piercing.between(one.centre, other.centre):
            continue
        slot = Slot(one.diameter, apart + one.diameter, one.axis, middle)
        key = (*np.round(np.abs(one.axis), 3).tolist(), *np.round(np.abs(between), 2).tolist(), round(slot.width, 2))
        groups.setdefault(key, []).append(slot)
    return [sorted(groups[key], key=lambda slot: np.round(slot.middle, 2).tolist()) for key in sorted(groups)]


def slot_words(slots: list[Slot]) -> str:
    """The call-out of equal slots."""
    count = f"{len(slots)}x " if len(slots) > 1 else ""
    return f"{count}SLOT {number(slots[0].width)} x {number(slots[0].length)} THRU"


def _ends(solid: cq.Solid) -> list[_End]:
    found = []
    for face in solid.Faces():
        if face.geomType() != "CYLINDER":
            continue
        surface = BRepAdaptor_Surface(face.wrapped)
        cylinder = surface.Cylinder()
        hollow = (face.wrapped.Orientation() == TopAbs_REVERSED) == cylinder.Position().Direct()
        low, high = surface.FirstUParameter(), surface.LastUParameter()
        if not hollow or abs(high - low - math.pi) > HALF_TURN:
            continue
        line = cylinder.Axis()
        axis, point = (np.array(cq.Vector(of).toTuple()) for of in (line.Direction(), line.Location()))
        outwards = np.array(face.Center().toTuple()) - point
        centre = point + float(outwards @ axis) * axis
        outwards -= float(outwards @ axis) * axis
        depth = surface.LastVParameter() - surface.FirstVParameter()
        found.append(_End(2 * cylinder.Radius(), axis, centre, outwards / np.linalg.norm(outwards), depth))
    return found
