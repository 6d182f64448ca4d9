"""J by the method of the paper, a ball search over simulated scans: an independent check of the closed form."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import cKDTree

from scanwright.design.arrays import Array, Rotation, Setting
from scanwright.design.density.beams import scan_at
from scanwright.design.frames import R_world_rot, rotvec_to_matrix
from scanwright.design.objective.problem import Problem
from scanwright.design.sphere.directions import sample_set

PHASES = 8
SETS = 4  # of directions at each phase: 32 estimates of J, enough to estimate their spread
DIRECTIONS = 4000  # at each phase


@dataclass(frozen=True, slots=True)
class BallScore:
    """Mean of the estimates of J, and four standard errors of the mean."""

    J: float
    J_error: float


def ball_score(problem: Problem, angles_rad: Setting, directions: int = DIRECTIONS) -> BallScore:
    """Return J of mounting angles (alpha_rot, beta_rot, alpha_laser, beta_laser) by ball search at 8 start phases."""
    if problem.sweep is None:
        return ball_score_on(scan_tree(problem, angles_rad), problem, angles_rad, directions)
    joints = [problem.sweep.angles_rad((i + 0.5) / PHASES) for i in range(PHASES)]
    return _score(problem, ((scan_tree(problem, angles_rad, joint), np.eye(3)) for joint in joints), directions)


def scan_tree(problem: Problem, angles_rad: Setting, joint_rad: Array | None = None) -> cKDTree:
    """Return a search tree of the beams at joint angles, by default of one simulated turn."""
    joint_rad = problem.lines.angles_rad if joint_rad is None else joint_rad
    scan = scan_at(problem.bearings_rad, joint_rad, angles_rad, problem.lever)
    return cKDTree(scan, balanced_tree=False, compact_nodes=False)


def ball_score_on(tree: cKDTree, problem: Problem, angles_rad: Setting, directions: int = DIRECTIONS) -> BallScore:
    """Return `ball_score` from the tree of a full turn; for other start phases the directions are rotated instead."""
    axis = R_world_rot(angles_rad[0], angles_rad[1])[:, 2]
    phases = start_phases(problem.lines.count, problem.lines.step_rad)
    # row vectors times R(phase) are rotated by -phase
    return _score(problem, ((tree, rotvec_to_matrix(axis * phase)) for phase in phases), directions)


def start_phases(lines: int, step_rad: float) -> Float[ndarray, " n"]:
    """Return eight start phases [rad] that are spread evenly over the turn and over the gap between two lines."""
    i = np.arange(PHASES)
    return step_rad * (np.round(i * lines / PHASES) + (i + 0.5) / PHASES)


def _estimate(tree: cKDTree, problem: Problem, back: Rotation, wanted: int, index: int) -> Float[ndarray, " moments"]:
    """Return each moment over one set of directions at one start phase."""
    chord = 2 * np.sin(problem.ball_rad / 2)
    values = []
    for moment in problem.objective.moments:
        samples = sample_set(moment.field, problem.grid_step_deg, wanted, index)
        counts = tree.query_ball_point(samples.directions @ back, chord, return_length=True, workers=-1)
        g = moment.g(problem.lines.repeats * counts)
        highest = moment.gathered == "highest"
        values.append(g.max() if highest else samples.weights @ g / samples.weights.sum())
    return np.array(values)


def _score(problem: Problem, scans: Iterable[tuple[cKDTree, Rotation]], directions: int) -> BallScore:
    """Return the score from the tree of each start phase, and the rotation of the directions for it."""
    estimates = [
        _estimate(tree, problem, back, directions // SETS, SETS * i + k)
        for i, (tree, back) in enumerate(scans)
        for k in range(SETS)
    ]
    moments = np.array(estimates).T
    each = problem.objective.join(moments)
    highest = [moment.gathered == "highest" for moment in problem.objective.moments]
    gathered = np.where(highest, moments.max(axis=1), moments.mean(axis=1))
    return BallScore(
        J=float(problem.objective.join(gathered)),
        J_error=float(4 * np.std(each, ddof=1) / np.sqrt(len(each))),
    )
