"""Maps of J from `search.csv` and `axes.csv`, and the mounts of the lowest J."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from scanwright.design.angles import AngleSet, angles_words, standard_settings
from scanwright.design.arrays import Array, Setting
from scanwright.design.evaluation.landscape_picture import LandscapePanel, draw_landscape
from scanwright.design.evaluation.picture_files import svg_bytes
from scanwright.design.objective.holes import NO_BLIND_WEIGHT, holes, percent
from scanwright.design.objective.problem import Problem
from scanwright.design.objective.score import score
from scanwright.design.search.optimum import price
from scanwright.design.search.space import SearchSpace
from scanwright.design.task.task import Task
from scanwright.report.build_files import data_uri

PLANE = ("alpha_laser", "beta_laser")
AXIS = ("alpha_rot", "beta_rot")
SIZE_IN = 5.4, 5.2  # its letters are legible on a phone
DPI = 150  # of the mesh in it
ROWS = 24  # of the lowest J that are scored: `search.csv` has neither blind spots nor limits


@dataclass(frozen=True, slots=True)
class OtherMount:
    """A row of `search.csv`.

    Attributes:
        angles_deg: its mounting angles.
        J: exact, without parts.
        breaks: requirement of the task that it breaks; empty if none.
        blind: whether that is a blind spot.
    """

    angles_deg: tuple[float, ...]
    J: float
    breaks: str
    blind: bool = False


@dataclass(frozen=True, slots=True)
class OtherMounts:
    """The rows of the lowest J.

    Attributes:
        within: those within the requirements of the task, the lowest J first.
        broken: the others, likewise.
        alone: sentence about the lowest J alone if it breaks the requirements, and the cost of keeping them.
    """

    within: tuple[OtherMount, ...]
    broken: tuple[OtherMount, ...]
    alone: str


def other_mounts(problem: Problem, task: Task, setting: Setting, planes: Array) -> OtherMounts:
    """Return the mounts of the lowest J, by the requirements of a task.

    Args:
        problem: the task as numbers.
        task: requirements; a blind spot breaks none if the scanner as built has one.
        setting: as built, (alpha_rot, beta_rot, alpha_laser, beta_laser) [rad].
        planes: alpha_laser, beta_laser [deg], J, alpha_rot, beta_rot [deg], shape (settings, 5); J is inf if none is
            allowed.
    """
    own = score(problem, setting)
    avoid = task.angles.holes == "avoid" and own.blind_weight <= NO_BLIND_WEIGHT
    space = SearchSpace(problem, task.angles, task.limits, avoid)
    lowest = planes[np.argsort(planes[:, 2], kind="stable")][:ROWS]
    mounts = [_mount(space, row[[3, 4, 0, 1]]) for row in lowest if np.isfinite(row[2])]
    ordered = sorted(mounts, key=lambda mount: mount.J)
    return OtherMounts(
        within=tuple(mount for mount in ordered if not mount.breaks),
        broken=tuple(mount for mount in ordered if mount.breaks),
        alone=_alone(problem, mounts[0], own.J) if mounts and mounts[0].breaks and mounts[0].J < own.J else "",
    )


def _mount(space: SearchSpace, angles_deg: Setting) -> OtherMount:
    own = score(space.problem, np.radians(angles_deg))
    breaks = "" if space.keeps(own, angles_deg) else "breaks the limits"
    blind = space.avoid_holes and own.blind_weight > NO_BLIND_WEIGHT
    if blind:
        breaks = f"blind to {percent(own.blind_weight)} of the weight"
    return OtherMount(tuple(angles_deg.tolist()), own.J, breaks, blind)


def _alone(problem: Problem, mount: OtherMount, J: float) -> str:
    blind = "; ".join(hole.words() for hole in holes(problem, np.radians(mount.angles_deg)))
    return (
        f"Without blind spots and limits, {angles_words(mount.angles_deg)} with J = {mount.J:.4f} would be best, which "
        f"{f'is {blind}' if mount.blind else 'breaks the limits of the task'}. "
        f"Keeping the requirements of the task costs {price(problem, J, mount.J)}."
    )


def landscape(rows: Array, names: tuple[str, str], angles: AngleSet, label: str) -> str | None:
    """Draw J over a pair of angles with the built one marked, SVG as a data address; None if the task fixes both.

    Args:
        rows: both angles [deg] and the lowest J, shape (settings, 3); inf if none is allowed.
        names: `PLANE` or `AXIS`.
        angles: what was built.
        label: what the J is.
    """
    if len(rows) < 2 or not np.isfinite(rows[:, 2]).any():
        return None
    figure = Figure(figsize=SIZE_IN, layout="constrained")
    axis = figure.subplots()
    first = 2 if names == PLANE else 0
    built = tuple(getattr(angles.angles_deg, name) for name in names)
    standard = {name: tuple(np.degrees(setting[first : first + 2])) for name, setting in standard_settings().items()}
    draw_landscape(axis, LandscapePanel(names, rows, built, standard, label))
    figure.legend(*axis.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return data_uri(svg_bytes(figure, DPI), ".svg")
