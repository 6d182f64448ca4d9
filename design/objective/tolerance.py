"""Sensitivity of J to errors of the mounting angles."""

from __future__ import annotations

import numpy as np

from scanwright.design.arrays import Setting
from scanwright.design.objective.problem import NODES, Problem
from scanwright.design.objective.score import quick_J
from scanwright.design.task.angle_ranges import NAMES


def sensitivity(problem: Problem, angles_rad: Setting, off_rad: float, nodes: int = NODES) -> dict[str, float]:
    """Return the rise of J by name of the angle if one mounting angle is off by `off_rad`, the larger of both signs."""
    J = quick_J(problem, angles_rad, nodes)
    worse = [max(quick_J(problem, moved, nodes) for moved in pair) - J for pair in _moved(angles_rad, off_rad)]
    return dict(zip(NAMES, worse, strict=True))


def worst_within(problem: Problem, angles_rad: Setting, off_rad: float, nodes: int) -> float:
    """Return the highest J of the mount and of those of `worst_off`."""
    return max(quick_J(problem, angles_rad, nodes), worst_off(problem, angles_rad, off_rad, nodes))


def worst_off(problem: Problem, angles_rad: Setting, off_rad: float, nodes: int) -> float:
    """Return the highest J of the mounts with one angle off by plus or minus `off_rad`."""
    return max(quick_J(problem, moved, nodes) for pair in _moved(angles_rad, off_rad) for moved in pair)


def rise_words(rises: dict[str, float], J_error: float) -> str:
    """Return the result of `sensitivity` as text; a rise below the error of J is not stated."""
    least = max(J_error, 5e-5)  # four digits are printed
    rising = ", ".join(f"{rise:.4f} ({name})" for name, rise in rises.items() if rise > least)
    still = ", ".join(name for name, rise in rises.items() if rise <= least)
    if not rising:
        return "J rises by no more than its error for every angle"
    return f"J rises by {rising}" + (f", by no more than its error ({still})" if still else "")


def _moved(angles_rad: Setting, off_rad: float) -> list[tuple[Setting, Setting]]:
    return [(angles_rad - off_rad * axis, angles_rad + off_rad * axis) for axis in np.eye(4)]
