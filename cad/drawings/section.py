"""A part cut along its axis: what is left of it, and the hatching of the faces that the cut made. Millimetres."""

from __future__ import annotations

import math
from collections.abc import Iterator

import cadquery as cq
import numpy as np

from scanwright.cad import solids
from scanwright.design.arrays import Array, Vector

HATCH_MM = 2.5  # between two lines
SLOPE_RAD = math.radians(45.0)
ON_CUT = 1e-4
COARSE = 0.05  # chord and angle of what is hatched: a line ends within a hair of the outline
JOINED = 1e-6

Line = tuple[tuple[float, float], tuple[float, float]]


def cut_along_axis(solid: cq.Solid, right: Vector, up: Vector) -> cq.Shape:
    """The half of a solid that is behind the plane of a view through x = y = 0; the viewer is at right x up."""
    box, towards = solid.BoundingBox(), np.cross(right, up)
    half = 2.0 * box.DiagonalLength + 2.0 * math.hypot(*box.center.toTuple())
    before = cq.Solid.makeBox(2 * half, 2 * half, half, cq.Vector(-half, -half, 0))
    return solid.cut(before.moved(solids.location(np.stack([right, up, towards], axis=1))))


def hatching(cut: cq.Shape, right: Vector, up: Vector, zero: Vector) -> list[Line]:
    """Lines over the faces of a cut, in the plane of its view, from the lowest to the highest.

    Args:
        cut: of `cut_along_axis`.
        right: unit vector that points to the right of the view.
        up: unit vector that points up in it.
        zero: point that the plane has its zero at.
    """
    along = math.cos(SLOPE_RAD) * right + math.sin(SLOPE_RAD) * up
    across = np.cross(np.cross(right, up), along)
    frame = np.stack([along, across])
    triangles = np.array([corners @ frame.T for corners in _on_cut(cut, np.cross(right, up))])
    if not len(triangles):
        return []
    low, high = triangles[..., 1].min(), triangles[..., 1].max()
    lines = []
    for level in HATCH_MM * np.arange(math.ceil(low / HATCH_MM), math.floor(high / HATCH_MM) + 1) + 1e-7:
        for ends in _joined(sorted(_crossings(triangles, float(level)))):
            points = [end * along + level * across - zero for end in ends]
            first, last = ((round(float(p @ right), 3) + 0.0, round(float(p @ up), 3) + 0.0) for p in points)
            lines.append((first, last))
    return lines


def _on_cut(cut: cq.Shape, towards: Vector) -> Iterator[Array]:
    """Triangles of the faces that the cut made, each of shape (3, 3)."""
    for face in cut.Faces():
        flat = face.geomType() == "PLANE" and float(np.array(face.normalAt().toTuple()) @ towards) > 1 - ON_CUT
        if flat and abs(float(np.array(face.Center().toTuple()) @ towards)) < ON_CUT:
            points, triangles = face.copy().tessellate(COARSE, COARSE)
            corners = np.array([point.toTuple() for point in points])
            yield from (corners[list(triangle)] for triangle in triangles)


def _crossings(triangles: Array, level: float) -> Iterator[tuple[float, float]]:
    """Where a line at a height of the second coordinate is in each triangle."""
    below = triangles[..., 1] < level
    for corners, under in zip(triangles, below, strict=True):
        if not 0 < under.sum() < 3:
            continue
        ends = []
        for a, b in ((0, 1), (1, 2), (2, 0)):
            if under[a] != under[b]:
                share = (level - corners[a, 1]) / (corners[b, 1] - corners[a, 1])
                ends.append(float(corners[a, 0] + share * (corners[b, 0] - corners[a, 0])))
        yield min(ends), max(ends)


def _joined(spans: list[tuple[float, float]]) -> list[tuple[float, float]]:
    joined: list[tuple[float, float]] = []
    for low, high in spans:
        if joined and low <= joined[-1][1] + JOINED:
            joined[-1] = joined[-1][0], max(joined[-1][1], high)
        else:
            joined.append((low, high))
    return joined
