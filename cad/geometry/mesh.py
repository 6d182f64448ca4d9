"""One canonical triangle mesh per solid, and its binary STL. Millimetres, rotation frame.

The kernel's tessellation depends on earlier meshes of the shape and repeats vertices. Here a fresh copy is meshed,
vertices are rounded and merged, triangles without area dropped, and everything sorted: equal solids give equal bytes.
"""

from dataclasses import dataclass

import cadquery as cq
import manifold3d
import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.TopAbs import TopAbs_REVERSED
from OCP.TopLoc import TopLoc_Location

from scanwright.design.arrays import Array
from scanwright.design.errors import BuildError

CHORD_ERROR = 0.01  # mm, of the longest edge's share: volume within 1e-4 on the parts (measured)
CHORD_ANGLE = 0.1  # rad: 63 sides to a hole
DECIMALS = 6


@dataclass(frozen=True, slots=True)
class TriMesh:
    """Triangles, counter-clockwise from outside."""

    vertices: Array  # (n, 3), mm
    faces: NDArray[np.int64]  # (m, 3)

    def across(self) -> tuple[Array, Array]:
        """Return the unit normals of the triangles, zero without area, shape (m, 3), and their areas [mm2]."""
        a, b, c = (self.vertices[self.faces[:, i]] for i in range(3))
        cross = np.cross(b - a, c - a)
        doubled = np.linalg.norm(cross, axis=1)
        return np.divide(cross, doubled[:, None], out=np.zeros_like(cross), where=doubled[:, None] > 0), doubled / 2

    def volume(self) -> float:
        """Return enclosed volume [mm3]."""
        a, b, c = (self.vertices[self.faces[:, i]] for i in range(3))
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)

    def manifold(self) -> manifold3d.Manifold:
        """Return the mesh for booleans and slices."""
        return manifold3d.Manifold(manifold3d.Mesh64(self.vertices, self.faces.astype(np.uint64)))

    def is_closed(self) -> bool:
        """Return whether every edge is shared by exactly two triangles in opposite directions."""
        edges = np.concatenate([self.faces[:, [0, 1]], self.faces[:, [1, 2]], self.faces[:, [2, 0]]])
        forth = np.sort(edges[:, 0] * len(self.vertices) + edges[:, 1])
        back = np.sort(edges[:, 1] * len(self.vertices) + edges[:, 0])
        return bool(len(np.unique(forth)) == len(forth) and np.array_equal(forth, back))


def mesh_of(solid: cq.Shape, chord_error: float = CHORD_ERROR, chord_angle: float = CHORD_ANGLE) -> TriMesh:
    """Tessellate a solid canonically, within a chord error [mm] and angle [rad]."""
    return canonical(TriMesh(*_tessellated(solid, chord_error, chord_angle)))


def of_manifold(solid: manifold3d.Manifold) -> TriMesh:
    """Return the mesh of the result of a boolean."""
    mesh = solid.to_mesh64()
    return TriMesh(np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).astype(np.int64))


def canonical(mesh: TriMesh, decimals: int = DECIMALS) -> TriMesh:
    """Return the mesh with rounded, merged and sorted vertices and faces."""
    raw = np.round(mesh.vertices, decimals) + 0.0  # no -0.0
    vertices, index = np.unique(raw, axis=0, return_inverse=True)
    faces = index.reshape(-1)[mesh.faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    first = np.argmin(faces, axis=1)
    faces = np.stack([faces[np.arange(len(faces)), (first + k) % 3] for k in range(3)], axis=1)
    return TriMesh(vertices, faces[np.lexsort(faces.T[::-1])])


def _tessellated(solid: cq.Shape, chord_error: float, chord_angle: float) -> tuple[Array, NDArray[np.int64]]:
    """Return points face by face, shape (n, 3), and triangles, shape (m, 3)."""
    shape = solid.copy()
    shape.mesh(chord_error, chord_angle)
    points: list[tuple[float, float, float]] = []
    triangles = []
    for face in shape.Faces():
        place = TopLoc_Location()
        facets = BRep_Tool.Triangulation_s(face.wrapped, place)
        if facets is None:  # a face too small for a triangle
            continue
        to_shape, first = place.Transformation(), len(points) - 1
        points += [facets.Node(i).Transformed(to_shape).Coord() for i in range(1, facets.NbNodes() + 1)]
        corners = np.array([facets.Triangle(i).Get() for i in range(1, facets.NbTriangles() + 1)], dtype=np.int64)
        inside_out = face.wrapped.Orientation() == TopAbs_REVERSED
        triangles.append(first + (corners[:, [0, 2, 1]] if inside_out else corners))
    return np.array(points), np.concatenate(triangles)


def checked_mesh(solid: cq.Solid, part: str) -> TriMesh:
    """Return the mesh of a part, closed and of the right volume.

    Raises:
        BuildError: the mesh is open, or its volume is off by more than 0.1 %.
    """
    return checked(mesh_of(solid), solid, part)


def checked(mesh: TriMesh, solid: cq.Solid, part: str) -> TriMesh:
    """Return the mesh if it is closed and has the volume of its solid; raises as `checked_mesh`."""
    if not mesh.is_closed():
        raise BuildError(f"{part}: mesh: tolerance = {CHORD_ERROR} mm: the surface is not closed")
    off = mesh.volume() / solid.Volume() - 1
    if abs(off) > 1e-3:
        raise BuildError(f"{part}: mesh: tolerance = {CHORD_ERROR} mm: volume is off by {off:.2%}")
    return mesh


def stl_bytes(mesh: TriMesh, part: str, config_hash: str) -> bytes:
    """Return a binary STL; its header names the part, the configuration and the unit."""
    header = f"{part} config={config_hash} unit=mm".encode("ascii")
    corners, (normal, _) = mesh.vertices[mesh.faces], mesh.across()
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    table = np.zeros(len(corners), dtype=record)
    table["normal"], table["corners"] = np.round(normal, DECIMALS) + 0.0, corners
    return header.ljust(80)[:80] + np.uint32(len(corners)).tobytes() + table.tobytes()
