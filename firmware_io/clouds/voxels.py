"""Voxels of a cloud, and sums over them."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from scanwright.design.arrays import Array, Floats, Ints


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
