"""The room about a scanner in square tiles, coloured by beam density in bands with factors of two."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import viser
from jaxtyping import Bool, Float, UInt32
from numpy import ndarray

from scanwright.design.arrays import Array
from scanwright.design.evaluation.coverage import UNSEEN
from scanwright.report.colours import Bands, Colours, ramp
from scanwright.report.room import Room

AMBIENT, LAMP, LAMP_M = np.pi, 0.7, (1.0, 0.6, 2.0)  # three.js: a body has its own colour at intensity pi
ACES_IN = np.array([[0.59719, 0.35458, 0.04823], [0.076, 0.90834, 0.01566], [0.0284, 0.13383, 0.83777]])
ACES_OUT = np.array([[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]])
TILES = 5_000  # approximately; with more, a browser without a graphics card draws fewer than ten frames a second
BLIND = (236, 236, 240)  # colour of blind directions: a grey that is not in the scale
OVERLAP = 1.06  # of the tiles, to hide gaps
INWARD = (  # quaternion w, x, y, z that turns +z into the room, for the low and the high wall across each axis
    (np.sqrt(0.5), 0, np.sqrt(0.5), 0),
    (np.sqrt(0.5), 0, -np.sqrt(0.5), 0),
    (np.sqrt(0.5), -np.sqrt(0.5), 0, 0),
    (np.sqrt(0.5), np.sqrt(0.5), 0, 0),
    (1, 0, 0, 0),
    (0, 1, 0, 0),
)


@dataclass(frozen=True, slots=True)
class RoomTiles:
    """Square tiles of one size on floor, walls and ceiling, with the front towards the room.

    Attributes:
        middles_m: centres of the tiles relative to the optical centre.
        corners_m: corners of a tile relative to its centre, front to +z.
        faces: triangles of a tile.
        wxyz: quaternion of each tile, which turns +z into the room.
    """

    middles_m: Float[ndarray, "n 3"]
    corners_m: Float[ndarray, "4 3"]
    faces: UInt32[ndarray, "2 3"]
    wxyz: Float[ndarray, "n 4"]

    def where(self, some: Bool[ndarray, " n"]) -> RoomTiles:
        """Return some of the tiles."""
        return replace(self, middles_m=self.middles_m[some], wxyz=self.wxyz[some])

    @property
    def normals(self) -> Float[ndarray, "n 3"]:
        """Unit vectors from the tiles into the room."""
        w, x, y, _ = self.wxyz.T  # no rotation about z
        return np.stack([2 * w * y, -2 * w * x, 1 - 2 * x**2 - 2 * y**2], axis=1)

    @property
    def directions(self) -> Float[ndarray, "n 3"]:
        """Unit vectors from the optical centre to the tiles."""
        return np.asarray(self.middles_m / np.linalg.norm(self.middles_m, axis=1, keepdims=True))


def density_colours(density: Float[ndarray, " n"], bands: Bands) -> Colours:
    """Return the colours of mean densities, shape (n, 3); `BLIND` for 0."""
    return np.where(density[:, None] > UNSEEN, ramp(bands(density)), np.array(BLIND, np.uint8))


def lit(scene: viser.SceneApi) -> None:
    """Set the lights of a scene that `unlit` assumes."""
    scene.configure_default_lights(enabled=False, cast_shadow=False)
    scene.configure_environment_map(None)  # the browser shows a pale picture until it is loaded
    scene.add_light_ambient("/light/all", intensity=AMBIENT)
    scene.add_light_directional("/light/above", intensity=LAMP, position=LAMP_M, cast_shadow=False)


def unlit(colours: Colours, normals: Array) -> Colours:
    """Return colours of tiles that appear as in the colour key, whatever their orientation.

    This is the inverse of the lighting of the page and of the tone mapping of three.js (ACESFilmicToneMapping).
    """
    c = colours / 255.0
    shown = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4) @ np.linalg.inv(ACES_OUT).T
    square, single, rest = 1 - 0.983729 * shown, 0.0245786 - 0.432951 * shown, -0.000090537 - 0.238081 * shown
    film = (-single + np.sqrt(single**2 - 4 * square * rest)) / (2 * square)
    linear = 0.6 * film @ np.linalg.inv(ACES_IN).T
    lit = AMBIENT + LAMP * np.maximum(0, normals @ np.array(LAMP_M) / np.linalg.norm(LAMP_M))
    return np.round(255 * np.clip(linear * AMBIENT / lit[:, None], 0, 1)).astype(np.uint8)


def room_tiles(room: Room) -> RoomTiles:
    """Return tiles that cover all walls exactly; to fit, the rows overlap."""
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
    """Return the centres of tiles between two walls."""
    count = max(1, int(np.ceil((high - low) / side)))
    return np.linspace(low + side / 2, high - side / 2, count) if high - low > side else np.array([(low + high) / 2])
