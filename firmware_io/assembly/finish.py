"""Filters, normals and output format of assembled clouds, one cloud in memory at a time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float64
from numpy import ndarray

from scanwright.design.angles import AngleSet
from scanwright.design.arrays import Floats
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.assembly.assemble import AssembleSummary
from scanwright.firmware_io.assembly.options import AssembleOptions
from scanwright.firmware_io.clouds import filters
from scanwright.firmware_io.clouds.cloud import Cloud
from scanwright.firmware_io.clouds.formats import read_clouds, write_clouds
from scanwright.firmware_io.poses.trajectory import Trajectory

SeenFrom = Callable[[Cloud], Float64[ndarray, "n 3"]]


def seen_from(angles: AngleSet, poses: Trajectory | None) -> SeenFrom:
    """Return a function for the position of the scanner at the time of each point of a cloud, shape (n, 3)."""
    origin_m = angles.T_world_rot(0.0)[:3, 3]

    def of(cloud: Cloud) -> Floats:
        if poses is None:
            return np.broadcast_to(origin_m, cloud.points_m.shape).astype(float)
        if cloud.start_ns is None or "time_s" not in cloud.columns:
            raise RecordingError("normals of a map need the times of its points: include time_s in columns")
        time_ns = cloud.start_ns + np.rint(cloud.columns["time_s"] * 1e9).astype(np.int64)
        # times in the file are rounded: those of the first and the last point may be just outside
        T = poses.T_map_world(np.clip(time_ns, poses.time_ns[0], poses.time_ns[-1]))
        return T[:, :3, :3] @ origin_m + T[:, :3, 3]

    return of


def finish_clouds(
    summary: AssembleSummary, out: Path, options: AssembleOptions, seen_from: SeenFrom
) -> AssembleSummary:
    """Filter the clouds of a summary and write them in the format and with the name of `out`.

    Raises:
        RecordingError: the format cannot store them, or points of an organised cloud would be dropped.
        InstallError: the format requires the extra `clouds`.
    """
    left_out, notes, rows = Counter(summary.left_out), list(summary.notes), 0
    written: list[Path] = []
    for path in summary.clouds:
        (cloud, *_), _ = read_clouds(path)
        cloud, dropped = _finished(cloud, options, seen_from)
        left_out.update(dropped)
        target = out.with_name(f"{path.stem}{out.suffix}")
        wrote = write_clouds(target, [cloud], organised=options.organised)
        rows += wrote.rows
        notes += [line for each in wrote.notes if (line := f"note: {each}") not in notes]
        written += wrote.paths
    return replace(
        summary,
        out=out,
        clouds=tuple(written),
        points=summary.beams - sum(left_out.values()),
        rows=rows,
        left_out=dict(left_out),
        notes=tuple(notes),
    )


def _finished(cloud: Cloud, options: AssembleOptions, seen_from: SeenFrom) -> tuple[Cloud, dict[str, int]]:
    dropped: dict[str, int] = {}
    if options.outliers is not None:
        stray = filters.outliers(cloud.points_m, options.outliers)
        dropped["outlier"] = int(stray.sum())
        cloud = cloud.select(np.flatnonzero(~stray))
    if options.voxel_m is not None:
        chosen = filters.one_to_a_voxel(cloud.points_m, options.voxel_m)
        dropped["another_point_of_the_voxel"] = len(cloud.points_m) - len(chosen)
        cloud = cloud.select(chosen)
    if options.normals:
        there = cloud.valid
        normal = np.full(cloud.points_m.shape, np.nan, np.float32)
        normal[there] = filters.normals(cloud.points_m[there], seen_from(cloud)[there])
        cloud = replace(cloud, columns={**cloud.columns, **dict(zip(("nx", "ny", "nz"), normal.T.copy(), strict=True))})
    return cloud, {reason: count for reason, count in dropped.items() if count}
