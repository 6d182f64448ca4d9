"""Two pads: where the axis points and how the lidar sits on it, each over the landscape of the objective."""

from __future__ import annotations

import numpy as np
from PIL import Image
from scipy.interpolate import RegularGridInterpolator

from scanwright.design.search.optimum import Optimum
from scanwright.design.task.angle_ranges import NAMES
from scanwright.report.build_files import png_uri
from scanwright.report.colours import ramp
from scanwright.studio.state import BOUNDS_DEG

PIXELS = 180  # of a picture's height: a pad is about 140 high
STEP, LEAST = 0.05, 0.5  # ratio of a band, and the lowest ratio that has a colour of its own
PADS = ((0, "Where the axis points", "axes", "lidar"), (2, "How the lidar sits", "planes", "axis"))


def pads_html(optimum: Optimum | None) -> str:
    """Return the pads, with landscapes if the task has been searched; `setting_link.js` moves their dots."""
    pads, drawn = "", False
    for first, title, table, other in PADS:
        (x, y), names = BOUNDS_DEG[first : first + 2], NAMES[first : first + 2]
        picture = "" if optimum is None else _landscape(optimum, table, x, y)
        drawn |= bool(picture)
        pads += (
            f'<div style="flex:{x / y:g}"><b>{title}</b><div class="sw-pad" data-first="{first}" data-x="{x:g}" '
            f'data-y="{y:g}" style="aspect-ratio:{x / y:g}" title="Bright: more beams, with the best {other} for it">'
            f'{picture}<button class="sw-dot" aria-label="{title}: {names[0]} and {names[1]}, arrow keys move it">'
            "</button></div><div>alpha &rarr; beta &uarr;</div></div>"
        )
    words = "Bright: as many beams as the best mount; dark: half of them or fewer."
    if not drawn:
        words = "Optimise shows how good each place is." if optimum is None else "The task fixes the angles."
    return f'<div class="sw-pads">{pads}</div><div class="sw-small">{words}</div>'


def _landscape(optimum: Optimum, table: str, x: float, y: float) -> str:
    """Return the lowest J over a pair of angles in bands, as an element that covers its range; empty if it has none.

    `table` is `axes` or `planes`; x and y are the bounds of the angles [deg].
    """
    rows = getattr(optimum.search, table)[:, :3]
    xs, ys = np.unique(rows[:, 0]), np.unique(rows[:, 1])
    finite = np.isfinite(rows[:, 2])
    if len(xs) < 2 or len(ys) < 2 or not finite.any():
        return ""
    best, worst = rows[finite, 2].min(), rows[finite, 2].max()
    J = np.full((len(ys), len(xs)), worst)
    J[np.searchsorted(ys, rows[finite, 1]), np.searchsorted(xs, rows[finite, 0])] = rows[finite, 2]
    fine_y, fine_x = np.linspace(ys[-1], ys[0], PIXELS), np.linspace(xs[0], xs[-1], 2 * PIXELS)
    J = RegularGridInterpolator((ys, xs), J)(np.stack(np.meshgrid(fine_y, fine_x, indexing="ij"), axis=-1))
    ratio = np.exp(best - J) if optimum.problem.objective.name == "log" else 1 - (J - best) / max(worst - best, 1e-9)
    level = (np.floor(ratio / STEP) * STEP - LEAST) / (1 - LEAST)
    picture = png_uri(Image.fromarray(ramp(level.ravel()).reshape(*J.shape, 3)))
    left, top = 50 * (1 + xs[0] / x), 50 * (1 - ys[-1] / y)
    width, height = 50 * (xs[-1] - xs[0]) / x, 50 * (ys[-1] - ys[0]) / y
    return (
        f'<img alt="" src="{picture}" style="left:{left:.1f}%;top:{top:.1f}%;width:{width:.1f}%;height:{height:.1f}%">'
    )
