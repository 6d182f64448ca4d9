"""All scan positions of a session in one frame: a chain of pairs, then all overlapping pairs, then the graph."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float64
from numpy import ndarray

from scanwright.design.arrays import Floats, Pose
from scanwright.design.progress import Progress
from scanwright.firmware_io.registration.graph import Edge, Graph, solve_graph
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
