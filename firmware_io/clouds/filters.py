"""Filters of a cloud: outliers, one point per voxel, and normals; voxels, and sums over them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Bool, Float, Float32, Float64, Int64
from numba import njit
from numpy import ndarray
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from scanwright.design.arrays import Array, Floats, Ints

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
    apart_m = np.concatenate([d[:, 1:].mean(axis=1) for _, d, _ in nearest(cKDTree(points_m), points_m, k + 1)])
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
    for here, _, index in nearest(cKDTree(points), points, min(neighbours + 1, len(points))):
        near = points[index] - points[index].mean(axis=1, keepdims=True)
        _, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", near, near))
        normal: Floats = axes[:, :, 0]
        towards = np.broadcast_to(seen_from_m, points.shape)[here] - points[here]
        away = np.sum(normal * towards, axis=1) < 0
        normals[here] = np.where(away[:, None], -normal, normal)
    return normals


def nearest(
    tree: cKDTree, points: Float[ndarray, "n 3"], count: int, reach: float = np.inf
) -> Iterator[tuple[slice, Float64[ndarray, "m k"], Int64[ndarray, "m k"]]]:
    """Yield rows, and distances and indices of their nearest in the tree; inf and the tree's size without one."""
    for begin in range(0, len(points), _AT_ONCE):
        here = slice(begin, begin + _AT_ONCE)
        off, index = tree.query(points[here], count, distance_upper_bound=reach, workers=-1)
        yield here, off, index


def voxel_of(points_m: Floats, edge_m: float, level: NDArray[np.uint8] | None = None) -> Ints:
    """Return the voxel of each point, shape (n,), numbered in the order of their first points.

    Points are finite, shape (n, 3); a voxel has the edge `edge_m * 2**level`, of level 0 without levels, shape (n,).
    """
    return _numbered(points_m, edge_m, np.zeros(len(points_m), np.uint8) if level is None else level)


def voxel_sums(voxel: Ints, values: Array) -> Floats:
    """Return the sums of `values`, shape (n, k), over the points of each voxel, shape (m, k)."""
    return np.stack([np.bincount(voxel, column) for column in values.T], axis=1)


@njit(cache=True)
def _numbered(points_m: Floats, edge_m: float, level: NDArray[np.uint8]) -> Ints:
    """Number the voxels by an open hash table, in one pass for any extent of the cloud."""
    n = len(points_m)
    size = 1
    while size < 2 * n:
        size *= 2
    slot = np.full(size, -1, np.int64)
    key = np.empty((n, 4), np.int64)
    voxel = np.empty(n, np.int64)
    used = 0
    for i in range(n):
        edge = edge_m * 2.0 ** level[i]
        a = np.int64(np.floor(points_m[i, 0] / edge))
        b = np.int64(np.floor(points_m[i, 1] / edge))
        c = np.int64(np.floor(points_m[i, 2] / edge))
        # Teschner et al., "Optimized spatial hashing for collision detection of deformable objects" (2003)
        h = ((a * 73856093) ^ (b * 19349663) ^ (c * 83492791) ^ np.int64(level[i]) * 2654435761) & (size - 1)
        while True:
            j = slot[h]
            if j < 0:
                j = used
                slot[h] = j
                key[j, 0], key[j, 1], key[j, 2], key[j, 3] = a, b, c, level[i]
                used += 1
                break
            if key[j, 0] == a and key[j, 1] == b and key[j, 2] == c and key[j, 3] == level[i]:
                break
            h = (h + 1) & (size - 1)
        voxel[i] = j
    return voxel
