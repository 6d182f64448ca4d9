"""Every method to compute J, for any objective, for the work-precision diagram; each has one parameter.

Each is a function (problem, angles, parameter) -> J. Methods for full turns use circles about the axis; methods for
sweeps use directions.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.special import roots_legendre

from scanwright.design.arrays import Array, Setting
from scanwright.design.density.ball_count import ball_count
from scanwright.design.density.beams import beam_directions_rot, polar_and_azimuth, scan_at
from scanwright.design.density.spin import ball_search, mean_count, phase_statistics
from scanwright.design.density.sweep import mean_count_swept
from scanwright.design.errors import TaskError
from scanwright.design.frames import R_world_rot
from scanwright.design.objective.named_objectives import Moment
from scanwright.design.objective.problem import Problem
from scanwright.design.objective.quadrature import polar_rule
from scanwright.design.objective.score import quick_J
from scanwright.design.sphere.directions import equal_angle_grid, sample_set

Method = Callable[[Problem, Setting, int], float]
Methods = dict[str, tuple[Method, str, tuple[int, ...]]]  # name -> method, name of its parameter, values to try


def by_segments(problem: Problem, angles_rad: Setting, nodes: int) -> float:
    """Exact counts on nodes that are dense at the ends of segments: the program's method (`design.objective.score`)."""
    return quick_J(problem, angles_rad, nodes)


def by_mean_count(problem: Problem, angles_rad: Setting, nodes: int) -> float:
    """As `by_segments`, with g of the mean count: the lower bound, which ignores the gaps of a fast scan."""

    def moment_of(moment: Moment) -> float:
        rule, polar, _ = polar_rule(problem, angles_rad, nodes, moment.field)
        g = moment.g(mean_count(rule.polar_rad, polar, problem.lines, problem.ball_rad))
        return _gathered(moment, g, rule.fine)

    return _joined(problem, moment_of)


def by_rings(problem: Problem, angles_rad: Setting, rings: int) -> float:
    """Exact counts on evenly spaced rings about the axis, without regard to edges."""
    t = (np.arange(rings) + 0.5) * np.pi / rings
    return _from_rings(problem, angles_rad, t, np.sin(t))


def by_rings_single(problem: Problem, angles_rad: Setting, rings: int) -> float:
    """As `by_rings`, with product and sum in single precision, as in the search."""
    t = (np.arange(rings) + 0.5) * np.pi / rings
    return _from_rings(problem, angles_rad, t, np.sin(t), np.float32)


def by_gauss(problem: Problem, angles_rad: Setting, nodes: int) -> float:
    """Exact counts on Gauss-Legendre nodes of the entire polar axis: best for smooth densities, unlike these."""
    z, w = roots_legendre(nodes)
    return _from_rings(problem, angles_rad, np.arccos(z), w)


def by_harmonics(problem: Problem, angles_rad: Setting, band: int) -> float:
    """Zonal harmonics of density and weight up to a degree (Funk-Hecke), their coefficients from Gauss nodes.

    Raises:
        TaskError: the objective uses a lowest count, which is not a sum of harmonics.
    """
    axis = R_world_rot(angles_rad[0], angles_rad[1])[:, 2]
    z, w = roots_legendre(2 * band + 2)
    t = np.arccos(z)
    basis = np.polynomial.legendre.legvander(z, band)
    degrees = 2 * np.arange(band + 1) + 1

    def moment_of(moment: Moment) -> float:
        if moment.gathered == "highest":
            raise TaskError("a lowest count is not a sum of harmonics")
        of_g = basis.T @ (w * _zonal(problem, angles_rad, t, moment))
        of_weight = basis.T @ (w * moment.field.on_circles(axis, t)[0])
        return float((degrees * of_g * of_weight).sum() / (2 * of_weight[0]))

    return _joined(problem, moment_of)


def by_ball_search(problem: Problem, angles_rad: Setting, rows: int) -> float:
    """The paper's method: a simulated scan, a KD-tree, an equal-angle grid; with solid angles, one start phase."""
    return _on_a_grid(problem, angles_rad, rows, ball_search)


def by_ball_count(problem: Problem, angles_rad: Setting, rows: int) -> float:
    """As `by_ball_search`, with the counts from a grid on the sphere (`design.density.ball_count`)."""
    return _on_a_grid(problem, angles_rad, rows, ball_count)


def by_mean_count_swept(problem: Problem, angles_rad: Setting, directions: int) -> float:
    """Directions spread over the region, with g of the mean count: the lower bound."""
    assert problem.sweep is not None
    lines, beams = problem.sweep, problem.beams_rot(angles_rad[2:])

    def moment_of(moment: Moment) -> float:
        samples = sample_set(moment.field, None, directions, 0)
        turned = samples.directions @ R_world_rot(angles_rad[0], angles_rad[1])
        return _gathered(moment, moment.g(mean_count_swept(turned, beams, lines, problem.ball_rad)), samples.weights)

    return _joined(problem, moment_of)


METHODS: Methods = {
    "segments": (by_segments, "nodes", (81, 243, 729, 2187, 6561, 19683, 59049)),
    "mean count": (by_mean_count, "nodes", (243, 2187, 19683)),
    "rings": (by_rings, "rings", (90, 180, 360, 720, 2880, 11520, 46080)),
    "rings, single precision": (by_rings_single, "rings", (181, 361, 2880, 46080)),
    "Gauss-Legendre": (by_gauss, "nodes", (64, 256, 1024, 2048)),
    "harmonics": (by_harmonics, "degree", (32, 128, 512)),
    "ball search": (by_ball_search, "grid rows", (30, 60, 90, 180, 360)),
    "ball count": (by_ball_count, "grid rows", (30, 60, 90, 180, 360, 720)),
}
SWEPT: Methods = {
    "directions": (by_segments, "directions", (800, 2187, 6561, 19683, 59049)),
    "mean count": (by_mean_count_swept, "directions", (729, 6561, 59049)),
    "ball search": (by_ball_search, "grid rows", (30, 60, 90, 180)),
    "ball count": (by_ball_count, "grid rows", (30, 60, 90, 180, 360)),
}


def _joined(problem: Problem, moment_of: Callable[[Moment], float]) -> float:
    """Return J from its moments."""
    return float(problem.objective.join(np.array([moment_of(moment) for moment in problem.objective.moments])))


def _gathered(moment: Moment, g: Float[ndarray, " n"], weight: Float[ndarray, " n"]) -> float:
    seen = weight > 0
    return float(g[seen].max() if moment.gathered == "highest" else weight[seen] @ g[seen] / weight[seen].sum())


def _zonal(problem: Problem, angles_rad: Setting, t: Float[ndarray, " n"], moment: Moment) -> Float[ndarray, " n"]:
    """Return at polar angles the mean of g over the phases, or g of the lowest count."""
    polar, azimuth = polar_and_azimuth(beam_directions_rot(problem.bearings_rad, angles_rad[2], angles_rad[3]))
    rings = phase_statistics(t, polar, azimuth, problem.lines, problem.ball_rad, moment.g)
    return moment.g(rings.least) if moment.gathered == "highest" else rings.mean_g


def _from_rings(
    problem: Problem,
    angles_rad: Setting,
    t: Float[ndarray, " n"],
    width: Float[ndarray, " n"],
    precision: type[np.floating] = np.float64,
) -> float:
    axis = R_world_rot(angles_rad[0], angles_rad[1])[:, 2]

    def moment_of(moment: Moment) -> float:
        weight = (moment.field.on_circles(axis, t)[0] * width).astype(precision)
        return _gathered(moment, _zonal(problem, angles_rad, t, moment).astype(precision), weight)

    return _joined(problem, moment_of)


def _on_a_grid(
    problem: Problem, angles_rad: Setting, rows: int, count: Callable[[Array, Array, float], Array]
) -> float:
    grid = equal_angle_grid(180 / rows)
    scan = scan_at(problem.bearings_rad, problem.joint_rad(), angles_rad)

    def moment_of(moment: Moment) -> float:
        weight = moment.field.weight_at(grid) * np.sqrt(np.maximum(1 - grid[:, 2] ** 2, 0))
        seen = weight > 0
        counts = problem.lines.repeats * count(scan, grid[seen], problem.ball_rad)
        return _gathered(moment, moment.g(counts), weight[seen])

    return _joined(problem, moment_of)
