"""The room about a scanner: the floor, walls and ceiling that the pages colour by beam density."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from scanwright.design.arrays import Vector
from scanwright.design.task.shapes import CeilingRegion, OnPlane
from scanwright.design.task.task import Task

HEIGHT_M, CEILING_M, REACH_M, BEHIND_M = 1.0, 2.5, 2.0, 1.0  # of a room that the task does not describe: a usual one
UPRIGHT = 0.05  # a middle less far from the vertical has no heading
AZIMUTH_DEG, ABOVE_DEG = 35.0, 28.0  # of the camera behind the scanner: three walls are in view
LITTLE = 0.02  # share of the weight below the horizon, under which the camera looks through the floor
HEADROOM_M = 0.4  # at least, from the scanner to the ceiling


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

    Args:
        room: about the scanner.
        centre_m: optical centre in the world [m].
        middle: mean direction of the weight.
        below: share of the weight below the horizon.
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
