"""Probability to hit a thin upright pole, which scan lines parallel to it can miss (paper, Fig. 3).

The middle of the pole is at the height of the optical centre. It covers the azimuths within `asin(width / (2 range))`
of its own and the elevations within `atan(height / (2 range))` of the horizon; beams have no width. For one simulated
scan the poles with at least n beams form a union of intervals of azimuth, one for every n successive hits, so only the
start phase is drawn.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scanwright.design.arrays import Array, Setting
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.density.beams import scan_at
from scanwright.design.errors import TaskError
from scanwright.design.objective.problem import Problem

BEAMS = 1, 3  # required beams: a hit, and more than a stray point
PHASES = 24
CELLS = 18_000  # of azimuth, for the weights
HEIGHTS = 9  # elevations at which the weight of a pole is evaluated
SEED = 0


@dataclass(frozen=True, slots=True)
class Pole:
    """An upright pole, its middle at the height of the optical centre, and its range.

    Raises:
        TaskError: a number is not above 0, or the scanner would be inside the pole.
    """

    width_m: float
    height_m: float
    range_m: float

    def __post_init__(self) -> None:
        for name in ("width_m", "height_m", "range_m"):
            if not 0 < getattr(self, name) < np.inf:
                raise TaskError(f"pole: {name} = {getattr(self, name):g}: must be above 0")
        if self.width_m >= 2 * self.range_m:
            raise TaskError(f"pole: width_m = {self.width_m:g}: the scanner would be inside the pole")

    @property
    def half_width_rad(self) -> float:
        """Azimuth from its middle to its edge."""
        return float(np.arcsin(self.width_m / (2 * self.range_m)))

    @property
    def half_height_rad(self) -> float:
        """Elevation of its upper end."""
        return float(np.arctan(self.height_m / (2 * self.range_m)))


@dataclass(frozen=True, slots=True)
class Chance:
    """Probability that a pole gets at least `beams` beams in one full scan, over its azimuth and the start phase."""

    beams: int  # required number of beams
    chance: float  # probability, 0 to 1
    error: float  # four standard errors of the mean over start phases, and the width of a cell of azimuth


@dataclass(frozen=True, slots=True)
class PoleChances:
    """Probability of hitting a pole with one mount."""

    chances: tuple[Chance, ...]  # for each of `BEAMS`
    # distribution of the azimuth of the pole: "weighted" by the weight of the task; or "unmasked", uniform outside the
    # masks, if the region does not contain any of the pole
    stands: str


def require_in_range(pole: Pole, lidar: Lidar) -> None:
    """Reject a pole that the lidar cannot measure.

    Raises:
        TaskError: it is too near or too far away.
    """
    low, high = lidar.range_min_mm / 1000, lidar.practical_range_m
    if not low <= pole.range_m <= high:
        raise TaskError(f"pole: range_m = {pole.range_m:g}: {lidar.name} measures from {low:g} to {high:g} m")


def pole_chances(problem: Problem, angles_rad: Setting, pole: Pole) -> PoleChances:
    """Return the probability of (alpha_rot, beta_rot, alpha_laser, beta_laser) [rad] to hit a pole.

    Raises:
        TaskError: the robot hides every azimuth.
    """
    weights, distribution = _azimuth_weights(problem, pole)
    total = float(weights.sum())
    if not total > 0:
        raise TaskError("pole: the robot hides every azimuth at that height; choose a higher or a farther pole")
    below = np.concatenate([[0.0], np.cumsum(weights)]) / total
    rng = np.random.default_rng(SEED)
    per_phase = []
    for i in range(PHASES):
        azimuths = _hits(problem, angles_rad, pole, (i + rng.random()) / PHASES, rng)
        need = [-(-beams // problem.lines.repeats) for beams in BEAMS]  # each line is measured `repeats` times
        per_phase.append([_share(azimuths, n, pole.half_width_rad, below) for n in need])
    shares = np.array(per_phase)
    cell = 1 / np.count_nonzero(weights)
    errors = 4 * shares.std(axis=0, ddof=1) / PHASES**0.5 + cell
    chances = [Chance(n, float(p), float(e)) for n, p, e in zip(BEAMS, shares.mean(axis=0), errors, strict=True)]
    return PoleChances(tuple(chances), distribution)


def _azimuth_weights(problem: Problem, pole: Pole) -> tuple[Array, str]:
    """Return the relative probability of a pole in each cell of azimuth from -pi, and the distribution's name."""
    azimuth = -np.pi + 2 * np.pi * (np.arange(CELLS) + 0.5) / CELLS
    elevation = pole.half_height_rad * ((np.arange(HEIGHTS) + 0.5) * 2 / HEIGHTS - 1)
    p, e = (grid.ravel() for grid in np.meshgrid(azimuth, elevation, indexing="ij"))
    directions = np.stack([np.cos(e) * np.cos(p), np.cos(e) * np.sin(p), np.sin(e)], axis=1)
    weights = problem.field.weight_at(directions).reshape(CELLS, HEIGHTS).mean(axis=1)
    if weights.any():
        return weights, "weighted"
    return 1.0 - problem.field.masked_at(directions).reshape(CELLS, HEIGHTS).mean(axis=1), "unmasked"


def _hits(problem: Problem, angles_rad: Setting, pole: Pole, start: float, rng: np.random.Generator) -> Array:
    """Return the sorted azimuths, -pi to pi, of the unmasked beams of one scan within the height of the pole."""
    if problem.sweep is not None:
        joint = problem.sweep.angles_rad(start)
    else:  # a start anywhere in the turn: between two lines by `start`, and at any of them
        joint = problem.lines.angles_rad + problem.lines.step_rad * (start + rng.integers(problem.lines.count))
    beams = scan_at(problem.bearings_rad, joint, angles_rad, problem.lever)
    level = beams[np.abs(beams[:, 2]) <= np.sin(pole.half_height_rad)]
    seen = level[~problem.field.masked_at(level)]
    return np.sort(np.arctan2(seen[:, 1], seen[:, 0]))


def _share(azimuths: Array, beams: int, half_rad: float, below: Array) -> float:
    """Return the share of the poles within `half_rad` of at least `beams` hits; `below` cumulates it over the cells."""
    if len(azimuths) < beams:
        return 0.0
    around = np.concatenate([azimuths, azimuths[: beams - 1] + 2 * np.pi])
    first, last = around[: len(azimuths)], around[beams - 1 :]
    start, end = last - half_rad, first + half_rad
    start, end = start[end > start], end[end > start]
    # starts and ends increase: cut each interval at the end of the one before, and the last at the start of the first
    if not len(start):
        return 0.0
    start = np.maximum(start, np.concatenate([start[:1], end[:-1]]))
    end = np.minimum(end, start[0] + 2 * np.pi)
    start = np.minimum(start, end)
    return float((_cumulated(end, below) - _cumulated(start, below)).sum())


def _cumulated(azimuth_rad: Array, below: Array) -> Array:
    """Return the share of the poles from -pi up to azimuths of any number of turns."""
    turns, rest = np.divmod((azimuth_rad + np.pi) / (2 * np.pi), 1.0)
    return turns + np.interp(rest, np.linspace(0, 1, len(below)), below)
