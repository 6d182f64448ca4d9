"""A cloud in parts, and the survey of all parts that writers require."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from scanwright.design import frames
from scanwright.design.arrays import Vector
from scanwright.firmware_io.clouds.cloud import Cloud

Again = Callable[[], Iterator[Cloud]]
"""Reads the parts of a cloud from the first one on; all have the same columns, pose and start."""


@dataclass(frozen=True, slots=True)
class Parts:
    """The clouds of a file, in parts."""

    clouds: tuple[Again, ...]  # of the file, in its order
    notes: tuple[str, ...] = ()  # data that are not read


@dataclass(frozen=True, slots=True, eq=False)
class CloudSurvey:
    """All parts of a cloud, without its points."""

    head: Cloud  # columns, pose and start, and no point
    rows: int  # with a point
    low_m: Vector  # lowest corner in the world, shape (3,)
    high_m: Vector  # highest corner in the world, shape (3,)
    limits: dict[str, tuple[float, float]]  # column -> smallest and largest finite value; (0, 0) if there is none
    integers: frozenset[str]  # columns of integers from 0 to 65535


def survey(parts: Iterable[Cloud]) -> CloudSurvey | None:
    """Return the survey of the parts of a cloud; None if no row is a point."""
    merged: CloudSurvey | None = None
    for part in parts:
        flat = part.flat()
        if len(flat.points_m):
            merged = _of(flat) if merged is None else _both(merged, _of(flat))
    return merged


def _of(cloud: Cloud) -> CloudSurvey:
    world_m = frames.apply(cloud.T_world_cloud, cloud.points_m.astype(float))
    limits, integers = {}, set()
    for name, values in cloud.columns.items():
        known = values[np.isfinite(values)]
        limits[name] = (known.min().item(), known.max().item()) if known.size else (0, 0)
        if known.size == values.size and limits[name][0] >= 0 and limits[name][1] <= 65535:
            integers |= {name} if np.all(values == np.round(values)) else set()
    head = cloud.select(np.empty(0, np.int64))
    low_m, high_m = world_m.min(axis=0), world_m.max(axis=0)
    return CloudSurvey(head, len(cloud.points_m), low_m, high_m, limits, frozenset(integers))


def _both(a: CloudSurvey, b: CloudSurvey) -> CloudSurvey:
    return replace(
        a,
        rows=a.rows + b.rows,
        low_m=np.minimum(a.low_m, b.low_m),
        high_m=np.maximum(a.high_m, b.high_m),
        limits={
            name: (min(low, b.limits[name][0]), max(high, b.limits[name][1])) for name, (low, high) in a.limits.items()
        },
        integers=a.integers & b.integers,
    )
