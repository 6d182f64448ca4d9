"""The maps of the report: densities, each one picture of all directions.

A map is unrolled: theta from up to down, phi from -180 to 180 deg, so that its middle is ahead.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import binary_dilation, gaussian_filter

from scanwright.design.angles import AngleSet
from scanwright.design.arrays import Array
from scanwright.design.evaluation.coverage import UNSEEN, mean_density_at
from scanwright.design.objective.problem import Problem
from scanwright.design.search.mounts.reference import TunedMount
from scanwright.design.self_occlusion import SelfOcclusion
from scanwright.report.answer import mounting_rad
from scanwright.report.build_files import png_uri
from scanwright.report.colours import Bands, bands_to, ramp

STEP_DEG = 0.5  # of a cell: two pixels of the ball on a wide page
SMOOTH_CELLS = 1.5  # standard deviation, less than the ball: else an edge of a band follows single scan lines
DENSEST = 0.995  # of the sphere is not denser than the highest edge or twice of it: the rest lies about the axis
# the palette: shades of the map, then what is no shade
SHADES = 250
OUTLINE, HALO, MASKED, HATCH, NOTHING = range(SHADES, SHADES + 5)
PLAIN = [(17, 17, 17), (255, 255, 255), (221, 221, 221), (119, 119, 119), (255, 255, 255)]
HATCH_CELLS = 12  # period of the hatching
MOST_LEVELS = 8  # of the weight with an outline each
NOWHERE = 1e-3  # a mean direction shorter than this is none

Indices = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class SphereMap:
    """One picture of the sphere."""

    title: str
    picture: str


@dataclass(frozen=True, slots=True)
class DensitySphere:
    """The pictures of one build."""

    maps: tuple[SphereMap, ...]  # at least one
    bands: Bands  # colour scale of the density maps
    middle: tuple[float, ...]  # mean direction of the weight, of length 1; (0, 0, 0) if it is all around
    below: float  # share of the weight below the horizon


def density_sphere(
    problem: Problem,
    angles: AngleSet,
    mounts: Iterable[TunedMount],
    shadow: SelfOcclusion | None = None,
) -> DensitySphere:
    """Draw the density of the scanner, without the beams that `shadow` blocks, and of the mounts, on one scale.

    Raises:
        BuildError: the shadow is of another number of beams.
    """
    setting = mounting_rad(angles)
    directions, shape = _directions()
    weight = problem.field.weight_at(directions).reshape(shape)
    masked = problem.field.masked_at(directions).reshape(shape)
    own = f"this scanner, {'without' if shadow is None else 'with'} parts"
    densities = {own: mean_density_at(problem, setting, directions, shadow)}
    for mount in mounts:
        densities[f"{mount.name}, without parts"] = mean_density_at(problem, mount.angles_rad, directions)
    area, order = np.sqrt(1 - directions[:, 2] ** 2), densities[own].argsort()
    bands = bands_to(densities[own][order][np.searchsorted(area[order].cumsum(), DENSEST * area.sum())])
    maps = [
        SphereMap(f"density of {name}", _picture(_shades(density.reshape(shape), bands), weight, masked))
        for name, density in densities.items()
    ]
    counts = weight.ravel() * area
    middle = counts @ directions / max(float(counts.sum()), 1e-12)
    length = float(np.linalg.norm(middle))
    middle *= (length > NOWHERE) / max(length, NOWHERE)
    below = float(counts[directions[:, 2] < 0].sum() / max(float(counts.sum()), 1e-12))
    return DensitySphere(tuple(maps), bands, tuple(middle.round(6).tolist()), below)


def _directions() -> tuple[Array, tuple[int, int]]:
    """Return unit vectors of the cells of a picture, shape (n, 3), and its rows and columns."""
    theta = np.radians(np.arange(STEP_DEG / 2, 180, STEP_DEG))
    phi = np.radians(np.arange(-180 + STEP_DEG / 2, 180, STEP_DEG))
    t, p = np.meshgrid(theta, phi, indexing="ij")
    return np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1).reshape(-1, 3), t.shape


def _shades(density: Array, bands: Bands) -> Indices:
    """Return palette entries of densities, smoothed among the directions that are seen."""
    seen = density > UNSEEN
    total, share = (gaussian_filter(each, SMOOTH_CELLS, mode=("nearest", "wrap")) for each in (density, seen * 1.0))
    shade = (SHADES - 1) * bands(total / np.maximum(share, UNSEEN))
    return np.where(seen, shade, NOTHING).astype(np.uint8)


def _picture(shades: Indices, weight: Array, masked: NDArray[np.bool_]) -> str:
    """Return a map with hatched masks, and a dark line on a bright one where the weight changes."""
    row, column = np.indices(shades.shape)
    hatch = (row + column) % HATCH_CELLS < HATCH_CELLS // 4
    out = np.where(masked, np.where(hatch, HATCH, MASKED), shades).astype(np.uint8)
    if len(np.unique(weight)) > MOST_LEVELS:  # a map: its outline
        weight = weight > 0
    edge = (weight != np.roll(weight, 1, axis=1)) | (weight != np.vstack([weight[:1], weight[:-1]]))
    wider = binary_dilation(np.pad(edge, ((0, 0), (1, 1)), mode="wrap"), np.ones((3, 3)))[:, 1:-1]
    out[wider & ~masked] = HALO
    out[edge & ~masked] = OUTLINE
    image = Image.fromarray(out)
    image.putpalette(
        [*ramp(np.linspace(0, 1, SHADES)).ravel().tolist(), *(part for colour in PLAIN for part in colour)]
    )
    return png_uri(image)
