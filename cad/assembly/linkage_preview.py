"""The alignment linkage for the eye: put together from the very shapes of the part, but as meshes.

Booleans of meshes take milliseconds where those of the kernel take a second. What comes is the part to within the
chords of its meshes, unchecked: what is printed is made by `cad.parts.alignment_linkage`, and may be refused there.
"""

from __future__ import annotations

import cadquery as cq
import manifold3d
import numpy as np
from numpy.typing import NDArray

from cad.layout.linkage import AlignmentLinkage
from cad.parts.alignment_linkage import shapes_of
from design.frames import Array

CHORD_ERROR = 0.2  # mm: not seen on a screen, a third of the triangles of the files
CHORD_ANGLE = 0.3  # rad
DECIMALS = 6  # of mm: vertices closer than this are one


def draft_linkage(p: AlignmentLinkage) -> tuple[Array, NDArray[np.uint32]]:
    """Vertices [mm] (n, 3) and faces (m, 3) of the linkage, rotation frame.

    Raises:
        BuildError: the kernel fails at one of its shapes.
    """
    shapes = shapes_of(p)
    room = _together(shapes.room)
    body = _held((_solid(shapes.plate) + _solid(shapes.neck)) - room - _together(shapes.beside))
    body = (body + _solid(shapes.hub)) - room - _together(shapes.holes)
    mesh = body.to_mesh64()
    return np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).astype(np.uint32)


def coarse(shape: cq.Shape) -> tuple[Array, NDArray[np.uint32]]:
    """Vertices [mm] (n, 3) and faces (m, 3) of a shape, coarsely meshed; those on an edge stand once for each face."""
    points, triangles = shape.tessellate(CHORD_ERROR, CHORD_ANGLE)
    return np.array([(p.x, p.y, p.z) for p in points], dtype=float), np.array(triangles, np.uint32)


def _solid(shape: cq.Shape) -> manifold3d.Manifold:
    points, faces = coarse(shape)
    vertices, index = np.unique(np.round(points, DECIMALS), axis=0, return_inverse=True)
    return manifold3d.Manifold(manifold3d.Mesh64(vertices, index.reshape(-1)[faces].astype(np.uint64)))


def _together(shapes: list[cq.Shape]) -> manifold3d.Manifold:
    return manifold3d.Manifold.batch_boolean([_solid(shape) for shape in shapes], manifold3d.OpType.Add)


def _held(body: manifold3d.Manifold) -> manifold3d.Manifold:
    """The piece that holds the plate: the largest."""
    return max(body.decompose(), key=lambda piece: float(piece.volume()))
