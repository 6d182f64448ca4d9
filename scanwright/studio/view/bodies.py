"""The scanner as a page draws it: bodies with colours, coarsely meshed, made as fast as the kernel allows."""

from __future__ import annotations

import numpy as np

from cad.kernel import require_kernel
from design.frames import Array
from design.scanner import Scanner
from scanwright.studio.view.workbench import Body


def bodies_of(scanner: Scanner, turning: bool) -> tuple[Body, ...]:
    """The parts that turn with the horn, or those that stand still: two halves for two cores.

    The linkage, which takes the kernel longer than all others together, is a draft of the same shapes.

    Raises:
        BuildError: a part cannot be made.
    """
    require_kernel()
    from cad.assembly.make import make_parts
    from cad.layout.names import ALIGNMENT_LINKAGE
    from scanwright.studio.view.linkage_preview import coarse, draft_linkage

    assembly = make_parts(scanner, lambda spec: spec.name != ALIGNMENT_LINKAGE and spec.turns == turning)
    meshes = {name: coarse(solid) for name, solid in (assembly.made | assembly.bought).items()}
    if turning:
        meshes[ALIGNMENT_LINKAGE] = draft_linkage(assembly.layout.linkage)
    return tuple(_body(name, assembly.spec(name).colour, *mesh) for name, mesh in meshes.items())


def _body(name: str, colour: tuple[float, float, float], vertices_mm: Array, faces: Array) -> Body:
    red, green, blue = (round(255 * c) for c in colour)
    return Body(name, (vertices_mm * 1e-3).astype(np.float32), faces.astype(np.uint32), (red, green, blue))
