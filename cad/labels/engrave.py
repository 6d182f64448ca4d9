"""Planar faces of a solid as polygons, and grooves in them. Millimetres, rotation frame.

Grooves are made without a boolean, which takes seconds for a line of letters.

The face gets a hole per outline, and each hole walls and a floor.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cadquery as cq
import numpy as np
import shapely
import shapely.geometry
from OCP.BRep import BRep_Builder
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
from OCP.gp import gp_Vec
from OCP.TopoDS import TopoDS, TopoDS_Shell, TopoDS_Wire

from scanwright.cad import solids
from scanwright.design.arrays import Array
from scanwright.design.catalogue.products import Printer

WIDTHS = (0.4, 0.9)  # of grooves, least and most
DEPTHS = (0.3, 0.6)
HAIRLINE = 2e-3  # between the triangles of a face


@dataclass(frozen=True, slots=True)
class Flat:
    """A planar face."""

    face: cq.Face  # of the kernel
    frame: Array  # its axes as columns, the outward normal the last, the first along its longest straight edge
    origin: Array  # a point in its plane
    outline: shapely.Polygon  # of the face along the first two axes, about the origin

    def at(self, points: Array) -> Array:
        """Return points of the plane, shape (n, 2), in the rotation frame, shape (n, 3)."""
        return np.asarray(self.origin + points @ self.frame[:, :2].T)

    def along(self, points: Array) -> Array:
        """Return points of the rotation frame, shape (n, 3), in the plane, shape (n, 2)."""
        return np.asarray((points - self.origin) @ self.frame[:, :2])

    def holds(self, point: Array, normal: Array) -> bool:
        """Return whether a point is in the plane and a direction is its outward normal."""
        level = float((point - self.origin) @ self.frame[:, 2])
        return bool(self.frame[:, 2] @ normal > 1 - 1e-9 and abs(level) < 1e-6)


def flats_of(solid: cq.Solid, most: int, least_mm2: float = 0.0) -> list[Flat]:
    """Return the `most` largest planar faces of at least an area, the largest first."""
    faces = [face for face in solid.Faces() if face.geomType() == "PLANE" and face.Area() >= least_mm2]
    places = [(-round(face.Area(), 1), *np.round(face.Center().toTuple(), 3)) for face in faces]
    return [_flat(faces[i]) for i in sorted(range(len(faces)), key=places.__getitem__)[:most]]


def flat_at(solid: cq.Solid, point: Array, normal: Array) -> Flat | None:
    """Return the planar face with that outward normal that contains a point; None if there is none."""
    for face in solid.Faces():
        if face.geomType() == "PLANE" and np.array(face.normalAt().toTuple()) @ normal > 1 - 1e-9:
            flat = _flat(face)
            if flat.holds(point, normal) and flat.outline.contains(shapely.Point(flat.along(point[None])[0])):
                return flat
    return None


def _flat(face: cq.Face) -> Flat:
    normal = np.array(face.normalAt().toTuple())
    helper = np.eye(3)[int(np.argmin(np.abs(np.round(normal, 6))))]
    along = np.cross(helper, normal) / np.linalg.norm(np.cross(helper, normal))
    frame = np.column_stack([along, np.cross(normal, along), normal])
    origin = np.array(face.Center().toTuple())
    points, triangles = face.copy().tessellate(0.05, 0.3)
    flat = (np.array([p.toTuple() for p in points]) - origin) @ frame[:, :2]
    pieces = shapely.polygons(flat[np.array(triangles)])
    outline = shapely.union_all(pieces[shapely.area(pieces) > 1e-6], grid_size=1e-4).buffer(HAIRLINE)
    return _along_edge(Flat(face, frame, origin, max(shapely.get_parts(outline), key=shapely.area)))


def _along_edge(flat: Flat) -> Flat:
    """Return the same face with its first axis along its longest straight edge."""
    corners = np.asarray(shapely.simplify(flat.outline.exterior, 5 * HAIRLINE).coords)
    edges = np.round(np.diff(corners, axis=0), 2)
    along = edges[int(np.argmax(np.round(np.linalg.norm(edges, axis=1), 1)))]
    x, y = along / np.linalg.norm(along) * (1 if tuple(along) > (0, 0) else -1)
    turn = np.array([[x, -y], [y, x]])
    outline = shapely.transform(flat.outline, lambda points: points @ turn)
    frame = np.column_stack([flat.frame[:, :2] @ turn, flat.frame[:, 2]])
    return Flat(flat.face, frame, flat.origin, outline)


@dataclass(frozen=True, slots=True)
class Groove:
    """Width and depth of a groove."""

    width: float
    depth: float


def groove_of(printer: Printer) -> Groove:
    """Return the groove for a printer: two lines wide, half a wall deep (a wall is three lines wide)."""
    wall = printer.min_wall_mm
    return Groove(float(np.clip(wall * 2 / 3, *WIDTHS)), float(np.clip(wall / 2, *DEPTHS)))


def engrave(solid: cq.Solid, grooves: Sequence[tuple[Flat, Sequence[shapely.Polygon]]], depth: float) -> cq.Solid:
    """Return the solid with grooves of one depth; outlines are inside their face and apart, in its axes."""
    builder, shell = BRep_Builder(), TopoDS_Shell()
    builder.MakeShell(shell)
    for face in solid.Faces():
        own = [(flat, outline) for flat, outlines in grooves if flat.face.isSame(face) for outline in outlines]
        for piece in _grooved(face, own, depth) if own else [face]:
            builder.Add(shell, piece.wrapped)
    shell.Closed(True)
    return cq.Solid.makeSolid(cq.Shell(shell))


def _grooved(face: cq.Face, grooves: Sequence[tuple[Flat, shapely.Polygon]], depth: float) -> list[cq.Face]:
    """Return the faces that replace a face: itself with holes, the islands of letters, walls and floors.

    Walls must share their edges with their neighbours: nothing here may copy or repair a shape.
    """
    rest = BRepBuilderAPI_MakeFace(face.wrapped)
    pieces: list[cq.Face] = []
    for flat, outline in grooves:
        ring = shapely.geometry.polygon.orient(outline)  # counter-clockwise from outside, its own holes clockwise
        outer = _wire(ring.exterior, flat)
        letter = BRepBuilderAPI_MakeFace(outer, True)
        for hole in ring.interiors:
            inner = _wire(hole, flat)
            letter.Add(inner)
            pieces.append(cq.Face(BRepBuilderAPI_MakeFace(_reversed(inner), True).Face()))
        top = cq.Face(letter.Face())
        into = gp_Vec(*(-depth * flat.frame[:, 2]).tolist())
        prism = cq.Shape.cast(BRepPrimAPI_MakePrism(top.wrapped, into).Shape())
        pieces += [cq.Face(wall.wrapped.Reversed()) for wall in prism.Faces() if not wall.isSame(top)]
        rest.Add(_reversed(outer))
    return [cq.Face(rest.Face()), *pieces]


def _wire(ring: shapely.LinearRing, flat: Flat) -> TopoDS_Wire:
    corners: Array = flat.at(np.asarray(ring.coords)[:-1])
    return cq.Wire.makePolygon([solids.vector(corner) for corner in corners], close=True).wrapped


def _reversed(wire: TopoDS_Wire) -> TopoDS_Wire:
    return TopoDS.Wire_s(wire.Reversed())
