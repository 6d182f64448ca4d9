"""Coarse J of a sweep over every scan plane and every mounting of the servo: a matrix product over directions.

The density of a sweep differs all around the axis, so the twist of the servo about it counts, nothing folds, and the
polar angle is not enough: the factors are g at directions of the rotation frame, and the weights that each mounting
turns to them. As for the spin, g of the mean count comes first and bounds what is worth an exact look.
"""

from __future__ import annotations

import numpy as np

from design.arrays import Array
from design.concurrency.parallel import in_chunks
from design.density.beams import beam_directions_rot
from design.density.sweep import mean_count_swept, zones_swept
from design.errors import TaskError
from design.frames import R_world_rot
from design.objective.named_objectives import Moment
from design.objective.problem import Problem
from design.search.coarse import MARGIN, Landscape, Progress
from design.search.grid_classes import Folded
from design.search.plane_axis_product import BothWays, lowest, one_way
from design.sphere.directions import EMPTY, spiral

DIRECTIONS = 3000  # of the rotation frame, at least: one every 3.7 deg
MOST_DIRECTIONS = 20_000
IN_REGION = 600  # of them, if it takes no more than the most
MOST_SETTINGS = 50_000_000
REPORT = 200


def swept_landscape(problem: Problem, planes: Folded, axes: Folded, progress: Progress) -> tuple[Landscape, int]:
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
    directions = spiral(int(np.clip(IN_REGION / max(share, 1e-9), DIRECTIONS, MOST_DIRECTIONS)))
    weights = tuple(_weights(moment, axes, directions) for moment in problem.objective.moments)
    beams = [beam_directions_rot(problem.bearings_rad, *np.radians(plane)) for plane in planes.settings_deg]
    progress(f"mean densities of {len(beams):,} scan planes")
    means = in_chunks(lambda chunk: [_mean(problem, directions, b) for b in beams[chunk]], len(beams), smallest=1)
    mean = np.stack([row for part in means for row in part])
    g = np.stack([moment.g(mean) for moment in problem.objective.moments])
    exact = np.zeros(len(beams), dtype=bool)
    best = np.inf

    def ways_of(g: Array) -> list[BothWays]:
        return [one_way(m, of_g, w) for m, of_g, w in zip(problem.objective.moments, g, weights, strict=True)]

    bounds = lowest(problem.objective, ways_of(g), planes.has, axes.has)[0].min(axis=0)
    for c in np.argsort(bounds, kind="stable"):
        if bounds[c] > best + MARGIN:
            break
        if exact.sum() % REPORT == 0:
            progress(f"exact densities: {exact.sum()} of at most {len(beams):,} scan planes")
        g[:, c] = _exact(problem, directions, beams[c])
        exact[c] = True
        one = slice(c, c + 1)
        best = min(best, float(lowest(problem.objective, ways_of(g[:, one]), planes.has[:, one], axes.has)[0].min()))
    by_plane, its_class, its_flip, by_axis = lowest(problem.objective, ways_of(g), planes.has, axes.has)
    return Landscape(problem.objective, g, weights, by_plane, (its_class, its_flip), by_axis), int(exact.sum())


def _mean(problem: Problem, directions: Array, beams: Array) -> Array:
    assert problem.sweep is not None
    return mean_count_swept(directions, beams, problem.sweep, problem.ball_rad)


def _exact(problem: Problem, directions: Array, beams: Array) -> Array:
    """What one plane gives at the directions, shape (moments, n)."""
    assert problem.sweep is not None
    rows = []
    for moment, table in zip(problem.objective.moments, problem.tables, strict=True):
        z = zones_swept(directions, beams, problem.sweep, problem.ball_rad, table)
        rows.append(z.mean_g if moment.gathered == "mean" else moment.g(z.least))
    return np.stack(rows)


def _weights(moment: Moment, axes: Folded, directions: Array) -> Array:
    """Share of the weight at each direction of the rotation frame, for each mounting, shape (mountings, n)."""
    R = R_world_rot(*np.radians(axes.settings_deg.T))
    rows = np.stack([moment.field.weight_at(directions @ r.T) for r in R])
    total = rows.sum(axis=1, keepdims=True)
    if not (total > 0).all():
        raise TaskError(EMPTY)
    return rows / total
