"""Bodies of STEP files: their names, solids, meshes and cylinders; and meshes of STL and 3MF files."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
CHORD_MM, CHORD_RAD = 0.02, 0.2  # of the meshes made of solids
RAYS = 24  # perpendicular to an axis
FAR_MM = 1e3


@dataclass(frozen=True)
class StepBody:
    """A named solid [mm]; `shape` is that of cadquery."""

    name: str
    shape: Any

    @cached_property
    def mesh(self) -> Any:
        """Its surface as a mesh of trimesh."""
        import trimesh

        corners, triangles = self.shape.tessellate(CHORD_MM, CHORD_RAD)
        return trimesh.Trimesh(np.array([c.toTuple() for c in corners]), np.array(triangles))

    @cached_property
    def cylinders(self) -> Array:
        """Cylindrical faces: a point of the axis, its unit vector, the radius, and both ends from the point; (n, 9)."""
        from OCP.BRepAdaptor import BRepAdaptor_Surface
        from OCP.GeomAbs import GeomAbs_SurfaceType

        rows = []
        for face in self.shape.Faces():
            surface = BRepAdaptor_Surface(face.wrapped)
            if surface.GetType() == GeomAbs_SurfaceType.GeomAbs_Cylinder:
                cylinder = surface.Cylinder()
                at, along = cylinder.Axis().Location(), cylinder.Axis().Direction()
                ends = surface.FirstVParameter(), surface.LastVParameter()
                rows.append((*at.Coord(), *along.Coord(), cylinder.Radius(), *ends))
        return np.array(rows).reshape(-1, 9)

    def first_hits(self, starts: Array, directions: Array) -> tuple[Array, Array]:
        """Cast rays; return the distance of each one's first hit [mm], infinity without, and whether it leaves."""
        from trimesh.ray.ray_pyembree import RayMeshIntersector

        caster = self.__dict__.setdefault("_caster", RayMeshIntersector(self.mesh))
        points, rays, faces = caster.intersects_location(starts, directions, multiple_hits=False)
        distance, leaves = np.full(len(starts), np.inf), np.zeros(len(starts), dtype=bool)
        distance[rays] = np.linalg.norm(points - starts[rays], axis=1)
        leaves[rays] = np.einsum("ij,ij->i", self.mesh.face_normals[faces], directions[rays]) > 0
        return distance, leaves

    def free_radius(self, at: Array, along: Array, t: Array) -> tuple[Array, Array]:
        """Return the least and the largest distance of the body around points `at + t along` [mm]: 0 inside of it."""
        across = ring(along, RAYS)
        starts = np.repeat(at + t[:, None] * along, RAYS, axis=0)
        distance, leaves = self.first_hits(starts, np.tile(across, (len(t), 1)))
        inside = leaves.reshape(-1, RAYS).mean(axis=1) > 0.5
        around = distance.reshape(-1, RAYS)
        return np.where(inside, 0.0, around.min(axis=1)), np.where(inside, 0.0, around.max(axis=1))


def ring(along: Array, count: int) -> Array:
    """Return unit vectors perpendicular to a vector, spread evenly, shape (count, 3)."""
    across = np.linalg.svd(along[None])[2][1:]
    turn = 2 * np.pi * np.arange(count) / count
    return np.cos(turn)[:, None] * across[0] + np.sin(turn)[:, None] * across[1]


def step_bodies(file: Path) -> dict[str, StepBody]:
    """Return the named bodies of an assembly, in its own frame."""
    import cadquery as cq
    from OCP.STEPCAFControl import STEPCAFControl_Reader
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDataStd import TDataStd_Name
    from OCP.TDF import TDF_LabelSequence
    from OCP.TDocStd import TDocStd_Document
    from OCP.XCAFDoc import XCAFDoc_DocumentTool

    document = TDocStd_Document(TCollection_ExtendedString("outside"))
    reader = STEPCAFControl_Reader()
    reader.SetNameMode(True)
    reader.ReadFile(str(file))
    reader.Transfer(document)
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    free, found = TDF_LabelSequence(), {}
    shapes.GetFreeShapes(free)
    for root in range(1, free.Length() + 1):
        members = TDF_LabelSequence()
        shapes.GetComponents_s(free.Value(root), members)
        for member in range(1, members.Length() + 1):
            label, name = members.Value(member), TDataStd_Name()
            if label.FindAttribute(TDataStd_Name.GetID_s(), name):
                text = name.Get().ToExtString()
                found[text] = StepBody(text, cq.Shape.cast(shapes.GetShape_s(label)))
    return found


def solid_of(file: Path) -> Any:
    """Return the shape of a STEP file with one part."""
    import cadquery as cq

    return cq.importers.importStep(str(file)).val()


def mesh_of(file: Path) -> Any:
    """Return the mesh of an STL or 3MF file, all its bodies in one."""
    import trimesh

    loaded = trimesh.load(file)
    mesh: Any = loaded.to_geometry() if isinstance(loaded, trimesh.Scene) else loaded
    mesh.merge_vertices()
    return mesh
