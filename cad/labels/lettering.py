"""Lines of engraved letters of straight strokes, and their place on a face. Millimetres.

Without a font file, the same text is the same groove on every machine. A glyph is a list of chains on a grid 4 wide and
6 high.
"""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
import shapely.affinity

from scanwright.cad.labels.engrave import Flat
from scanwright.design.arrays import Array

LEADING = 1.65  # from line to line, of the height
ADVANCE = 6.0  # grid units from glyph to glyph

# Each chain is a run of grid points, x then y, chains parted by a space.
GLYPHS = {
    "0": "0006464000",
    "1": "152620 1030",
    "2": "064643030040",
    "3": "06464000 0343",
    "4": "060343 4640",
    "5": "460603434000",
    "6": "460600404303",
    "7": "064620",
    "8": "0006464000 0343",
    "9": "004046060343",
    "A": "0004264440 0242",
    "B": "00063645443303 3342413000",
    "C": "46060040",
    "D": "00062644422000",
    "E": "46060040 0333",
    "F": "460600 0333",
    "G": "460600404323",
    "H": "0006 4046 0343",
    "I": "2026 1030 1636",
    "J": "4641301001",
    "K": "0006 460340",
    "L": "060040",
    "M": "0006234640",
    "N": "00064046",
    "O": "0006464000",
    "P": "0006464303",
    "Q": "0006464000 2240",
    "R": "0006464303 2340",
    "S": "460603434000",
    "T": "0646 2620",
    "U": "06004046",
    "V": "062046",
    "W": "0610243046",
    "X": "0046 0640",
    "Y": "062346 2320",
    "Z": "06460040",
    ".": "2021",
    "-": "0343",
    "+": "0343 2125",
    "_": "0040",
    "/": "0046",
    " ": "",
}


def text_width(text: str, height: float) -> float:
    """Return the length of a line of text [mm]."""
    return (len(text) * ADVANCE - (ADVANCE - 4)) * height / 6 if text else 0.0


def letters(text: str, height: float, stroke: float) -> list[shapely.Polygon]:
    """Return outlines of one line of text, origin at its lower left corner; strokes that meet are one outline.

    The height [mm] of capitals is that to the middle of their strokes; a sign without a glyph is a blank.
    """
    unit = height / 6
    strokes = []
    for i, letter in enumerate(text.upper()):
        origin = np.array([i * ADVANCE * unit, 0.0])
        for chain in GLYPHS.get(letter, "").split():
            points = [origin + unit * np.array([int(chain[k]), int(chain[k + 1])]) for k in range(0, len(chain), 2)]
            strokes += [shapely.Polygon(_outline(a, b, stroke)) for a, b in pairwise(points)]
    joined = shapely.normalize(shapely.union_all(strokes, grid_size=1e-6))
    return [part for part in shapely.get_parts(joined) if part.area > 0]


def _outline(start: Array, end: Array, stroke: float) -> Array:
    along = (end - start) / math.dist(start, end)
    half = stroke / 2
    side, over = half * np.array([-along[1], along[0]]), half * along
    return np.stack([start - over - side, end + over - side, end + over + side, start - over + side])


@dataclass(frozen=True, slots=True)
class Lettering:
    """Lettering, its origin at the lower left corner of its last line."""

    lines: tuple[str, ...]
    height: float

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of all lines."""
        width = max(text_width(line, self.height) for line in self.lines)
        return width, self.height * (1 + LEADING * (len(self.lines) - 1))

    def outlines(self, stroke: float) -> list[shapely.Polygon]:
        """Return outlines of its grooves, about its origin."""
        return [
            shapely.affinity.translate(letter, 0.0, LEADING * self.height * i)
            for i, line in enumerate(reversed(self.lines))
            for letter in letters(line, self.height, stroke)
        ]


@dataclass(frozen=True, slots=True)
class Place:
    """The place of lettering on a face: its axes are the columns of `turn` (2, 2), its origin is at (x, y)."""

    flat: Flat
    x: float
    y: float
    turn: Array

    def put(self, points: Array) -> Array:
        """Return points of the lettering, shape (n, 2), in the axes of the face."""
        return np.asarray(points @ self.turn.T + [self.x, self.y])

    def outlines(self, lines: Lettering, stroke: float) -> list[shapely.Polygon]:
        """Return outlines of the grooves of some lines, in the axes of the face."""
        return [shapely.transform(outline, self.put) for outline in lines.outlines(stroke)]
