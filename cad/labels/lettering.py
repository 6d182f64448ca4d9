"""Lines of lettering, and their place on a face. Millimetres."""

from dataclasses import dataclass

import numpy as np
import shapely
import shapely.affinity

from scanwright.cad.labels.flats import Flat
from scanwright.cad.labels.glyphs import letters, text_width
from scanwright.design.arrays import Array

LEADING = 1.65  # from line to line, of the height


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
