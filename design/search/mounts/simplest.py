"""`angles.prefer = "simple"`: the mount with the fewest angles other than 0 within the accepted loss.

Candidates are the mounts of the grid with at most one free angle other than 0, the reference mounts with their tuned
angle on the grid, and the results of the search.
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

ROUGH_J = 0.05  # error of a quick J


def simplest_first(space: SearchSpace, families: tuple[Family, ...]) -> tuple[Family, ...]:
    """Return the families of a search (lowest J first) after the simplest mount that costs at most `prefer_loss`.

    The simplest mount has the fewest angles other than 0, then the lowest J. It meets the limits, and has no blind spot
    if the optimum has none.
    """
    ranges, optimum = space.ranges, families[0]
    most_J = highest_J(space.problem, optimum.score.J, ranges.prefer_loss)
    free = optimum.score.blind_weight <= NO_BLIND_WEIGHT
    space = replace(space, avoid_holes=space.avoid_holes or free)
    known = {family.angles_deg: family for family in families if most_J + EQUAL >= family.score.J}
    quick = {setting: space.J(np.array(setting), QUICK_NODES) for setting in _simple_settings(ranges)}
    quick |= {angles_deg: family.score.J for angles_deg, family in known.items()}
    near = [setting for setting, J in quick.items() if most_J + ROUGH_J >= J]
    simplest = optimum
    for setting in sorted(near, key=lambda setting: (angles_used(setting), quick[setting])):
        result = space.score(np.array(setting))
        if result is not None and most_J + EQUAL >= result.J:
            simplest = known.get(setting) or Family(setting, result, 1, "")
            break
    return (simplest, *(family for family in families if family.angles_deg != simplest.angles_deg))


def highest_J(problem: Problem, J: float, loss: float) -> float:
    """Return the highest J within a relative loss: of beams per ball, or of J for objectives other than `log`."""
    return J - math.log1p(-loss) if problem.objective.name == "log" else J + loss * abs(J)


def _simple_settings(ranges: AngleRanges) -> list[Four]:
    """Return the candidates within the ranges, each once."""
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
