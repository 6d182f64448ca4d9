"""Where the linkage is, and what it must leave free, as tests of points; used before there are solids.

Millimetres. Points are in the laser frame, shape (n, 3), except for `in_hull`; each result has the shape (n,).
"""

import math

import numpy as np
from scipy.spatial import ConvexHull

from scanwright.cad.layout.envelope import Box, slot_ends
from scanwright.cad.layout.rotor.linkage import AlignmentLinkage
from scanwright.design.arrays import Array, Mask

FAR_ABOVE = 1e3


def in_box(points: Array, box: Box, gap: float) -> Mask:
    """Return points inside a box that is larger by a gap."""
    return np.asarray(((points > np.array(box[0]) - gap) & (points < np.array(box[1]) + gap)).all(axis=1))


def swept(box: Box) -> Box:
    """Return the box extended upwards: the path of something inserted from above."""
    low, (x, y, _) = box
    return low, (x, y, FAR_ABOVE)


def in_fan(points: Array, p: AlignmentLinkage, gap: float, fan_z: tuple[float, float] | None = None) -> Mask:
    """Return points in the linkage's free sector for its beams, or between other heights of the laser frame."""
    low, high = fan_z or p.fan_z
    bearing = np.arctan2(points[:, 1], points[:, 0])
    in_slab = (points[:, 2] > low - gap) & (points[:, 2] < high + gap)
    in_slab &= np.hypot(points[:, 0], points[:, 1]) > min(p.half_x, p.half_y) - gap
    return np.asarray(in_slab & np.any([(bearing - first) % (2 * math.pi) < last - first for first, last in p.fan], 0))


def behind_screws(points: Array, p: AlignmentLinkage) -> Mask:
    """Return points on the paths of drivers of the lidar's screws; none with a sub-plate."""
    below = points[:, 2] < p.top - p.plate
    if p.ears is not None:
        return np.zeros_like(below)
    return below & at_screws(points, p)


def at_screws(points: Array, p: AlignmentLinkage) -> Mask:
    """Return points over or under the heads of the lidar's screws, anywhere in their slots."""
    near = [_from_slot(points, *slot_ends(place, p.screw_travel)) < p.screw.driver_radius for place in p.holes]
    return np.asarray(np.any(near, axis=0))


def _from_slot(points: Array, first: tuple[float, float], last: tuple[float, float]) -> Array:
    """Return distances from the line between the middles of a slot's ends, across z."""
    flat, along = points[:, :2] - first, np.subtract(last, first)
    share = np.clip(flat @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
    return np.asarray(np.hypot(*(flat - share[:, None] * along).T))


def in_hull(points: Array, corners: Array, gap: float) -> Mask:
    """Return points inside the convex hull of corners, shape (m, 3), or nearer to it than a gap."""
    inside = np.arange(len(points))
    for *normal, offset in ConvexHull(corners).equations:  # most points fall out at the first few planes
        inside = inside[points[inside] @ normal + offset < gap]
    return np.isin(np.arange(len(points)), inside, assume_unique=True)
