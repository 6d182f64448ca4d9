"""Blends at the foot of a convex body on a flat face: corners of convex shapes to fuse with both. No kernel.

A blend is a fillet of three facets that turn by 30 deg each (of a right angle): at 2 mm its steps are those of printed
layers. Hulls have slivers of facets at which the fillets of the kernel fail; a union of convex shapes is always valid.
"""

import math

import numpy as np
import shapely

from scanwright.design.arrays import Array

BLEND_MM = 2.0  # reach of a blend, on the face and along the body
EDGE_MM = 0.5  # from the edge of the face
SHORT_MM = 10.0  # a shorter blend is left out
INTO_MM = 0.2  # of its ends, inside face and body: no facet coincides with one of theirs
SMOOTH_MM = 0.5  # shorter facets of the body are joined
STEEP = math.sqrt(3.0)  # slope of its facet at the body: 60 deg, that at the face has 30
MIDDLE = 1 / (1 + STEEP)  # distance of the edge between the facets, from face and body, over the reach


def foot_blend(corners: Array, face: float, within: Array, reach: float = BLEND_MM) -> list[Array]:
    """Return the corners (n, 3) of two convex shapes; none if the body does not cross the face, or fills it.

    Args:
        corners: of the convex body above the face, shape (m, 3), mm.
        face: height of the face; its material is below, at least INTO_MM thick.
        within: outline of the face, shape (k, 2): blends end EDGE_MM from it.
        reach: of the blend, on the face and along the body, mm.
    """
    edge, free = MIDDLE * reach, shapely.Polygon(within).buffer(-EDGE_MM, join_style="mitre")
    outwards = (-INTO_MM, reach + STEEP * INTO_MM), (edge + INTO_MM, edge - STEEP * INTO_MM)
    upwards = (-INTO_MM, (reach + INTO_MM) / STEEP), (reach + INTO_MM, -INTO_MM / STEEP)
    foot = section(corners, face)
    if not len(foot) or _area(foot).buffer(reach).difference(_area(foot)).intersection(free).area < SHORT_MM * reach:
        return []
    shapes = []
    for layers in (outwards, upwards):
        outlines = [_grown(section(corners, face + z), out, free) for z, out in layers]
        if all(len(outline) for outline in outlines):
            shapes.append(np.concatenate(outlines))
    return shapes


def section(corners: Array, height: float) -> Array:
    """Return the outline (n, 3) of the section of a convex body, by its corners (m, 3), at a height; may be empty."""
    below, above = corners[corners[:, 2] < height], corners[corners[:, 2] >= height]
    low, high = np.repeat(below, len(above), axis=0), np.tile(above, (len(below), 1))
    share = (height - low[:, 2:]) / (high[:, 2:] - low[:, 2:])
    return _at(shapely.convex_hull(shapely.multipoints(low + share * (high - low))), height)


def _grown(outline: Array, out: float, free: shapely.Polygon) -> Array:
    """Return a level outline (n, 3), wider by a distance, within a free area; empty without area."""
    if not len(outline):
        return outline
    wider = _area(outline).simplify(SMOOTH_MM).buffer(out, join_style="mitre")
    return _at(wider.intersection(free), float(outline[0, 2]))


def _area(outline: Array) -> shapely.Polygon:
    return shapely.Polygon(outline[:, :2])


def _at(area: shapely.Geometry, height: float) -> Array:
    """Return the outline (n, 3) of an area at a height; empty if it is no polygon."""
    points = shapely.get_coordinates(area)[:-1] if isinstance(area, shapely.Polygon) else np.empty((0, 2))
    return np.insert(points, 2, height, axis=1)
