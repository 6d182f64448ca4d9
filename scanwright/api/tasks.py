"""Optimise, evaluate and compare mounting angles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from scanwright.api.arguments import TaskLike, as_built_scanner, as_task, deprecated, lever_in, pole_in, with_say
from scanwright.design.progress import Progress, no_progress

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from scanwright.design.evaluation.comparison import ComparisonRow
    from scanwright.design.evaluation.evaluation import Evaluation, Lever
    from scanwright.design.evaluation.poles import Pole
    from scanwright.design.search.optimum import Optimum


@with_say
def optimise(task: TaskLike, *, progress: Progress = no_progress) -> Optimum:
    """Find the best mounting angles of a task.

    Args:
        task: lidar, servo, motion and region to see.
        progress: progress callback.

    Returns:
        The optimum: `search.best` are the best groups of equivalent mounts, best first; `angle_set()` is the input of
        parts and frame chain.

    Raises:
        TaskError: the task is malformed, no direction has a weight, or no mount satisfies its limits.

    Example:
        >>> import scanwright as sw
        >>> optimum = sw.optimise("ceiling")
        >>> alpha_rot, beta_rot, alpha_laser, beta_laser = optimum.search.best[0].angles_deg
        >>> alpha_rot, beta_rot  # this task fixes them: it hangs upside down
        (180.0, 0.0)
    """
    from scanwright.design.search.optimum import find_optimum

    return find_optimum(as_task(task), progress)


@with_say
def evaluate(
    task: TaskLike,
    angles_deg: Sequence[float] | None = None,
    *,
    pole: Pole | str | None = None,
    lever: Lever | str | None = None,
    progress: Progress = no_progress,
) -> Evaluation:
    """Evaluate given mounting angles, by the closed form and by a brute-force count of beams.

    Args:
        task: a task; of a build folder, `Evaluation.as_built` includes its parts.
        angles_deg: alpha_rot, beta_rot, alpha_laser, beta_laser; None uses those of the build folder.
        pole: upright pole, whose probability to be hit is computed; a text as in version 0.1 still works.
        lever: offset of the optical centre from the axis, at a range; a text as in version 0.1 still works.
        progress: progress callback.

    Raises:
        TaskError: the task is malformed, these are not four angles, or no direction has a weight.
        BuildError: a file of the build folder is missing or was edited.

    Example:
        >>> import scanwright as sw
        >>> rolling = sw.evaluate("uniform", (0, 90, 0, -90))
        >>> abs(rolling.score.J - rolling.ball.J) < rolling.score.J_error + rolling.ball.J_error
        True
    """
    from scanwright.design.evaluation import evaluation

    if isinstance(pole, str):
        pole = pole_in(deprecated(pole, "pole"))
    if isinstance(lever, str):
        lever = lever_in(deprecated(lever, "lever"))
    built = as_built_scanner(task)
    loaded = as_task(task) if built is None else built.loaded
    if built is not None and (angles_deg is None or np.allclose(np.radians(angles_deg), built.setting_rad, atol=1e-9)):
        return evaluation.evaluate(loaded, built.setting_rad, pole, lever, progress, built.shadow, built.checks)
    return evaluation.evaluate(loaded, evaluation.setting_rad(angles_deg or ()), pole, lever, progress)


@with_say
def compare(task: TaskLike, *, progress: Progress = no_progress) -> tuple[Optimum, list[ComparisonRow]]:
    """Compare the optimum of a task with reference mounts, a cheap scanner and 3D lidars.

    Rows do not include parts, except the first row of a build folder.

    Raises:
        TaskError: as for `optimise`.
        BuildError: a file of the build folder is missing or was edited.

    Example:
        >>> import scanwright as sw
        >>> optimum, rows = sw.compare("ceiling")
        >>> rows[0].name, rows[0].turns
        ('optimum', 1)
    """
    from scanwright.design.evaluation.comparison import compare
    from scanwright.design.search.optimum import find_optimum

    built = as_built_scanner(task)
    optimum = find_optimum(as_task(task) if built is None else built.loaded, progress)
    setting = None if built is None or built.shadow is None else (built.setting_rad, built.shadow)
    return optimum, compare(optimum.loaded, optimum.problem, optimum.search.best[0], optimum.mounts, progress, setting)


def draw_density(task: TaskLike, settings_deg: Mapping[str, Sequence[float]]) -> Figure:
    """Draw maps of the beam density of a full scan, one for each mount.

    Args:
        task: a task; its region and masks are outlined.
        settings_deg: title of a map -> its (alpha_rot, beta_rot, alpha_laser, beta_laser).

    Raises:
        TaskError: the task is malformed, a mount is not four angles, or no direction has a weight.

    Example:
        >>> import scanwright as sw
        >>> figure = sw.draw_density("ceiling", {"rolling": (0, 90, 0, -90)})
        >>> figure.get_size_inches().tolist()
        [8.0, 4.0]
    """
    from scanwright.design.evaluation.density_picture import density_figure
    from scanwright.design.evaluation.evaluation import setting_rad
    from scanwright.design.objective.problem import problem_of

    loaded = as_task(task)
    settings = {name: setting_rad(angles) for name, angles in settings_deg.items()}
    return density_figure(problem_of(loaded), settings, loaded.task.name)
