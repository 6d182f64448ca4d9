"""The scanner as the studio draws it: bodies with colours, coarsely meshed, made as fast as the kernel allows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanwright.cad.layout.names import ALIGNMENT_LINKAGE
from scanwright.design.scanner import Scanner


@dataclass(frozen=True, slots=True, eq=False)
class BodyMesh:
    """One body of the scanner, in the rotation frame at gamma = 0."""

    name: str  # of the part
    vertices_m: NDArray[np.float32]  # shape (n, 3)
    faces: NDArray[np.uint32]  # shape (m, 3)
    colour: tuple[int, int, int]  # sRGB, 0 .. 255


def make_bodies(scanner: Scanner, turning: bool) -> tuple[BodyMesh, ...]:
    """Return the parts that turn with the horn, or the fixed ones; raise BuildError if one fails."""
    from scanwright.cad.assembly.linkage_preview import coarse_mesh, draft_linkage
    from scanwright.cad.assembly.make import make_parts

    assembly = make_parts(scanner, lambda spec: spec.name != ALIGNMENT_LINKAGE and spec.turns == turning)
    meshes = {name: coarse_mesh(solid) for name, solid in (assembly.made | assembly.bought).items()}
    if turning:
        meshes[ALIGNMENT_LINKAGE] = draft_linkage(assembly.layout.linkage)
    bodies = []
    for name, mesh in meshes.items():
        red, green, blue = (round(255 * c) for c in assembly.spec(name).colour)
        vertices_m = (mesh.vertices * 1e-3).astype(np.float32)
        bodies.append(BodyMesh(name, vertices_m, mesh.faces.astype(np.uint32), (red, green, blue)))
    return tuple(bodies)
