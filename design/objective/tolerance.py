"""How J suffers when the mount is not as designed: printed angles are off by a degree sooner than by a tenth."""

from __future__ import annotations

import numpy as np

from scanwright.design.arrays import Setting
from scanwright.design.objective.problem import NODES, Problem
from scanwright.design.objective.score import quick_J
from scanwright.design.task.angle_ranges import NAMES


def sensitivity(problem: Problem, angles_rad: Setting, off_rad: float, nodes: int = NODES) -> dict[str, float]:
    """What each mounting angle costs in J when it alone is off, either way: the worse of the two."""
    J = quick_J(problem, angles_rad, nodes)
    worse = [max(quick_J(problem, moved, nodes) for moved in pair) - J for pair in _moved(angles_rad, off_rad)]
    return dict(zip(NAMES, worse, strict=True))


def worst_within(problem: Problem, angles_rad: Setting, off_rad: float, nodes: int) -> float:
    """Highest J of the setting and of those with one angle off, either way."""
    return max(quick_J(problem, angles_rad, nodes), worst_off(problem, angles_rad, off_rad, nodes))


def worst_off(problem: Problem, angles_rad: Setting, off_rad: float, nodes: int) -> float:
    """Highest J of the settings with one angle off, either way."""
    return max(quick_J(problem, moved, nodes) for pair in _moved(angles_rad, off_rad) for moved in pair)


def rise_words(rises: dict[str, float], J_error: float) -> str:
    """What `sensitivity` found, in words: within the error of J nothing is known to rise."""
    least = max(J_error, 5e-5)  # four digits are shown
    rising = ", ".join(f"{rise:.4f} ({name})" for name, rise in rises.items() if rise > least)
    still = ", ".join(name for name, rise in rises.items() if rise <= least)
    if not rising:
        return "J rises by no more than its error, whichever angle it is"
    return f"J rises by {rising}" + (f", by no more than its error ({still})" if still else "")


def _moved(angles_rad: Setting, off_rad: float) -> list[tuple[Setting, Setting]]:
    return [(angles_rad - off_rad * axis, angles_rad + off_rad * axis) for axis in np.eye(4)]
