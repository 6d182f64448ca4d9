"""Blind spots: weighted directions that a mount never sees, and their description."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from scanwright.design.arrays import Setting, Vector
from scanwright.design.frames import R_world_rot
from scanwright.design.objective.problem import NODES, Problem
from scanwright.design.objective.quadrature import polar_rule
from scanwright.design.objective.score import blind_share, blind_to_sweep
from scanwright.design.sphere.directions import weighted_samples

NO_BLIND_WEIGHT = 1e-9  # share of the weight that is rounding
DIRECTIONS = 20_000  # of the region, for a sweep
POINTS = (
    "ahead",
    "ahead on the left",
    "to the left",
    "behind on the left",
    "behind",
    "behind on the right",
    "to the right",
    "ahead on the right",
)
UPRIGHT_DEG = 80.0  # elevation above which no heading is stated


@dataclass(frozen=True, slots=True)
class BlindSpot:
    """Directions that get no beam at any start phase: a cone, or a ring if `inner_deg` is above 0."""

    centre: tuple[float, float, float]  # unit vector in the world
    half_angle_deg: float  # from the centre to the outer edge
    inner_deg: float  # from the centre to the inner edge of a ring
    weight: float  # share of the weight of the task
    scattered: bool = False  # whether only a part of the cone is blind

    def words(self) -> str:
        """Return its place, width and weight as text."""
        x, y, z = self.centre
        angle, wide = f"{self.half_angle_deg:.2f} deg about", ""
        if self.scattered and self.half_angle_deg > 60:
            return f"blind in places in many directions, {percent(self.weight)} of the weight"
        if self.scattered:
            angle = f"directions within {self.half_angle_deg:.2f} deg of"
        elif self.inner_deg:
            angle = f"{self.inner_deg:.2f} to {angle}"
        elif self.half_angle_deg < 20:
            wide = f", {200 * np.tan(np.radians(self.half_angle_deg)):.2g} cm wide per metre of range"
        return (
            f"blind {heading(np.array(self.centre))}: {angle} ({x:z.3f}, {y:z.3f}, {z:z.3f}){wide}, "
            f"{percent(self.weight)} of the weight"
        )


def holes(problem: Problem, angles_rad: Setting) -> tuple[BlindSpot, ...]:
    """Return the blind spots of (alpha_rot, beta_rot, alpha_laser, beta_laser) [rad], the largest weight first."""
    result = _of_spin(problem, angles_rad) if problem.sweep is None else _of_sweep(problem, angles_rad)
    return tuple(sorted((hole for hole in result if hole.weight > NO_BLIND_WEIGHT), key=lambda hole: -hole.weight))


def _of_spin(problem: Problem, angles_rad: Setting) -> list[BlindSpot]:
    rule, beam_polar, _ = polar_rule(problem, angles_rad, NODES)
    axis = R_world_rot(angles_rad[0], angles_rad[1])[:, 2]
    out = []
    for low, high in problem.blind_zones(beam_polar):
        inside = (low < rule.polar_rad) & (rule.polar_rad < high)
        weight = blind_share(rule.fine, inside)
        about_back = low > 0 and np.pi - low < high  # the nearer end of the axis
        inner, outer = (np.pi - high, np.pi - low) if about_back else (low, high)
        out.append(
            BlindSpot(triple(-axis if about_back else axis), float(np.degrees(outer)), float(np.degrees(inner)), weight)
        )
    return out


def _of_sweep(problem: Problem, angles_rad: Setting) -> list[BlindSpot]:
    """Return all blind directions as one cone about their mean."""
    samples = weighted_samples(problem.field, DIRECTIONS)
    R = R_world_rot(angles_rad[0], angles_rad[1])
    blind = blind_to_sweep(problem, samples.directions @ R, problem.beams_rot(angles_rad[2:]))
    middle = samples.weights[blind] @ samples.directions[blind]
    length = float(np.linalg.norm(middle))
    if not length > 0:
        return []
    off = np.arccos(np.clip(samples.directions[blind] @ middle / length, -1, 1))
    share = blind_share(samples.weights, blind)
    return [BlindSpot(triple(middle / length), float(np.degrees(off.max())), 0.0, share, True)]


def heading(direction: Vector) -> str:
    """Return a direction of the world as text: x is ahead, y to the left, z up."""
    x, y, z = direction
    up_deg = float(np.degrees(np.arctan2(z, np.hypot(x, y))))
    if abs(up_deg) > UPRIGHT_DEG:
        return "straight up" if up_deg > 0 else "straight down"
    point = POINTS[round(float(np.degrees(np.arctan2(y, x))) / 45) % 8]
    return point if abs(up_deg) < 0.5 else f"{point} and {abs(up_deg):.0f} deg {'up' if up_deg > 0 else 'down'}"


def percent(share: float) -> str:
    """Return a share in percent; a positive one is never printed as 0."""
    if 0 < share < 1e-6:
        return "below 0.0001%"
    return f"{100 * share:.2g}%" if share < 0.1 else f"{share:.1%}"


def triple(v: Float[ndarray, " 3"]) -> tuple[float, float, float]:
    """Return a vector as a tuple without negative zeros."""
    x, y, z = (float(value) + 0.0 for value in v)
    return x, y, z
