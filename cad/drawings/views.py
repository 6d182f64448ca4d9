"""Views that a part needs.

Three views along the rotation frame's axes and an isometric; a section along the axis if a diameter has a fit; a view
onto every inclined pattern of three holes or more; and one that shows the angle of such a pattern in true size, if no
other does.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import cadquery as cq
import numpy as np
import shapely

from scanwright.cad import solids
from scanwright.cad.drawings.patterns import (
    STRAIGHT,
    Part,
    Pattern,
    along_pattern,
    azimuth_deg,
    number,
    parallel,
    planes_across,
)
from scanwright.cad.drawings.pen import Point
from scanwright.cad.drawings.project import Curve, project
from scanwright.design.arrays import Array, Vector

Z = np.array([0.0, 0.0, 1.0])
HATCH_MM = 2.5  # between two lines
SLOPE_RAD = math.radians(45.0)  # ISO 128-3
ON_CUT_MM = 1e-4  # of a face from the plane of the cut: rounding of the kernel
COARSE_MM = 0.05  # chord and angle of hatched faces

Line = tuple[tuple[float, float], tuple[float, float]]


def cut_along_axis(solid: cq.Solid, right: Vector, up: Vector) -> cq.Shape:
    """Return the half of a solid behind the plane of a view through x = y = 0; the viewer is at right x up."""
    box, towards = solid.BoundingBox(), np.cross(right, up)
    half = 2.0 * box.DiagonalLength + 2.0 * math.hypot(*box.center.toTuple())
    before = cq.Solid.makeBox(2 * half, 2 * half, half, cq.Vector(-half, -half, 0))
    return solid.cut(before.moved(solids.location(np.stack([right, up, towards], axis=1))))


def hatching(cut: cq.Shape, right: Vector, up: Vector, zero: Vector) -> list[Line]:
    """Return lines over the faces of `cut_along_axis` in the plane of its view, from the lowest to the highest."""
    along = math.cos(SLOPE_RAD) * right + math.sin(SLOPE_RAD) * up
    across = np.cross(np.cross(right, up), along)
    frame = np.stack([along, across])
    faces = shapely.union_all([shapely.Polygon(corners @ frame.T) for corners in _on_cut(cut, np.cross(right, up))])
    if faces.is_empty:
        return []
    left, low, far, high = faces.bounds
    levels = HATCH_MM * np.arange(math.ceil(low / HATCH_MM), math.floor(high / HATCH_MM) + 1) + 1e-7
    lines = []
    for level in levels:
        pieces = shapely.get_parts(faces.intersection(shapely.LineString([(left, level), (far, level)])))
        spans = sorted(tuple(sorted(shapely.get_coordinates(piece)[:, 0])) for piece in pieces if piece.length > 0)
        for ends in spans:
            points = [end * along + level * across - zero for end in ends]
            first, last = ((round(float(p @ right), 3) + 0.0, round(float(p @ up), 3) + 0.0) for p in points)
            lines.append((first, last))
    return lines


def _on_cut(cut: cq.Shape, towards: Vector) -> Iterator[Array]:
    """Yield the triangles of the cut faces, each of shape (3, 3)."""
    for face in cut.Faces():
        flat = face.geomType() == "PLANE" and float(np.array(face.normalAt().toTuple()) @ towards) > 1 - ON_CUT_MM
        if flat and abs(float(np.array(face.Center().toTuple()) @ towards)) < ON_CUT_MM:
            points, triangles = face.copy().tessellate(COARSE_MM, COARSE_MM)
            corners = np.array([point.toTuple() for point in points])
            yield from (corners[list(triangle)] for triangle in triangles)


@dataclass(frozen=True, slots=True)
class View:
    """A view of a part."""

    title: str  # above the view
    right: Array  # unit vector to the right, in the rotation frame
    up: Array  # unit vector upwards
    origin: Array  # point whose projection is 0 of the ordinates
    curves: list[Curve]  # lines of the part, model mm
    kind: str  # front and top have ordinates of planes too, angle, section and iso none
    hatching: tuple[Line, ...] = ()  # lines over cut faces

    @property
    def towards(self) -> Array:
        """Return the direction from the part to the viewer."""
        return np.cross(self.right, self.up)

    def flat(self, point: Array | Point3) -> Point:
        """Project a point of the rotation frame onto the view, model mm."""
        away = np.asarray(point) - self.origin
        return float(away @ self.right), float(away @ self.up)


Point3 = tuple[float, float, float]


def views_of(part: Part) -> list[View]:
    """Return all views of a part: front, top, left, isometric, then the others."""
    inclined = [pattern for pattern in part.patterns if has_view(pattern)]
    upright = [p for p in part.patterns if len(p.holes) >= 2 and parallel(p.direction, Z) and not p.slot]
    tilt = _level(outwards_of(inclined[0], part)) if inclined else np.array([1.0, 0.0, 0.0])
    along = _along(part, upright) if upright else tilt
    away = np.cross(Z, along)
    base = np.array([0.0, 0.0, part.datum])
    name = "X" if abs(along[0] - 1) < STRAIGHT else f"azimuth {number(azimuth_deg(along))}°"
    views = [
        _view(part, f"FRONT  ({name} right, Z up)", along, Z, base, "front"),
        _view(part, f"TOP  ({name} right)", along, away, base, "top"),
        _view(part, "FROM THE LEFT  (Z up)", -away, Z, base, "left"),
    ]
    corner = (along - away + Z) / math.sqrt(3)
    right = (along + away) / math.sqrt(2)
    views.append(_view(part, "", right, np.cross(corner, right), base, "iso"))
    if part.fits:
        cut = cut_along_axis(part.solid, along, Z)
        curves = project(cut, along, Z, base, hidden=False)
        lines = tuple(hatching(cut, along, Z, base))
        views.append(View("S-S  (along the axis)", along, Z, base, curves, "section", lines))
    letters = iter("ABCDEF")
    for pattern in inclined:
        if not any(parallel(pattern.direction, view.towards) for view in views):
            outwards = outwards_of(pattern, part)
            side = along_pattern(pattern, outwards)
            title = f"{next(letters)}  onto the inclined holes"
            up = np.cross(outwards, side)
            views.append(_view(part, title, side, up, pattern.centre, "onto"))
    for pattern in inclined[:1]:
        if not any(shows_angle(view, pattern) for view in views[:3]):
            level = _level(pattern.direction)
            views.append(_view(part, f"{next(letters)}  angle in true size", level, Z, base, "angle"))
    return views


def has_view(pattern: Pattern) -> bool:
    """Return whether a pattern gets a separate view."""
    return len(pattern.holes) >= 3 and not parallel(pattern.direction, Z)


def outwards_of(pattern: Pattern, part: Part) -> Array:
    """Return the direction of the holes to the lidar, or away from the middle of the part."""
    if part.lidar_axis is not None and parallel(pattern.direction, part.lidar_axis):
        return part.lidar_axis
    middle = np.array(part.solid.Center().toTuple())
    return pattern.direction if (pattern.centre - middle) @ pattern.direction > 0 else -pattern.direction


def shows_angle(view: View, pattern: Pattern) -> bool:
    """Return whether a view shows the angle of a pattern to the rotation axis in true size."""
    direction = pattern.direction
    return not parallel(direction, Z) and parallel(view.up, Z) and abs(float(direction @ view.towards)) < STRAIGHT


def _along(part: Part, upright: list[Pattern]) -> Array:
    """Return X, or the line of two holes if the part has faces across that line but none across X: a bar."""
    x = np.array([1.0, 0.0, 0.0])
    if len(upright[0].holes) != 2 or planes_across(part.solid, x):
        return x
    first, last = (np.array(hole.low) for hole in upright[0].holes)
    line = (last - first) / np.linalg.norm(last - first)
    line = line if float(line @ first) > 0 else -line  # outwards
    return line if planes_across(part.solid, line) else x


def _view(part: Part, title: str, right: Array, up: Array, origin: Array, kind: str) -> View:
    return View(title, right, up, origin, project(part.solid, right, up, origin, hidden=kind != "iso"), kind)


def _level(direction: Array) -> Array:
    """Return the horizontal part of a direction, as a unit vector."""
    level = np.array([direction[0], direction[1], 0.0])
    return level / np.linalg.norm(level)
