"""Whether an object of the size that a task states can be missed, and the period that does not miss it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scanwright.design.arrays import Setting
from scanwright.design.errors import TaskError
from scanwright.design.evaluation.metres import AT_M, rounded
from scanwright.design.findings import Finding
from scanwright.design.motion import LONGEST_S, Spin, Sweep
from scanwright.design.objective.holes import NO_BLIND_WEIGHT
from scanwright.design.objective.problem import Problem, problem_of
from scanwright.design.objective.score import Score, score_on
from scanwright.design.search.shortest_period import shortest_period_s
from scanwright.design.self_occlusion import SelfOcclusion
from scanwright.design.task.task import DensityRules, LoadedTask

# periods of a sweep to try, in units of that of the task
LONGER = (1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 16.0)
NODES = 2187  # of the region, for each of them


def missed_object(
    loaded: LoadedTask, angles_rad: Setting, own: Score, shadow: SelfOcclusion | None = None
) -> Finding | None:
    """Return a warning if an object as wide as a ball can get no beam; blind spots have their own messages.

    A task states the size of the smallest object with a `density.ball_radius_deg` other than the default. `own` is the
    score of the mount without the beams that `shadow` blocks.
    """
    radius_deg = loaded.task.density.ball_radius_deg
    if radius_deg == DensityRules().ball_radius_deg:  # a build writes the default to its task.toml
        return None
    if own.least > 0 or own.blind_weight > NO_BLIND_WEIGHT:
        return None
    across_mm = 2000 * AT_M * np.tan(np.radians(radius_deg))
    message = (
        f"an object {rounded(across_mm)} mm wide at {AT_M:g} m ({2 * radius_deg:.2g} deg) can be missed: at the worst "
        "place it gets no beam"
    )
    period_s = _period_that_hits(loaded, angles_rad, shadow)
    hint = "set limits.min_density = 1 to search mounts that hit it"
    if period_s is not None:
        hint += f"; this one does with motion.period_s = {period_s:.6g}"
    return Finding("missed_object", "warning", "region", message, float(own.least), 1.0, "beams", hint)


def _period_that_hits(loaded: LoadedTask, angles_rad: Setting, shadow: SelfOcclusion | None) -> float | None:
    """Return a period with a beam on every ball of the region, of a sweep the first of `LONGER`; None if unknown."""
    motion = loaded.task.motion
    if isinstance(motion, Spin):
        try:
            return shortest_period_s(_seen(loaded, shadow), angles_rad, loaded.lidar.scan_rate_hz, 1)
        except TaskError:
            return None
    if not isinstance(motion, Sweep):
        return None
    for factor in LONGER:
        period_s = float(f"{factor * motion.period_s:.3g}")
        slower = motion.model_copy(update={"period_s": period_s})
        problem = _seen(replace(loaded, task=loaded.task.model_copy(update={"motion": slower})), shadow)
        if period_s <= LONGEST_S and score_on(problem, angles_rad, NODES).least > 0:
            return period_s
    return None


def _seen(loaded: LoadedTask, shadow: SelfOcclusion | None) -> Problem:
    problem = problem_of(loaded)
    return problem if shadow is None else problem.behind(shadow)
