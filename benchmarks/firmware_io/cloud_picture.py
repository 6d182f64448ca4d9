"""A cloud as a picture: from above, from behind and from the side at one scale, and obliquely, coloured by height."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Colormap, Normalize
from matplotlib.figure import Figure

from scanwright.design import frames
from scanwright.design.arrays import Floats
from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import atomic_write
from scanwright.firmware_io.clouds.ply import read_ply

_WIDTH_IN = 11.0
_CELLS = 700  # along the widest view; finer than a screen shows
_KEPT_PERCENT = (0.5, 99.5)  # what is drawn: a few stray points far off must not shrink the room
_OBLIQUE_PERCENT = (4, 96)  # the oblique view shows the dense middle only, larger


def cloud_picture(ply: Path, png: Path) -> None:
    """Draw a cloud in four views, metres on the axes, the world's origin as a cross.

    Raises:
        RecordingError: the cloud cannot be read or has no point, or the picture cannot be written.
    """
    rows = read_ply(ply)
    points_m = np.stack([np.asarray(rows[name], float) for name in "xyz"], axis=1)
    points_m = points_m[np.isfinite(points_m).all(axis=1)]
    if not len(points_m):
        raise RecordingError(f"{ply}: no row of the cloud is a point")
    total = len(points_m)
    low, high = np.percentile(points_m, _KEPT_PERCENT, axis=0)
    margin = 0.04 * float((high - low).max()) + 0.01
    low, high = low - margin, high + margin
    points_m = points_m[((points_m >= low) & (points_m <= high)).all(axis=1)]
    span = high - low
    height = Normalize(*np.percentile(points_m[:, 2], [1, 99]))
    colours = colormaps["turbo"]
    cell_m = float(span.max()) / _CELLS

    tall = (span[0] + span[2]) / (span[1] + span[0])
    figure = Figure(figsize=(_WIDTH_IN, _WIDTH_IN * tall + 1.1), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(2, 2, width_ratios=[span[1], span[0]], height_ratios=[span[0], span[2]])
    x, y, z = points_m.T
    _view(panels[0, 0], y, x, z, cell_m, height, colours)
    _view(panels[1, 0], y, z, z, cell_m, height, colours)
    _view(panels[1, 1], x, z, z, cell_m, height, colours)
    inner = np.percentile(points_m, _OBLIQUE_PERCENT, axis=0)
    dense = points_m[((points_m >= inner[0]) & (points_m <= inner[1])).all(axis=1)]
    dense = dense if len(dense) else points_m
    seen = dense @ (frames.Rx(np.radians(-50)) @ frames.Rz(np.radians(115))).T
    _view(panels[0, 1], seen[:, 0], seen[:, 1], dense[:, 2], 1.5 * cell_m, height, colours)
    for panel, title, right, up in (
        (panels[0, 0], "from above", "y, left [m]", "x, ahead [m]"),
        (panels[1, 0], "from behind", "y, left [m]", "z, up [m]"),
        (panels[1, 1], "from the right", "x, ahead [m]", "z, up [m]"),
    ):
        panel.set(title=title, xlabel=right, ylabel=up)
        panel.plot(0, 0, "k+", markersize=12, markeredgewidth=1.5)
        panel.grid(color="0.85", linewidth=0.5)
        panel.set_axisbelow(True)
    for panel in panels[:, 0]:
        panel.invert_xaxis()
    panels[0, 1].set(title="the middle, from behind and above", xticks=[], yticks=[])
    panels[0, 1].set_frame_on(False)
    figure.suptitle(f"{ply.name}: {total:,} points, the cross is the world's origin, colour is height", fontsize=11)
    with atomic_write(png, RecordingError) as part:
        figure.savefig(part, format="png", metadata={"Software": None})


def _view(
    panel: Axes, right: Floats, up: Floats, height_m: Floats, cell_m: float, scale: Normalize, colours: Colormap
) -> None:
    """Draw the mean height in each cell, the fainter the fewer points it holds: one point looks like one point."""
    edges = [np.arange(v.min(), v.max() + 2 * cell_m, cell_m) for v in (up, right)]
    count, _, _ = np.histogram2d(up, right, bins=edges)
    total, _, _ = np.histogram2d(up, right, bins=edges, weights=height_m)
    image = colours(scale(np.divide(total, count, out=np.zeros_like(total), where=count > 0)))
    often = np.percentile(count[count > 0], 90)
    image[..., 3] = np.where(count > 0, np.clip(0.3 + 0.7 * np.log1p(count) / np.log1p(often), 0, 1), 0)
    extent = (edges[1][0], edges[1][-1], edges[0][0], edges[0][-1])
    panel.imshow(image, origin="lower", extent=extent, interpolation="nearest")
