"""J by the paper's own way, the ball search over a simulated scan: slow, obvious, shares no density with the rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from design.beams import simulated_scan
from design.frames import Array, R_world_rot, rotvec_to_matrix
from design.objective import Problem, log_density
from design.sphere import Samples, equal_angle_grid, weighted_samples

PHASES = 8
SETS = 4  # of directions for every phase: 32 estimates of J, so that their spread is known well enough
DIRECTIONS = 4000  # for every phase


@dataclass(frozen=True, slots=True)
class BallScore:
    """Mean of the estimates of J, and four standard errors of that mean."""

    J: float
    J_error: float


def ball_score(problem: Problem, angles_rad: Array, directions: int = DIRECTIONS) -> BallScore:
    """Ball search of the setting (alpha_rot, beta_rot, alpha_laser, beta_laser) [rad], mean over 8 start phases.

    Raises:
        TaskError: no direction has a weight.
    """
    return ball_score_on(scan_tree(problem, angles_rad), problem, angles_rad, directions)


def scan_tree(problem: Problem, angles_rad: Array) -> cKDTree:
    """The simulated full scan of a setting, ready to be searched; it depends on beams and lines only."""
    scan = simulated_scan(problem.bearings_rad, problem.lines, angles_rad)
    return cKDTree(scan, balanced_tree=False, compact_nodes=False)


def ball_score_on(tree: cKDTree, problem: Problem, angles_rad: Array, directions: int = DIRECTIONS) -> BallScore:
    """As `ball_score`, for a scan that is there already.

    Another start phase is the same scan turned about the axis, so the directions are turned back instead.
    """
    axis = R_world_rot(angles_rad[0], angles_rad[1])[:, 2]
    chord = 2 * np.sin(problem.ball_rad / 2)
    estimates = []
    for i, phase in enumerate(start_phases(problem.lines.count, problem.lines.step_rad)):
        for samples in sample_sets(problem, directions // SETS, SETS * i):
            turned = samples.directions @ rotvec_to_matrix(axis * phase)  # rows times R(phase): columns turned back
            counts = tree.query_ball_point(turned, chord, return_length=True, workers=-1)
            estimates.append(samples.weights @ log_density(counts) / samples.weights.sum())
    return BallScore(
        J=float(np.mean(estimates)),
        J_error=float(4 * np.std(estimates, ddof=1) / np.sqrt(len(estimates))),
    )


def start_phases(lines: int, step_rad: float) -> Array:
    """Eight phases spread over the turn and, at once, evenly over the gap between two lines, shape (8,)."""
    i = np.arange(PHASES)
    return step_rad * (np.round(i * lines / PHASES) + (i + 0.5) / PHASES)


def sample_sets(problem: Problem, directions: int, first: int) -> list[Samples]:
    """Sets of directions that share no ring of the spiral: no two shall cut the region's edges in the same way."""
    if problem.grid_step_deg:
        grid = equal_angle_grid(problem.grid_step_deg)
        weights = problem.field.weight_at(grid)
        return [Samples(grid[weights > 0], weights[weights > 0])]
    return [weighted_samples(problem.field, directions + 17 * (first + k), turn_rad=first + k) for k in range(SETS)]
