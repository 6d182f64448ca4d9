"""A room that is cut open: its size about a scanner, the place of the camera, and the wall that a pixel shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from scanwright.design.arrays import Rotation, Vector
from scanwright.design.frames import Ry, Rz
from scanwright.design.task.shapes import CeilingRegion, OnPlane
from scanwright.design.task.task import Task

PIXELS = 1_100_000  # twice the width of the page's column
MARGIN = 0.005  # around the room, one length from the camera
AWAY = 1.6  # of the camera from the middle of the room, as a share of its diagonal
AZIMUTH_RAD, ABOVE_RAD = np.radians(35.0), np.radians(28.0)  # of the camera behind the scanner: three walls are in view
UPRIGHT = 0.05  # a middle less far from the vertical has no heading
HEIGHT_M, CEILING_M, REACH_M, BEHIND_M = 1.0, 2.5, 2.0, 1.0  # of a room that the task does not describe: a usual one
HEADROOM_M = 0.4  # at least, from the scanner to the ceiling


@dataclass(frozen=True, slots=True)
class Room:
    """Its lowest and highest corner [m], from the optical centre."""

    low: Vector
    high: Vector

    def corners(self) -> Float[ndarray, "8 3"]:
        """Return all eight corners."""
        choose = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T
        return np.where(choose == 1, self.high, self.low)

    def walls_along(self, directions: Float[ndarray, "*k 3"]) -> Float[ndarray, "*k 3"]:
        """Return the points where rays from the optical centre meet its walls, shape (..., 3)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            along_m = np.where(directions > 0, self.high, self.low) / directions
        away_m = np.where(directions == 0, np.inf, along_m).min(axis=-1, keepdims=True)
        return np.asarray(away_m * directions)


@dataclass(frozen=True, slots=True)
class Pinhole:
    """A pinhole.

    Attributes:
        eye: its place [m].
        R_world_camera: its axes in the world, as columns: to the right, up, and back to the eye.
        low: left and lower edge of the picture, one length away.
        high: right and upper edge.
        size: pixels, rows and columns.
    """

    eye: Vector
    R_world_camera: Rotation
    low: Vector
    high: Vector
    size: tuple[int, int]

    @property
    def pixel(self) -> float:
        """Return the width of a pixel, one length away."""
        return float(self.high[0] - self.low[0]) / self.size[1]

    def rays(self) -> Float[ndarray, "n 3"]:
        """Return unit vectors of the pixels, row after row from the top left."""
        rows, columns = self.size
        x = self.low[0] + self.pixel * (np.arange(columns) + 0.5)
        y = self.high[1] - self.pixel * (np.arange(rows) + 0.5)
        across, up = np.meshgrid(x, y)
        rays = np.stack([across, up, -np.ones_like(across)], axis=-1).reshape(-1, 3) @ self.R_world_camera.T
        return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))

    def shares(self, points_m: Float[ndarray, "n 3"]) -> Float[ndarray, "n 2"]:
        """Return the places of points on the picture: shares of its width from the left, of its height from the top."""
        x, y = _seen_from(self.eye, self.R_world_camera, points_m).T
        (left, bottom), (right, top) = self.low, self.high
        return np.stack([(x - left) / (right - left), (top - y) / (top - bottom)], axis=1)


@dataclass(frozen=True, slots=True)
class Walls:
    """What the pixels show of a room whose nearer walls are cut away.

    Attributes:
        points_m: shape (n, 3), valid inside only.
        away_m: from the camera, shape (n,).
        face: 0 to 5, low and high of each axis; -1 outside the room. Shape (n,).
    """

    points_m: Float[ndarray, "n 3"]
    away_m: Float[ndarray, " n"]
    face: Int[ndarray, " n"]

    @property
    def inside(self) -> Bool[ndarray, " n"]:
        """Return the pixels that show the room, shape (n,)."""
        return self.face >= 0


def room_about(task: Task) -> tuple[Room, str]:
    """Return the room about the scanner, and its description."""
    planes = [region for region in task.weight if isinstance(region, OnPlane)]
    height = planes[0].height_m if planes else HEIGHT_M
    ceiling = max([r.ceiling_m for r in planes if isinstance(r, CeilingRegion)], default=CEILING_M) - height
    named = np.array([corner for region in planes for corner in region.corners_m()]).reshape(-1, 3)
    corners = np.vstack([named, [-BEHIND_M, -REACH_M, -height], [REACH_M, REACH_M, max(ceiling, HEADROOM_M)]])
    if not planes:
        corners = np.vstack([corners, [-REACH_M, 0, 0]])
    low, high = corners.min(axis=0), corners.max(axis=0)
    size = f"{high[0] - low[0]:.3g} x {high[1] - low[1]:.3g} x {high[2] - low[2]:.3g} m"
    place = f"the scanner {height:g} m over its floor"
    about = place if planes else f"{place}, since the task names no height"
    return Room(low, high), f"The room is {size}, {about}"


def pinhole_behind(room: Room, middle: Vector, from_below: bool) -> Pinhole:
    """Return a camera behind the scanner and to its side, whose window shows the entire room.

    Args:
        room: to be shown.
        middle: mean direction of the regions of interest; the camera looks along its heading.
        from_below: whether it looks through the floor.
    """
    across = float(np.hypot(*middle[:2]))
    heading = float(np.arctan2(middle[1], middle[0])) if across > UPRIGHT else 0.0
    pitch = -ABOVE_RAD if from_below else ABOVE_RAD
    back = Rz(heading + np.pi + AZIMUTH_RAD) @ Ry(-pitch) @ np.array([1.0, 0, 0])
    right = np.cross([0, 0, 1.0], back)
    right /= np.linalg.norm(right)
    R_world_camera = np.column_stack([right, np.cross(back, right), back])
    centre = (room.low + room.high) / 2
    eye = centre + AWAY * np.linalg.norm(room.high - room.low) * back
    corners = _seen_from(eye, R_world_camera, room.corners())
    low, high = corners.min(axis=0) - MARGIN, corners.max(axis=0) + MARGIN
    pixel = np.sqrt(np.prod(high - low) / PIXELS)
    columns, rows = np.round((high - low) / pixel).astype(int)
    return Pinhole(eye, R_world_camera, low, high, (int(rows), int(columns)))


def walls_behind(room: Room, camera: Pinhole, rays: Float[ndarray, "n 3"]) -> Walls:
    """Return the points where rays of the camera leave the room."""
    with np.errstate(divide="ignore"):
        ends = (np.where(rays > 0, room.high, room.low) - camera.eye) / rays
        starts = (np.where(rays > 0, room.low, room.high) - camera.eye) / rays
    away_m, axis = ends.min(axis=1), ends.argmin(axis=1)
    face = 2 * axis + (rays[np.arange(len(rays)), axis] > 0)
    return Walls(camera.eye + away_m[:, None] * rays, away_m, np.where(away_m > starts.max(axis=1), face, -1))


def _seen_from(eye: Vector, R_world_camera: Rotation, points_m: Float[ndarray, "n 3"]) -> Float[ndarray, "n 2"]:
    x, y, z = ((points_m - eye) @ R_world_camera).T
    return np.stack([-x / z, -y / z], axis=1)
