"""Check of a reported J by a brute-force count over simulated beams, before parts are made from the angles.

The count (`design.objective.counted`) shares neither regions nor quadrature with J.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scanwright.design.arrays import Setting
from scanwright.design.density.beams import NO_LEVER
from scanwright.design.errors import NumericalError, TaskError
from scanwright.design.objective.counted import COUNTED, counted_J
from scanwright.design.objective.named_objectives import log
from scanwright.design.objective.problem import problem_of
from scanwright.design.objective.score import Score, score
from scanwright.design.self_occlusion import SelfOcclusion
from scanwright.design.task.task import LoadedTask

SURE = 4.0 / 3.0  # four standard errors, in units of the three that a count states
NEAR = 5e-3  # error of the count to aim at; wrong weights change J by far more
SETS = 16
FIRST = 256  # directions of each set at first; their spread shows how many are needed
AIM = 0.8  # of NEAR, since the spread of few directions is uncertain
MOST_WORK = 2.4e5  # directions of one set times the cost of each: 0.3 s of processor time in all
PER_LAYER = 4.0  # cost of a direction for each region, in beams
DOUBT = 0.5  # of the error of a count that ended before `NEAR`: a larger difference is counted again
AGAIN = (8, 64)  # increases of directions before a difference is an error: few directions can all miss a blind spot


def require_counted(
    loaded: LoadedTask,
    angles_rad: Setting,
    result: Score,
    shadow: SelfOcclusion | None = None,
    lever: tuple[float, float, float] = NO_LEVER,
) -> None:
    """Compare the score of (alpha_rot, beta_rot, alpha_laser, beta_laser) [rad] with a count of simulated beams.

    `result` is the score without the beams that `shadow` blocks. For the objective `worst` a count gives a bound only,
    and objectives of installed packages have no formula for counts: then J of `log` is compared, which uses the same
    beams, regions and lines.

    Raises:
        NumericalError: they differ by more than their errors.
        TaskError: the masks leave too little of the regions.
    """
    objective = loaded.task.density.objective
    if objective == "worst" or objective not in COUNTED:
        if shadow is None and lever == NO_LEVER:
            if objective == "worst":
                _require_least(loaded, angles_rad, result)
            _require_log(loaded, angles_rad)
        return
    J, J_error, points = _counted(loaded, angles_rad, shadow, lever)
    if not np.isfinite(J_error):  # a set of directions has no beams: only `log` is finite then
        if shadow is None and lever == NO_LEVER:
            _require_log(loaded, angles_rad)
        return
    agree = _agree(J, result, J_error if J_error <= NEAR else DOUBT * J_error)
    for more in AGAIN:
        if agree:
            return
        again = counted_J(loaded, angles_rad, more * points, more * points, SETS, shadow=shadow, lever=lever)
        J, J_error = again.J, SURE * again.J_error
        agree = _agree(J, result, J_error)
    if not agree:
        raise NumericalError(
            f"J = {result.J:.6g} +- {result.J_error:.1g}, "
            f"but a count over simulated beams gives {J:.6g} +- {J_error:.1g}"
        )


def _agree(J: float, result: Score, J_error: float) -> bool:
    """Return whether a count and a score agree; NaN agrees with nothing."""
    return J == result.J or abs(J - result.J) <= result.J_error + J_error


def _counted(
    loaded: LoadedTask, angles_rad: Setting, shadow: SelfOcclusion | None, lever: tuple[float, float, float]
) -> tuple[float, float, int]:
    """Return J by counting, four standard errors, and the directions of each set."""
    task = loaded.task
    points = FIRST
    try:
        count = counted_J(loaded, angles_rad, points, points, SETS, shadow=shadow, lever=lever)
    except TaskError as error:
        raise TaskError("weight: masks leave too little of the regions to count beams in: widen them") from error
    near = max(4.0, len(loaded.lidar.bearings_rad()) * min(1.0, task.density.ball_radius_deg / 60))
    cost = near + PER_LAYER * (len(task.weight) + len(task.mask)) / max(count.weighted, 1e-3)
    while SURE * count.J_error > NEAR and 2 * points * cost <= MOST_WORK:
        # the error of a net is nearly inversely proportional to the number of its points, a power of two
        needed = np.ceil(np.log2(SURE * count.J_error / (AIM * NEAR)))
        points *= 2 ** int(min(needed, np.log2(MOST_WORK / cost / points)))
        count = counted_J(loaded, angles_rad, points, points, SETS, shadow=shadow, lever=lever)
    return count.J, SURE * count.J_error, points


def _require_least(loaded: LoadedTask, angles_rad: Setting, result: Score) -> None:
    count = counted_J(loaded, angles_rad, 0, FIRST, 2)
    if result.J + result.J_error < count.J:
        raise NumericalError(f"min_density = {result.least}, but a count over simulated beams finds {count.least}")


def _require_log(loaded: LoadedTask, angles_rad: Setting) -> None:
    density = loaded.task.density.model_copy(update={"objective": "log"})
    as_log = replace(loaded, task=loaded.task.model_copy(update={"density": density}))
    problem = replace(problem_of(loaded), nodes=FIRST, tolerance=NEAR)
    require_counted(as_log, angles_rad, score(problem.with_objective(log(problem.field)), np.asarray(angles_rad)))
