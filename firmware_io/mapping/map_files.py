"""`scanwright map`: clouds become an occupancy grid over their floor, in files of a ROS map_server.

Errors raise RecordingError.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float64
from numpy import ndarray

from scanwright.design import frames
from scanwright.design.angles import AngleSet
from scanwright.design.arrays import Vector
from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import atomic_write, check_place
from scanwright.design.progress import Progress, no_progress
from scanwright.firmware_io.clouds.cloud import Cloud
from scanwright.firmware_io.clouds.formats import read_clouds
from scanwright.firmware_io.mapping.occupancy import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    Heights,
    OccupancyGrid,
    check_resolution,
    occupancy_grid,
)
from scanwright.firmware_io.mapping.seen_through import Stand, seen_through
from scanwright.firmware_io.registration.poses import cloud_names, read_poses

_SHADES = {UNKNOWN: 205, FREE: 254, OCCUPIED: 0}
# 205 means 0.19608, above the lower threshold: unknown. With Nav2's default, 0.25, it would be free.
_THRESHOLDS = {"occupied_thresh": 0.65, "free_thresh": 0.196}
_COUNT = "count"  # of points in a voxel, as written by `merge` of the registration


@dataclass(frozen=True, slots=True, eq=False)
class MapSummary:
    """Result of `map_files`.

    Attributes:
        grid: the map.
        heights: of the layer of obstacles.
        points: of all clouds in the map.
        moved: points dropped by ray conflicts with another cloud.
        wrote: YAML and image.
        notes: one sentence each.
    """

    grid: OccupancyGrid
    heights: Heights
    points: int
    moved: int
    wrote: tuple[Path, Path]
    notes: tuple[str, ...]

    def lines(self) -> list[str]:
        """Format the result."""
        grid, heights = self.grid, self.heights
        rows, columns = grid.cells.shape
        kinds = (("occupied", OCCUPIED), ("free", FREE))
        areas = [f"{grid.count(kind):,} {word} ({grid.area_m2(kind):.2f} m2)" for word, kind in kinds]
        return [
            *(f"note: {line}" for line in self.notes),
            *([f"left out {self.moved:,} points: another cloud was seen through them"] if self.moved else []),
            f"floor at z = {heights.floor_m:z.3f} m, obstacles from {heights.from_m:g} to {heights.to_m:g} m above it",
            f"mapped {self.points:,} points: {columns} x {rows} cells of {grid.resolution_m:g} m, {', '.join(areas)}",
            f"wrote {', '.join(str(path) for path in self.wrote)}",
        ]


def map_files(
    paths: Sequence[Path],
    out: Path,
    scanner: AngleSet | None,
    poses: Path | None,
    floor_m: float | None,
    from_m: float,
    to_m: float,
    resolution_m: float,
    seen_through_m: float | None,
    progress: Progress = no_progress,
) -> MapSummary:
    """Read clouds, find the floor, write the map; the arguments are those of `scanwright.make_map`."""
    _check_place(out)
    check_resolution(resolution_m)
    Heights(0.0 if floor_m is None else floor_m, from_m, to_m)
    positions, notes = _positions(paths, scanner, poses, progress)
    moved = 0
    if seen_through_m is not None:
        progress("searching for moving objects")
        moving = seen_through(positions, seen_through_m)
        moved = sum(int(mask.sum()) for mask in moving)
        positions = [Stand(stand.points_m[~mask], stand.eye_m) for stand, mask in zip(positions, moving, strict=True)]
    points_m = np.concatenate([stand.points_m for stand in positions])
    eyes_m = np.repeat([stand.eye_m for stand in positions], [len(stand.points_m) for stand in positions], axis=0)
    if floor_m is None:
        floor_m = find_floor(points_m, float(np.nanmin(eyes_m[:, 2], initial=np.inf)))
    heights = Heights(floor_m, from_m, to_m)
    progress("marking occupied and free cells")
    grid = occupancy_grid(points_m, eyes_m, heights, resolution_m)
    notes += _about_eyes(positions)
    return MapSummary(grid, heights, len(points_m), moved, write_map(out, grid), tuple(notes))


def _positions(
    paths: Sequence[Path], scanner: AngleSet | None, poses: Path | None, progress: Progress
) -> tuple[list[Stand], list[str]]:
    """Return all clouds of all files in the frame of the map, and notes about dropped data."""
    named: list[tuple[Path, Cloud]] = []
    counts, notes = [], []
    for path in paths:
        read, lines = read_clouds(path)
        notes += lines
        counts.append((path, len(read)))
        named += [(path, cloud) for cloud in read]
    T_clouds = None if poses is None else read_poses(poses, cloud_names(counts))
    positions = []
    for k, (path, cloud) in enumerate(named):
        progress(f"reading {path.name}", k / len(named))
        if not cloud.valid.any():
            raise RecordingError(f"{path}: none of the {len(cloud.points_m)} rows is a point")
        T = cloud.T_world_cloud if T_clouds is None else T_clouds[k]
        eye_m = _eye(path, cloud, scanner, placed=T_clouds is not None or cloud.placed)
        points_m = cloud.flat().points_m.astype(float)
        positions.append(Stand(frames.apply(T, points_m), frames.apply(T, eye_m[None])[0]))
    return positions, notes


def _eye(path: Path, cloud: Cloud, scanner: AngleSet | None, *, placed: bool) -> Vector:
    """Return the position of the scanner in the frame of its cloud."""
    if _COUNT in cloud.columns and (scanner is not None or placed):
        raise RecordingError(
            f"{path}: merged from several clouds (column {_COUNT}): pass those clouds and the poses that register wrote"
        )
    if scanner is not None:
        return scanner.T_world_rot(0.0)[:3, 3]
    return np.zeros(3) if placed else np.full(3, np.nan)


def _about_eyes(positions: Sequence[Stand]) -> list[str]:
    unknown = sum(bool(np.isnan(stand.eye_m[0])) for stand in positions)
    if not unknown:
        return []
    subject = "the cloud" if len(positions) == 1 else f"{unknown} of {len(positions)} clouds"
    free = "no cell is free" if unknown == len(positions) else "these free no cell"
    return [f"unknown scanner position of {subject}, so {free}: pass the angle set (`angles`) or `poses`"]


def _check_place(path: Path) -> None:
    """Raise RecordingError if a map cannot be written."""
    check_place(path, RecordingError)
    if path.suffix not in (".yaml", ".yml"):
        raise RecordingError(
            f"{path}: a map_server reads {path.with_suffix('.yaml').name}, with a .pgm in the same folder"
        )
    check_place(path.with_suffix(".pgm"), RecordingError)


def write_map(path: Path, grid: OccupancyGrid) -> tuple[Path, Path]:
    """Write a map, and return its files: YAML and image.

    The first row of the image has the largest y; the origin is the lower left corner of the lower left pixel, its third
    number the yaw.
    """
    _check_place(path)
    image = path.with_suffix(".pgm")
    rows, columns = grid.cells.shape
    shades = np.zeros(256, np.uint8)
    for value, shade in _SHADES.items():
        shades[value] = shade  # index -1 is the last one
    with atomic_write(image, RecordingError) as part:
        part.write_bytes(f"P5\n{columns} {rows}\n255\n".encode() + shades[grid.cells[::-1]].tobytes())
    x, y = (round(float(value), 6) for value in grid.origin_m)
    lines = [
        f"image: {json.dumps(image.name)}",  # a string of JSON is one of YAML
        "mode: trinary",
        f"resolution: {grid.resolution_m!r}",
        f"origin: [{x!r}, {y!r}, 0.0]",
        "negate: 0",
        *(f"{name}: {value}" for name, value in _THRESHOLDS.items()),
    ]
    with atomic_write(path, RecordingError) as part:
        part.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path, image


_CELL_M = 0.25  # narrower than free floor between furniture
_THICK_M = 0.1  # of one level: three sigmas of the noisiest sensor in both directions, and a carpet
_LEAST_M2 = 1.0  # smaller levels are tables
_MOST_BELOW = 0.05  # fraction of the points below a floor, by reflections
_MOST_TILT_RAD = math.radians(1.0)  # a wall of 0.1 m, six metres away
_GIVE_IT = "pass its height as floor_m"


def find_floor(points_m: Float64[ndarray, "n 3"], below_m: float = math.inf) -> float:
    """Return the height of the floor.

    Each square of 0.25 m has a lowest point. The level of most of these is the floor, if it has an area (a horizontal
    scan plane has only lines), and if almost no points are below it (unlike a ceiling).

    Args:
        points_m: shape (n, 3), finite, z up.
        below_m: upper bound of the floor, such as the height of the scanner.
    """
    squares = np.floor(points_m[:, :2] / _CELL_M).astype(np.int64)
    order = np.lexsort((points_m[:, 2], squares[:, 1], squares[:, 0]))
    first = np.r_[True, (np.diff(squares[order], axis=0) != 0).any(axis=1)] if order.size else np.zeros(0, bool)
    lowest = order[first]
    lowest = lowest[points_m[lowest, 2] < below_m]
    if not lowest.size:
        raise RecordingError(f"floor: no point lies below the scanner: {_GIVE_IT}")
    height_m = np.sort(points_m[lowest, 2])
    counts = np.searchsorted(height_m, height_m + _THICK_M, side="right") - np.arange(height_m.size)
    low_m = float(height_m[np.argmax(counts)])
    on_level = lowest[np.abs(points_m[lowest, 2] - low_m - _THICK_M / 2) <= _THICK_M / 2]
    level = {(int(x), int(y)) for x, y in squares[on_level]}  # count squares with four neighbours
    inner = sum({(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)} <= level for x, y in level)
    area_m2 = inner * _CELL_M**2
    if area_m2 < _LEAST_M2:
        raise RecordingError(
            f"floor: what lies lowest shares no level: {area_m2:.2g} m2 at z = {low_m:z.2f} m, {_LEAST_M2:g} m2 at "
            f"least: {_GIVE_IT}"
        )
    if (below := float(np.mean(points_m[:, 2] < low_m - _THICK_M))) > _MOST_BELOW:
        raise RecordingError(
            f"floor: {below:.0%} of the points lie below the widest level, z = {low_m:z.2f} m, which is no floor then: "
            f"{_GIVE_IT}"
        )
    layer = points_m[np.abs(points_m[:, 2] - np.median(points_m[on_level, 2])) <= _THICK_M / 2]
    middle_m = layer.mean(axis=0)
    slope, *_ = np.linalg.lstsq((layer - middle_m)[:, :2], layer[:, 2] - middle_m[2], rcond=None)
    if (tilt_rad := math.atan(math.hypot(*slope))) > _MOST_TILT_RAD:
        raise RecordingError(
            f"floor: tilted by {math.degrees(tilt_rad):.1f} deg, at most {math.degrees(_MOST_TILT_RAD):g}: level the "
            f"cloud, or {_GIVE_IT}"
        )
    return float(np.median(layer[:, 2]))
