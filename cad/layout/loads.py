"""Weight of the rotor, compliance of its shaft, and rating of a servo's horn. SI units. No kernel."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from scanwright.design.arrays import Array
from scanwright.design.frames import STANDARD_GRAVITY_M_S2
from scanwright.design.scanner import Scanner

RATED_AT_MM = 10.0  # the servo's radial load is rated at this distance from the horn
HORN_TILTS_RAD = 1e-3  # of a servo's horn at its rated moment: assumed, no maker states it
RUBS_NM = (5e-3, 5e-3)  # of bearings, and of a ring whose friction is not in the catalogue: assumed
NEAR_MM = 500.0
UNRATED_NM = 0.15  # assumed rating of a horn without one: half of that of MX-28, the weakest rated one
FAR_MM = 10_000.0  # distance at which an angle error is compared with the range noise
ALUMINIUM_G_CM3 = 2.7
ALUMINIUM_PA = 70e9
STEEL_G_CM3 = 7.85
METAL_POISSON = 0.33


@dataclass(frozen=True, slots=True)
class Weight:
    """Weight of the rotor, split along and across the axis."""

    across_n: float  # component of the weight across the axis
    along_n: float  # component along the axis
    lever_m: float  # height of the centre of mass above the horn
    off_axis_m: float  # distance of the centre of mass from the axis

    def at_g(self, g: float) -> Weight:
        """Return the same rotor under a multiple of gravity."""
        return replace(self, across_n=g * self.across_n, along_n=g * self.along_n)

    @property
    def moment_nm(self) -> float:
        """Moment about the horn in the worst position of a turn."""
        return self.across_n * self.lever_m + self.along_n * self.off_axis_m


@dataclass(frozen=True, slots=True)
class ShaftBend:
    """Compliance of the shaft at the hub's lower end, equal in all directions across the axis."""

    compliance: Array  # (sideways, slope) of (force, moment), shape (2, 2) [m, rad per N, N m]
    twist_rad_per_nm: float  # about the axis
    stretch_m_per_n: float  # along the axis

    def rotation_of(self, force_n: Array, moment_nm: Array) -> Array:
        """Return the rotation of the hub [rad] by force and moment at its lower end, rotation frame."""
        along = np.array([-force_n[1], force_n[0], 0.0])  # z x force
        bend = self.compliance[1, 0] * along + self.compliance[1, 1] * np.array([*moment_nm[:2], 0.0])
        return bend + np.array([0.0, 0.0, self.twist_rad_per_nm * moment_nm[2]])

    def shift_of(self, force_n: Array, moment_nm: Array) -> Array:
        """Return the displacement of the hub's lower end [m]."""
        across = np.array([moment_nm[1], -moment_nm[0], 0.0])  # moment x z
        bend = self.compliance[0, 0] * np.array([*force_n[:2], 0.0]) + self.compliance[0, 1] * across
        return bend + np.array([0.0, 0.0, self.stretch_m_per_n * force_n[2]])


def tilt_sine(scanner: Scanner) -> float:
    """Return the sine of the angle between the rotation axis and the vertical."""
    up = scanner.angles.T_world_rot(0.0)[2, :3]
    return math.hypot(float(up[0]), float(up[1]))


def weight_of(scanner: Scanner, mass_kg: float, lever_m: float, off_axis_m: float) -> Weight:
    """Return the weight of a rotor whose centre of mass is known."""
    sine = tilt_sine(scanner)
    weight = mass_kg * STANDARD_GRAVITY_M_S2
    return Weight(weight * sine, weight * math.sqrt(1.0 - min(1.0, sine**2)), lever_m, off_axis_m)


def rated_moment_nm(scanner: Scanner) -> float | None:
    """Return the rated tilt moment of the horn; None if the maker states no radial load."""
    rated = scanner.servo.radial_load_n
    return None if rated is None else rated * RATED_AT_MM / 1000


def trusted_moment_nm(scanner: Scanner) -> float:
    """Return the tilt moment allowed on the horn: its rating, or UNRATED_NM."""
    rated = rated_moment_nm(scanner)
    return UNRATED_NM if rated is None else rated


def friction_nm(scanner: Scanner) -> tuple[float, float]:
    """Return the least and largest friction torque of ring and bearings."""
    ring = scanner.slip_ring
    return RUBS_NM if ring is None or ring.friction_nm is None else ring.friction_nm


def noise_deg(scanner: Scanner) -> float:
    """Return the largest angle that moves no point within FAR_MM by more than the lidar's range noise."""
    range_mm = np.linspace(NEAR_MM, FAR_MM, 96)
    return math.degrees(math.atan(float((scanner.lidar.sigma_mm(range_mm) / range_mm).min())))
