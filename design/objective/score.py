"""J of one mount and its numerical error, for any objective of `design.objective.named_objectives`.

For full turns each moment `int w <g(d)> dO / int w dO` is one-dimensional in the polar angle about the axis: `<g(d)>`
(`design.density.spin`) times the mean weight of each circle (`design.sphere.regions`), both exact. The quadrature over
the polar angle contains a rule with a third of the nodes, and their difference measures the error. For sweeps the
moments are means over disjoint sets of directions, and their spread is the error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int64
from numpy import ndarray

from scanwright.design.arrays import Setting
from scanwright.design.density.spin import PhaseStatistics, phase_statistics
from scanwright.design.density.sweep import mean_count_swept, phase_statistics_swept
from scanwright.design.frames import R_world_rot
from scanwright.design.objective.named_objectives import Moment
from scanwright.design.objective.problem import Problem
from scanwright.design.objective.quadrature import polar_rule
from scanwright.design.sphere.directions import sample_sets
from scanwright.design.sphere.polar_rule import PolarRule
from scanwright.design.sphere.total_weight import require_drawn

MOST_NODES = 200_000
ROUNDING = 1e-6  # smallest stated error
# share of `_misfit` that is stated, for nodes more than `FAR` steps between beams apart, which can meet all beams at
# nearly the same phase, and for closer nodes (`benchmarks.design.claims stated`)
ERROR_SHARE, FAR = (0.7, 0.2), 0.6
BENDS = 1.6  # weight of bends relative to differences of rules, which are 3 to 9 times the error of the finer rule
THIRD_FACTOR = 3.0  # error of a highest value, in units of the error of a third of the nodes
RANGE = 16  # nodes of the first ranges of the search for the lowest count
MOST_RANGES, SLIVER_RAD = 2048, 1e-6
SETS = 8  # of directions for a sweep
SURE = 4.5  # standard errors of their mean: exceeded in 0.3 % of cases (Student's t)


@dataclass(frozen=True, slots=True)
class Score:
    """J of one mount."""

    J: float  # the objective
    J_error: float  # conservative estimate of its numerical error (`score_on`)
    J_lower: float  # J of the mean counts, a lower bound of J since g is convex
    least: int  # lowest count of beams per ball in the weighted region at any start phase
    blind_weight: float  # share of the weight farther than a ball radius from all scan lines


def score(problem: Problem, angles_rad: Setting) -> Score:
    """Return J of (alpha_rot, beta_rot, alpha_laser, beta_laser) [rad], with nodes added until the tolerance is met."""
    nodes, before = problem.nodes, None
    while True:
        result = score_on(problem, angles_rad, nodes)
        if result.J_error <= problem.tolerance or nodes >= MOST_NODES or problem.grid_step_deg:
            return result
        if (result.J, result.J_error) == before:  # the error is that of one count: more nodes do not reduce it
            return result
        nodes, before = nodes * 3, (result.J, result.J_error)


def score_on(problem: Problem, angles_rad: Setting, nodes: int, *, stated: bool = True) -> Score:
    """Return J of a mount on a number of nodes; without `stated`, `J_error` and `J_lower` are NaN."""
    join, moments = problem.objective.join, problem.objective.moments
    if problem.sweep is None:
        result = [_moment_on_circles(problem, moment, angles_rad, nodes, stated) for moment in moments]
    else:
        result = [_moment_on_directions(problem, moment, angles_rad, nodes) for moment in moments]
    values = np.array([moment.value for moment in result])
    J = float(join(values))
    J_error = J_lower = np.nan
    if stated:
        each = np.arange(len(values))
        moved = np.array([join(np.where(each == k, m.value + m.error, values)) for k, m in enumerate(result)])
        J_error = float(np.linalg.norm(moved - J)) + problem.objective.join_error + ROUNDING if np.isfinite(J) else 0.0
        J_lower = float(join(np.array([moment.lower for moment in result])))
    shares = [(moment.share, m) for moment, m in zip(moments, result, strict=True) if moment.share > 0]
    return Score(
        J=J,
        J_error=J_error,
        J_lower=J_lower,
        least=min(m.least for _, m in shares),
        blind_weight=min(1.0, sum(share * m.blind for share, m in shares)),
    )


def quick_J(problem: Problem, angles_rad: Setting, nodes: int) -> float:
    """Return J without its error, for searches that need it often."""
    return score_on(problem, angles_rad, nodes, stated=False).J


def bound_J(problem: Problem, angles_rad: Setting, nodes: int) -> float:
    """Return J of the mean counts of a sweep, a lower bound of J that is much faster."""
    moments = problem.objective.moments
    values = [_moment_on_directions(problem, moment, angles_rad, nodes, exact=False).value for moment in moments]
    return float(problem.objective.join(np.array(values)))


def blind_share(weights: Float[ndarray, " n"], blind: Bool[ndarray, " n"]) -> float:
    """Return the share of the weights that is blind; equal summation makes it exactly 1 if all are blind."""
    return float(np.where(blind, weights, 0.0).sum() / weights.sum())


def blind_to_sweep(
    problem: Problem,
    directions_rot: Float[ndarray, "n 3"],
    beams_rot: Float[ndarray, "beams 3"],
    mean: Float[ndarray, " n"] | None = None,
) -> Bool[ndarray, " n"]:
    """Return whether directions of the rotation frame are farther than a ball radius from all lines of a sweep.

    `mean` are their mean counts within the ball of the problem, if known.
    """
    assert problem.sweep is not None
    # the field of view counts as continuous between beams: no ball is smaller than half their step
    ball_rad = max(problem.ball_rad, float(np.median(np.diff(problem.bearings_rad))) / 2 + 1e-9)
    if mean is None or ball_rad > problem.ball_rad:
        mean = mean_count_swept(directions_rot, beams_rot, problem.sweep, ball_rad)
    return mean <= 0


@dataclass(frozen=True, slots=True)
class _MomentValue:
    """A moment of one mount, its lowest count, blind share of the weight, error, and lower bound."""

    value: float
    least: int
    blind: float
    error: float = np.nan
    lower: float = np.nan


def _moment_on_circles(problem: Problem, moment: Moment, angles_rad: Setting, nodes: int, stated: bool) -> _MomentValue:
    """Return a moment by quadrature over the polar angle."""
    rule, polar, azimuth = polar_rule(problem, angles_rad, nodes, moment.field)

    def seen(polar_rad: Float[ndarray, " n"], until_rad: Float[ndarray, " n"] | None = None) -> PhaseStatistics:
        return phase_statistics(polar_rad, polar, azimuth, problem.lines, problem.ball_rad, moment.g, until_rad)

    z = seen(rule.polar_rad)
    if stated and not problem.grid_step_deg:  # the paper's grid has no weight between nodes
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
    """Return an error measure of a rule: differences from the rule with a third of its nodes, and bends of g.

    `g` is relative to its mean, since a missing weight changes the mean by g minus the mean. Both rules can miss the
    same step between two nodes; second differences of g show how large such steps are. The difference in each segment
    is included by half, since differences can cancel by chance.
    """
    by_segment = np.bincount(rule.segment, (share - rule.coarse / rule.fine.sum()) * g)
    pairs = np.maximum(share[1:], share[:-1])
    bends = np.diff(g, 2) * np.maximum(pairs[1:], pairs[:-1]) * (rule.segment[2:] == rule.segment[:-2])
    return float(np.linalg.norm([by_segment.sum(), *by_segment / 2, *BENDS * bends]))


def _widest_rad(rule: PolarRule) -> float:
    """Return the widest distance between neighbouring nodes with weight."""
    inside = (rule.segment[1:] == rule.segment[:-1]) & (rule.fine[1:] > 0) & (rule.fine[:-1] > 0)
    return float(np.diff(rule.polar_rad)[inside].max(initial=0.0))


def _with_lowest(
    seen: Callable[[Float[ndarray, " n"], Float[ndarray, " n"] | None], PhaseStatistics],
    rule: PolarRule,
    z: PhaseStatistics,
) -> Float[ndarray, " n"]:
    """Return the lowest counts at the nodes, with that of the lowest node replaced by the lowest of the entire region.

    Between nodes the count can be lower. Branch and bound over ranges of the polar angle: ranges whose bound is below
    the lowest count are halved until they are shorter than `SLIVER_RAD`. If there are more than `MOST_RANGES`, those
    with the highest bounds are dropped.
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
    """Return the lower and the upper ends of ranges of `RANGE` nodes that cover all segments with weight."""
    apart = (segment[1:] != segment[:-1]) | ~there[1:] | ~there[:-1]
    first, last = np.flatnonzero(np.append(True, apart)), np.flatnonzero(np.append(apart, True))
    first, last = first[last > first], last[last > first]
    ends = [
        # nodes are dense at the ends of a segment: the first is an eighth of a step from its end
        np.array([t[i] - (t[i + 1] - t[i]) / 8, *t[i + RANGE : k : RANGE], t[k] + (t[k] - t[k - 1]) / 8])
        for i, k in zip(first, last, strict=True)
    ]
    none = [np.empty(0)]
    return np.concatenate([each[:-1] for each in ends] or none), np.concatenate([each[1:] for each in ends] or none)


def _moment_on_directions(
    problem: Problem, moment: Moment, angles_rad: Setting, nodes: int, *, exact: bool = True
) -> _MomentValue:
    """Return a moment over `SETS` sets of directions, or over the grid; of the mean counts if not `exact`.

    Its error is `SURE` standard errors of the mean over the sets.
    """
    assert problem.sweep is not None
    R = R_world_rot(angles_rad[0], angles_rad[1])
    beams = problem.beams_rot(angles_rad[2:])
    sets = sample_sets(moment.field, problem.grid_step_deg, nodes // SETS, SETS)
    if not problem.grid_step_deg:
        require_drawn(moment.field, np.concatenate([samples.weights for samples in sets]) / SETS)
    directions = np.concatenate([samples.directions for samples in sets]) @ R
    if exact:
        z = phase_statistics_swept(directions, beams, problem.sweep, problem.ball_rad, moment.g)
    else:
        mean = mean_count_swept(directions, beams, problem.sweep, problem.ball_rad)
        z = PhaseStatistics(moment.g(mean), mean, mean, mean)
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
    z: PhaseStatistics,
    lower: Float[ndarray, " n"],
    fine: Float[ndarray, " n"],
    blind: Bool[ndarray, " n"],
) -> _MomentValue:
    """Return the highest g, with an error from the three subsets of every third node.

    All subsets can contain the same count, and a sliver between two nodes one less: that is the smallest error.
    """
    g = np.where(fine > 0, moment.g(z.least), -np.inf)
    least = int(z.least[fine > 0].min())
    value = float(g.max())
    thirds = [highest for highest in (g[i::3].max(initial=-np.inf) for i in range(3)) if np.isfinite(highest)]
    return _MomentValue(
        value=value,
        error=max(THIRD_FACTOR * (value - float(np.mean(thirds))), _one_less(moment, least)),
        lower=float(lower[fine > 0].max()),
        least=least,
        blind=blind_share(fine, blind),
    )


def _one_less(moment: Moment, least: int) -> float:
    """Return the rise of g if the count is one less than `least`; 0 if `least` is 0."""
    if not least:
        return 0.0
    fewer, now = moment.g(np.array([least - 1.0, least]))
    return float(fewer - now)
