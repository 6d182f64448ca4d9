"""Pose graph of all scan positions: least squares on SE(3), with the covariance of every pose.

A small motion (rotation vector w, translation v) acts on the right: T + (w, v) = (R exp(w), t + R v). The stated
covariances of the pairs are those of their noise; if pairs contradict each other by more, all are scaled up by the
same factor, and outliers are left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from numpy import ndarray
from scipy.spatial.transform import Rotation

from scanwright.design import frames
from scanwright.design.arrays import Pose

_MAX_STEPS = 30  # of Gauss-Newton
_SETTLED = 1e-9  # rad and m: far below the noise of any pose
_OUTLIER = 36.0  # times the median squared error of the edges, in squared sigmas: 6 sigma
_MEDIAN_CHI2 = 5.35  # of six degrees of freedom


@dataclass(frozen=True, slots=True, eq=False)
class Edge:
    """Pose `j` in the frame of pose `i`, `T_i_j`, and the covariance (6, 6) of a small motion on its right."""

    i: int
    j: int
    T_i_j: Pose
    covariance: Float64[ndarray, "6 6"]


@dataclass(frozen=True, slots=True, eq=False)
class Graph:
    """Solved poses."""

    T_world: Float64[ndarray, "n 4 4"]  # shape (n, 4, 4)
    covariance: Float64[ndarray, "n 6 6"]  # shape (n, 6, 6), zero for the first, which is held
    left_out: tuple[Edge, ...]  # edges that contradict all others
    scale: float  # factor on the stated sigmas of the edges for them to agree, at least 1


def solve_graph(T_world: Float64[ndarray, "n 4 4"], edges: Sequence[Edge]) -> Graph:
    """Return the least-squares poses from start poses of shape (n, 4, 4); the first pose is held.

    Raises:
        ValueError: the edges do not connect all poses.
    """
    edges_used, left_out = list(edges), []
    while True:
        if not connected(len(T_world), edges_used):
            raise ValueError("the edges do not connect all poses")
        poses, covariance, chi2 = _least_squares(T_world, edges_used)
        limit = _OUTLIER * max(1.0, float(np.median(chi2)) / _MEDIAN_CHI2)
        worst = int(np.argmax(chi2))
        rest = edges_used[:worst] + edges_used[worst + 1 :]
        if chi2[worst] <= limit or not connected(len(T_world), rest):
            break
        left_out.append(edges_used[worst])
        edges_used = rest
    freedom = 6 * (len(edges_used) - len(T_world) + 1)
    scale = max(1.0, float(np.sqrt(chi2.sum() / freedom))) if freedom else 1.0
    return Graph(poses, scale**2 * covariance, tuple(left_out), scale)


def connected(count: int, edges: Sequence[Edge]) -> bool:
    """Whether the edges join `count` poses to one graph."""
    label = np.arange(count)
    for edge in edges:
        label[label == label[edge.i]] = label[edge.j]
    return bool((label == label[0]).all())


def _least_squares(
    T_world: Float64[ndarray, "n 4 4"], edges: Sequence[Edge]
) -> tuple[Float64[ndarray, "n 4 4"], Float64[ndarray, "n 6 6"], Float64[ndarray, " edges"]]:
    """Return poses by Gauss-Newton, their covariances, and the squared residual of each edge in sigmas."""
    poses, n = T_world.copy(), len(T_world)
    information = [np.linalg.inv(edge.covariance) for edge in edges]
    for _ in range(_MAX_STEPS):
        H, g, chi2 = np.zeros((6 * n, 6 * n)), np.zeros(6 * n), np.zeros(len(edges))
        for k, (edge, weight) in enumerate(zip(edges, information, strict=True)):
            residual, J_i, J_j = _residual(poses[edge.i], poses[edge.j], edge.T_i_j)
            chi2[k] = residual @ weight @ residual
            at_i, at_j = slice(6 * edge.i, 6 * edge.i + 6), slice(6 * edge.j, 6 * edge.j + 6)
            H[at_i, at_i] += J_i.T @ weight @ J_i
            H[at_j, at_j] += J_j.T @ weight @ J_j
            H[at_i, at_j] += J_i.T @ weight @ J_j
            H[at_j, at_i] += J_j.T @ weight @ J_i
            g[at_i] += J_i.T @ weight @ residual
            g[at_j] += J_j.T @ weight @ residual
        step = np.zeros(6 * n)
        step[6:] = np.linalg.solve(H[6:, 6:], -g[6:])
        if np.abs(step).max(initial=0.0) < _SETTLED:
            break
        w, v = step.reshape(n, 2, 3).swapaxes(0, 1)
        poses = poses @ frames.rigid(Rotation.from_rotvec(w).as_matrix(), v)
    spread = np.linalg.inv(H[6:, 6:])
    covariance = np.zeros((n, 6, 6))
    for k in range(1, n):
        covariance[k] = spread[6 * k - 6 : 6 * k, 6 * k - 6 : 6 * k]
    return poses, covariance, chi2


def _residual(
    T_i: Pose, T_j: Pose, T_i_j: Pose
) -> tuple[Float64[ndarray, " 6"], Float64[ndarray, "6 6"], Float64[ndarray, "6 6"]]:
    """Return the difference of edge and poses, (6,), and its derivatives by small motions of both, (6, 6) each."""
    seen = np.linalg.inv(T_i) @ T_j
    R, u = T_i_j[:3, :3].T, seen[:3, 3]
    turned = R @ seen[:3, :3]
    residual = np.concatenate([Rotation.from_matrix(turned).as_rotvec(), R @ (u - T_i_j[:3, 3])])
    J_i, J_j = np.zeros((6, 6)), np.zeros((6, 6))
    J_i[:3, :3] = -seen[:3, :3].T
    J_i[3:, :3] = R @ frames.cross_matrix(u)
    J_i[3:, 3:] = -R
    J_j[:3, :3] = np.eye(3)
    J_j[3:, 3:] = turned
    return residual, J_i, J_j
