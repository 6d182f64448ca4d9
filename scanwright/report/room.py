"""The room about a scanner, and one simulated scan."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from scanwright.design import frames
from scanwright.design.arrays import Array, Float32s, Vector
from scanwright.design.scanner import Scanner
from scanwright.design.scene.ray_caster import Scene, build_scene, load_scene
from scanwright.design.self_occlusion import SelfOcclusion
from scanwright.design.task.shapes import CeilingRegion, OnPlane, Placed
from scanwright.design.task.task import Task
from scanwright.firmware_io.emulators.world import furnished_room, measure_ranges, range_model, see
from scanwright.report.build_files import numbers

HEIGHT_M, CEILING_M, REACH_M, BEHIND_M = 1.0, 2.5, 2.0, 1.0  # of a room that the task does not describe: a usual one
UPRIGHT = 0.05  # a middle less far from the vertical has no heading
AZIMUTH_DEG, ABOVE_DEG = 35.0, 28.0  # of the camera behind the scanner: three walls are in view
LITTLE = 0.02  # share of the weight below the horizon, under which the camera looks through the floor
HEADROOM_M = 0.4  # at least, from the scanner to the ceiling
MOST_RAYS = 150_000  # what a page draws at once
STEPS = 2**16 - 1  # of the places of a stored cloud, along each side of its box
SEED = 0  # the same noise for the same mount


@dataclass(frozen=True, slots=True)
class Room:
    """Its lowest and highest corner [m], from the optical centre."""

    low: Vector
    high: Vector

    def walls_along(self, directions: Float[ndarray, "*k 3"]) -> Float[ndarray, "*k 3"]:
        """Return the points where rays from the optical centre meet its walls, shape (..., 3)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            along_m = np.where(directions > 0, self.high, self.low) / directions
        away_m = np.where(directions == 0, np.inf, along_m).min(axis=-1, keepdims=True)
        return np.asarray(away_m * directions)

    def beyond(self, eye_m: Vector, along: Vector) -> Vector | None:
        """Return the direction from the optical centre to where a ray leaves the room; None if it misses the room."""
        if not (np.isfinite([eye_m, along]).all() and np.any(along)):
            return None
        with np.errstate(divide="ignore", invalid="ignore"):
            near, far = np.sort([(self.low - eye_m) / along, (self.high - eye_m) / along], axis=0)
        if not max(0.0, np.nanmax(near)) < np.nanmin(far):
            return None
        point = eye_m + np.nanmin(far) * along
        return np.asarray(point / np.linalg.norm(point))


def room_about(task: Task) -> Room:
    """Return the room about the scanner: of the task, as far as it describes one."""
    planes = [region for region in task.weight if isinstance(region, OnPlane)]
    height = planes[0].height_m if planes else HEIGHT_M
    ceiling = max([r.ceiling_m for r in planes if isinstance(r, CeilingRegion)], default=CEILING_M) - height
    named = np.array([corner for region in planes for corner in region.corners_m()]).reshape(-1, 3)
    corners = np.vstack([named, [-BEHIND_M, -REACH_M, -height], [REACH_M, REACH_M, max(ceiling, HEADROOM_M)]])
    if not planes:
        corners = np.vstack([corners, [-REACH_M, 0, 0]])
    return Room(corners.min(axis=0), corners.max(axis=0))


def room_scene(room: Room, centre_m: Vector, middle: Vector, below: float) -> dict[str, Any]:
    """Return the room and its camera for the stage, ready for JSON.

    `middle` is the mean direction of the weight, `below` its share below the horizon.
    """
    heading = float(np.arctan2(middle[1], middle[0])) if np.hypot(*middle[:2]) > UPRIGHT else 0.0
    from_below = below < LITTLE
    low, high = (np.round(centre_m + end, 4) for end in (room.low, room.high))
    yaw, pitch = heading + np.pi + np.radians(AZIMUTH_DEG), np.radians(-ABOVE_DEG if from_below else ABOVE_DEG)
    return {
        "centre": np.round(centre_m, 6).tolist(),
        "room": {"low": low.tolist(), "high": high.tolist()},
        "level": float(high[2] if from_below else low[2]),
        "look": {"yaw": round(float(yaw), 4), "pitch": round(float(pitch), 4)},
    }


def one_scan(
    scanner: Scanner,
    joint_rad: Array,
    placed: Placed | None,
    folder: Path,
    shadow: SelfOcclusion | None = None,
    most_rays: int = MOST_RAYS,
) -> Float32s:
    """Return points of one full scan with the noise of the data sheet in the world [m], thinned evenly, shape (n, 3).

    Args:
        scanner: with the optical centre at the origin of the world.
        joint_rad: axis angle of each line, shape (lines,).
        placed: the scene, in a file of `folder`; None for a furnished room.
        folder: of the scene.
        shadow: beams that the parts of the scanner block; None if unknown.
        most_rays: largest number of rays.

    Raises:
        SceneError: the scene cannot be read.
    """
    lidar, angles = scanner.lidar, scanner.angles
    thin = int(np.ceil(np.sqrt(joint_rad.size * len(lidar.bearings_rad()) / most_rays)))
    joint_rad, bearing_rad = joint_rad[::thin], lidar.bearings_rad()[::thin]
    free = np.ones((len(joint_rad), len(bearing_rad)), bool)
    if shadow is not None:
        free = shadow.free(joint_rad)[:, ::thin]
    line, beam = np.nonzero(free)
    joint_rad, bearing_rad = joint_rad[line], bearing_rad[beam]
    hits = see(_scene(placed, folder), angles, bearing_rad, joint_rad)
    range_m = measure_ranges(hits, range_model(lidar), np.random.default_rng(SEED)).range_m
    back = np.isfinite(range_m)
    return _points(range_m[back], bearing_rad[back], angles.T_world_laser(joint_rad[back]))


def cloud_scene(points_m: Float[ndarray, "n 3"], level: Float[ndarray, " n"]) -> dict[str, Any]:
    """Return a cloud for the stage, ready for JSON; `level` is the place of each point on the colour scale, 0 to 1."""
    low, high = points_m.min(axis=0), points_m.max(axis=0)
    span = np.maximum(high - low, 1e-6)
    values = np.column_stack([(points_m - low) / span, np.clip(level, 0, 1)])
    return {
        "points": numbers(np.round(STEPS * values), "<u2"),
        "low": np.round(low, 6).tolist(),
        "span": np.round(span, 6).tolist(),
        "fit": {"centre": np.round((low + high) / 2, 4).tolist(), "radius": float(np.linalg.norm(span) / 2)},
    }


def _points(range_m: Array, bearing_rad: Array, T: Float[ndarray, "n 4 4"]) -> Float32s:
    in_plane = np.stack([np.cos(bearing_rad), np.sin(bearing_rad)], axis=-1)
    return (range_m[:, None] * np.einsum("nij,nj->ni", T[:, :3, :2], in_plane) + T[:, :3, 3]).astype(np.float32)


@lru_cache(maxsize=4)
def _scene(placed: Placed | None, folder: Path) -> Scene:
    if placed is None:
        return build_scene(furnished_room())
    R_mesh_world = placed.R_mesh_world()
    T_world_mesh = frames.rigid(R_mesh_world.T, -R_mesh_world.T @ np.array(placed.sensor_m))
    return load_scene(folder / placed.file, placed.unit_m, T_world_mesh)
