"""Bodies painted by their distances, each with a dark edge: the pictures of steps and plates.

`design/scene/parallel_view.py` casts the pixels, as for the pictures of the checks in the report.
"""

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image

from scanwright.design.arrays import Array, Vector
from scanwright.design.scene.parallel_view import ParallelView
from scanwright.design.scene.ray_caster import Scene

EDGE = 0.45  # of a body's colour, at its outline
STEP_M = 0.0015  # between two distances that are an edge
COLOURS = 48


@dataclass(frozen=True, slots=True)
class Piece:
    """Something to draw."""

    scene: Scene  # its triangles
    moved_m: Vector  # displacement
    colour: Array  # sRGB, 0 to 255


def painted(view: ParallelView, pieces: Sequence[Piece]) -> Image.Image:
    """Draw the bodies by their distances, each with a dark edge."""
    columns, rows = view.size
    away = np.full(columns * rows, np.inf)
    which = np.full(columns * rows, -1)
    colour = np.full((columns * rows, 3), 255.0)
    for i, piece in enumerate(pieces):
        shown = view.shown(piece.scene, piece.moved_m)
        front = shown.away_m < away
        away[front], which[front] = shown.away_m[front], i
        colour[front] = shown.brightness[front, None] * piece.colour
    edge = _edges(np.where(np.isfinite(away), away, 1e3).reshape(rows, columns), which.reshape(rows, columns))
    colour[edge.reshape(-1)] *= EDGE
    return Image.fromarray(colour.reshape(rows, columns, 3).round().astype(np.uint8))


def _edges(away: Array, which: Array) -> Array:
    """Return the pixels of a nearer body at the border to another one, or to a farther piece of itself."""
    edge = np.zeros(away.shape, bool)
    for axis in (0, 1):
        for turn in (1, -1):
            other = np.roll(away, turn, axis)
            apart = (np.roll(which, turn, axis) != which) | (other - away > STEP_M)
            edge |= apart & (away < other) & (which >= 0)
    return edge


def rod(start: Vector, along: Vector, radius: float, length: float, sides: int) -> Array:
    """Return a closed prism about an axis: triangles, shape (4 sides, 3, 3), in the unit of `start`."""
    helper = np.eye(3)[int(np.argmin(np.abs(along)))]
    x = np.cross(helper, along)
    x /= np.linalg.norm(x)
    turn = 2 * math.pi * np.arange(sides) / sides
    near = start + radius * (np.cos(turn)[:, None] * x + np.sin(turn)[:, None] * np.cross(along, x))
    far, after = near + length * along, np.roll(np.arange(sides), -1)
    middle = [np.broadcast_to(start, near.shape), np.broadcast_to(start + length * along, near.shape)]
    fans = [(near, near[after], far[after]), (near, far[after], far), (near, near[after], middle[0])]
    return np.concatenate([np.stack(fan, axis=1) for fan in (*fans, (far, far[after], middle[1]))])


def png_bytes(image: Image.Image) -> bytes:
    """Return the file of a picture, in few colours."""
    file = io.BytesIO()
    image.quantize(COLOURS).save(file, "PNG")
    return file.getvalue()
