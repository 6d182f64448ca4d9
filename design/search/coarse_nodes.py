"""Nodes of coarse J: polar angles about the axis for full turns, directions of the rotation frame for sweeps.

The density of a sweep is not symmetric about the axis, so the orientation of the servo about it matters, and the grid
has no symmetries.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from scanwright.design.arrays import Array, Counts, Ints
from scanwright.design.concurrency.parallel import in_chunks
from scanwright.design.density.beams import beam_directions_rot, polar_and_azimuth, polar_of_planes
from scanwright.design.density.spin import PhaseStatistics, mean_count, phase_statistics
from scanwright.design.density.sweep import mean_count_swept, phase_statistics_swept
from scanwright.design.errors import TaskError
from scanwright.design.frames import R_world_rot
from scanwright.design.objective.named_objectives import Moment
from scanwright.design.objective.score import blind_to_sweep
from scanwright.design.search.constraints import AtMost, Constraint, NoHole, fan_reach
from scanwright.design.search.plane_axis_product import both_orientations, one_orientation
from scanwright.design.search.space import SearchSpace
from scanwright.design.sphere.directions import EMPTY, spiral, weighted_samples
from scanwright.design.sphere.outline import reach_about
from scanwright.design.sphere.polar_weights import weights_over_polar
from scanwright.design.sphere.regions import Field

FEW_AXES = 4000  # up to this number nodes are 0.5 deg apart, above 1 deg
MOST_NODES = 1441  # for balls below half a degree
DIRECTIONS = 3000  # fewest of the rotation frame: one every 3.7 deg
MOST_DIRECTIONS = 20_000
IN_REGION = 600  # directions wanted in the region
MOST_SETTINGS = 50_000_000


class Circles:
    """Equally spaced polar angles about the axis, for full turns; planes and axes are classes of the grid.

    Attributes:
        batch: planes whose exact densities are computed at once.
        turns: whether a flipped plane has its nodes in the opposite order.
        orientations: computes a moment of planes about axes, not flipped and flipped.
    """

    batch, turns = 64, True
    orientations = staticmethod(both_orientations)

    def __init__(self, space: SearchSpace, fineness: float) -> None:
        self._problem, self._axes = space.problem, space.axes.representatives
        # caustics are as wide as the ball: nodes are at most a quarter of it apart
        usual = max(180, 2 * np.pi / self._problem.ball_rad) if len(self._axes) <= FEW_AXES else 90
        half = min((MOST_NODES - 1) // 2, int(fineness * usual))
        self._polar = np.linspace(0, np.pi, 2 * half + 1)  # odd, so that a flip keeps the node at the equator
        self._planes_rad = np.radians(space.planes.settings_deg[space.planes.first])
        self._fans = fan_reach(self._problem, self._planes_rad)

    def weights(self, field: Field) -> Array:
        """Return the share of a weight at the nodes, shape (axes, nodes)."""
        nodes = len(self._polar)
        return weights_over_polar(field, self._axes, nodes, self._problem.grid_step_deg)

    def inside(self, weights: Array) -> Array:
        """Return 1 for nodes inside the region and not at its edge, else 0, shape (axes, nodes)."""
        there = weights > 0
        there[:, 1:-1] &= there[:, :-2] & there[:, 2:]
        return there.astype(np.float32)

    def means(self) -> Array:
        """Return the mean counts, shape (planes, nodes)."""
        problem = self._problem

        def of(chunk: slice) -> Array:
            beams = polar_of_planes(problem.bearings_rad, self._planes_rad[chunk])
            return np.stack([mean_count(self._polar, row, problem.lines, problem.ball_rad) for row in beams])

        return np.concatenate(in_chunks(of, len(self._planes_rad), smallest=8))

    def exact(self, planes: Ints) -> tuple[Array, Array]:
        """Return `<g(d)>` of some planes, shape (moments, n, nodes), and the lowest counts, shape (n, nodes)."""
        problem, planes_rad = self._problem, self._planes_rad[planes]

        def of(plane: Array) -> tuple[Array, Array]:
            beams = polar_and_azimuth(beam_directions_rot(problem.bearings_rad, *plane))
            return _rows(
                problem.objective.moments,
                lambda g: phase_statistics(self._polar, *beams, problem.lines, problem.ball_rad, g),
            )

        parts = in_chunks(lambda chunk: [of(plane) for plane in planes_rad[chunk]], len(planes_rad), smallest=1)
        return _stacked([row for part in parts for row in part])

    def blind(self, means: Array) -> Array:  # noqa: ARG002, used for sweeps
        """Return 1 for blind nodes, else 0, shape (planes, nodes)."""
        return ((self._polar < self._fans[:, :1]) | (self._polar > self._fans[:, 1:])).astype(np.float32)

    def no_hole(self, field: Field, blind: Array, weights: Array) -> Constraint:  # noqa: ARG002, used for sweeps
        """Return the constraint that no part of a field is blind."""
        return NoHole(self._fans, reach_about(field, self._axes))


class Directions:
    """Directions of the rotation frame that cover the sphere evenly, for sweeps; see `Circles`."""

    batch, turns = 16, False
    orientations = staticmethod(one_orientation)

    def __init__(self, space: SearchSpace, fineness: float) -> None:
        settings = len(space.planes.first) * len(space.axes.first)
        if settings > MOST_SETTINGS:
            raise TaskError(
                f"angles.step_deg: {settings:,} settings, at most {MOST_SETTINGS:,} for a sweep, which has no "
                "symmetries: use a larger step_deg, or fix an angle"
            )
        self._problem = space.problem
        share = float((space.problem.field.weight_at(spiral(MOST_DIRECTIONS)) > 0).mean())
        usual = np.clip(IN_REGION / max(share, 1e-9), DIRECTIONS, MOST_DIRECTIONS)
        self._directions = spiral(int(fineness * usual))
        self._many = share * len(self._directions) >= IN_REGION
        self._R = R_world_rot(*np.radians(space.axes.settings_deg.T))
        planes_rad = np.radians(space.planes.settings_deg)
        self._beams = [beam_directions_rot(space.problem.bearings_rad, *plane) for plane in planes_rad]

    def weights(self, field: Field) -> Array:
        """See `Circles`.

        Raises:
            TaskError: no direction has a weight.
        """
        if not self._many:
            return self._weights_nearby(field)
        rows = np.stack([field.weight_at(self._directions @ r.T) for r in self._R])
        total = rows.sum(axis=1, keepdims=True)
        if not (total > 0).all():
            raise TaskError(EMPTY)
        return rows / total

    def _weights_nearby(self, field: Field) -> Array:
        """Return the weights of a small region: each direction of the region counts at the nearest node."""
        from scipy.spatial import cKDTree  # a heavy import that few tasks need

        samples = weighted_samples(field, IN_REGION)
        tree, count = cKDTree(self._directions), len(self._directions)
        nearest = [tree.query(samples.directions @ r)[1] for r in self._R]
        return np.stack([np.bincount(row, samples.weights, count) for row in nearest]) / samples.weights.sum()

    def inside(self, weights: Array) -> Array:
        """See `Circles`."""
        return (weights > 0).astype(np.float32)

    def means(self) -> Array:
        """See `Circles`."""
        problem, sweep = self._problem, self._problem.sweep
        assert sweep is not None

        def of(beams: Array) -> Array:
            return mean_count_swept(self._directions, beams, sweep, problem.ball_rad)

        parts = in_chunks(lambda chunk: [of(b) for b in self._beams[chunk]], len(self._beams), smallest=1)
        return np.stack([row for part in parts for row in part])

    def exact(self, planes: Ints) -> tuple[Array, Array]:
        """See `Circles`."""
        problem, sweep = self._problem, self._problem.sweep
        assert sweep is not None

        def of(beams: Array) -> tuple[Array, Array]:
            return _rows(
                problem.objective.moments,
                lambda g: phase_statistics_swept(self._directions, beams, sweep, problem.ball_rad, g),
            )

        return _stacked([of(self._beams[plane]) for plane in planes])

    def blind(self, means: Array) -> Array:
        """See `Circles`."""
        rows = zip(self._beams, means, strict=True)
        hidden = [blind_to_sweep(self._problem, self._directions, beams, row) for beams, row in rows]
        return np.stack(hidden).astype(np.float32)

    def no_hole(self, field: Field, blind: Array, weights: Array) -> Constraint:  # noqa: ARG002, used for turns
        """See `Circles`."""
        return AtMost(blind, (weights > 0).astype(np.float32), 0.5, turns=False)


def _rows(
    moments: tuple[Moment, ...], seen: Callable[[Callable[[Counts], Array]], PhaseStatistics]
) -> tuple[Array, Array]:
    """Return g of one plane for each moment, shape (moments, nodes), and the lowest counts at the nodes."""
    rows = []
    for moment in moments:
        z = seen(moment.g)
        rows.append(z.mean_g if moment.gathered == "mean" else moment.g(z.least))
    return np.stack(rows), z.least


def _stacked(rows: list[tuple[Array, Array]]) -> tuple[Array, Array]:
    return np.stack([g for g, _ in rows], axis=1), np.stack([least for _, least in rows])


Nodes = Circles | Directions
