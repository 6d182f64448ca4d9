"""Filters of a cloud: outliers, one point per voxel, and normals."""

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
    """Return isolated points, shape (n,), whose mean distance to their neighbours exceeds that of others.

    The limit is the mean of all points plus `sigmas` standard deviations: R. B. Rusu, "Semantic 3D Object Maps for
    Everyday Manipulation in Human Living Environments" (2009), section 4.1, as in PCL and Open3D. In a cloud of one
    scan position, far surfaces are sparser than near ones and are dropped first. `points_m` must be finite.
    """
    count = len(points_m)
    k = min(neighbours, count - 1)
    if k < 1:
        return np.zeros(count, bool)
    apart_m = np.concatenate([d[:, 1:].mean(axis=1) for d, _ in _nearest(points_m, k + 1)])
    return apart_m > apart_m.mean() + sigmas * apart_m.std()


def one_to_a_voxel(points_m: Float[ndarray, "n 3"], edge_m: float) -> Int64[ndarray, " kept"]:
    """Return the indices of the points nearest to the mean of each voxel, increasing, shape (m,)."""
    voxel = voxel_of(np.asarray(points_m, float), edge_m)
    mean_m = voxel_sums(voxel, points_m) / np.bincount(voxel)[:, None]
    off_m2 = np.sum((points_m - mean_m[voxel]) ** 2, axis=1)
    order = np.lexsort((off_m2, voxel))
    first = np.r_[True, np.diff(voxel[order]) > 0] if order.size else np.zeros(0, bool)
    return np.sort(order[first])


def normals(
    points_m: Float[ndarray, "n 3"], seen_from_m: Float64[ndarray, "... 3"], neighbours: int = NEIGHBOURS
) -> Float32[ndarray, "n 3"]:
    """Return unit normals of surfaces towards `seen_from_m`, shape (3,) or (n, 3); NaN for fewer than three points.

    A normal is the direction of the smallest spread of a point and its neighbours. `points_m` must be finite.
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
    """Yield distances and indices of the nearest points, including the point itself, (m, count) at a time."""
    from scipy.spatial import cKDTree

    tree = cKDTree(points_m)
    for begin in range(0, len(points_m), _AT_ONCE):
        yield tree.query(points_m[begin : begin + _AT_ONCE], count, workers=-1)
