"""Grooves in planar faces of a mesh. Millimetres.

Only meshes have lettering: a STEP file with it is ten times as large, and whoever machines, loads or changes the part
there has no use for it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import manifold3d
import numpy as np
import shapely

from scanwright.cad.geometry.mesh import TriMesh, of_manifold
from scanwright.cad.labels.flats import Flat
from scanwright.design.catalogue.products import Printer
from scanwright.design.errors import BuildError

WIDTHS = (0.4, 0.9)  # of grooves, least and most
DEPTHS = (0.3, 0.6)
ABOVE = 0.05  # of a face: where a groove begins, so that no two faces coincide
VOLUME_ERROR = 0.01  # of the grooves, relative


@dataclass(frozen=True, slots=True)
class Groove:
    """Width and depth of a groove."""

    width: float
    depth: float


def groove_of(printer: Printer) -> Groove:
    """Return the groove for a printer: two lines wide, half a wall deep (a wall is three lines wide)."""
    wall = printer.min_wall_mm
    return Groove(float(np.clip(wall * 2 / 3, *WIDTHS)), float(np.clip(wall / 2, *DEPTHS)))


def engrave(
    mesh: TriMesh, grooves: Sequence[tuple[Flat, Sequence[shapely.Polygon]]], depth: float, part: str
) -> TriMesh:
    """Return the mesh with grooves of one depth; outlines are inside their face and apart, in its axes.

    Raises:
        BuildError: the grooves spoil the part.
    """
    tools = [_tool(flat, outlines, depth) for flat, outlines in grooves]
    cut = mesh.manifold() - manifold3d.Manifold.batch_boolean(tools, manifold3d.OpType.Add)
    engraved = of_manifold(cut)
    wanted = depth * sum(outline.area for _, outlines in grooves for outline in outlines)
    lost = mesh.volume() - engraved.volume()
    if not engraved.is_closed() or abs(lost - wanted) > VOLUME_ERROR * wanted or len(cut.decompose()) != 1:
        raise BuildError(f"{part}: lettering: grooves {depth:g} mm deep do not leave one closed body")
    return engraved


def _tool(flat: Flat, outlines: Sequence[shapely.Polygon], depth: float) -> manifold3d.Manifold:
    """Return the body that the grooves of one face take off."""
    rings = [np.asarray(ring.coords)[:-1] for one in outlines for ring in (one.exterior, *one.interiors)]
    prism = manifold3d.CrossSection(rings, manifold3d.FillRule.EvenOdd).extrude(depth + ABOVE)
    T_rot_face = np.column_stack([flat.frame, flat.origin - depth * flat.frame[:, 2]])
    return prism.transform(T_rot_face)
