"""Surfaces of a mesh, seen from the optical centre on a grid of directions."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from scanwright.design.errors import TaskError
from scanwright.design.frames import Rx, Ry, Rz
from scanwright.design.scene.posture import AS_IT_IS, Posture
from scanwright.design.scene.ray_caster import build_scene, cast, load_triangles

_LEAST_M = 0.02  # no robot and no room is smaller
_UNITS_M = (0.001, 0.01, 0.0254, 0.3048, 1.0, 1000.0)
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """Rays at the middles of cells: rows theta 0 .. 180, columns phi 0 .. 360 of the world."""

    directions: Float[ndarray, "rows columns 3"]  # unit vectors in the world, shape (rows, columns, 3)
    range_m: Float[ndarray, "rows columns"]  # inf without a hit, shape (rows, columns)
    # between ray and surface normal, NaN without a hit, shape (rows, columns)
    incidence_rad: Float[ndarray, "rows columns"]
    points_m: Float[ndarray, "rows columns 3"]  # the points hit, in the frame of the mesh, shape (rows, columns, 3)

    def area_per_sr(self) -> Float[ndarray, "rows columns"]:
        """Square metres of surface per steradian, `r^2 / cos(incidence)`; 0 without a hit."""
        hit = np.isfinite(self.range_m)
        across = np.cos(np.where(hit, self.incidence_rad, 0.0))
        return np.where(hit & (across > 1e-3), np.where(hit, self.range_m, 0.0) ** 2 / np.maximum(across, 1e-3), 0.0)

    def within(self, low_m: float, high_m: float) -> Bool[ndarray, "rows columns"]:
        """Return whether a surface is between two ranges, shape (rows, columns)."""
        return (self.range_m >= low_m) & (self.range_m <= high_m)


def cell_directions(step_deg: float) -> Float[ndarray, "rows columns 3"]:
    """Return the centres of the cells of a grid in theta and phi, shape (180 / step, 360 / step, 3)."""
    rows = round(180 / step_deg)
    theta = (np.arange(rows) + 0.5) * np.pi / rows
    phi = (np.arange(2 * rows) + 0.5) * np.pi / rows
    t, p = np.meshgrid(theta, phi, indexing="ij")
    return np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)


def cast_surface(
    path: Path,
    unit_m: float,
    sensor_m: tuple[float, float, float],
    rpy_deg: tuple[float, float, float],
    step_deg: float,
    posture: Posture = AS_IT_IS,
    most_m: float | None = None,
) -> Surface:
    """Cast a ray at every cell.

    Args:
        path: of the mesh.
        unit_m: length of one unit of the file.
        sensor_m: the optical centre in the mesh.
        rpy_deg: the axes of the world in the mesh: roll, pitch, yaw, the last about z.
        step_deg: between the rays.
        posture: of the robot of a URDF.
        most_m: largest plausible extent, if the unit is only assumed; None if it is known.

    Raises:
        TaskError: the mesh cannot be read, its size is implausible, or no ray hits it.
    """
    directions = cell_directions(step_deg)
    roll, pitch, yaw = np.radians(rpy_deg)
    R_mesh_world = Rz(yaw) @ Ry(pitch) @ Rx(roll)
    rays = directions.reshape(-1, 3) @ R_mesh_world.T
    triangles = load_triangles(path, unit_m, posture=posture)
    hits = cast(build_scene(triangles, str(path)), np.array(sensor_m), rays)
    across_m = float(np.ptp(triangles, axis=(0, 1)).max())
    _log.info("%s: %.3g m across at unit_m = %g", path.name, across_m, unit_m)
    if most_m is not None and not _LEAST_M <= across_m <= most_m:
        unit = next((each for each in _UNITS_M if _LEAST_M * 10 < across_m / unit_m * each <= most_m / 2), 1.0)
        hidden = " and hides every direction" if np.isfinite(hits.range_m).all() else ""
        raise TaskError(
            f"{path}: the mesh is {across_m:.4g} m across{hidden}: write unit_m; {unit:g} makes it "
            f"{across_m / unit_m * unit:.3g} m, {unit_m:g} keeps this size"
        )
    if not np.isfinite(hits.range_m).any():
        raise TaskError(f"{path}: sensor_m = {list(sensor_m)}: no ray from there hits the mesh; unit_m right?")
    shape = directions.shape[:2]
    far = np.where(np.isfinite(hits.range_m), hits.range_m, 0.0)
    points = np.array(sensor_m) + far[:, None] * rays
    return Surface(
        directions, hits.range_m.reshape(shape), hits.incidence_rad.reshape(shape), points.reshape(*shape, 3)
    )
