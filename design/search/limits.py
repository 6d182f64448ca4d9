"""What a task demands of scan planes whatever their J: no gap between lines and no blind cone beyond a limit.

Both are decided by the plane alone, so the search never looks at planes that break them. What depends on the axis too
stands in `design.search.constraints`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from scanwright.design.arrays import Setting
from scanwright.design.density.beams import beam_directions_rot, line_spacing, polar_of_planes
from scanwright.design.errors import TaskError
from scanwright.design.objective.problem import Problem
from scanwright.design.search.grid_classes import Folded
from scanwright.design.task.task import Limits


def allowed_planes(problem: Problem, planes: Folded, limits: Limits) -> Folded:
    """The scan planes of the grid that keep the limits on gaps and blind cones.

    Raises:
        TaskError: none does.
    """
    if limits.max_line_gap_deg is None and limits.max_blind_cone_deg is None:
        return planes
    shown = np.radians(planes.settings_deg[planes.first])
    gap, cone = line_gaps_deg(problem, shown), blind_cones_deg(problem, shown)
    for name, values, limit in (
        ("max_line_gap_deg", gap, limits.max_line_gap_deg),
        ("max_blind_cone_deg", cone, limits.max_blind_cone_deg),
    ):
        if limit is not None and values.min() > limit * (1 + 1e-9) + 1e-9:
            hint = "; a longer period narrows it" if name == "max_line_gap_deg" else ""
            raise TaskError(f"limits.{name} = {limit:g}: the scan planes of this task reach {values.min():.3g}{hint}")
    keep = planes_keep(problem, shown, limits)
    if not keep.any():
        raise TaskError("limits: no scan plane keeps max_line_gap_deg and max_blind_cone_deg at once")
    return _only(planes, keep)


def blinding_words(problem: Problem, limits: Limits, angles_deg: Setting) -> str:
    """Why limits on the scan plane leave parts of the region blind, from the best setting without that sees all."""
    planes_rad = np.radians(angles_deg[None, 2:])
    gap_deg, cone_deg = float(line_gaps_deg(problem, planes_rad)[0]), float(blind_cones_deg(problem, planes_rad)[0])
    setting = ", ".join(f"{angle:g}" for angle in angles_deg)
    if limits.max_line_gap_deg is not None and gap_deg > limits.max_line_gap_deg:
        limit = f"max_line_gap_deg = {limits.max_line_gap_deg:g}"
        lines = np.ceil(2 * np.pi / problem.lines.step_rad * gap_deg / limits.max_line_gap_deg - 1e-9)
        period = f"{lines:.0f} lines in a turn, a period_s of {lines / problem.scan_rate_hz:.6g}"
        cure = f"lines {gap_deg:.3g} deg apart: the limit takes {period}"
    else:
        limit = f"max_blind_cone_deg = {limits.max_blind_cone_deg:g}"
        cure = f"a blind cone of {cone_deg:.3g} deg that the region does not reach"
    return (
        f"limits.{limit}: every scan plane that keeps it leaves a part of the region blind; ({setting}) sees all of it "
        f'and has {cure}; change the limit, or set angles.holes = "allow"'
    )


def planes_keep(problem: Problem, planes_rad: Float[ndarray, "n 2"], limits: Limits) -> Bool[ndarray, " n"]:
    """Whether scan planes (n, 2) keep the limits on gaps and blind cones, shape (n,)."""
    keep = np.ones(len(planes_rad), dtype=bool)
    if limits.max_line_gap_deg is not None:
        keep &= line_gaps_deg(problem, planes_rad) <= limits.max_line_gap_deg * (1 + 1e-9)
    if limits.max_blind_cone_deg is not None:
        keep &= blind_cones_deg(problem, planes_rad) <= limits.max_blind_cone_deg + 1e-9
    return keep


def blind_cones_deg(problem: Problem, planes_rad: Float[ndarray, "n 2"]) -> Float[ndarray, " n"]:
    """Half angle of the wider blind cone about the axis, of scan planes (n, 2), shape (n,)."""
    polar = polar_of_planes(problem.bearings_rad, planes_rad)
    return np.degrees(np.maximum(polar.min(axis=1), np.pi - polar.max(axis=1)))


def line_gaps_deg(problem: Problem, planes_rad: Float[ndarray, "n 2"]) -> Float[ndarray, " n"]:
    """Widest distance between neighbouring scan lines of one family, across them, of scan planes (n, 2), shape (n,)."""
    spacings = [line_spacing(beam_directions_rot(problem.bearings_rad, *plane), plane) for plane in planes_rad]
    return np.degrees(problem.lines.step_rad * np.array(spacings))


def _only(planes: Folded, keep: Bool[ndarray, " classes"]) -> Folded:
    """The classes that are kept, with their settings."""
    numbers = np.cumsum(keep) - 1
    feasible = keep[planes.classes]
    places = np.cumsum(feasible) - 1
    return replace(
        planes,
        settings_deg=planes.settings_deg[feasible],
        points=planes.points[feasible],
        classes=numbers[planes.classes[feasible]],
        flip=planes.flip[feasible],
        first=places[planes.first[keep]],
        has=planes.has[:, keep],
        own=planes.own[keep],
    )
