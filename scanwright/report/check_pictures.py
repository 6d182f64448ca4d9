"""The bodies that a check is about, and a small picture of the scanner with them in front.

Named bodies are dark, in a lighter shade behind other bodies; all others are pale. The view is that of the page.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from PIL import Image

from scanwright.design.arrays import Array
from scanwright.design.scene.parallel_view import Shown, in_front, view_of
from scanwright.design.scene.ray_caster import Scene
from scanwright.report.build_files import png_uri

SIZE_PX = 200, 150  # pixels, wide and high
STILL_PX = 720, 480
FINER = 2  # rays per pixel and side
YAW_RAD, PITCH_RAD = np.radians(40.0), np.radians(22.0)  # as in stage.js
MARGIN = 1.04
COLOURS = 32
NAMED, OTHER = np.array([190.0, 60.0, 0.0]), np.array([235.0, 235.0, 232.0])
THROUGH = 0.7  # of the named colour if another body is before it
LIDAR = "lidar"
BEAM_CODES = ("beams_hidden", "beams_partly_hidden")  # their subject is a range of beams
PREFIXES = {LIDAR: ("lidar_",), "slip ring": ("ring_",), "servo": ("servo_case", "servo_horn")}
PREFIXES["bearing"] = ("bearing_outer", "bearing_inner")


@dataclass(frozen=True, slots=True)
class PlacedBody:
    """One body of the scanner in its place."""

    scene: Scene  # its triangles, for every picture
    turns: bool  # whether it turns with the axis
    colour: tuple[float, ...] = (0.6, 0.6, 0.6)  # sRGB, 0 to 1


def bodies_named(
    code: str, subject: str, bodies: Mapping[str, PlacedBody], bought: Mapping[str, str]
) -> tuple[str, ...]:
    """Return the bodies that a check is about, in alphabetical order."""
    names: set[str] = set()
    for word in [LIDAR] if code in BEAM_CODES else subject.split(" and "):
        kind = bought.get(word, word)
        if word in bodies:
            names.add(word)
        elif word in ("rotor", "everything that turns"):
            names |= {name for name, body in bodies.items() if body.turns}
        elif word == "parts that move together":
            names |= bodies.keys()
        else:
            names |= {name for name in bodies if name.startswith(PREFIXES.get(kind, ()))}
    return tuple(sorted(names))


def still(bodies: Mapping[str, PlacedBody]) -> str:
    """Return a picture of the scanner in its colours, PNG as a data address: for a page that cannot draw in 3D."""
    each = _shown(bodies, STILL_PX)
    first_m, colour = in_front(list(each.values())).away_m, np.full((STILL_PX[0] * STILL_PX[1], 3), 255.0)
    for name, shown in each.items():
        front = np.isfinite(first_m) & (shown.away_m <= first_m + 1e-6)
        colour[front] = 255 * shown.brightness[front, None] * np.array(bodies[name].colour)
    return _png(colour.reshape(STILL_PX[1], STILL_PX[0], 3))


class CheckPictures:
    """Pictures of one scanner, each drawn once."""

    def __init__(self, bodies: Mapping[str, PlacedBody]) -> None:
        self._each = _shown(bodies, (SIZE_PX[0] * FINER, SIZE_PX[1] * FINER))
        self._all = in_front(list(self._each.values()))
        self._drawn: dict[tuple[str, ...], str] = {}

    def picture(self, names: tuple[str, ...]) -> str:
        """Return the scanner with some of its bodies in front, PNG as a data address."""
        if names not in self._drawn:
            self._drawn[names] = self._draw(names)
        return self._drawn[names]

    def _draw(self, names: tuple[str, ...]) -> str:
        shown = in_front([self._each[name] for name in names])
        named = np.isfinite(shown.away_m)[:, None]
        front = named & (shown.away_m <= self._all.away_m + 1e-6)[:, None]
        pale = np.where(np.isfinite(self._all.away_m)[:, None], self._all.brightness[:, None] * OTHER, 255.0)
        strong = shown.brightness[:, None] * NAMED
        colour = np.where(front, strong, np.where(named, THROUGH * strong + (1 - THROUGH) * pale, pale))
        width, height = SIZE_PX
        return _png(colour.reshape(height, FINER, width, FINER, 3).mean(axis=(1, 3)))


def _shown(bodies: Mapping[str, PlacedBody], size_px: tuple[int, int]) -> dict[str, Shown]:
    corners = np.concatenate([body.scene.triangles_m.reshape(-1, 3) for body in bodies.values()])
    view = view_of(corners, size_px, YAW_RAD, PITCH_RAD, MARGIN)
    return {name: view.shown(body.scene) for name, body in bodies.items()}


def _png(colour: Array) -> str:
    return png_uri(Image.fromarray(colour.round().astype(np.uint8)).quantize(COLOURS))
