"""Detection of moved objects by ray conflicts: points at places through which beams of another scan position passed.

If the nearest beams of the other position all ended well behind a point, its place was empty then, so its object has
appeared or disappeared. Unusable input raises RecordingError.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64
from numpy import ndarray
from scipy.spatial import cKDTree

from scanwright.design.arrays import Floats, Vector
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.clouds.filters import nearest

_BEAMS = 10  # fewer can be on one side of a point, or miss a thin object: benchmarks/firmware_io/mapping/
_REACH = 2.0  # times the median angle to the tenth beam, beyond which a place was not observed
_SAMPLE = 2000  # beams for that median
_NEIGHBOURS = 8  # of a point, for the majority
_NEAR_M = 0.15  # largest distance of neighbours on one object


@dataclass(frozen=True, slots=True, eq=False)
class Stand:
    """Points of one scan position, in the frame of the map."""

    points_m: Float64[ndarray, "n 3"]  # shape (n, 3), finite
    eye_m: Vector  # optical centre of the scanner, shape (3,); NaN if unknown


def seen_through(positions: Sequence[Stand], beyond_m: float = 0.1) -> list[Bool[ndarray, " n"]]:
    """Return the moved points of each scan position, shape (n,) each.

    A point is moved if the ten nearest beams of another position all ended more than `beyond_m` behind it: so many
    surround it, so that one of them would end before it on its surface, also at grazing angles. Then it follows the
    majority of its neighbours within 0.15 m. A beam without a return is no evidence. Points within `beyond_m` of a
    fixed surface, such as the soles of a foot, are kept.

    Args:
        positions: at least two with a known eye, of one frame; others are unchanged.
        beyond_m: more than three times the noise, and than the error of the poses.
    """
    if not 0 < beyond_m < np.inf:
        raise RecordingError(f"seen_through_m = {beyond_m}: must be above 0 and finite; 0.1 is usual")
    known = [k for k, stand in enumerate(positions) if np.isfinite(stand.eye_m).all()]
    if len(known) < 2:
        raise RecordingError(
            f"seen_through_m: {len(known)} clouds with a known scanner position, minimum 2: assemble one cloud per "
            "turn, and pass the angle set (`angles`) or `poses`"
        )
    moved = [np.zeros(len(stand.points_m), bool) for stand in positions]
    for k in known:
        eye_m = positions[k].eye_m
        along, range_m = _directions(positions[k].points_m, eye_m)
        ends_m, tree = np.append(range_m, -np.inf), cKDTree(along)
        sample = along[:: max(1, len(along) // _SAMPLE)]
        reach = _REACH * float(np.median(tree.query(sample, _BEAMS + 1)[0][:, -1]))
        for other in known if np.isfinite(reach) else ():  # infinite for a few points
            if other != k:
                left = np.flatnonzero(~moved[other])
                towards, point_m = _directions(positions[other].points_m[left], eye_m)
                for here, off, beam in nearest(tree, towards, _BEAMS, reach):
                    behind = ends_m[beam].min(axis=1) > point_m[here] + beyond_m
                    moved[other][left[here]] = np.isfinite(off).all(axis=1) & behind
    return [_as_neighbours(stand.points_m, mask) for stand, mask in zip(positions, moved, strict=True)]


def _directions(points_m: Float64[ndarray, "n 3"], eye_m: Vector) -> tuple[Floats, Floats]:
    """Return unit vectors from the eye, and ranges; a point at the eye has a zero vector."""
    along = points_m - eye_m
    range_m = np.linalg.norm(along, axis=1)
    return along / np.where(range_m > 0, range_m, 1.0)[:, None], range_m


def _as_neighbours(points_m: Float64[ndarray, "n 3"], moved: Bool[ndarray, " n"]) -> Bool[ndarray, " n"]:
    """Return the majority of the neighbours of each point, including itself."""
    if not moved.any():
        return moved
    marked = np.zeros_like(moved)
    padded = np.append(moved, False)
    for here, off, index in nearest(cKDTree(points_m), points_m, _NEIGHBOURS + 1, _NEAR_M):
        marked[here] = 2 * padded[index].sum(axis=1) > np.isfinite(off).sum(axis=1)
    return marked
