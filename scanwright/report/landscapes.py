"""What the report makes of `search.csv` and `axes.csv`: maps of J, and the settings of the lowest J."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from scanwright.design.angles import AngleSet, standard_settings
from scanwright.design.arrays import Array, Setting
from scanwright.design.evaluation.landscape_picture import LandscapePanel, draw_landscape
from scanwright.design.evaluation.picture_files import svg_bytes
from scanwright.design.objective.holes import NO_BLIND_WEIGHT, holes, percent
from scanwright.design.objective.problem import Problem
from scanwright.design.objective.score import score
from scanwright.design.search.constraints import Requirements
from scanwright.design.search.optimum import price
from scanwright.design.task.task import Task
from scanwright.report.data_uri import data_uri

PLANE = ("alpha_laser", "beta_laser")
AXIS = ("alpha_rot", "beta_rot")
SIZE = 5.4, 5.2  # inches: its letters can still be read on a phone
DPI = 150  # of the mesh in it
LOOKED = 24  # rows of the lowest J that are looked at: `search.csv` knows neither holes nor limits


@dataclass(frozen=True, slots=True)
class OtherMount:
    """A row of `search.csv`: its setting, its exact J without parts, and what it breaks; nothing where it keeps all."""

    angles_deg: tuple[float, ...]
    J: float
    breaks: str


@dataclass(frozen=True, slots=True)
class OtherMounts:
    """The rows of the lowest J.

    Attributes:
        kept: those that keep what the task asks, the lowest J first.
        broken: the others, likewise.
        alone: what J alone would take where that breaks it, and what keeping it costs, in a sentence.
    """

    kept: tuple[OtherMount, ...]
    broken: tuple[OtherMount, ...]
    alone: str


def other_mounts(problem: Problem, task: Task, setting: Setting, planes: Array) -> OtherMounts:
    """The settings of the lowest J, by what a task asks.

    Args:
        problem: the task as numbers.
        task: what it asks; a hole is no fault where the scanner as built has one.
        setting: as built, (alpha_rot, beta_rot, alpha_laser, beta_laser) [rad].
        planes: alpha_laser, beta_laser [deg], J, alpha_rot, beta_rot [deg], shape (settings, 5); J is inf where none is
            allowed.
    """
    own = score(problem, setting)
    avoid = task.angles.holes == "avoid" and own.blind_weight <= NO_BLIND_WEIGHT
    required = Requirements(problem, task.limits, avoid)
    lowest = planes[np.argsort(planes[:, 2], kind="stable")][:LOOKED]
    found = [_mount(required, row[[3, 4, 0, 1]]) for row in lowest if np.isfinite(row[2])]
    ordered = sorted(found, key=lambda mount: mount.J)
    return OtherMounts(
        kept=tuple(mount for mount in ordered if not mount.breaks),
        broken=tuple(mount for mount in ordered if mount.breaks),
        alone=_alone(problem, found[0], own.J) if found and found[0].breaks and found[0].J < own.J else "",
    )


def _mount(required: Requirements, angles_deg: Setting) -> OtherMount:
    found = score(required.problem, np.radians(angles_deg))
    breaks = "" if required.keeps(found, angles_deg) else "breaks the limits"
    if required.avoid_holes and found.blind_weight > NO_BLIND_WEIGHT:
        breaks = f"blind to {percent(found.blind_weight)} of the weight"
    return OtherMount(tuple(angles_deg.tolist()), found.J, breaks)


def _alone(problem: Problem, mount: OtherMount, J: float) -> str:
    angles = ", ".join(f"{angle:g}" for angle in mount.angles_deg)
    blind = "; ".join(hole.words() for hole in holes(problem, np.radians(mount.angles_deg)))
    return (
        f"J alone, not asked for holes or limits, would take ({angles}) with J = {mount.J:.4f}, which "
        f"{f'is {blind}' if mount.breaks.startswith('blind') else 'breaks the limits of the task'}. "
        f"What keeps all that the task asks costs {price(problem, J, mount.J)} against it."
    )


def landscape(rows: Array, names: tuple[str, str], angles: AngleSet, label: str) -> str | None:
    """J over a pair of angles with the built one marked, SVG as a data address; None where the task fixes both.

    Args:
        rows: both angles [deg] and the lowest J, shape (settings, 3); inf where none is allowed.
        names: `PLANE` or `AXIS`.
        angles: what was built.
        label: what the J is.
    """
    if len(rows) < 2 or not np.isfinite(rows[:, 2]).any():
        return None
    figure = Figure(figsize=SIZE, layout="constrained")
    axis = figure.subplots()
    first = 2 if names == PLANE else 0
    built = tuple(getattr(angles.angles_deg, name) for name in names)
    standard = {name: tuple(np.degrees(setting[first : first + 2])) for name, setting in standard_settings().items()}
    draw_landscape(axis, LandscapePanel(names, rows, built, standard, label))
    figure.legend(*axis.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return data_uri(svg_bytes(figure, DPI), ".svg")
