"""Pictures of densities: theta down, phi across, the weighted region drawn in."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from design.arrays import Setting
from design.evaluation.coverage import mean_density_at
from design.objective.problem import Problem

STEP_DEG = 0.5
INK = "#111111"


def density_picture(path: Path, problem: Problem, settings: Mapping[str, Setting], title: str) -> None:
    """Write `density_figure` to a PNG."""
    density_figure(problem, settings, title).savefig(path, dpi=110, metadata={"Software": None})


def density_figure(problem: Problem, settings: Mapping[str, Setting], title: str) -> Figure:
    """Density maps one above the other on one colour scale.

    Args:
        problem: the task as numbers.
        settings: title of each map and its (alpha_rot, beta_rot, alpha_laser, beta_laser) [rad], from the top.
        title: line above all.
    """
    theta = np.arange(STEP_DEG / 2, 180, STEP_DEG)
    phi = np.arange(-180 + STEP_DEG / 2, 180, STEP_DEG)
    t, p = np.meshgrid(np.radians(theta), np.radians(phi), indexing="ij")
    directions = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1).reshape(-1, 3)
    weight = problem.field.weight_at(directions).reshape(t.shape)
    masked = problem.field.masked_at(directions).reshape(t.shape)
    maps = {name: mean_density_at(problem, angles, directions).reshape(t.shape) for name, angles in settings.items()}
    highest = max(float(m.max()) for m in maps.values())
    norm = LogNorm(vmin=max(1.0, highest / 300), vmax=highest, clip=True)

    figure = Figure(figsize=(8, 0.9 + 3.1 * len(maps)), layout="constrained")
    axes: list[Axes] = list(np.atleast_1d(figure.subplots(len(maps), 1, sharex=True)))
    image = None
    for axis, (name, density) in zip(axes, maps.items(), strict=True):
        axis.set_facecolor("white")
        shown = np.ma.masked_less(density, 1e-9)
        image = axis.imshow(shown, norm=norm, cmap="cividis", extent=(-180, 180, 180, 0), aspect="auto")
        if np.ptp(weight) > 0:
            levels = np.unique(weight)
            axis.contour(phi, theta, weight, levels=(levels[:-1] + levels[1:]) / 2, colors="white", linewidths=2.4)
            axis.contour(phi, theta, weight, levels=(levels[:-1] + levels[1:]) / 2, colors=INK, linewidths=1.1)
        if masked.any():
            axis.contourf(phi, theta, masked, levels=[0.5, 1.5], colors=["#dddddd"], alpha=0.75)
            axis.contourf(phi, theta, masked, levels=[0.5, 1.5], colors="none", hatches=["///"])
        axis.set_title(name, fontsize=10, loc="left")
        axis.set_ylabel("theta [deg]\n(0 is up)")
        axis.set_yticks(range(0, 181, 45))
    axes[-1].set_xlabel("phi [deg] (0 is ahead, 90 is left)")
    axes[-1].set_xticks(range(-180, 181, 45))
    if image is not None:
        ball = np.degrees(problem.ball_rad)
        figure.colorbar(image, ax=axes, label=f"mean beams within {ball:g} deg (white: never seen)", shrink=0.9)
    figure.suptitle(title, fontsize=11)
    return figure
