"""Beams of the 2D lidar in the rotation frame, the scan lines of one full turn, and the simulated scan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from numpy.typing import ArrayLike

from scanwright.design import frames


@dataclass(frozen=True, slots=True)
class ScanLines:
    """The scan lines of one full turn: line k is at `k * step_rad`, k = 0 .. count - 1.

    If period times scan rate is not an integer, the gap after the last line is shorter than `step_rad`. If the servo
    stops at each line, each is measured `repeats` times.
    """

    count: int
    step_rad: float
    repeats: int = 1

    @property
    def angles_rad(self) -> Float[ndarray, " {self.count}"]:
        """Axis angles of the lines, shape (count,)."""
        return self.step_rad * np.arange(self.count)


def scan_lines(period_s: float, scan_rate_hz: float) -> ScanLines:
    """Return the lines of one turn in `period_s` = T: `gamma_k = 2 pi k / (T f)`, k = 0 .. ceil(T f) - 1."""
    turns = period_s * scan_rate_hz
    nearest = round(turns)
    if nearest >= 1 and abs(turns - nearest) < 1e-9 * turns:  # 0.07 * 100 is 7 and not 7.000000000000001
        turns = nearest
    return ScanLines(count=int(np.ceil(turns)), step_rad=2 * np.pi / turns)


NO_LEVER = (0.0, 0.0, 0.0)


def beam_directions_rot(
    bearings_rad: Float[ndarray, " beams"],
    alpha_laser_rad: float,
    beta_laser_rad: float,
    lever: ArrayLike = NO_LEVER,
) -> Float[ndarray, "beams 3"]:
    """Return unit vectors of the beams in the rotation frame, shape (beams, 3): `R_rot_laser Rz(gamma_beam) e_x`.

    With a lever arm, `t_rot_laser / range`, they point from the axis to the ends of the beams at that range. The arm
    turns with the laser, so the density stays rotationally symmetric about the axis.
    """
    in_laser = np.stack([np.cos(bearings_rad), np.sin(bearings_rad), np.zeros_like(bearings_rad)], axis=1)
    beams = in_laser @ frames.R_rot_laser(alpha_laser_rad, beta_laser_rad).T
    if not np.any(lever):
        return beams
    ends = beams + np.asarray(lever, dtype=float)
    return ends / np.linalg.norm(ends, axis=1, keepdims=True)


def polar_of_planes(
    bearings_rad: Float[ndarray, " beams"], planes_rad: Float[ndarray, "n 2"]
) -> Float[ndarray, "n beams"]:
    """Return the polar angles of all beams for scan planes (alpha_laser, beta_laser), shape (n, beams)."""
    R = frames.R_rot_laser(*planes_rad.T)[:, :, :2]
    x, y, z = np.einsum("nij,jb->inb", R, np.stack([np.cos(bearings_rad), np.sin(bearings_rad)]))
    return np.arctan2(np.hypot(x, y), z)


def line_spacing(beams: Float[ndarray, "n 3"], plane_rad: ArrayLike) -> float:
    """Return the widest distance between neighbouring scan lines, perpendicular to them, as a share of the axis step.

    Args:
        beams: unit vectors in the rotation frame.
        plane_rad: (alpha_laser, beta_laser) of the scan plane.
    """
    normal = frames.R_rot_laser(*np.asarray(plane_rad, dtype=float))[:, 2]
    return float(np.abs(np.cross([0.0, 0.0, 1.0], beams) @ normal).max())


def polar_and_azimuth(directions: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
    """Return polar angle and azimuth [rad] of unit vectors, shape (n,) each; accurate close to the poles."""
    x, y, z = directions.T
    return np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)


def is_closed(bearings_rad: Float[ndarray, " beams"]) -> bool:
    """Return whether a field of view is a full circle: the gap from its last beam to its first is an ordinary step."""
    apart = np.abs(np.diff(bearings_rad))
    if apart.size < 2 or 2 * np.pi - apart.sum() > 1.5 * apart.max():  # avoids the slow median
        return False
    return bool(2 * np.pi - apart.sum() <= 1.5 * np.median(apart))


def blind_zones(
    bearings_rad: Float[ndarray, " beams"], beam_polar_rad: Float[ndarray, " beams"], ball_rad: float
) -> Float[ndarray, "zones 2"]:
    """Return the ranges of the polar angle about the axis that no beam comes within a ball radius of, shape (zones, 2).

    The field of view counts as continuous between neighbouring beams (docs/definitions.md, Blind), and as several
    sectors if beams are missing in the middle, such as behind a part that turns with the laser.
    """
    apart = np.diff(bearings_rad)
    first = np.zeros(1, dtype=int)  # beam of each sector
    if len(apart) > 1 and not 0 < apart.max() <= 1.5 * apart.min():  # avoids the slow median
        first = np.append(first, np.flatnonzero(apart > 1.5 * np.median(apart)) + 1)
    low, high = (of.reduceat(beam_polar_rad, first) for of in (np.minimum, np.maximum))
    order = np.argsort(low)
    starts = np.append(0.0, np.maximum.accumulate(high[order] + ball_rad))
    zones = np.stack([starts, np.append(low[order] - ball_rad, np.pi)], axis=1)
    return zones[zones[:, 1] > zones[:, 0]]


def scan_at(
    bearings_rad: Float[ndarray, " beams"],
    joint_rad: Float[ndarray, " k"],
    angles_rad: ArrayLike,
    lever: ArrayLike = NO_LEVER,
) -> Float[ndarray, "n 3"]:
    """Return the world directions of all beams, line after line (paper, section 4.1), shape (k * beams, 3)."""
    alpha_rot, beta_rot, alpha_laser, beta_laser = np.asarray(angles_rad, dtype=float)
    beams = beam_directions_rot(bearings_rad, alpha_laser, beta_laser, lever)
    R = frames.R_world_rot(alpha_rot, beta_rot, joint_rad)
    return np.einsum("kij,bj->kbi", R, beams).reshape(-1, 3)
