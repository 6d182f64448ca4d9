"""How parts are printed, for the slicer and in words: solid, of wide lines in layers of a stated height.

PrusaSlicer and its kin take settings of an object from its 3MF; all others skip them and have to be told. What the
checks say of bending holds for solid parts, so that nothing is saved inside: time is saved by wide lines, by walls that
leave no narrow gaps, and by leaving out closed layers above and below, which a solid part has anyway (slicers lay both
at a quarter of their speed). Temperatures and speeds are the printer's own.
"""

from __future__ import annotations

from collections.abc import Mapping

from scanwright.design.catalogue.products import Printer

WALLS = 4  # lines: of 3 to 5 the quickest for the parts of `ground_ahead`
SOLID = {
    "fill_density": "100%",
    "fill_pattern": "rectilinear",
    "perimeters": f"{WALLS}",
    "top_solid_layers": "1",
    "bottom_solid_layers": "1",
    "solid_infill_below_area": "0",
}
PRINTED_CM3_H = 20.0  # as `benchmarks.cad.slicer` measures it for these parts
LINES = ("", "external_perimeter_", "perimeter_", "infill_", "solid_infill_")


def slicer_settings(printer: Printer) -> Mapping[str, str]:
    """Keys and values of PrusaSlicer for every object; none where no filament is laid."""
    if printer.layer_mm is None or printer.line_mm is None:
        return {}
    lines = {f"{which}extrusion_width": f"{printer.line_mm:g}" for which in LINES}
    return {"layer_height": f"{printer.layer_mm:g}", **lines, **SOLID}


def print_words(printer: Printer) -> str:
    """The same as the end of a sentence: how to print."""
    if printer.layer_mm is None or printer.line_mm is None:
        return "solid"
    return f"solid (100 % fill), in layers of {printer.layer_mm:g} mm and lines {printer.line_mm:g} mm wide"


def print_hours(mass_g: float, printer: Printer) -> float:
    """Return the estimated time to print parts of a mass."""
    return mass_g / printer.density_g_cm3 / PRINTED_CM3_H


def hours_in_words(hours: float) -> str:
    """Return a time to print as text, to half an hour below 5 h."""
    return f"about {max(round(2 * hours) / 2, 0.5) if hours < 5 else round(hours):g} h"
