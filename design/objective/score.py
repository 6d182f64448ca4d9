"""J of one setting, with the error of its own quadrature, for any objective of `design.objective.named_objectives`.

In coordinates about the axis each moment `int w <g(d)> dO / int w dO` is one-dimensional: the zonal `<g(d)>`
(`design.density.spin`) times the mean weight of each circle (`design.sphere.regions`), both exact at every polar angle.
What is left is the quadrature over that angle. Its segments end where a circle touches an edge of the region or passes
a corner of it; the rule with a third of the nodes is inside the full one, and their difference measures the error.
A sweep is not zonal: its moments are means over sets of directions that share none, and their spread is the error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int64
from numpy import ndarray

from scanwright.design.arrays import Setting
from scanwright.design.density.spin import Zones, zones
from scanwright.design.density.sweep import mean_count_swept, zones_swept
from scanwright.design.frames import R_world_rot
from scanwright.design.objective.named_objectives import Moment
from scanwright.design.objective.problem import Problem
from scanwright.design.objective.quadrature import polar_rule
from scanwright.design.sphere.directions import sample_sets
from scanwright.design.sphere.polar_rule import PolarRule
from scanwright.design.sphere.total_weight import require_drawn

MOST_NODES = 200_000
ROUNDING = 1e-6  # floor of the stated error
# shares of `_misfit` that are stated: of nodes further apart than `FAR` steps between beams, which may meet all beams
# at nearly the same phase, and of closer ones (`benchmarks.design.claims stated`)
ERROR_SHARE, FAR = (0.7, 0.2), 0.6
BENDS = 1.6  # weight of bends against differences of rules, whose finer one is off by a third to a ninth of them
MISSED_AGAIN = 3.0  # times what a third of the nodes misses: each further third finds less
RANGE = 16  # nodes of a range of polar angles that the search for the lowest count begins with
MOST_RANGES, SLIVER_RAD = 2048, 1e-6
SETS = 8  # of directions for a sweep
SURE = 4.5  # standard errors of their mean: by Student's t three in a thousand are further off


@dataclass(frozen=True, slots=True)
class Score:
    """J of one setting.

    Attributes:
        J: the objective.
        J_error: estimate of its numerical error, on the safe side (`score_on`); of a lowest count one at least.
        J_lower: with g of the mean counts, a lower bound of J as g is convex.
        least: lowest count in the weighted region at any start phase, beams per ball.
        blind_weight: share of the weight that is blind: beyond a ball radius of all that the fan passes over.
    """

    J: float
    J_error: float
    J_lower: float
    least: int
    blind_weight: float


def score(problem: Problem, angles_rad: Setting) -> Score:
    """J of the setting (alpha_rot, beta_rot, alpha_laser, beta_laser) [rad], on as many nodes as its tolerance needs.

    Raises:
        TaskError: no direction has a weight.
    """
    nodes, before = problem.nodes, None
    while True:
        result = score_on(problem, angles_rad, nodes)
        if result.J_error <= problem.tolerance or nodes >= MOST_NODES or problem.grid_step_deg:
            return result
        if (result.J, result.J_error) == before:  # a whole count, which no nodes make smaller
            return result
        nodes, before = nodes * 3, (result.J, result.J_error)


def score_on(problem: Problem, angles_rad: Setting, nodes: int, *, stated: bool = True) -> Score:
    """J of a setting on a number of nodes; `J_error` and `J_lower` are NaN if they are not stated.

    `ERROR_SHARE` of `_misfit` is stated. A missing weight changes a mean by how far g is from the mean there, so g
    counts from it.

    Raises:
        TaskError: no direction has a weight.
    """
    join, moments = problem.objective.join, problem.objective.moments
    if problem.sweep is None:
        result = [_moment_on_circles(problem, k, angles_rad, nodes, stated) for k in range(len(moments))]
    else:
        result = [_moment_on_directions(problem, k, angles_rad, nodes) for k in range(len(moments))]
    values = np.array([moment.value for moment in result])
    J = float(join(values))
    J_error = J_lower = np.nan
    if stated:
        each = np.arange(len(values))
        moved = np.array([join(np.where(each == k, m.value + m.error, values)) for k, m in enumerate(result)])
        J_error = float(np.linalg.norm(moved - J)) + problem.objective.join_error + ROUNDING if np.isfinite(J) else 0.0
        J_lower = float(join(np.array([moment.lower for moment in result])))
    spoken = [(moment.share, m) for moment, m in zip(moments, result, strict=True) if moment.share > 0]
    return Score(
        J=J,
        J_error=J_error,
        J_lower=J_lower,
        least=min(m.least for _, m in spoken),
        blind_weight=min(1.0, sum(share * m.blind for share, m in spoken)),
    )


def quick_J(problem: Problem, angles_rad: Setting, nodes: int) -> float:
    """J alone, as `score` computes it: for searches that call it often."""
    return score_on(problem, angles_rad, nodes, stated=False).J


def bound_J(problem: Problem, angles_rad: Setting, nodes: int) -> float:
    """J of the mean counts of a sweep, a lower bound of J that takes a fraction of its time: for searches."""
    values = [
        _moment_on_directions(problem, k, angles_rad, nodes, exact=False).value
        for k in range(len(problem.objective.moments))
    ]
    return float(problem.objective.join(np.array(values)))


def blind_share(weights: Float[ndarray, " n"], blind: Bool[ndarray, " n"]) -> float:
    """Share of weights (n,) that is blind, 0 .. 1: both sums are made alike, so all of it is 1 and no part is more."""
    return float(np.where(blind, weights, 0.0).sum() / weights.sum())


def blind_to_sweep(
    problem: Problem,
    directions_rot: Float[ndarray, "n 3"],
    beams_rot: Float[ndarray, "beams 3"],
    mean: Float[ndarray, " n"] | None = None,
) -> Bool[ndarray, " n"]:
    """Whether directions of the rotation frame (n, 3) lie beyond a ball radius of all that a sweep passes over.

    `mean` are their mean counts within the ball of the problem, if they are known.
    """
    assert problem.sweep is not None
    # between two beams the fan is continuous: no ball is smaller than half their step
    ball_rad = max(problem.ball_rad, float(np.median(np.diff(problem.bearings_rad))) / 2 + 1e-9)
    if mean is None or ball_rad > problem.ball_rad:
        mean = mean_count_swept(directions_rot, beams_rot, problem.sweep, ball_rad)
    return mean <= 0


@dataclass(frozen=True, slots=True)
class _MomentValue:
    """A moment of one setting, with the least count, the share that is blind, and its error and its lower bound."""

    value: float
    least: int
    blind: float
    error: float = np.nan
    lower: float = np.nan


def _moment_on_circles(problem: Problem, index: int, angles_rad: Setting, nodes: int, stated: bool) -> _MomentValue:
    """A moment by quadrature over the polar angle."""
    moment = problem.objective.moments[index]
    rule, polar, azimuth = polar_rule(problem, angles_rad, nodes, moment.field)

    def seen(polar_rad: Float[ndarray, " n"], until_rad: Float[ndarray, " n"] | None = None) -> Zones:
        return zones(polar_rad, polar, azimuth, problem.lines, problem.ball_rad, moment.g, until_rad)

    z = seen(rule.polar_rad)
    if stated and not problem.grid_step_deg:  # of the paper's grid nothing between the nodes counts
        z = replace(z, least=_with_lowest(seen, rule, z))
    blind = np.zeros(len(rule.polar_rad), dtype=bool)
    for low, high in problem.blind_zones(polar):
        blind |= (low < rule.polar_rad) & (rule.polar_rad < high)
    if moment.gathered == "highest":
        return _highest(moment, z, moment.g(z.mean), rule.fine, blind)
    total = rule.fine.sum()
    share = rule.fine / total
    result = _MomentValue(float(share @ z.mean_g), int(z.least[share > 0].min()), blind_share(rule.fine, blind))
    if not stated:
        return result
    beam_step_rad = float(np.median(np.diff(problem.bearings_rad))) if len(polar) > 1 else np.inf
    close = bool(_widest_rad(rule) <= FAR * abs(beam_step_rad))
    error = ERROR_SHARE[close] * _misfit(rule, share, z.mean_g - result.value)
    return replace(result, error=error, lower=float(share @ moment.g(z.mean)))


def _misfit(rule: PolarRule, share: Float[ndarray, " n"], g: Float[ndarray, " n"]) -> float:
    """What a rule may be off by: the rule with a third of its nodes, and the bends of g from node to node.

    Both rules may miss a step or a bend between two nodes alike; those that nodes meet show how large one may be, and
    a step is a bend, too. The differences of the rules count in all, and half of each segment's, as they may cancel by
    chance.
    """
    by_segment = np.bincount(rule.segment, (share - rule.coarse / rule.fine.sum()) * g)
    pairs = np.maximum(share[1:], share[:-1])
    bends = np.diff(g, 2) * np.maximum(pairs[1:], pairs[:-1]) * (rule.segment[2:] == rule.segment[:-2])
    return float(np.linalg.norm([by_segment.sum(), *by_segment / 2, *BENDS * bends]))


def _widest_rad(rule: PolarRule) -> float:
    """The widest distance between neighbouring nodes with weight."""
    inside = (rule.segment[1:] == rule.segment[:-1]) & (rule.fine[1:] > 0) & (rule.fine[:-1] > 0)
    return float(np.diff(rule.polar_rad)[inside].max(initial=0.0))


def _with_lowest(
    seen: Callable[[Float[ndarray, " n"], Float[ndarray, " n"] | None], Zones], rule: PolarRule, z: Zones
) -> Float[ndarray, " n"]:
    """Lowest counts at the nodes, that of the lowest node replaced by the lowest of the whole region, shape (n,).

    A count dips where windows of several beams begin and end within less than a node. Branch and bound over ranges of
    the polar angle: those whose bound is not below the lowest count so far are done, the others are halved until they
    are shorter than `SLIVER_RAD`. Of more than `MOST_RANGES` those of the highest bounds are dropped.
    """
    t, there = rule.polar_rad, rule.fine > 0
    lowest = np.flatnonzero(there)[np.argmin(z.least[there])]
    least = z.least.copy()
    low, high = _weighted_ranges(t, there, rule.segment)
    while len(low) and least[lowest] > 0:
        bound = seen(low, high).least
        open_ = np.flatnonzero(bound < least[lowest])
        open_ = open_[np.argsort(bound[open_], kind="stable")[:MOST_RANGES]]
        low, high = low[open_], high[open_]
        middle = (low + high) / 2
        if len(middle):
            least[lowest] = min(least[lowest], seen(middle, None).least.min())
        wide = high - low > SLIVER_RAD
        low, middle, high = low[wide], middle[wide], high[wide]
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    return least


def _weighted_ranges(
    t: Float[ndarray, " n"], there: Bool[ndarray, " n"], segment: Int64[ndarray, " n"]
) -> tuple[Float[ndarray, " ranges"], Float[ndarray, " ranges"]]:
    """Ranges of some nodes each that together are all segments with weight: their lower and their upper ends."""
    apart = (segment[1:] != segment[:-1]) | ~there[1:] | ~there[:-1]
    first, last = np.flatnonzero(np.append(True, apart)), np.flatnonzero(np.append(apart, True))
    first, last = first[last > first], last[last > first]
    ends = [
        # nodes crowd at the ends of a segment: the first is an eighth of a step from it
        np.array([t[i] - (t[i + 1] - t[i]) / 8, *t[i + RANGE : k : RANGE], t[k] + (t[k] - t[k - 1]) / 8])
        for i, k in zip(first, last, strict=True)
    ]
    none = [np.empty(0)]
    return np.concatenate([each[:-1] for each in ends] or none), np.concatenate([each[1:] for each in ends] or none)


def _moment_on_directions(
    problem: Problem, index: int, angles_rad: Setting, nodes: int, *, exact: bool = True
) -> _MomentValue:
    """A moment over `SETS` sets of directions, of which `SURE` standard errors are its error, or over the grid.

    If it is not to be exact, it is that of the mean counts.
    """
    assert problem.sweep is not None
    moment = problem.objective.moments[index]
    R = R_world_rot(angles_rad[0], angles_rad[1])
    beams = problem.beams_rot(angles_rad[2:])
    sets = sample_sets(moment.field, problem.grid_step_deg, nodes // SETS, SETS)
    if not problem.grid_step_deg:
        require_drawn(moment.field, np.concatenate([samples.weights for samples in sets]) / SETS)
    directions = np.concatenate([samples.directions for samples in sets]) @ R
    if exact:
        z = zones_swept(directions, beams, problem.sweep, problem.ball_rad, moment.g)
    else:
        mean = mean_count_swept(directions, beams, problem.sweep, problem.ball_rad)
        z = Zones(moment.g(mean), mean, mean, mean)
    blind = blind_to_sweep(problem, directions, beams, z.mean)
    lower = moment.g(z.mean)
    result, first = [], 0
    for samples in sets:
        own = slice(first, first := first + len(samples.weights))
        if moment.gathered == "highest":
            result.append(_highest(moment, z.of(own), lower[own], samples.weights, blind[own]))
        else:
            share = samples.weights / samples.weights.sum()
            value, bound = (float(share @ of[own]) for of in (z.mean_g, lower))
            hidden = blind_share(samples.weights, blind[own])
            result.append(_MomentValue(value, int(z.least[own].min()), hidden, lower=bound))
    values, least = np.array([f.value for f in result]), min(f.least for f in result)
    gather = np.max if moment.gathered == "highest" else np.mean
    if moment.gathered == "highest":
        error = max(float(np.ptp(values)), _one_less(moment, least))
    else:
        error = SURE * float(np.std(values, ddof=1)) / SETS**0.5 if len(values) > 1 else 0.0
    return _MomentValue(
        value=float(gather(values)),
        error=error,
        lower=float(gather([f.lower for f in result])),
        least=least,
        blind=float(np.mean([f.blind for f in result])),
    )


def _highest(
    moment: Moment,
    z: Zones,
    lower: Float[ndarray, " n"],
    fine: Float[ndarray, " n"],
    blind: Bool[ndarray, " n"],
) -> _MomentValue:
    """The highest g anywhere; the mean error of every third node gives that of all.

    All thirds may meet the same count where a sliver between two nodes has one less, so that is the least error.
    """
    g = np.where(fine > 0, moment.g(z.least), -np.inf)
    least = int(z.least[fine > 0].min())
    value = float(g.max())
    thirds = [highest for highest in (g[i::3].max(initial=-np.inf) for i in range(3)) if np.isfinite(highest)]
    return _MomentValue(
        value=value,
        error=max(MISSED_AGAIN * (value - float(np.mean(thirds))), _one_less(moment, least)),
        lower=float(lower[fine > 0].max()),
        least=least,
        blind=blind_share(fine, blind),
    )


def _one_less(moment: Moment, least: int) -> float:
    """How much g rises if a count is one less than `least`; 0 if there is none less."""
    if not least:
        return 0.0
    fewer, now = moment.g(np.array([least - 1.0, least]))
    return float(fewer - now)
