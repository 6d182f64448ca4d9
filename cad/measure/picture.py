"""The picture of a proposal: silhouettes of the model with the proposed holes."""

from functools import cache

import numpy as np
import shapely

from scanwright.cad.drawings.devices.outline import spots_of
from scanwright.cad.drawings.devices.sketch import sketch_of, views_of
from scanwright.cad.measure.proposal import Proposal
from scanwright.design.arrays import Array

GRID_MM = 0.01  # to which corners are snapped: edges of neighbours then meet
SMALLEST_MM2 = 2.0  # smaller gaps are those between the faces of a model
SIMPLER_MM = 0.05  # that an outline may leave the model by


def picture_svg(proposal: Proposal, model: str) -> bytes:
    """Return the views of a model with its dimensions and proposed holes, as SVG."""
    notes = [f"Measured in {model}: all values unverified.", *proposal.notes]

    @cache
    def seen(right: tuple[float, ...], up: tuple[float, ...]) -> list[Array]:
        return silhouette(proposal.triangles, np.array(right), np.array(up))

    def draw(right: Array, up: Array) -> list[Array]:  # from the opposite side the outline is mirrored
        sign = right.sum()
        return [ring * (sign, 1.0) for ring in seen(tuple(np.abs(right)), tuple(up))]

    return sketch_of(model, views_of(spots_of(proposal.holes, "?"), draw), notes)


def silhouette(triangles: Array, right: Array, up: Array) -> list[Array]:
    """Return the outlines of a mesh in a view, closed polygons with shape (n, 2) each.

    Args:
        triangles: corners, shape (t, 3, 3).
        right: unit vector to the right of the view.
        up: unit vector upwards.
    """
    flat = triangles @ np.stack([right, up], axis=1)
    flat = np.unique(np.round(flat / GRID_MM) * GRID_MM, axis=0)
    (ax, ay), (bx, by), (cx, cy) = np.moveaxis(flat, 0, -1)
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    union = shapely.union_all(shapely.polygons(flat[np.abs(area) > GRID_MM**2]), grid_size=GRID_MM)
    shapes = [shape for shape in shapely.get_parts(union) if isinstance(shape, shapely.Polygon)]
    rings = [ring for shape in shapes for ring in (shape.exterior, *shape.interiors)]
    large = (ring for ring in rings if shapely.Polygon(ring).area > SMALLEST_MM2)
    return [np.asarray(shapely.simplify(ring, SIMPLER_MM).coords)[:-1] for ring in large]
