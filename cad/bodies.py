"""The scanner as a page draws it: bodies with colours, coarsely meshed, made as fast as the kernel allows."""

from __future__ import annotations

import numpy as np

from cad.kernel import require_kernel
from design.scanner import Scanner
from design.studio.workbench import Body

CHORD_ERROR = 0.2  # mm: not seen on a screen, a third of the triangles of the files
CHORD_ANGLE = 0.3  # rad


def bodies_of(scanner: Scanner, turning: bool) -> tuple[Body, ...]:
    """The parts that turn with the horn, or those that stand still: two halves for two cores.

    Raises:
        BuildError: a part cannot be made.
    """
    require_kernel()
    from cad.assembly import colour_of, make_parts, turns

    assembly = make_parts(scanner, lambda name: turns(name) == turning)
    bodies = []
    for name, solid in (assembly.made | assembly.bought).items():
        points, triangles = solid.tessellate(CHORD_ERROR, CHORD_ANGLE)
        vertices_m = np.array([(p.x, p.y, p.z) for p in points], dtype=np.float32) * np.float32(1e-3)
        red, green, blue = (round(255 * c) for c in colour_of(name))
        bodies.append(Body(name, vertices_m, np.array(triangles, np.uint32), (red, green, blue)))
    return tuple(bodies)
