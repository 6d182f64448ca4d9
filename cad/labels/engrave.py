"""Planar faces of a solid as polygons, and grooves in them, in its mesh. Millimetres, rotation frame.

Only meshes have lettering: a STEP file with it is ten times as large, and whoever machines, loads or changes the part
there has no use for it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cadquery as cq
import manifold3d
import numpy as np
import shapely

from scanwright.cad.geometry.mesh import TriMesh, canonical, of_manifold
from scanwright.design.arrays import Array
from scanwright.design.catalogue.products import Printer
from scanwright.design.errors import BuildError

WIDTHS = (0.4, 0.9)  # of grooves, least and most
DEPTHS = (0.3, 0.6)
ABOVE = 0.05  # of a face: where a groove begins, so that no two faces coincide
VOLUME_ERROR = 0.01  # of the grooves, relative
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


def engrave(
    mesh: TriMesh, grooves: Sequence[tuple[Flat, Sequence[shapely.Polygon]]], depth: float, part: str
) -> TriMesh:
    """Return the mesh with grooves of one depth; outlines are inside their face and apart, in its axes.

    Raises:
        BuildError: the grooves spoil the part.
    """
    tools = [_tool(flat, outlines, depth) for flat, outlines in grooves]
    cut = mesh.manifold() - manifold3d.Manifold.batch_boolean(tools, manifold3d.OpType.Add)
    engraved = canonical(of_manifold(cut))
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
