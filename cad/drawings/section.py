"""A part cut along its axis: the half behind the cut, and the hatching of the cut faces. Millimetres."""

import math
from collections.abc import Iterator

import cadquery as cq
import numpy as np
import shapely

from scanwright.cad import solids
from scanwright.design.arrays import Array, Vector

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
    """Return lines over the faces of a cut, in the plane of its view, from the lowest to the highest.

    Args:
        cut: of `cut_along_axis`.
        right: unit vector that points to the right of the view.
        up: unit vector that points up in it.
        zero: point that the plane has its zero at.
    """
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
