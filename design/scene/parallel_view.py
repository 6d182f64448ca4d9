"""A parallel view of bodies: direction of view, the body of each pixel, and its brightness.

Rays are cast like beams. Each body has its own view, so that a picture can combine bodies by distance or show one
through another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from scanwright.design.arrays import Array, Rotation, Vector
from scanwright.design.scene.ray_caster import Scene, cast

DARKEST = 0.35  # brightness of a surface seen edge on


@dataclass(frozen=True, slots=True)
class Shown:
    """The pixels of a body, row by row from the top left."""

    away_m: Float[ndarray, " n"]  # distance from the plane of the view, inf without the body, shape (n,)
    brightness: Float[ndarray, " n"]  # 0 to 1, shape (n,)


def in_front(views: Sequence[Shown]) -> Shown:
    """Return the view of several bodies: in each pixel the nearest one."""
    away_m, brightness = views[0].away_m.copy(), views[0].brightness.copy()
    for view in views[1:]:
        nearer = view.away_m < away_m
        away_m[nearer], brightness[nearer] = view.away_m[nearer], view.brightness[nearer]
    return Shown(away_m, brightness)


@dataclass(frozen=True, slots=True)
class ParallelView:
    """Position and direction of the viewer."""

    axes: Rotation  # rows to the right, up, and back to the viewer
    low: Float[ndarray, " 2"]  # centre of the lowest pixel at the left, in right and up [m]
    away_m: float  # distance of the plane of the view from the origin, along back; no body is in front of it
    pixel_m: float  # width of a pixel
    size: tuple[int, int]  # pixels, columns and rows

    def at(self, points_m: Float[ndarray, "*k 3"]) -> Float[ndarray, "*k 2"]:
        """Return columns and rows of points, from the centre of the top left pixel, shape (..., 2)."""
        x, y = np.moveaxis(points_m @ self.axes[:2].T - self.low, -1, 0) / self.pixel_m
        return np.stack([x, self.size[1] - 1 - y], axis=-1)

    def shown(self, scene: Scene, moved_m: Vector | None = None) -> Shown:
        """Cast a body, optionally displaced by `moved_m`; only the pixels of its box get a ray."""
        columns, rows = self.size
        shift = np.zeros(3) if moved_m is None else moved_m
        seen = self.at(scene.triangles_m.reshape(-1, 3) + shift)
        low = np.clip(np.floor(seen.min(axis=0)).astype(int), 0, [columns, rows])
        high = np.clip(np.ceil(seen.max(axis=0)).astype(int) + 1, low, [columns, rows])
        x, y = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]))
        right, up, back = self.axes
        across = self.low[0] + self.pixel_m * x.reshape(-1, 1)
        high_m = self.low[1] + self.pixel_m * (rows - 1 - y.reshape(-1, 1))
        starts = across * right + high_m * up + self.away_m * back - shift
        hits = cast(scene, starts, np.broadcast_to(-back, starts.shape))
        away, brightness = np.full((rows, columns), np.inf), np.zeros((rows, columns))
        away[y, x] = hits.range_m.reshape(x.shape)
        lit = DARKEST + (1 - DARKEST) * np.nan_to_num(np.cos(hits.incidence_rad))
        brightness[y, x] = lit.reshape(x.shape)
        return Shown(away.reshape(-1), brightness.reshape(-1))


def view_of(
    corners_m: Array, size: tuple[int, int], yaw_rad: float, pitch_rad: float, margin: float, R: Rotation | None = None
) -> ParallelView:
    """Return the view that shows all of the points, shape (n, 3), in `size` columns and rows.

    The viewer is at `yaw_rad` about z from x, and `pitch_rad` above the horizontal. `margin` is the width of the
    picture over that of the points. The columns of `R` are the axes of the frame in which z is upright.
    """
    cy, sy, cp, sp = np.cos(yaw_rad), np.sin(yaw_rad), np.cos(pitch_rad), np.sin(pitch_rad)
    axes = np.array([[-sy, cy, 0], [-cy * sp, -sy * sp, cp], [cy * cp, sy * cp, sp]])
    axes = axes if R is None else axes @ R.T
    seen = np.ascontiguousarray((corners_m @ axes.T).T)  # numpy finds the minimum of a row ten times faster
    low, high = seen.min(axis=1), seen.max(axis=1)
    middle, half = (low + high) / 2, (high - low) / 2 * margin
    pixel = float(2 * max(half[:2] / size))
    corner = middle[:2] - pixel * (np.array(size) - 1) / 2
    return ParallelView(axes, corner, float(middle[2] + 2 * half[2] + 0.1), pixel, size)
