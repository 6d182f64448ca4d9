"""Where a check looked: the bodies that its `where` names, and a small picture of the scanner with them in front.

What is named is dark, and shows through what stands before it in a lighter shade; all else is pale. The pictures
read in grey. They are cast like beams, in a parallel projection from where the 3D view of the page starts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from design.arrays import Array
from design.scene import ray_caster
from scanwright.report.data_uri import png_uri

SIZE = 200, 150  # pixels, wide and high
FINER = 2  # rays per pixel and side
YAW_RAD, PITCH_RAD = np.radians(40.0), np.radians(22.0)  # as in scanner.js
MARGIN = 1.04
COLOURS = 32
NAMED, OTHER = np.array([190.0, 60.0, 0.0]), np.array([235.0, 235.0, 232.0])
THROUGH = 0.7  # of the named colour where another body stands before it
SERVO, BEARING = ("servo_case", "servo_horn"), ("bearing_outer", "bearing_inner")
PREFIXES = {"lidar": "lidar_", "slip ring": "ring_"}


@dataclass(frozen=True, slots=True)
class PlacedBody:
    """One body of the scanner as it stands.

    Attributes:
        triangles_m: corners of its triangles [m], shape (t, 3, 3).
        turns: with the axis.
        colour: sRGB, 0 to 1.
    """

    triangles_m: Array
    turns: bool
    colour: tuple[float, ...] = (0.6, 0.6, 0.6)


def bodies_named(where: str, bodies: Mapping[str, PlacedBody], bought: Mapping[str, str]) -> tuple[str, ...]:
    """Names of the bodies that a check's `where` is about, in alphabetical order; none where it is no place.

    Args:
        where: as in `checks.json`: bodies or groups of them, joined by "and".
        bodies: of the scanner.
        bought: by the number of a product what it is, as the parts list has them: lidar, servo, slip ring, bearing.
    """
    found: set[str] = set()
    for word in where.split(" and "):
        kind = bought.get(word, word)
        if word in bodies:
            found.add(word)
        elif kind == "servo":
            found |= set(SERVO) & bodies.keys()
        elif kind == "bearing":
            found |= set(BEARING) & bodies.keys()
        elif word in ("rotor", "everything that turns"):
            found |= {name for name, body in bodies.items() if body.turns}
        elif word == "parts that move together":
            found |= bodies.keys()
        elif kind in PREFIXES or word == "fan" or word.startswith("beams at "):
            prefix = PREFIXES.get(kind, PREFIXES["lidar"])
            found |= {name for name in bodies if name.startswith(prefix)}
    return tuple(sorted(found))


class CheckPictures:
    """Pictures of one scanner, each drawn once."""

    def __init__(self, bodies: Mapping[str, PlacedBody]) -> None:
        self._bodies = bodies
        corners = np.concatenate([body.triangles_m.reshape(-1, 3) for body in bodies.values()])
        self._origins, self._direction = _rays(corners)
        self._nearest, self._shade = self._cast(tuple(bodies))
        self._drawn: dict[tuple[str, ...], str] = {}

    def picture(self, names: tuple[str, ...]) -> str:
        """The scanner with some of its bodies in front, PNG as a data address."""
        if names not in self._drawn:
            self._drawn[names] = self._draw(names)
        return self._drawn[names]

    def _draw(self, names: tuple[str, ...]) -> str:
        nearest, shade = self._cast(names)
        named = np.isfinite(nearest)[:, None]
        front = named & (nearest <= self._nearest + 1e-6)[:, None]
        pale = np.where(np.isfinite(self._nearest)[:, None], self._shade[:, None] * OTHER, 255.0)
        strong = shade[:, None] * NAMED
        colour = np.where(front, strong, np.where(named, THROUGH * strong + (1 - THROUGH) * pale, pale))
        width, height = SIZE
        fine = colour.reshape(height, FINER, width, FINER, 3).mean(axis=(1, 3))
        return png_uri(Image.fromarray(fine.round().astype(np.uint8)).quantize(COLOURS))

    def _cast(self, names: tuple[str, ...]) -> tuple[Array, NDArray[np.float64]]:
        """Distance along each ray to the first of some bodies, inf where there is none, and its brightness 0 to 1."""
        triangles = np.concatenate([self._bodies[name].triangles_m for name in names])
        hits = ray_caster.cast(
            ray_caster.build_scene(triangles), self._origins, np.broadcast_to(self._direction, self._origins.shape)
        )
        return hits.range_m, 0.35 + 0.65 * np.nan_to_num(np.cos(hits.incidence_rad))


def _rays(corners: Array) -> tuple[Array, Array]:
    """Starts of the rays, row after row from the top left, shape (n, 3), and their direction."""
    cy, sy, cp, sp = np.cos(YAW_RAD), np.sin(YAW_RAD), np.cos(PITCH_RAD), np.sin(PITCH_RAD)
    right, up, back = np.array([[-sy, cy, 0], [-cy * sp, -sy * sp, cp], [cy * cp, sy * cp, sp]])
    seen = corners @ np.array([right, up, back]).T
    middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
    half = np.ptp(seen, axis=0) / 2 * MARGIN
    columns, rows = SIZE[0] * FINER, SIZE[1] * FINER
    pixel = 2 * max(half[0] / columns, half[1] / rows)
    x = middle[0] + pixel * (np.arange(columns) - (columns - 1) / 2)
    y = middle[1] - pixel * (np.arange(rows) - (rows - 1) / 2)
    across, high = np.meshgrid(x, y)
    starts = across.reshape(-1, 1) * right + high.reshape(-1, 1) * up + (middle[2] + 2 * half[2] + 0.1) * back
    return starts, -back
