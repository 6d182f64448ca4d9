"""The walls about a scanner as pictures of beam density, in bands with factors of two."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import viser
import viser.transforms
from jaxtyping import Float
from numpy import ndarray
from scipy.sparse import csr_array

from scanwright.design.arrays import Array
from scanwright.design.evaluation.coverage import UNSEEN
from scanwright.report.colours import Bands, Colours
from scanwright.report.room import Room

NODES = 5_000  # approximately, at which the density is known; more would delay the picture
FINER = 3  # pixels per node and side
SMOOTH = 0.7  # standard deviation in nodes: otherwise the edge of a band follows single scan lines
BLIND = (236, 236, 240)  # colour of blind directions: a grey that is not in the scale
EDGE = (96, 104, 116)  # colour of the edges of the room: without them it looks flat
AMBIENT, LAMP, LAMP_M = np.pi, 0.7, (1.0, 0.6, 2.0)  # three.js: a body has its own colour at intensity pi


@dataclass(frozen=True, slots=True)
class WallPicture:
    """One picture; `rows` and `columns` interpolate between its nodes."""

    handle: viser.ImageHandle
    rows: csr_array
    columns: csr_array

    def finer(self, values: Float[ndarray, " n"]) -> Float[ndarray, "height width"]:
        """Return values at the pixels from those at the nodes."""
        return (self.columns @ (self.rows @ values.reshape(self.rows.shape[1], -1)).T).T


class DensityRoom:
    """Floor, walls and ceiling; `wall_pictures.js` hides those between the camera and the room.

    Attributes:
        directions: from the optical centre to the nodes, shape (n, 3).
        walls: of the room.
    """

    def __init__(self, scene: viser.SceneApi, room: Room, centre_m: Array | None = None) -> None:
        """`centre_m` is the optical centre in the world; the origin if it is None."""
        self.frame = scene.add_frame("/room", show_axes=False, position=np.zeros(3) if centre_m is None else centre_m)
        size, middle = room.high - room.low, (room.low + room.high) / 2
        side = np.sqrt(2 * (size * np.roll(size, 1)).sum() / NODES)
        self.walls, nodes = list[WallPicture](), []
        for axis, sign in ((axis, sign) for axis in range(3) for sign in (-1, 1)):
            right = np.eye(3)[(axis + 1) % 3]
            z = sign * np.eye(3)[axis]  # a picture is seen from its -z side
            R = np.column_stack([right, np.cross(z, right), z])
            width, height = size[(axis + 1) % 3], size[(axis + 2) % 3]
            columns, rows = (np.linspace(-0.5, 0.5, int(np.ceil(length / side)) + 1) for length in (width, height))
            at = middle + z * size[axis] / 2
            grid = np.stack(np.meshgrid(columns * width, rows * height, [0.0]), axis=-1).reshape(-1, 3)
            nodes.append(grid @ R.T + at)
            handle = scene.add_image(
                f"/room/{len(self.walls)}",
                np.zeros((2, 2, 4), np.uint8),  # transparent until it is known
                width,
                height,
                format="png",
                wxyz=viser.transforms.SO3.from_matrix(R).wxyz,
                position=at,
                cast_shadow=False,
                receive_shadow=False,
            )
            self.walls.append(WallPicture(handle, _finer(len(rows)), _finer(len(columns))))
        points = np.concatenate(nodes)
        self.directions = points / np.linalg.norm(points, axis=1, keepdims=True)
        self._ends = np.cumsum([0, *map(len, nodes)])

    def colour(self, density: Float[ndarray, " n"], bands: Bands, opacity: Array | None = None) -> None:
        """Show the densities at the nodes, and how opaque the walls are there."""
        seen = (density > UNSEEN) * 1.0
        for k, wall in enumerate(self.walls):
            part = slice(self._ends[k], self._ends[k + 1])
            shown = wall.finer(density[part])
            if not seen[part].all():
                share = wall.finer(seen[part])
                shown = np.where(share < 0.5, 0.0, shown / np.maximum(share, UNSEEN))
            image = density_colours(shown, bands)
            image[[0, -1]] = image[:, [0, -1]] = EDGE
            if opacity is not None:
                image = np.dstack([image, np.round(255 * wall.finer(opacity[part])).astype(np.uint8)])
            wall.handle.image = image


def density_colours(density: Float[ndarray, "*n"], bands: Bands) -> Colours:
    """Return the colours of mean densities, shape (..., 3); `BLIND` for 0."""
    colours = bands.colours(density)
    colours[density <= UNSEEN] = BLIND
    return colours


def lit(scene: viser.SceneApi) -> None:
    """Set the lights of a scene: bodies in their own colours, brighter from above."""
    scene.configure_default_lights(enabled=False, cast_shadow=False)
    scene.configure_environment_map(None)  # the browser shows a pale picture until it is loaded
    scene.add_light_ambient("/light/all", intensity=AMBIENT)
    scene.add_light_directional("/light/above", intensity=LAMP, position=LAMP_M, cast_shadow=False)


def _finer(nodes: int) -> csr_array:
    """Return weights of nodes in a row for pixels in the row, from end to end."""
    away = np.linspace(0, nodes - 1, FINER * nodes)[:, None] - np.arange(nodes)
    weights = np.exp(-((away / SMOOTH) ** 2) / 2) * (abs(away) < 3 * SMOOTH)
    return csr_array(weights / weights.sum(axis=1, keepdims=True))
