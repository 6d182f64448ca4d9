"""Merging of registered clouds to one map: the mean point of each voxel."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64
from numpy import ndarray

from scanwright.design import frames
from scanwright.firmware_io.clouds.cloud import Cloud
from scanwright.firmware_io.registration.thin import voxel_means

_SINGLE_M = 500.0  # beyond it float32 is coarser than 0.03 mm


def merge(clouds: Sequence[Cloud], T_world: Float64[ndarray, "n 4 4"], spacing_m: float) -> Cloud:
    """Return the map in the world frame: one point for each voxel with an edge of `spacing_m`.

    Its columns are `count`, the number of points of the voxel, and the mean `intensity` if every cloud has one.
    """
    bright = all("intensity" in cloud.columns for cloud in clouds)
    means, counts = [], []
    for cloud, T in zip(clouds, T_world, strict=True):
        valid = np.isfinite(cloud.points_m).all(axis=1)
        world = frames.apply(T, cloud.points_m[valid].astype(float))
        rows = np.column_stack([world, cloud.columns["intensity"][valid]]) if bright else world
        mean, count = voxel_means(world, rows, spacing_m)
        means.append(mean)
        counts.append(count)
    every, level = np.concatenate(means), np.zeros(sum(map(len, means)), np.uint8)
    joined, number = voxel_means(every[:, :3], every, spacing_m, level, np.concatenate(counts))
    real = np.float32 if np.abs(joined[:, :3]).max() < _SINGLE_M else np.float64
    columns = {"intensity": joined[:, 3].astype(np.float32)} if bright else {}
    return Cloud(joined[:, :3].astype(real), columns | {"count": number.astype(np.uint32)})
