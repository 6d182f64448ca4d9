"""Content of a drawing: solid, holes, cylinders about the axis, and plane faces. Rotation frame, mm."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cadquery as cq
import numpy as np

from scanwright.cad.drawings.patterns import Pattern, on_axis, patterns_of, slots_of, with_threads
from scanwright.cad.geometry.holes import Round, rounds_of
from scanwright.cad.layout.joints import Joint
from scanwright.cad.parts.part_spec import OnSheet, ToleratedDiameter
from scanwright.design.arrays import Array

STRAIGHT = 1e-4  # two directions closer than this are parallel
PLANE_MM2 = 3.0  # smaller faces get no ordinate
SIDE_MM2 = 8.0  # nor do smaller upright ones: flanks of a pulley's teeth, ends of blind holes
SAME_SIZE_MM = 5e-3  # between a fit's diameter and its cylinder's: half of the last printed digit
PLANES = 9  # the largest faces of one direction that get an ordinate: more do not fit


@dataclass(frozen=True, slots=True)
class Part:
    """Content of the drawing of a part."""

    solid: cq.Solid  # rotation frame, moved so that the axis of its ordinates is x = y = 0
    patterns: list[Pattern]  # its holes off the axis, then its slots
    axial: list[Round]  # its cylinders about that axis
    datum: float  # height of the lowest point
    lidar_axis: Array | None  # z of the lidar that it carries; None for other parts
    fits: tuple[ToleratedDiameter, ...]  # of its cylinders about the axis

    def tolerance(self, item: Round) -> str:
        """Return the text behind the diameter of a cylinder about the axis."""
        fit = next((fit for fit in self.fits if is_of(fit, item)), None)
        return "" if fit is None else f"  {fit.tolerance}"


def part_of(name: str, solid: cq.Solid, lidar_axis: Array | None, on_sheet: OnSheet, joints: Sequence[Joint]) -> Part:
    """Read a solid; slots and threads come from its joints, fits from those that one of its cylinders has."""
    away = (-on_sheet.axis[0], -on_sheet.axis[1], 0.0)
    if any(away):
        solid = solid.translate(cq.Vector(*away))
    rounds = rounds_of(solid)
    axial = [item for item in rounds if on_axis(item)]
    fits = tuple(fit for fit in on_sheet.fits if any(is_of(fit, item) for item in axial))
    datum = float(solid.BoundingBox().zmin)
    patterns = with_threads(patterns_of(rounds), [joint for joint in joints if joint.holder == name], away)
    patterns += slots_of([joint for joint in joints if joint.part == name], away)
    return Part(solid, patterns, axial, datum, lidar_axis, fits)


def is_of(fit: ToleratedDiameter, item: Round) -> bool:
    """Return whether a fit belongs to a cylinder."""
    return fit.hole == item.hole and abs(fit.diameter - item.diameter) < SAME_SIZE_MM


def parallel(a: Array, b: Array) -> bool:
    """Return whether two unit vectors are parallel or opposite."""
    return float(np.linalg.norm(np.cross(a, b))) < STRAIGHT


def azimuth_deg(direction: Array) -> float:
    """Return the azimuth of a direction: from +Y, counter-clockwise from above, 0 to 360."""
    return round(math.degrees(math.atan2(-direction[0], direction[1])) % 360, 6) % 360


def planes_across(solid: cq.Solid, normal: Array, least_mm2: float = PLANE_MM2) -> list[float]:
    """Return the positions of the larger plane faces across a direction, the largest first."""
    areas: dict[float, float] = {}
    for face in solid.Faces():
        if face.geomType() == "PLANE" and parallel(np.array(face.normalAt().toTuple()), normal):
            place = round(float(np.array(face.Center().toTuple()) @ normal), 2) + 0.0
            areas[place] = areas.get(place, 0.0) + face.Area()
    places = sorted((place for place in areas if areas[place] >= least_mm2), key=lambda place: (-areas[place], place))
    return places[:PLANES]
