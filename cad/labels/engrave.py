"""Grooves in a planar face, made without a boolean, which takes seconds for a line of letters. Millimetres.

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
from scanwright.cad.labels.flats import Flat
from scanwright.design.arrays import Array
from scanwright.design.catalogue.products import Printer

WIDTHS = (0.4, 0.9)  # of grooves, least and most
DEPTHS = (0.3, 0.6)


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
