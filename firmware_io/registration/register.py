"""All scan positions of a session in one frame: a chain of pairs, then all overlapping pairs, then their pose graph.

The graph is solved by least squares on SE(3), with the covariance of every pose. A small motion (rotation vector w,
translation v) acts on the right: T + (w, v) = (R exp(w), t + R v). The stated covariances of the pairs are those of
their noise; if pairs contradict each other by more, all are scaled up by the same factor, and outliers are left out.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float64
from numpy import ndarray
from scipy.spatial.transform import Rotation

from scanwright.design import frames
from scanwright.design.arrays import Floats, Pose
from scanwright.design.progress import Progress
from scanwright.firmware_io.registration.pairwise import (
    MAX_CONTRADICTION,
    MIN_OVERLAP,
    Pair,
    align,
    judge_pair,
    near_share,
    refused,
)
from scanwright.firmware_io.registration.sensor_view import SensorView
from scanwright.firmware_io.registration.start import find_start

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


_LOG = logging.getLogger(__name__)
_WORTH = 0.35  # near share of a pair worth a try: with neighbours within 1 m, well above the overlap
_ROUNDS = 3  # a closed loop moves poses, which may bring more pairs into reach
_START_OFF_M, _START_OFF_SHARE = 2.0, 0.3  # of the distance of two starts: above the error of odometry and compass


@dataclass(frozen=True, slots=True, eq=False)
class Registration:
    """Result of the registration of a session."""

    T_world: Float64[ndarray, "n 4 4"]  # pose of every cloud, shape (n, 4, 4); NaN for those that could not be joined
    covariance: Float64[ndarray, "n 6 6"]  # of a small motion (rotation vector [rad], translation [m]) on its right
    pairs: tuple[Pair, ...]  # all tried pairs, the accepted ones first
    # pairs that overlap although one of the two scanners measured the space of the other's points to be free, if some
    # cloud has more of them than half its accepted pairs; else empty
    conflicts: tuple[Pair, ...]
    scale: float  # factor on the stated sigmas of the pairs for them to agree, at least 1

    @property
    def complete(self) -> bool:
        """Whether every cloud has a pose, and no two poses contradict each other."""
        return bool(np.isfinite(self.T_world).all()) and not self.conflicts


def register(views: Sequence[SensorView], starts: Sequence[Pose], progress: Progress) -> Registration:
    """Find all poses, from start poses in the world, one for each view, or none if they are unknown.

    The frame of the first cloud becomes the world, unless its pose is given.
    """
    pairs: dict[tuple[int, int], Pair] = {}
    poses = _chain(views, starts, pairs, progress)
    order = sorted(poses)
    sure = {pair for pair in pairs if not pairs[pair].why_not}
    scale = 1.0
    covariance = np.full((len(views), 6, 6), np.nan)
    covariance[0] = 0.0
    for _ in range(_ROUNDS):
        near = [pair for pair in combinations(order, 2) if pair not in sure and _in_reach(views, poses, *pair)]
        for i, j in near:
            progress(f"aligning {views[i].name} and {views[j].name}")
            pairs[i, j] = align(views[i], views[j], np.linalg.inv(poses[i]) @ poses[j])
        sure.update(near)
        if not near and np.isfinite(covariance[order]).all():
            break
        graph = _solve(order, poses, pairs)
        poses = dict(zip(order, graph.T_world, strict=True))
        covariance[order], scale = graph.covariance, graph.scale
    T_world = np.array([poses.get(k, np.full((4, 4), np.nan)) for k in range(len(views))])
    tried = tuple(sorted(pairs.values(), key=lambda pair: bool(pair.why_not)))
    return Registration(T_world, covariance, tried, _conflicts(views, poses, pairs), scale)


def _conflicts(
    views: Sequence[SensorView], poses: dict[int, Floats], pairs: dict[tuple[int, int], Pair]
) -> tuple[Pair, ...]:
    """Find clouds at a wrong place that looks alike, by contradictions outside the chain of good pairs.

    People and doors move, so one pair is no proof: the pairs of a cloud vote.
    """
    conflicts, votes = [], np.zeros(len(views), int)
    for i, j in combinations(sorted(poses), 2):
        if (i, j) in pairs and not pairs[i, j].why_not:
            votes[[i, j]] += 1
        elif _in_reach(views, poses, i, j):
            pair = judge_pair(views[i], views[j], np.linalg.inv(poses[i]) @ poses[j])
            if pair.overlap >= MIN_OVERLAP and pair.contradiction > MAX_CONTRADICTION:
                conflicts.append(pair)
                votes[[i, j]] -= 2
    return tuple(conflicts) if votes.min(initial=0) < 0 else ()


def _chain(
    views: Sequence[SensorView],
    starts: Sequence[Floats],
    pairs: dict[tuple[int, int], Pair],
    progress: Progress,
) -> dict[int, Floats]:
    """Return a first pose for every cloud that can be joined to the first; neighbours in the list are tried first."""
    poses = {0: starts[0] if starts else np.eye(4)}
    while True:
        missing = [k for k in range(len(views)) if k not in poses]
        untried = [(k, i) for k in missing for i in poses if (min(i, k), max(i, k)) not in pairs]
        for k, i in sorted(untried, key=lambda pair: (abs(pair[0] - pair[1]), pair)):
            low, high = min(i, k), max(i, k)
            progress(f"aligning {views[low].name} and {views[high].name}")
            pair = _pair(views[low], views[high], [starts[low], starts[high]] if starts else [])
            pairs[low, high] = pair
            _LOG.info("%s and %s: %s", pair.a, pair.b, "; ".join(pair.why_not) or f"{pair.overlap:.0%} overlap")
            if not pair.why_not:
                poses[k] = poses[i] @ (pair.T_a_b if i == low else np.linalg.inv(pair.T_a_b))
                break
        else:
            return poses


def _pair(a: SensorView, b: SensorView, starts: Sequence[Floats]) -> Pair:
    """Align from the given poses, else without a start; a result far from the given poses is refused."""
    if not starts:
        return find_start(a, b)
    T_a_b = np.linalg.inv(starts[0]) @ starts[1]
    near = _near_start(align(a, b, T_a_b), T_a_b)
    return near if not near.why_not else _near_start(find_start(a, b), T_a_b)


def _near_start(pair: Pair, T_a_b: Pose) -> Pair:
    """Refuse the pair if it is far from its start: another room, or another door of a corridor, may fit as well."""
    distance_m = float(np.linalg.norm(T_a_b[:3, 3]))
    off_m = float(np.linalg.norm(pair.T_a_b[:3, 3] - T_a_b[:3, 3]))
    if pair.why_not or distance_m == 0 or off_m <= _START_OFF_M + _START_OFF_SHARE * distance_m:
        return pair  # equal starts are unknown ones: the files of many programs hold (0, 0, 0)
    return refused(pair, f"it lies {off_m:.1f} m from the start that was given")


def _in_reach(views: Sequence[SensorView], poses: dict[int, Floats], i: int, j: int) -> bool:
    """Whether the two clouds may overlap enough to be aligned."""
    return near_share(views[i], views[j], np.linalg.inv(poses[i]) @ poses[j]) > _WORTH


def _solve(order: Sequence[int], poses: dict[int, Floats], pairs: dict[tuple[int, int], Pair]) -> Graph:
    """Solve the graph of the accepted pairs; outliers are refused in `pairs`."""
    row = {k: position for position, k in enumerate(order)}
    edges = [Edge(row[i], row[j], pair.T_a_b, pair.covariance) for (i, j), pair in pairs.items() if not pair.why_not]
    graph = solve_graph(np.array([poses[k] for k in order]), edges)
    for edge in graph.left_out:
        i, j = order[edge.i], order[edge.j]
        pairs[i, j] = refused(pairs[i, j], "it contradicts all other pairs")
    return graph
