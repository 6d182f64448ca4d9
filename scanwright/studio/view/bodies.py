"""The scanner as a page draws it: bodies with colours, coarsely meshed, made as fast as the kernel allows."""

from __future__ import annotations

import numpy as np

from design.frames import Array
from design.scanner import Scanner
from scanwright.studio.view.workbench import Body


def bodies_of(scanner: Scanner, turning: bool) -> tuple[Body, ...]:
    """The parts that turn with the horn, or those that stand still: two halves for two cores.

    The linkage, which takes the kernel longer than all others together, is a draft of the same shapes.

    Raises:
        BuildError: a part cannot be made.
    """
    from cad.assembly.assembly import make_parts, turns
    from cad.layout.linkage import PART
    from scanwright.studio.view.linkage_preview import coarse, draft_linkage

    assembly = make_parts(scanner, lambda name: name != PART and turns(name) == turning)
    meshes = {name: coarse(solid) for name, solid in (assembly.made | assembly.bought).items()}
    if turning:
        meshes[PART] = draft_linkage(assembly.linkage)
    return tuple(_body(name, *mesh) for name, mesh in meshes.items())


def _body(name: str, vertices_mm: Array, faces: Array) -> Body:
    from cad.assembly.assembly import colour_of

    red, green, blue = (round(255 * c) for c in colour_of(name))
    return Body(name, (vertices_mm * 1e-3).astype(np.float32), faces.astype(np.uint32), (red, green, blue))
