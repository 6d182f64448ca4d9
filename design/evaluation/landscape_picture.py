"""The picture of a search: lowest J over all axes for every scan plane, and over all scan planes for every axis."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, MultipleLocator

from scanwright.design.angles import STANDARD_DEG
from scanwright.design.arrays import Array
from scanwright.design.errors import BuildError, TaskError
from scanwright.design.evaluation.density_picture import INK
from scanwright.design.search.search import SearchResult

OPTIMUM: dict[str, Any] = {"marker": "*", "ms": 15, "color": "white", "mec": INK, "mew": 1.2}
STANDARD: dict[str, dict[str, Any]] = {"rolling": {"marker": "s"}, "pitching": {"marker": "D"}}
PLAIN: dict[str, Any] = {"ms": 8, "color": "white", "mec": INK, "mew": 1.2, "ls": "none"}
LEVELS = 9
SHADED = 0.9  # of the settings: planes near the useless one would take all shades for themselves
TICKS_DEG = 30
FLAT = 1e-5  # single precision: less is no difference


@dataclass(frozen=True, slots=True)
class LandscapePanel:
    """J over a pair of angles.

    Attributes:
        names: of the pair.
        rows: both angles [deg] and J, shape (settings, 3); at least one angle varies.
        optimum: the pair to mark.
        standard: pairs of the standard alignments.
        label: what the J is.
    """

    names: tuple[str, str]
    rows: Array
    optimum: tuple[float, ...]
    standard: dict[str, tuple[float, ...]]
    label: str


def landscape_picture(path: Path, result: SearchResult, title: str) -> Path:
    """Map of J over alpha_laser, beta_laser and over alpha_rot, beta_rot; a curve if one of a pair is fixed.

    Args:
        path: PNG to write; `.png` is added to a name without a suffix.
        result: of the search. Scan planes that cannot win carry a lower bound of their J.
        title: line above all.

    Returns:
        The file.

    Raises:
        TaskError: the task fixes all four angles.
        BuildError: the file cannot be written, or its suffix is of no picture.
    """
    best = result.best[0].angles_deg
    panels = [
        (("alpha_laser", "beta_laser"), result.planes[:, :3], best[2:], 2, "axes"),
        (("alpha_rot", "beta_rot"), result.axes, best[:2], 0, "scan planes"),
    ]
    open_panels = [panel for panel in panels if len(panel[1]) > 1]
    if not open_panels:
        raise TaskError("picture: the task fixes all four angles, so there is nothing to map: free some of them")
    figure = Figure(figsize=(0.6 + 6.2 * len(open_panels), 5.4), layout="constrained")
    axes = np.atleast_1d(figure.subplots(1, len(open_panels)))
    label = "lowest coarse J over all {}" if len(result.planes) > 1 < len(result.axes) else "coarse J"
    for axis, (names, rows, optimum, first, over) in zip(axes, open_panels, strict=True):
        standard = {name: angles[first : first + 2] for name, angles in STANDARD_DEG.items()}
        draw_landscape(axis, LandscapePanel(names, rows, optimum, standard, label.format(over)))
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    figure.suptitle(title, fontsize=11)
    file = path if path.suffix else path.with_suffix(".png")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(file, dpi=110, metadata={"Software": None})
    except OSError as error:
        raise BuildError(f"{file}: cannot write the picture: {error.strerror or error}") from error
    except ValueError as error:  # no picture by its suffix
        raise BuildError(f"{file}: cannot write the picture: {error}") from error
    return file


def draw_landscape(axis: Axes, of: LandscapePanel) -> None:
    """J over a pair of angles: a map, or a curve if one of them is fixed."""
    draw = _map if np.all(np.ptp(of.rows[:, :2], axis=0) > 0) else _curve
    draw(axis, of)


def _map(axis: Axes, of: LandscapePanel) -> None:
    """J in shades, bright where it is low, with lines of equal J."""
    x, column = np.unique(of.rows[:, 0], return_inverse=True)
    y, row = np.unique(of.rows[:, 1], return_inverse=True)
    J = np.full((len(y), len(x)), np.nan)  # settings that break a limit stay empty
    J[row, column] = of.rows[:, 2]
    J = np.ma.masked_invalid(J)
    axis.set_facecolor("white")
    if np.ptp(J) > FLAT:
        worst = np.quantile(J.compressed(), SHADED)
        shades = axis.pcolormesh(x, y, J, cmap="cividis_r", vmax=worst, shading="nearest", rasterized=True)
        levels = MaxNLocator(LEVELS).tick_values(J.min(), worst)
        lines = axis.contour(x, y, J, levels=levels, colors=INK, linewidths=0.6, linestyles="solid")
        axis.clabel(lines, fontsize=7)
        bar = axis.figure.colorbar(
            shades, ax=axis, location="top", shrink=0.9, extend="max", label=f"{of.label} (bright is better)"
        )
        bar.ax.invert_xaxis()
    else:
        axis.text(x.mean(), (y[0] + y[-1]) / 2 - 0.1 * np.ptp(y), f"{of.label}: {J.min():.3f} everywhere", ha="center")
    for name, angles in of.standard.items():
        axis.plot(*angles, label=name, clip_on=False, **STANDARD[name], **PLAIN)
    axis.plot(*of.optimum, label="optimum", ls="none", clip_on=False, zorder=3, **OPTIMUM)
    axis.set_xlim(x[0], x[-1])
    axis.set_ylim(y[0], y[-1])
    axis.set_xlabel(f"{of.names[0]} [deg]")
    axis.set_ylabel(f"{of.names[1]} [deg]")
    for side, values in ((axis.xaxis, x), (axis.yaxis, y)):
        if np.ptp(values) >= 4 * TICKS_DEG:
            side.set_major_locator(MultipleLocator(TICKS_DEG * (1 + (np.ptp(values) > 180))))


def _curve(axis: Axes, of: LandscapePanel) -> None:
    """J over the one angle of the pair that is free; standard alignments that the fixed one allows are marked."""
    free = 0 if np.ptp(of.rows[:, 0]) > 0 else 1
    fixed, value = of.names[1 - free], of.rows[0, 1 - free]
    order = np.argsort(of.rows[:, free])
    x, J = of.rows[order, free], np.ma.masked_invalid(of.rows[order, 2])
    axis.plot(x, J, color=INK, lw=1.2)
    for name, angles in of.standard.items():
        if angles[1 - free] == value:
            axis.plot(angles[free], np.interp(angles[free], x, J), label=name, **STANDARD[name], **PLAIN)
    axis.plot(of.optimum[free], np.interp(of.optimum[free], x, J), label="optimum", ls="none", zorder=3, **OPTIMUM)
    axis.set_xlabel(f"{of.names[free]} [deg]   ({fixed} = {value:g})")
    axis.set_ylabel(of.label)
    axis.grid(color="#dddddd")
    axis.spines[["top", "right"]].set_visible(False)
