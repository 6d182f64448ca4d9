"""Pictures of beam densities over theta and phi, with the weighted region."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import Bool
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from numpy import ndarray

from scanwright.design.arrays import Array, Setting
from scanwright.design.evaluation.coverage import mean_density_at
from scanwright.design.objective.problem import Problem
from scanwright.design.self_occlusion import SelfOcclusion

STEP_DEG = 0.5
INK = "#111111"
SEEN = 1e-9  # mean beams in a ball
EXTENT = (-180, 180, 180, 0)
LEAST_FACTOR, MOST_FACTOR = 2.0, 10.0  # bounds of the colour scale of a ratio
ROUND = (1.0, 1.2, 1.5, 2.0, 3.0, 5.0, 10.0)


def density_figure(
    problem: Problem, settings: Mapping[str, Setting], title: str, shadow: SelfOcclusion | None = None
) -> Figure:
    """Return density maps on one colour scale, and below them the ratio of the first two, if there are two.

    `settings` maps titles to (alpha_rot, beta_rot, alpha_laser, beta_laser) [rad], from the top; `shadow` are the beams
    that the parts of the first one block.
    """
    theta = np.arange(STEP_DEG / 2, 180, STEP_DEG)
    phi = np.arange(-180 + STEP_DEG / 2, 180, STEP_DEG)
    t, p = np.meshgrid(np.radians(theta), np.radians(phi), indexing="ij")
    directions = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1).reshape(-1, 3)
    weight = problem.field.weight_at(directions).reshape(t.shape)
    masked = problem.field.masked_at(directions).reshape(t.shape)
    maps = {
        name: mean_density_at(problem, angles, directions, shadow if place == 0 else None).reshape(t.shape)
        for place, (name, angles) in enumerate(settings.items())
    }
    highest = max(float(m.max()) for m in maps.values())
    norm = LogNorm(vmin=max(1.0, highest / 300), vmax=highest, clip=True)

    with_ratio = len(maps) > 1
    figure = Figure(figsize=(8, 0.9 + 3.1 * (len(maps) + with_ratio)), layout="constrained")
    axes: list[Axes] = list(np.atleast_1d(figure.subplots(len(maps) + with_ratio, 1, sharex=True)))
    image = None
    for axis, (name, density) in zip(axes, maps.items(), strict=False):
        shown = np.ma.masked_less(density, SEEN)
        image = axis.imshow(shown, norm=norm, cmap="cividis", extent=EXTENT, aspect="auto")
        _frame(axis, phi, theta, weight, masked)
        axis.set_title(name, fontsize=10, loc="left")
    ball = np.degrees(problem.ball_rad)
    if image is not None:
        label = f"mean beams within {ball:g} deg (white: never seen)"
        figure.colorbar(image, ax=axes[: len(maps)], label=label, shrink=0.9)
    if with_ratio:
        (first, own), (second, other), *_ = maps.items()
        _ratio(axes[-1], own, other, weight * ~masked)
        _frame(axes[-1], phi, theta, weight, masked)
        axes[-1].set_facecolor("#bbbbbb")
        names = f"{first.split(':')[0]} over {second.split(':')[0]}"
        axes[-1].set_title(f"{names}: how many times the beams", fontsize=10, loc="left")
    axes[-1].set_xlabel("phi [deg] (0 is ahead, 90 is left)")
    axes[-1].set_xticks(range(-180, 181, 45))
    figure.suptitle(title, fontsize=11)
    return figure


def _ratio(axis: Axes, own: Array, other: Array, weight: Array) -> None:
    """Draw the ratio of two densities; the colour scale covers 95 % of the weighted region."""
    both = (own > SEEN) & (other > SEEN)
    ratio = np.ma.masked_where(~both, np.divide(own, other, out=np.ones_like(own), where=both))
    counts = both & (weight > 0)
    widest = np.exp(np.percentile(abs(np.log(ratio.data[counts])), 95)) if counts.any() else LEAST_FACTOR
    limit = float(np.clip(widest, LEAST_FACTOR, MOST_FACTOR))
    norm = LogNorm(1 / limit, limit, clip=True)
    image = axis.imshow(ratio, norm=norm, cmap="PuOr_r", extent=EXTENT, aspect="auto")
    bar = axis.figure.colorbar(image, ax=axis, label="orange: more, purple: fewer\n(grey: one of them sees nothing)")
    ticks = [factor for factor in ROUND if factor <= limit]
    bar.set_ticks([*(1 / factor for factor in ticks[:0:-1]), *ticks])
    bar.set_ticklabels([*(f"1/{factor:g}" for factor in ticks[:0:-1]), *(f"{factor:g}" for factor in ticks)])
    bar.minorticks_off()


def _frame(axis: Axes, phi: Array, theta: Array, weight: Array, masked: Bool[ndarray, "rows columns"]) -> None:
    """Draw the outline of the weighted region, the masks and the axes."""
    axis.set_facecolor("white")
    if np.ptp(weight) > 0:
        levels = np.unique(weight)
        axis.contour(phi, theta, weight, levels=(levels[:-1] + levels[1:]) / 2, colors="white", linewidths=2.4)
        axis.contour(phi, theta, weight, levels=(levels[:-1] + levels[1:]) / 2, colors=INK, linewidths=1.1)
    if masked.any():
        axis.contourf(phi, theta, masked, levels=[0.5, 1.5], colors=["#dddddd"], alpha=0.75)
        axis.contourf(phi, theta, masked, levels=[0.5, 1.5], colors="none", hatches=["///"])
    axis.set_ylabel("theta [deg]\n(0 is up)")
    axis.set_yticks(range(0, 181, 45))
