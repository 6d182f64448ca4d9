"""Blind cones, gaps between scan lines, angles at which they cross, and the share that half a turn misses.

For full turns these have closed forms. With gamma the angle between axis and scan-plane normal, the scan plane meets
the circle at polar angle t in at most two bearings phi0 +- sigma, sin(gamma) cos(sigma) = cos(t). Each bearing in the
field of view makes a family of scan lines there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.optimize import nnls
from scipy.spatial import ConvexHull, QhullError

from scanwright.design.arrays import Array, Plane, Setting, Vector
from scanwright.design.density.beams import beam_directions_rot, line_spacing, polar_and_azimuth
from scanwright.design.evaluation.metres import AT_M, spacing
from scanwright.design.findings import Finding
from scanwright.design.frames import R_rot_laser, R_world_rot
from scanwright.design.objective.holes import heading, triple
from scanwright.design.objective.problem import NODES, Problem
from scanwright.design.objective.quadrature import polar_rule
from scanwright.design.sphere.directions import weighted_samples

DIRECTIONS = 20_000  # of the region, for a sweep and for the widest gap
FLAT = 1e-6  # distance of the centre from a facet that is rounding
WIDE = 3.0
"""Gaps wider than this times the spacing of lines or beams are reported: empty discs in a regular pattern reach the
square root of 2, and twice that at the end of a turn."""


@dataclass(frozen=True, slots=True)
class BlindCone:
    """A cone that no beam enters."""

    axis_world: tuple[float, float, float]  # unit vector of its axis in the world
    half_angle_deg: float  # half of its opening angle


@dataclass(frozen=True, slots=True)
class Gaps:
    """Gaps of one mount; shares are of the weight of the task."""

    # about the axis and its opposite, the wider one first, if beams do not reach the axis
    blind_cones: tuple[BlindCone, ...]
    line_gap_deg: float  # widest distance between neighbouring scan lines of one family, perpendicular to them
    seen_twice: float  # share that both families of lines cover
    crossing_deg: float | None  # mean angle at which they cross, 0 to 90; None if nothing is seen twice
    # mean share of the view of a full turn that half a turn does not see; None for a sweep
    half_turn_misses: float | None


def gaps(problem: Problem, angles_rad: Setting) -> Gaps:
    """Return the gaps of mounting angles (alpha_rot, beta_rot, alpha_laser, beta_laser) [rad]."""
    u = R_world_rot(angles_rad[0], angles_rad[1])[:, 2]
    beams = problem.beams_rot(angles_rad[2:])
    normal = R_rot_laser(angles_rad[2], angles_rad[3])[:, 2]
    polar_rad, weights, families = (_around if problem.sweep is None else _within_limits)(problem, angles_rad)
    seen = families.any(axis=0)
    twice = families.all(axis=0)
    apart, crossing = _between_families(normal, polar_rad)
    total = float(weights.sum())
    weight_twice = float(weights @ twice)
    # half a turn sees half of the directions of one family, and more if a second family is ahead or behind in azimuth
    misses = np.where(twice, 0.5 - apart / (2 * np.pi), 0.5) * seen
    return Gaps(
        blind_cones=_blind_cones(u, polar_and_azimuth(beams)[0]),
        line_gap_deg=float(np.degrees(problem.lines.step_rad * line_spacing(beams, angles_rad[2:]))),
        seen_twice=weight_twice / total,
        crossing_deg=float(np.degrees(weights @ (crossing * twice) / weight_twice)) if weight_twice > 0 else None,
        half_turn_misses=float(weights @ misses / total) if problem.sweep is None else None,
    )


def empty_cap(scan: Float[ndarray, "n 3"]) -> BlindCone:
    """Return the largest cap without a beam of a simulated scan: no beam lies beyond the facets of the convex hull.

    If the centre is not inside the hull, the cap is opposite to the point of the hull that is nearest to the centre.
    """
    try:
        hull = ConvexHull(scan)
    except QhullError:  # all beams in one plane, of a fan that turns in its own plane
        hull = ConvexHull(scan, qhull_options="QJ")
    widest = int(hull.equations[:, 3].argmax())
    axis, cosine = hull.equations[widest, :3], -hull.equations[widest, 3]
    if cosine < FLAT:
        nearest = _nearest_of_hull(scan[hull.vertices])
        if np.linalg.norm(nearest) > FLAT:
            axis, cosine = -nearest / np.linalg.norm(nearest), -np.linalg.norm(nearest)
    return BlindCone(triple(axis), float(np.degrees(np.arccos(np.clip(cosine, -1, 1)))))


def _nearest_of_hull(corners: Float[ndarray, "n 3"]) -> Vector:
    """Return the point of the convex hull that is nearest to the origin; the corners in use are added one by one."""
    kept = [0]
    while True:
        used = corners[kept]
        shares, _ = nnls(np.vstack([used.T, np.full(len(used), 100.0)]), np.array([0.0, 0.0, 0.0, 100.0]))
        nearest: Vector = shares @ used / shares.sum()
        ahead = corners @ nearest
        following = int(ahead.argmin())
        if following in kept or ahead[following] >= nearest @ nearest - 1e-12:
            return nearest
        kept.append(following)


def wide_gap(problem: Problem, angles_rad: Setting, beams: Float[ndarray, "n 3"]) -> Finding | None:
    """Return a warning if the region has a gap much wider than the spacing of lines and beams, but no blind spot.

    `beams` are unit vectors of one full scan in the world.
    """
    from scipy.spatial import cKDTree

    directions = weighted_samples(problem.field, DIRECTIONS).directions
    spacing_deg = float(np.degrees(spacing(problem, angles_rad)))
    tree = cKDTree(beams, balanced_tree=False, compact_nodes=False)
    chord = 2 * np.sin(problem.ball_rad / 2)
    distances = tree.query(directions, distance_upper_bound=float(chord))[0]
    widest = int(distances.argmax())
    if not np.isfinite(distances[widest]):
        return None
    gap_deg, limit_deg = float(np.degrees(4 * np.arcsin(distances[widest] / 2))), WIDE * spacing_deg
    if gap_deg <= limit_deg:
        return None
    across_mm = 2000 * AT_M * np.tan(np.radians(gap_deg / 2))
    message = (
        f"a gap {gap_deg:.1f} deg wide {heading(directions[widest])} ({across_mm:.0f} mm across at "
        f"{AT_M:g} m) has no beam; scan lines and beams are at most {spacing_deg:.2g} deg apart"
    )
    hint = "it can hide smaller objects: set density.ball_radius_deg to half the angle of the smallest one"
    return Finding("wide_gap", "warning", "region", message, gap_deg, limit_deg, "deg", hint)


def interlaced_period_s(period_s: float, scan_rate_hz: float) -> float:
    """Return the nearest period at which the lines of the next turn lie halfway between those of this one."""
    return (np.floor(period_s * scan_rate_hz) + 0.5) / scan_rate_hz


def _blind_cones(u: Vector, beam_polar: Float[ndarray, " beams"]) -> tuple[BlindCone, ...]:
    cones = [(u, float(beam_polar.min())), (-u, float(np.pi - beam_polar.max()))]
    result = [BlindCone(triple(axis), float(np.degrees(half))) for axis, half in cones if half > 1e-9]
    return tuple(sorted(result, key=lambda cone: -cone.half_angle_deg))


def _around(
    problem: Problem, angles_rad: Setting
) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"], Bool[ndarray, "2 n"]]:
    """Return polar angles, their weights, and whether each family covers them, for full turns."""
    rule, _, _ = polar_rule(problem, angles_rad, NODES)
    return rule.polar_rad, rule.fine, _families(problem.bearings_rad, angles_rad[2:], rule.polar_rad)[0]


def _within_limits(
    problem: Problem, angles_rad: Setting
) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"], Bool[ndarray, "2 n"]]:
    """Return polar angles of directions, their weights, and whether each family covers them within the sweep limits."""
    assert problem.sweep is not None
    samples = weighted_samples(problem.field, DIRECTIONS)
    polar, azimuth = polar_and_azimuth(samples.directions @ R_world_rot(angles_rad[0], angles_rad[1]))
    families, bearings = _families(problem.bearings_rad, angles_rad[2:], polar)
    beam_azimuth = np.stack([polar_and_azimuth(beam_directions_rot(b, *angles_rad[2:]))[1] for b in bearings])
    lower, upper = np.radians(problem.sweep.motion.limits_deg)
    return polar, samples.weights, families & ((azimuth - beam_azimuth - lower) % (2 * np.pi) <= upper - lower)


def _families(
    bearings_rad: Float[ndarray, " beams"], plane_rad: Plane, polar_rad: Float[ndarray, " n"]
) -> tuple[Bool[ndarray, "2 n"], Float[ndarray, "2 n"]]:
    """Return whether each of the two bearings of a polar angle lies in the field of view, and the bearings."""
    alpha, beta = plane_rad
    q = np.array([-np.sin(beta), np.cos(beta) * np.sin(alpha)])
    slope = np.hypot(*q)  # sin(gamma)
    nearest = np.arctan2(q[1], q[0])  # the bearing that comes closest to the axis
    if slope < 1e-12:
        return np.zeros((2, len(polar_rad)), dtype=bool), np.zeros((2, len(polar_rad)))
    ratio = np.cos(polar_rad) / slope
    met = np.abs(ratio) <= 1
    sigma = np.arccos(np.clip(ratio, -1, 1))
    both = np.stack([nearest + sigma, nearest - sigma])
    return met & _in_field_of_view(bearings_rad, both), both


def _in_field_of_view(
    bearings_rad: Float[ndarray, " beams"], tested_rad: Float[ndarray, "2 n"]
) -> Bool[ndarray, "2 n"]:
    """Return whether a beam is within half of the usual step: a field of view can have a gap at the housing."""
    turn = 2 * np.pi
    beams_rad, tested_rad = np.sort(_within_a_turn(bearings_rad)), _within_a_turn(tested_rad)
    around_rad = np.concatenate([beams_rad[-1:] - turn, beams_rad, beams_rad[:1] + turn])
    behind = np.searchsorted(around_rad, tested_rad, "right")
    nearest_rad = np.minimum(tested_rad - around_rad[behind - 1], around_rad[behind] - tested_rad)
    return nearest_rad <= np.median(np.diff(np.sort(bearings_rad))) / 2 * (1 + 1e-9)


def _within_a_turn(angle_rad: Array) -> Array:
    """Return angles in [0, 2 pi); the remainder of an angle just below 0 would be rounded to 2 pi."""
    rest = angle_rad % (2 * np.pi)
    return np.where(rest < 2 * np.pi, rest, 0.0)


def _between_families(
    normal: Vector, polar_rad: Float[ndarray, " n"]
) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
    """Return the azimuth between the two lines at a polar angle, 0 to pi, and their crossing angle, 0 to pi/2."""
    slope, upright = np.hypot(normal[0], normal[1]), abs(normal[2])
    sine = np.maximum(np.sin(polar_rad), 1e-12)
    # in the scan plane: slope sin(t) cos(azimuth) = -upright cos(t)
    azimuth = np.arccos(np.clip(-upright * np.cos(polar_rad) / np.maximum(slope * sine, 1e-12), -1, 1))
    apart = 2 * np.minimum(azimuth, np.pi - azimuth)
    half = np.arccos(np.clip(upright / sine, -1, 1))
    return apart, np.minimum(2 * half, np.pi - 2 * half)
