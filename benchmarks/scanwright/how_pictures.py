"""Pictures of docs/how-it-works.md, from a search of `ground_ahead`; they can be read at a width of 390 pixels.

uv run python -m benchmarks.scanwright.how_pictures
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

import scanwright as sw
from scanwright.design.arrays import Array
from scanwright.design.evaluation.coverage import mean_density_at
from scanwright.design.objective.holes import holes
from scanwright.design.objective.problem import Problem

PICTURES = Path(__file__).parents[2] / "docs/pictures"
FEW = 30.0  # lower end of the colours, beams within the ball
STEP_DEG = 0.5
INK = "#222222"
BLUE = "#2f5d8a"
DPI = 120  # 6.5 inches wide: text of 13 points is 11 pixels high on a phone
TEXT: dict[Any, Any] = {"font.size": 13, "axes.titlesize": 14}


def main() -> None:
    """Write the four pictures."""
    from matplotlib import rc_context

    optimum = sw.optimise("ground_ahead")
    with rc_context(TEXT):
        _save(why_angles(optimum), "how_angles.png")
        _save(reference_mounts(optimum), "how_mounts.png")
        _save(blind_spot(optimum), "how_blind_spot.png")
        _save(search_steps(optimum), "how_search.png")


def _save(figure: Figure, name: str) -> None:
    figure.savefig(PICTURES / name, dpi=DPI, metadata={"Software": None})


def why_angles(optimum: sw.Optimum) -> Figure:
    """Draw the density of a rolling lidar and of the optimum, with the region."""
    best = optimum.search.best[0]
    rolling = next(mount for mount in optimum.mounts if mount.name == "rolling")
    titles = {
        "Rolling lidar: dense straight ahead": rolling.angles_rad,
        "Optimised: dense in the region": best.angles_rad,
    }
    figure = Figure(figsize=(6.5, 6.6), layout="constrained")
    axes = figure.subplots(2, 1)
    for axis, (title, angles) in zip(axes, titles.items(), strict=True):
        image = _density_map(axis, optimum.problem, np.asarray(angles))
        axis.set_title(title, loc="left")
    figure.colorbar(image, ax=axes, location="bottom", label="beams within 2 deg of a direction", shrink=0.8)
    return figure


def reference_mounts(optimum: sw.Optimum) -> Figure:
    """Draw the density of the four reference mounts, and the gain of the optimum over each."""
    figure = Figure(figsize=(6.5, 5.6), layout="constrained")
    for axis, gain in zip(figure.subplots(2, 2).ravel(), optimum.gains, strict=True):
        image = _density_map(axis, optimum.problem, gain.mount.angles_rad)
        axis.set(xlabel="", ylabel="", xticks=(-180, 0, 180), yticks=(0, 90, 180))
        axis.set_title(f"{gain.mount.name}\noptimum: {gain.factor:.2f} x", loc="left")
    figure.colorbar(image, ax=figure.axes, location="bottom", label="beams within 2 deg of a direction", shrink=0.8)
    return figure


def blind_spot(optimum: sw.Optimum) -> Figure:
    """Draw the density around the axis with and without a blind spot."""
    plain = optimum.search.plain
    assert plain is not None
    spot = holes(optimum.problem, plain.angles_rad)[0]
    best = optimum.search.best[0]
    figure = Figure(figsize=(6.5, 4.0), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    titles = (("Lowest J:\nblind spot", plain.angles_rad), ("holes = avoid:\nno blind spot", best.angles_rad))
    for axis, (title, angles) in zip(axes, titles, strict=True):
        about, off_deg = _around(np.array(spot.centre), 6.0)
        density = mean_density_at(optimum.problem, angles, about.reshape(-1, 3)).reshape(about.shape[:2])
        shown = np.ma.masked_less(density, 1e-9)
        image = axis.imshow(shown, norm=LogNorm(FEW, 3000, clip=True), cmap="cividis", extent=(-off_deg, off_deg) * 2)
        axis.set_facecolor("white")
        axis.set_title(title, loc="left")
        axis.set_xlabel("degrees")
    figure.colorbar(image, ax=axes, label="beams (white: none)")
    return figure


def search_steps(optimum: sw.Optimum) -> Figure:
    """Draw how many mounts are left after each step of the search."""
    result = optimum.search
    steps = {
        "mounts of the grid": result.covered,
        "that differ": result.evaluated,
        "refined and printed": len(result.best),
    }
    figure = Figure(figsize=(6.5, 2.6), layout="constrained")
    axis = figure.subplots()
    bars = axis.barh(list(steps), list(steps.values()), color=BLUE)
    axis.bar_label(bars, [f"{count:,}" for count in steps.values()], padding=4)
    axis.set(xscale="log", xlim=(1, 3e8), xticks=[])
    axis.invert_yaxis()
    axis.spines[["top", "right", "bottom"]].set_visible(False)
    axis.set_title("Candidates after each step", loc="left")
    return figure


def _density_map(axis: Axes, problem: Problem, angles_rad: Array) -> AxesImage:
    """Draw the mean density over all directions, and the outline of the region."""
    theta = np.arange(STEP_DEG / 2, 180, STEP_DEG)
    phi = np.arange(-180 + STEP_DEG / 2, 180, STEP_DEG)
    t, p = np.meshgrid(np.radians(theta), np.radians(phi), indexing="ij")
    directions = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1).reshape(-1, 3)
    density = mean_density_at(problem, angles_rad, directions).reshape(t.shape)
    weight = problem.field.weight_at(directions).reshape(t.shape) > 0
    shown = np.ma.masked_less(density, 1e-9)
    image = axis.imshow(
        shown, norm=LogNorm(FEW, 3000, clip=True), cmap="cividis", extent=(-180, 180, 180, 0), aspect="auto"
    )
    for colour, width in (("white", 4.0), (INK, 1.8)):
        axis.contour(phi, theta, weight, levels=[0.5], colors=colour, linewidths=width)
    axis.set_facecolor("white")
    axis.set(xlabel="left 180 to right -180 deg", ylabel="up 0 to down 180", xticks=range(-180, 181, 90))
    axis.set_yticks(range(0, 181, 45))
    return image


def _around(centre: Array, off_deg: float) -> tuple[Array, float]:
    """Return directions of a square around a direction, shape (n, n, 3), and half its side [deg]."""
    side = np.linspace(-off_deg, off_deg, 241)
    left = np.cross([0.0, 0.0, 1.0], centre)
    left /= np.linalg.norm(left)
    up = np.cross(centre, left)
    x, y = np.meshgrid(np.radians(side), np.radians(side[::-1]))
    directions = centre + np.tan(x)[..., None] * left + np.tan(y)[..., None] * up
    return directions / np.linalg.norm(directions, axis=-1, keepdims=True), off_deg


if __name__ == "__main__":
    main()
