"""Picture of a registration: the map from above, a colour for each cloud, and the overlap of all pairs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from scanwright.design import frames
from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import atomic_write
from scanwright.firmware_io.registration.register import Registration
from scanwright.firmware_io.registration.sensor_view import SensorView

_SHOWN = 20_000  # points of one cloud: more only blacken the page
_SHOWN_PERCENT = (0.5, 99.5)


def overlap_picture(png: Path, views: Sequence[SensorView], registration: Registration) -> None:
    """Draw a complete registration."""
    colours = colormaps["turbo"](np.linspace(0.05, 0.95, len(views)))
    figure = Figure(figsize=(12, 6.5), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    above, table = figure.subplots(1, 2, width_ratios=[1.5, 1])
    placed = [frames.apply(T, view.fine.points_m) for view, T in zip(views, registration.T_world, strict=True)]
    for points, T, colour, view in zip(placed, registration.T_world, colours, views, strict=True):
        some = points[:: len(points) // _SHOWN + 1]
        above.scatter(some[:, 0], some[:, 1], s=1, color=colour, alpha=0.5, linewidths=0, rasterized=True)
        above.plot(T[0, 3], T[1, 3], "o", color=colour, markeredgecolor="black", label=view.name)
    low, high = np.percentile(np.concatenate(placed)[:, :2], _SHOWN_PERCENT, axis=0)
    margin = 0.05 * (high - low).max()
    above.set(
        title="from above, circles are the scan positions",
        xlabel="x [m]",
        ylabel="y [m]",
        aspect="equal",
        xlim=(low[0] - margin, high[0] + margin),
        ylim=(low[1] - margin, high[1] + margin),
    )
    names = [view.name for view in views]
    share = np.full((len(names), len(names)), np.nan)
    for pair in registration.pairs:
        if not pair.why_not:
            i, j = names.index(pair.a), names.index(pair.b)
            share[i, j] = share[j, i] = pair.overlap
    image = table.imshow(share, vmin=0, vmax=1, cmap="viridis")
    table.set(title="overlap of the pairs that are used", xticks=range(len(names)), yticks=range(len(names)))
    table.set_xticklabels(names, rotation=90, fontsize=7)
    table.set_yticklabels(names, fontsize=7)
    figure.colorbar(image, ax=table, shrink=0.7)
    with atomic_write(png, RecordingError) as part:
        figure.savefig(part, format="png", metadata={"Software": None})
