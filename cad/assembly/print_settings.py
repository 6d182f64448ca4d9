"""Print settings for the slicer and as text: solid parts of wide lines.

PrusaSlicer and its derivatives read settings from the 3MF; set them by hand in other slicers. The checks of bending
hold for solid parts. Time is saved by wide lines and by few closed layers, which slicers print at a quarter of the
speed.
"""

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
    "small_perimeter_speed": "30",  # mm/s, as outer walls: the slicer halves it around legs of a frame
}
PRINTED_CM3_H = 17.5  # of the part, with the time for its supports, as `benchmarks.cad.slicer` measures it
LINES = ("", "external_perimeter_", "perimeter_", "infill_", "solid_infill_")


def slicer_settings(printer: Printer) -> Mapping[str, str]:
    """Return the settings of PrusaSlicer for every object; none for a printer without filament."""
    if printer.layer_mm is None or printer.line_mm is None:
        return {}
    lines = {f"{which}extrusion_width": f"{printer.line_mm:g}" for which in LINES}
    return {"layer_height": f"{printer.layer_mm:g}", **lines, **SOLID}


def print_words(printer: Printer) -> str:
    """Return the print settings as the end of a sentence."""
    if printer.layer_mm is None or printer.line_mm is None:
        return "solid"
    return f"solid (100 % fill), in layers of {printer.layer_mm:g} mm and lines {printer.line_mm:g} mm wide"


def print_hours(mass_g: float, printer: Printer) -> float:
    """Return the estimated time to print parts of a mass, with their supports."""
    return mass_g / printer.density_g_cm3 / PRINTED_CM3_H


def hours_in_words(hours: float) -> str:
    """Return a time to print as text, to half an hour below 5 h."""
    return f"about {max(round(2 * hours) / 2, 0.5) if hours < 5 else round(hours):g} h"
