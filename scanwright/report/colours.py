"""The colours of all pages: a scale for numbers, and bands that double for beam densities."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scanwright.design.arrays import Array

COLOUR_STOPS = (  # dark to light at even steps of lightness: readable in grey and for the colour-blind
    (28, 38, 77),
    (41, 69, 122),
    (46, 110, 143),
    (61, 156, 143),
    (133, 194, 117),
    (212, 217, 92),
    (252, 232, 140),
)
Colours = NDArray[np.uint8]
FEWEST, MOST_BANDS = 5, 7  # beams at the lowest edge of a band, and bands


def ramp(level: Array) -> Colours:
    """Return the colours of levels 0 to 1, shape (n, 3); NaN counts as 0."""
    stops = np.array(COLOUR_STOPS, dtype=float)
    at = np.clip(np.nan_to_num(level), 0, 1) * (len(stops) - 1)
    columns = [np.interp(at, np.arange(len(stops)), stops[:, k]) for k in range(3)]
    return np.stack(columns, axis=1).astype(np.uint8)


@dataclass(frozen=True, slots=True)
class Bands:
    """Bands of beam density whose edges double, so that a step of colour is the same ratio everywhere."""

    edges: tuple[int, ...]

    def __call__(self, density: ArrayLike) -> Array:
        """Return the band of each density as a share of the colour scale, 0 for the lowest, 1 for the highest."""
        return np.searchsorted(self.edges, density, side="right") / len(self.edges)

    def colours(self, density: ArrayLike) -> Colours:
        """Return the colour of each density."""
        shades = ramp(np.linspace(0, 1, len(self.edges) + 1))
        return shades[np.searchsorted(self.edges, density, side="right")]

    def key(self) -> list[tuple[str, str]]:
        """Return the colour of each band and the fewest beams in it, the lowest first."""
        words = [f"<{self.edges[0]}", *map(str, self.edges)]
        colours = self.colours([0, *self.edges])
        return [("#" + bytes(colour).hex(), word) for colour, word in zip(colours, words, strict=True)]


def bands_to(highest: float) -> Bands:
    """Return the bands up to a density: the edges are `FEWEST` times powers of 2."""
    top = max(0, int(np.log2(max(highest, FEWEST) / FEWEST)))
    return Bands(tuple(FEWEST * 2**power for power in range(max(0, top - MOST_BANDS + 2), top + 1)))
