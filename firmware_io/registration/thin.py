"""Resampling of a cloud to an even density, and the merging of registered clouds by the means of voxels.

A rotating 2D lidar measures some directions a hundred times more densely than others, near surfaces more densely than
far ones, and along a line more densely than across. Such a cloud would register its own pattern: the twenty nearest
neighbours of a point lie on one scan line, and the lines of one scan align with those of the other.

The number of points in each cell of a cube map, which includes shadows, dropped beams and repeated turns, and the step
between neighbouring beams give the gap between the lines there; no voxel is finer than that gap on its surface.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64, Int64
from numpy import ndarray
from numpy.typing import NDArray

from scanwright.design import frames
from scanwright.design.arrays import Floats
from scanwright.firmware_io.clouds.cloud import Cloud
from scanwright.firmware_io.clouds.filters import voxel_of, voxel_sums
from scanwright.firmware_io.registration.cube_map import cells_of, solid_angles_sr

_SIDE = 45  # cells of 2 deg: narrower than the density varies, wider than the lines of a scan of two seconds
_LEVELS = 3  # voxels grow up to 2**3 times
_SINGLE_M = 500.0  # beyond it float32 is coarser than 0.03 mm


def thin(means: Floats, counts: NDArray[np.int64], spacing_m: float, step_rad: float) -> Float64[ndarray, "kept 3"]:
    """Return mean points of voxels, evenly spread over the surfaces that a scanner at the origin measured.

    `means` and `counts` are those of the finest voxels, with an edge of `spacing_m`; `step_rad` is `beam_step_rad`.
    """
    gap_m = np.linalg.norm(means, axis=1) * line_gaps_rad(means, counts, step_rad)
    level = np.clip(np.ceil(np.log2(np.maximum(gap_m, spacing_m) / spacing_m)), 0, _LEVELS).astype(np.uint8)
    # Fine voxels nest in coarse ones, so that nothing is lost by starting from their means
    return voxel_means(means, means, spacing_m, level, counts)[0]


def line_gaps_rad(
    points_m: Float64[ndarray, "n 3"], counts: Int64[ndarray, " n"], step_rad: float
) -> Float64[ndarray, " n"]:
    """Return the angle between neighbouring scan lines in the direction of each point, from the beams in each.

    In a cloud without lines (of another scanner, or shuffled) it is the mean angle between neighbours. `step_rad` is
    the angle between neighbouring beams of one line.
    """
    cells = cells_of(points_m, _SIDE)
    count = np.bincount(cells, counts, 6 * _SIDE**2)
    each_sr = solid_angles_sr(_SIDE) / np.maximum(count, 1)
    gap = each_sr / np.minimum(step_rad, np.sqrt(each_sr))
    return gap[cells]


def beam_step_rad(points_m: Float64[ndarray, "n 3"]) -> float:
    """Return the median angle between consecutive beams; larger ones are gaps and line ends."""
    some = np.unique(np.linspace(0, len(points_m) - 2, min(len(points_m) - 1, 20_011)).astype(int))
    here, there = points_m[some], points_m[some + 1]
    sine, cosine = np.linalg.norm(np.cross(here, there), axis=1), np.einsum("ij,ij->i", here, there)
    return float(np.median(np.arctan2(sine, cosine)))


def voxel_means(
    points_m: Floats,
    values: Floats,
    spacing_m: float,
    level: NDArray[np.uint8] | None = None,
    counts: NDArray[np.int64] | None = None,
) -> tuple[Floats, NDArray[np.int64]]:
    """Return the mean of `values`, shape (n, k), in each occupied voxel, shape (m, k), and its points, shape (m,).

    Voxels are those of `voxel_of`; with `counts` the values are means themselves, of so many points each.
    """
    weight = np.ones(len(points_m), np.int64) if counts is None else counts
    sums = voxel_sums(voxel_of(points_m, spacing_m, level), np.column_stack([values * weight[:, None], weight]))
    return sums[:, :-1] / sums[:, -1:], sums[:, -1].astype(np.int64)


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
