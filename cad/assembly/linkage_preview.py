"""The alignment linkage for display: the shapes of the part, joined as meshes.

Booleans of meshes take milliseconds, those of the kernel a second. The result is within the chords of its meshes and
not checked; `cad.parts.linkage.alignment_linkage` makes the printed part.
"""

import cadquery as cq
import manifold3d

from scanwright.cad.geometry.mesh import TriMesh, mesh_of, of_manifold
from scanwright.cad.layout.rotor.linkage import AlignmentLinkage
from scanwright.cad.parts.linkage.alignment_linkage import shapes_of

CHORD_ERROR = 0.2  # mm: not seen on a screen, a third of the triangles of the files
CHORD_ANGLE = 0.3  # rad


def draft_linkage(p: AlignmentLinkage) -> TriMesh:
    """Return the linkage, rotation frame."""
    shapes = shapes_of(p)
    free_space = _together(shapes.free_space)
    body = _together([shapes.plate, shapes.neck, *shapes.blends]) - free_space - _together(shapes.fins)
    carrying = max(body.decompose(), key=lambda piece: float(piece.volume()))  # the piece that holds the plate
    return of_manifold((carrying + _solid(shapes.hub)) - free_space - _together(shapes.holes))


def coarse_mesh(shape: cq.Shape) -> TriMesh:
    """Return a mesh of a shape for display."""
    return mesh_of(shape, CHORD_ERROR, CHORD_ANGLE)


def _solid(shape: cq.Shape) -> manifold3d.Manifold:
    return coarse_mesh(shape).manifold()


def _together(shapes: list[cq.Shape]) -> manifold3d.Manifold:
    return manifold3d.Manifold.batch_boolean([_solid(shape) for shape in shapes], manifold3d.OpType.Add)
