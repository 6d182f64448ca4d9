"""Fins: thin walls that a convex neck leaves next to its cuts. Laser frame, mm.

Also cut off are the claws outside of the cables of a lying lidar, which carry nothing.
"""

import math

import cadquery as cq
import numpy as np
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection

from scanwright.cad import solids
from scanwright.cad.layout.envelope import Box
from scanwright.design.arrays import Array

FAR = 200.0  # beyond any linkage
THIN = 3.0  # thinner walls next to the lidar are cut off
PRONG = 7.0  # likewise outside of a cable
INTO = 0.3  # below the space of lidar and cables: no ridge remains along their edges


def fins_of(top: float, body: Box, cables: tuple[Box, ...], corners: Array) -> list[cq.Shape]:
    """Return cuts of what the hull would leave thinner than THIN next to the lidar, and than PRONG outside its cables.

    On each side: all beyond it, less the prism over the thick part of the hull. No face coincides with one of the hull
    or of the lidar's space: the prism is 0.3 mm narrower, and the cut begins below the space. `corners` are the neck's.
    """
    planes = np.unique(np.round(ConvexHull(corners).equations, 7), axis=0)
    (x0, y0, _), (x1, y1, _) = body
    everywhere = (-FAR, FAR)
    sides = [(axis, edge, everywhere, top - INTO, THIN) for axis, edge in ((0, x0), (0, x1), (1, y0), (1, y1))]
    for (cx0, cy0, cz0), (cx1, cy1, _) in cables:
        sides.append((1, cy0 if cy0 < 0 else cy1, (cx0, cx1 - 1.4), cz0 - INTO, PRONG))
    cuts: list[cq.Shape] = []
    for axis, edge, reach, above, least in sides:
        outward, up = math.copysign(1.0, edge) * np.eye(3)[axis], np.array([0.0, 0.0, 1.0])
        along = np.cross(up, outward)
        first, last = sorted(float(along[1 - axis]) * end for end in reach)
        fin: cq.Shape = solids.box((first, above, -0.5), (last, FAR, FAR))
        thick = _thick(planes, outward, abs(edge), least, np.stack([along, up], axis=1))
        if thick is not None:
            fin = fin.cut(solids.prism(thick, -1.0, FAR + 1.0))
        frame = np.stack([along, up, outward], axis=1)
        cuts.append(fin.moved(solids.location(frame, edge * np.eye(3)[axis])))
    return cuts


def _thick(planes: Array, outward: Array, edge: float, least: float, onto: Array) -> Array | None:
    """Return the outline, shape (n, 2), 0.3 mm narrower, in which a hull is `least` thick beyond an edge, or None.

    That is the shadow, onto two directions (3, 2), of the intersection of the hull, the hull moved by `least`, and the
    half space beyond the edge.
    """
    moved = planes + np.outer(least * planes[:, :3] @ outward, [0.0, 0.0, 0.0, 1.0])
    sides = np.vstack([planes, moved, [*-outward, edge]])
    # the largest ball inside
    rows = np.column_stack([sides[:, :3], np.ones(len(sides))])
    best = linprog([0.0, 0.0, 0.0, -1.0], A_ub=rows, b_ub=-sides[:, 3], bounds=[(None, None)] * 3 + [(0, None)])
    if not best.success or best.x[3] < least / 6:
        return None
    shadow = np.asarray(HalfspaceIntersection(sides, best.x[:3]).intersections) @ onto
    drawn_in = ConvexHull(shadow).equations + np.array([0.0, 0.0, 0.3])
    corners = np.asarray(HalfspaceIntersection(drawn_in, best.x[:3] @ onto).intersections)
    return np.asarray(corners[ConvexHull(corners).vertices])
