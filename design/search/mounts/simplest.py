"""`angles.prefer = "simple"`: the mount with the fewest angles that costs no more than the task accepts.

Candidates are the settings of the grid in which at most one of the angles that the task leaves free is not 0, the
reference mounts with their tuned angle on the grid, and the families that the search found.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from scanwright.design.angles import STANDARD_DEG
from scanwright.design.objective.holes import NO_BLIND_WEIGHT
from scanwright.design.objective.problem import Problem
from scanwright.design.search.families import EQUAL, Family
from scanwright.design.search.mounts.reference import QUICK_NODES, TUNED, Four, angles_used
from scanwright.design.search.space import SearchSpace
from scanwright.design.task.angle_ranges import NAMES, AngleRanges

ROUGH_J = 0.05  # a quick J may be too high by this: then the exact one decides


def simplest_first(space: SearchSpace, families: tuple[Family, ...]) -> tuple[Family, ...]:
    """Put the simplest mount that costs at most `prefer_loss` before the families of a search, lowest J first.

    Simplest: the fewest angles that are not 0, then the lowest J. It keeps the limits, and has no hole if the optimum
    has none.
    """
    ranges, optimum = space.ranges, families[0]
    most_J = highest_J(space.problem, optimum.score.J, ranges.prefer_loss)
    free = optimum.score.blind_weight <= NO_BLIND_WEIGHT
    space = replace(space, avoid_holes=space.avoid_holes or free)
    known = {family.angles_deg: family for family in families if most_J + EQUAL >= family.score.J}
    quick = {setting: space.J(np.array(setting), QUICK_NODES) for setting in _simple_settings(ranges)}
    quick |= {angles_deg: family.score.J for angles_deg, family in known.items()}
    near = [setting for setting, J in quick.items() if most_J + ROUGH_J >= J]
    answer = optimum
    for setting in sorted(near, key=lambda setting: (angles_used(setting), quick[setting])):
        result = space.score(np.array(setting))
        if result is not None and most_J + EQUAL >= result.J:
            answer = known.get(setting) or Family(setting, result, 1, "")
            break
    others = [family for family in families if family.angles_deg != answer.angles_deg]
    return (answer, *others)


def highest_J(problem: Problem, J: float, loss: float) -> float:
    """The highest J that costs no more than a share: of the beams per ball, or of J for another objective than log."""
    return J - math.log1p(-loss) if problem.objective.name == "log" else J + loss * abs(J)


def _simple_settings(ranges: AngleRanges) -> list[Four]:
    """The candidates that the ranges hold, each once."""
    limits = [ranges.limits(name) for name in NAMES]
    none = [float(np.clip(0.0, *each)) for each in limits]
    result = [tuple(none), *STANDARD_DEG.values()]
    for k, name in enumerate(NAMES):
        result += [(*none[:k], angle, *none[k + 1 :]) for angle in ranges.grid_deg(name).tolist()]
    for line in (line for lines in TUNED.values() for line in lines):
        grid = ranges.grid_deg(NAMES[line.free])
        result += [line.at(angle) for angle in grid[(grid >= line.low_deg) & (grid <= line.high_deg)].tolist()]
    inside = [(a + 0.0, b + 0.0, c + 0.0, d + 0.0) for a, b, c, d in result if ranges.hold((a, b, c, d))]
    return list(dict.fromkeys(inside))
