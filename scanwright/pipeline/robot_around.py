"""Distances from the scanner straight down and up to the robot."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from scanwright.design.scene.ray_caster import build_scene, cast, load_triangles
from scanwright.design.task.shapes import GroundRegion, MaskRegion, MeshRegion


def robot_around(masks: Iterable[MaskRegion], folder: Path) -> tuple[float, float]:
    """Return the distances [m] from the optical centre straight down and up to the robot; infinite if it is not there.

    Masks of a task describe the robot: its meshes, and its top as a `ground`.

    Raises:
        SceneError: a mesh cannot be read.
    """
    below_m = above_m = math.inf
    for region in masks:
        if isinstance(region, GroundRegion) and region.from_m <= 0 <= region.to_m:
            below_m = min(below_m, region.height_m)
        elif isinstance(region, MeshRegion):
            scene = build_scene(
                load_triangles(folder / region.file, region.unit_m, posture=region.posture), region.file
            )
            up = region.R_mesh_world()[:, 2]
            down_m, up_m = cast(scene, region.sensor_m, np.stack([-up, up])).range_m
            below_m, above_m = min(below_m, float(down_m)), min(above_m, float(up_m))
    return below_m, above_m
