"""What people do to a cloud before they use it: strays out, one point to a voxel, which way its surfaces face."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Bool, Float, Float32, Float64, Int64
from numpy import ndarray

from scanwright.design.arrays import Floats
from scanwright.firmware_io.clouds.voxels import voxel_of, voxel_sums

NEIGHBOURS = 12  # of a point: enough for a plane, few enough for an edge
_AT_ONCE = 1 << 16  # points: bounds the memory of their neighbours


def outliers(points_m: Float[ndarray, "n 3"], sigmas: float, neighbours: int = NEIGHBOURS) -> Bool[ndarray, " n"]:
    """Points that stand alone, shape (n,): on average farther from their neighbours than most others are from theirs.

    Farther than the mean of all by more than `sigmas` standard deviations: R. B. Rusu, "Semantic 3D Object Maps for
    Everyday Manipulation in Human Living Environments" (2009), section 4.1, as PCL and Open3D do it. In a cloud of one
    stand far surfaces are sparser than near ones, and go first.

    Args:
        points_m: shape (n, 3), finite.
        sigmas: more leave more in.
        neighbours: of each point.
    """
    count = len(points_m)
    k = min(neighbours, count - 1)
    if k < 1:
        return np.zeros(count, bool)
    apart_m = np.concatenate([d[:, 1:].mean(axis=1) for d, _ in _nearest(points_m, k + 1)])
    return apart_m > apart_m.mean() + sigmas * apart_m.std()


def one_to_a_voxel(points_m: Float[ndarray, "n 3"], edge_m: float) -> Int64[ndarray, " kept"]:
    """Index of the point nearest to the mean of each voxel, in increasing order, shape (m,).

    Points stay as measured, with their time, beam and intensity.
    """
    voxel = voxel_of(np.asarray(points_m, float), edge_m)
    mean_m = voxel_sums(voxel, points_m) / np.bincount(voxel)[:, None]
    off_m2 = np.sum((points_m - mean_m[voxel]) ** 2, axis=1)
    order = np.lexsort((off_m2, voxel))
    first = np.r_[True, np.diff(voxel[order]) > 0] if order.size else np.zeros(0, bool)
    return np.sort(order[first])


def normals(
    points_m: Float[ndarray, "n 3"], seen_from_m: Float64[ndarray, "... 3"], neighbours: int = NEIGHBOURS
) -> Float32[ndarray, "n 3"]:
    """Unit normals of the surfaces that points lie on, towards where they were seen from, shape (n, 3).

    The direction in which a point and its neighbours spread least; NaN where fewer than three points are.

    Args:
        points_m: shape (n, 3), finite.
        seen_from_m: shape (3,) or (n, 3).
        neighbours: that lie on one surface.
    """
    normals = np.full((len(points_m), 3), np.nan, np.float32)
    if len(points_m) < 3:
        return normals
    points = np.asarray(points_m, float)
    begin = 0
    for _, index in _nearest(points, min(neighbours + 1, len(points))):
        here = slice(begin, begin + len(index))
        near = points[index] - points[index].mean(axis=1, keepdims=True)
        _, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", near, near))
        normal: Floats = axes[:, :, 0]
        towards = np.broadcast_to(seen_from_m, points.shape)[here] - points[here]
        away = np.sum(normal * towards, axis=1) < 0
        normals[here] = np.where(away[:, None], -normal, normal)
        begin += len(index)
    return normals


def _nearest(
    points_m: Float[ndarray, "n 3"], count: int
) -> Iterator[tuple[Float64[ndarray, "m k"], Int64[ndarray, "m k"]]]:
    """Distances and indices of the nearest points, each first itself, (m, count) at a time."""
    from scipy.spatial import cKDTree

    tree = cKDTree(points_m)
    for begin in range(0, len(points_m), _AT_ONCE):
        yield tree.query(points_m[begin : begin + _AT_ONCE], count, workers=-1)
