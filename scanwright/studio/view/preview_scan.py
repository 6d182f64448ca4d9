"""A scan of a scene without its devices: what the studio shows while the angles are still being chosen."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scanwright.design import frames
from scanwright.design.arrays import Array
from scanwright.design.frames import Rx, Ry, Rz
from scanwright.design.scanner import Scanner
from scanwright.design.scene.ray_caster import Scene, build_scene, load_scene
from scanwright.design.task.shapes import Placed
from scanwright.firmware_io.emulators.world import furnished_room, measure_ranges, range_model, see

MOST_RAYS = 150_000  # what a page draws at once
SEED = 0  # the same noise for the same mount


def preview_scan(scanner: Scanner, joint_rad: Array, placed: Placed | None, folder: Path) -> NDArray[np.float32]:
    """Points of one full scan with the noise of the data sheet, thinned evenly to what a page can draw.

    Args:
        scanner: its optical centre is the origin of the world.
        joint_rad: axis angle of each line, shape (lines,).
        placed: the scene; None for a furnished room.
        folder: that the scene's file is named from.

    Returns:
        In the world [m], shape (n, 3).

    Raises:
        SceneError: the scene cannot be read.
    """
    lidar, angles = scanner.lidar, scanner.angles
    thin = int(np.ceil(np.sqrt(joint_rad.size * len(lidar.bearings_rad()) / MOST_RAYS)))
    joint_rad, bearing_rad = joint_rad[::thin], lidar.bearings_rad()[::thin]
    beams = np.tile(bearing_rad, len(joint_rad))
    joint_rad = np.repeat(joint_rad, len(bearing_rad))
    hits = see(_scene(placed, folder), angles, beams, joint_rad)
    range_m = measure_ranges(hits, range_model(lidar), np.random.default_rng(SEED)).range_m
    back = np.isfinite(range_m)
    in_plane = np.stack([np.cos(beams), np.sin(beams)], axis=-1)[back]
    T = angles.T_world_laser(joint_rad[back])
    return (range_m[back, None] * np.einsum("nij,nj->ni", T[:, :3, :2], in_plane) + T[:, :3, 3]).astype(np.float32)


@lru_cache(maxsize=4)
def _scene(placed: Placed | None, folder: Path) -> Scene:
    if placed is None:
        return build_scene(furnished_room())
    roll, pitch, yaw = np.radians(placed.rpy_deg)
    R_mesh_world = Rz(yaw) @ Ry(pitch) @ Rx(roll)
    T_world_mesh = frames.rigid(R_mesh_world.T, -R_mesh_world.T @ np.array(placed.sensor_m))
    return load_scene(folder / placed.file, placed.unit_m, T_world_mesh)
