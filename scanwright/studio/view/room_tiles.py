"""The room about the scanner in square tiles, which take the same colours as those of the sphere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt32
from numpy import ndarray

from scanwright.design.arrays import Array
from scanwright.report.cut_room import Room

TILES = 5_000  # about; as many as the sphere has
OVERLAP = 1.06  # of the tiles, so that no seam shows
INWARD = (  # w, x, y, z of what turns +z into the room, for the low and the high wall across each axis
    (np.sqrt(0.5), 0, np.sqrt(0.5), 0),
    (np.sqrt(0.5), 0, -np.sqrt(0.5), 0),
    (np.sqrt(0.5), -np.sqrt(0.5), 0, 0),
    (np.sqrt(0.5), np.sqrt(0.5), 0, 0),
    (1, 0, 0, 0),
    (0, 1, 0, 0),
)


@dataclass(frozen=True, slots=True)
class RoomTiles:
    """Square tiles of one size on floor, walls and ceiling, whose front looks into the room.

    Attributes:
        middles_m: of the tiles, from the optical centre, shape (n, 3).
        corners_m: of one about its middle, front to +z, shape (4, 3).
        faces: its triangles, shape (2, 3).
        wxyz: what turns +z to the room, shape (n, 4).
    """

    middles_m: Float[ndarray, "n 3"]
    corners_m: Float[ndarray, "4 3"]
    faces: UInt32[ndarray, "2 3"]
    wxyz: Float[ndarray, "n 4"]

    @property
    def normals(self) -> Float[ndarray, "n 3"]:
        """Unit vectors from the tiles into the room."""
        w, x, y, _ = self.wxyz.T  # nothing turns about z
        return np.stack([2 * w * y, -2 * w * x, 1 - 2 * x**2 - 2 * y**2], axis=1)

    @property
    def directions(self) -> Float[ndarray, "n 3"]:
        """Unit vectors from the optical centre to the tiles."""
        return np.asarray(self.middles_m / np.linalg.norm(self.middles_m, axis=1, keepdims=True))


def room_tiles(room: Room) -> RoomTiles:
    """Lay them; they end where a wall does, so those of the last row overlap the most."""
    size = room.high - room.low
    area = 2 * (size[0] * size[1] + size[1] * size[2] + size[2] * size[0])
    side = float(np.sqrt(area / TILES))
    middles, wxyz = [], []
    for wall, turn in enumerate(INWARD):
        axis, end = divmod(wall, 2)
        rows = [_row(room.low[k], room.high[k], side) for k in range(3)]
        rows[axis] = (room.high if end else room.low)[[axis]]
        grid = np.stack(np.meshgrid(*rows, indexing="ij"), axis=-1).reshape(-1, 3)
        middles.append(grid)
        wxyz.append(np.tile(np.array(turn, dtype=float), (len(grid), 1)))
    half = side / 2 * OVERLAP
    corners = half * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    return RoomTiles(np.concatenate(middles), corners, faces, np.concatenate(wxyz))


def _row(low: float, high: float, side: float) -> Array:
    """Middles of tiles between two walls."""
    count = max(1, int(np.ceil((high - low) / side)))
    return np.linspace(low + side / 2, high - side / 2, count) if high - low > side else np.array([(low + high) / 2])
