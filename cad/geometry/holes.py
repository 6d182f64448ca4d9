"""Cylindrical features of a solid, read from its faces: holes and bosses. Millimetres."""

import math
from dataclasses import dataclass

import cadquery as cq
import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.gp import gp_Dir, gp_Lin, gp_Pnt
from OCP.IntCurvesFace import IntCurvesFace_ShapeIntersector
from OCP.TopAbs import TopAbs_REVERSED

from scanwright.design.arrays import Array

LEAST_TURN = math.pi * 1.02  # a shorter arc holds no screw and has no measurable diameter
SAME = 1e-3  # mm, and for directions


@dataclass(frozen=True, slots=True)
class Round:
    """A hole, or a boss, of one diameter."""

    diameter: float  # of the cylinder
    direction: tuple[float, float, float]  # unit vector along the axis; its largest component is positive
    low: tuple[float, float, float]  # end of the axis where `direction` starts
    high: tuple[float, float, float]  # the other end
    hole: bool  # whether the material is outside
    through: bool  # whether both ends of a hole are open

    @property
    def length(self) -> float:
        """Length along the axis."""
        return math.dist(self.low, self.high)


class Piercing:
    """Intersections of straight lines with the surface of a solid; the kernel prepares this once per solid."""

    def __init__(self, solid: cq.Solid) -> None:
        self._intersector = IntCurvesFace_ShapeIntersector()
        self._intersector.Load(solid.wrapped, 1e-6)

    def between(self, start: Array, end: Array) -> bool:
        """Return whether the straight line from start to end meets the surface."""
        along = end - start
        line = gp_Lin(gp_Pnt(*start.tolist()), gp_Dir(*along.tolist()))
        self._intersector.Perform(line, 0.0, float(np.linalg.norm(along)))
        return bool(self._intersector.NbPnt() > 0)


def rounds_of(solid: cq.Solid) -> list[Round]:
    """Return all cylinders of a solid that go at least half around, in a fixed order."""
    groups: dict[tuple[float, ...], list[tuple[float, float, float]]] = {}
    axes: dict[tuple[float, ...], tuple[Array, Array]] = {}
    for face in solid.Faces():
        if face.geomType() != "CYLINDER":
            continue
        surface = BRepAdaptor_Surface(face.wrapped)
        cylinder = surface.Cylinder()
        axis = cylinder.Axis()
        along = np.array([axis.Direction().X(), axis.Direction().Y(), axis.Direction().Z()])
        point = np.array([axis.Location().X(), axis.Location().Y(), axis.Location().Z()])
        direction = _positive(along)
        foot = point - (point @ direction) * direction
        base, sense = float(point @ direction), float(along @ direction)
        low, high = sorted(base + sense * v for v in (surface.FirstVParameter(), surface.LastVParameter()))
        hole = (face.wrapped.Orientation() == TopAbs_REVERSED) == cylinder.Position().Direct()
        key = (float(hole), round(2 * cylinder.Radius(), 3), *(np.round([*direction, *foot], 3) + 0.0).tolist())
        groups.setdefault(key, []).append((low, high, surface.LastUParameter() - surface.FirstUParameter()))
        axes.setdefault(key, (direction, foot))
    piercing = Piercing(solid)
    rounds = []
    for key, pieces in sorted(groups.items()):
        direction, foot = axes[key]
        hole = bool(key[0])
        for low, high, turn in _joined(pieces):
            if turn < LEAST_TURN or high - low < SAME:
                continue
            beyond = foot + (low - 0.05) * direction, foot + (high + 0.05) * direction
            through = hole and not piercing.between(*beyond)
            ends = triple(foot + low * direction), triple(foot + high * direction)
            rounds.append(Round(key[1], triple(direction), *ends, hole, through))
    return rounds


def _joined(pieces: list[tuple[float, float, float]]) -> list[tuple[float, float, float]]:
    """Return the faces of one cylinder that touch along its axis, as (low, high, turn) of the widest height."""
    joined: list[list[tuple[float, float, float]]] = []
    for piece in sorted(pieces):
        if joined and piece[0] <= max(other[1] for other in joined[-1]) + SAME:
            joined[-1].append(piece)
        else:
            joined.append([piece])
    out = []
    for group in joined:
        heights = [(low + high) / 2 for low, high, _ in group]
        turn = max(sum(t for low, high, t in group if low <= z <= high) for z in heights)
        out.append((min(p[0] for p in group), max(p[1] for p in group), turn))
    return out


def _positive(direction: Array) -> Array:
    """Return the direction or its opposite: the largest component is positive, of equal ones the last."""
    sizes = np.round(np.abs(direction), 6)
    largest = int(np.flatnonzero(sizes == sizes.max())[-1])
    return direction if direction[largest] > 0 else -direction


def triple(values: Array) -> tuple[float, float, float]:
    """Return a vector as a tuple, rounded to a millionth and without -0."""
    x, y, z = (round(float(v), 6) + 0.0 for v in values)
    return x, y, z
