"""Pictures as files: PNG for programs without SVG, SVG for print and zoom, always the same bytes."""

from __future__ import annotations

import io
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from scanwright.design.errors import BuildError
from scanwright.design.files.atomic_file import atomic_write

DPI = 110  # of the PNG, and of pixel images in the SVG
NO_DATE = {"Date": None, "Creator": None}


def save_picture(figure: Figure, path: Path, dpi: float = DPI) -> None:
    """Write a figure to a PNG and an SVG of the same name.

    Raises:
        BuildError: a file cannot be written.
    """
    with atomic_write(path, BuildError) as part:
        figure.savefig(part, format="png", dpi=dpi, metadata={"Software": None})
    figure.set_layout_engine("none")  # the SVG keeps the layout of the PNG, which takes as long as drawing it
    with atomic_write(path.with_suffix(".svg"), BuildError) as part:
        part.write_bytes(svg_bytes(figure, dpi))


def svg_bytes(figure: Figure, dpi: float = DPI) -> bytes:
    """Return a figure as SVG, with letters as outlines, so that no font is missing."""
    stream = io.BytesIO()
    with mpl.rc_context({"svg.hashsalt": "scanwright"}):  # its names are random otherwise
        figure.savefig(stream, format="svg", dpi=dpi, metadata=NO_DATE)
    return stream.getvalue()
