"""What a setting sees and what not, on the unmasked sphere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from design.beams import beam_directions_rot, polar_and_azimuth
from design.frames import Array, R_world_rot
from design.objective import Problem

CIRCLES = 10_000


@dataclass(frozen=True, slots=True)
class Coverage:
    """Shares of solid angle.

    Attributes:
        blind_fraction: of the unmasked sphere, where no beam comes at any start phase.
        masked_fraction: of the whole sphere, what the robot hides.
    """

    blind_fraction: float
    masked_fraction: float


def coverage(problem: Problem, angles_rad: Array) -> Coverage:
    """Blind and masked share of the setting (alpha_rot, beta_rot, alpha_laser, beta_laser) [rad]."""
    axis = R_world_rot(angles_rad[0], angles_rad[1])[:, 2]
    polar, _ = polar_and_azimuth(beam_directions_rot(problem.bearings_rad, angles_rad[2], angles_rad[3]))
    up = np.array([0.0, 0.0, 1.0])
    open_share = _unmasked(problem, up, 0.0, np.pi)
    blind = sum(_unmasked(problem, axis, a, b) for a, b in blind_zones(polar, problem.ball_rad))
    return Coverage(
        blind_fraction=blind / open_share if open_share > 0 else 0.0,
        masked_fraction=max(0.0, 1.0 - open_share),
    )


def blind_zones(beam_polar_rad: Array, ball_rad: float) -> list[tuple[float, float]]:
    """Ranges of the polar angle about the axis that lie further than a ball radius from every beam."""
    polar = np.sort(beam_polar_rad)
    starts = np.concatenate([[0.0], polar + ball_rad])
    ends = np.concatenate([polar - ball_rad, [np.pi]])
    return [(float(a), float(b)) for a, b in zip(starts, ends, strict=True) if b > a]


def _unmasked(problem: Problem, axis: Array, low_rad: float, high_rad: float) -> float:
    """Share of the whole sphere that lies between two polar angles and outside the masks."""
    height = np.cos(low_rad) - np.cos(high_rad)
    z = np.cos(low_rad) - height * (np.arange(CIRCLES) + 0.5) / CIRCLES
    _, shares = problem.field.on_circles(axis, np.arccos(np.clip(z, -1, 1)))
    return float(shares.mean() * height / 2)
