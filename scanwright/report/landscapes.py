"""The maps of J that the report draws from `search.csv` and `axes.csv`."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from design.angles import AngleSet, standard_settings
from design.arrays import Array
from design.evaluation.landscape_picture import LandscapePanel, draw_landscape
from design.evaluation.picture_files import svg_bytes
from scanwright.report.data_uri import data_uri

PLANE = ("alpha_laser", "beta_laser")
AXIS = ("alpha_rot", "beta_rot")
SIZE = 5.4, 5.2  # inches: its letters can still be read on a phone
DPI = 150  # of the mesh in it


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
