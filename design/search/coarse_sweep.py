"""Coarse J of a sweep over every scan plane and every mounting of the servo: a matrix product over directions.

The density of a sweep differs all around the axis, so the twist of the servo about it counts, nothing folds, and the
polar angle is not enough: the factors are g at directions of the rotation frame, and the weights that each mounting
turns to them. As for the spin, g of the mean count comes first and bounds what is worth an exact look.
"""

from __future__ import annotations

import numpy as np

from scanwright.design.arrays import Array, Ints
from scanwright.design.concurrency.parallel import in_chunks
from scanwright.design.density.beams import beam_directions_rot
from scanwright.design.density.sweep import mean_count_swept, zones_swept
from scanwright.design.errors import TaskError
from scanwright.design.frames import R_world_rot
from scanwright.design.objective.problem import Problem
from scanwright.design.objective.score import blind_to_sweep
from scanwright.design.progress import Progress
from scanwright.design.search.coarse import BLIND_MARGIN, USUAL, Effort, Landscape, settled
from scanwright.design.search.constraints import AtMost, Constraint
from scanwright.design.search.grid_classes import Folded
from scanwright.design.search.plane_axis_product import Lowest, lowest, one_orientation
from scanwright.design.sphere.directions import EMPTY, spiral, weighted_samples
from scanwright.design.sphere.regions import Field
from scanwright.design.task.task import Limits

DIRECTIONS = 3000  # of the rotation frame, at least: one every 3.7 deg
MOST_DIRECTIONS = 20_000
IN_REGION = 600  # of them, if it takes no more than the most
MOST_SETTINGS = 50_000_000
BATCH = 16  # planes whose exact densities are computed before the bound is asked again


def swept_landscape(
    problem: Problem,
    planes: Folded,
    axes: Folded,
    progress: Progress,
    limits: Limits,
    avoid_holes: bool,
    effort: Effort = USUAL,
) -> tuple[Landscape, int]:
    """Coarse J of everything, and how many planes of it are exact; the others keep their bound.

    Raises:
        TaskError: no direction has a weight, or the grid holds too many settings.
    """
    settings = len(planes.first) * len(axes.first)
    if settings > MOST_SETTINGS:
        raise TaskError(
            f"angles.step_deg: {settings:,} settings: nothing folds when the servo sweeps, at most {MOST_SETTINGS:,}: "
            "take a larger step_deg, or fix an angle"
        )
    share = float((problem.field.weight_at(spiral(MOST_DIRECTIONS)) > 0).mean())
    usual = np.clip(IN_REGION / max(share, 1e-9), DIRECTIONS, MOST_DIRECTIONS)
    directions = spiral(int(effort.fineness * usual))
    weigh = _weights if share * len(directions) >= IN_REGION else _weights_nearby
    weights = tuple(weigh(moment.field, axes, directions) for moment in problem.objective.moments)
    beams = [beam_directions_rot(problem.bearings_rad, *np.radians(plane)) for plane in planes.settings_deg]
    progress(f"mean densities of {len(beams):,} scan planes")
    means = in_chunks(lambda chunk: [_mean(problem, directions, b) for b in beams[chunk]], len(beams), smallest=1)
    mean = np.stack([row for part in means for row in part])
    g = np.stack([moment.g(mean) for moment in problem.objective.moments])
    thin = np.zeros((0, 0), np.float32)
    constraints: list[Constraint] = []
    shares = weigh(problem.field, axes, directions).astype(np.float32)
    hidden = [blind_to_sweep(problem, directions, b, row) for b, row in zip(beams, mean, strict=True)]
    blind = np.stack(hidden).astype(np.float32)
    if avoid_holes:
        constraints.append(AtMost(blind, (shares > 0).astype(np.float32), 0.5, turns=False))
    if limits.max_blind_weight is not None:
        constraints.append(AtMost(blind, shares, limits.max_blind_weight + BLIND_MARGIN, turns=False))
    if limits.min_density is not None:
        thin = (np.floor(mean + 1e-9) < limits.min_density).astype(np.float32)
        constraints.append(AtMost(thin, (shares > 0).astype(np.float32), 0.5, turns=False))

    def lowest_of(these: slice | Ints, every: slice) -> tuple[Lowest, Lowest]:
        moments = zip(problem.objective.moments, g, weights, strict=True)
        orientations = [one_orientation(moment, of_g[these], w[every]) for moment, of_g, w in moments]
        feasible = [constraint.of(these, every) for constraint in constraints]
        return lowest(problem.objective, orientations, planes.has[:, these], axes.has[:, every], feasible)

    def look(batch: Ints) -> None:
        for c in batch:
            g[:, c], least = _exact(problem, directions, beams[c])
            if limits.min_density is not None:
                thin[c] = least < limits.min_density

    plain, feasible, exact = settled(lowest_of, look, (len(beams), len(axes.first)), BATCH, effort.margin, progress)
    return Landscape(problem.objective, g, weights, blind, tuple(constraints), plain, feasible), exact


def _mean(problem: Problem, directions: Array, beams: Array) -> Array:
    assert problem.sweep is not None
    return mean_count_swept(directions, beams, problem.sweep, problem.ball_rad)


def _exact(problem: Problem, directions: Array, beams: Array) -> tuple[Array, Array]:
    """What one plane gives at the directions, shape (moments, n), and the least count there, shape (n,)."""
    assert problem.sweep is not None
    rows = []
    for moment in problem.objective.moments:
        z = zones_swept(directions, beams, problem.sweep, problem.ball_rad, moment.g)
        rows.append(z.mean_g if moment.gathered == "mean" else moment.g(z.least))
    return np.stack(rows), z.least


def _weights(field: Field, axes: Folded, directions: Array) -> Array:
    """Share of the weight at each direction of the rotation frame, for each mounting, shape (mountings, n)."""
    R = R_world_rot(*np.radians(axes.settings_deg.T))
    rows = np.stack([field.weight_at(directions @ r.T) for r in R])
    total = rows.sum(axis=1, keepdims=True)
    if not (total > 0).all():
        raise TaskError(EMPTY)
    return rows / total


def _weights_nearby(field: Field, axes: Folded, directions: Array) -> Array:
    """The same of a region that lies between the directions: each of its own is given to the one next to it."""
    from scipy.spatial import cKDTree  # a heavy import that few tasks need

    samples = weighted_samples(field, IN_REGION)
    R = R_world_rot(*np.radians(axes.settings_deg.T))
    tree = cKDTree(directions)
    rows = np.stack([np.bincount(tree.query(samples.directions @ r)[1], samples.weights, len(directions)) for r in R])
    return rows / samples.weights.sum()
