"""Fit coupon: a plate to print first, which tells the clearances of one printer.

Frame: its own, mm, lying on the bed. One row of bores for the shaft's spigot, one of holes for each screw that the
scanner's catalogue parts take; the number under each hole is its clearance on the diameter, and that of the printer's
profile is among them; a profile with nut traps gets a row of pockets. The bore that slides without play, and the hole
that the screw just falls through, belong in the profile (`fit_clearance_mm`, `screw_clearance_mm`).
"""

from __future__ import annotations

import math

import cadquery as cq
import numpy as np
import shapely

from cad import outlines, solids
from cad.labels.engrave import engrave, groove_of
from cad.labels.flats import Flat, flat_at
from cad.labels.glyphs import letters, text_width
from cad.layout.hub import Hub
from cad.layout.names import FIT_COUPON
from cad.screws import SCREWS, trap_of
from cad.solids import building
from design.arrays import Array
from design.scanner import Scanner

NUT = SCREWS["M3"]  # that the parts trap
THICKNESS = 5.0
LETTER = 4.5
STEP = 0.1  # from one clearance to the next
COLUMNS = 5
PITCH = 20.0
MARGIN = 4.0
POCKETS = "NUT"  # heading of the row for nuts


def fit_coupon(scanner: Scanner, stack: Hub) -> cq.Solid:
    """Make the coupon of one scanner's printer.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    printer, rows = scanner.printer, _rows(scanner, stack)
    groove, trap = groove_of(printer), trap_of(NUT, printer)
    heading = max(text_width(name, LETTER) for name, _, _ in rows) + 3.0
    heights = [max(nominal + max(fits), LETTER) + LETTER + 5.0 for _, nominal, fits in rows]
    width = 2 * MARGIN + heading + PITCH * COLUMNS
    depth = 2 * MARGIN + sum(heights) + LETTER + 3.0
    holes: list[cq.Solid] = []
    y = depth - MARGIN - LETTER
    words = [(printer.name, MARGIN, y)]
    for (name, nominal, fits), height in zip(rows, heights, strict=True):
        y -= height
        middle = y + LETTER + 2.0 + (height - LETTER - 5.0) / 2 + 1.5
        words.append((name, MARGIN, middle - LETTER / 2))
        for i, fit in enumerate(fits):
            x = MARGIN + heading + PITCH * (i + 0.5)
            bore = nominal + fit
            if name == POCKETS and trap is not None:
                pocket = outlines.polygon(bore / math.sqrt(3), 6) + np.array([x, middle])
                holes.append(solids.prism(pocket, THICKNESS - trap.depth, THICKNESS + 1.0))
                bore = trap.hole
            holes.append(solids.upright(bore / 2, -1.0, THICKNESS + 1.0, x, middle))
            mark = f"{fit:.2f}".rstrip("0").ljust(3, "0")
            words.append((mark, x - text_width(mark, LETTER) / 2, y))
    with building(FIT_COUPON, "plate and holes", "rows", len(rows)) as checked:
        plate = checked(solids.box((0.0, 0.0, 0.0), (width, depth, THICKNESS)).cut(*holes))
    with building(FIT_COUPON, "lettering", "title", printer.name) as checked:
        top = flat_at(plate, np.array([0.5, 0.5, THICKNESS]), np.array([0.0, 0.0, 1.0]))
        assert top is not None
        grooves = [outline for word in words for outline in _letters(*word, groove.width, top)]
        return checked(engrave(plate, [(top, grooves)], groove.depth))


def _rows(scanner: Scanner, stack: Hub) -> list[tuple[str, float, list[float]]]:
    """Heading, nominal diameter and clearances of each; the last one, of pockets, where the profile traps nuts."""
    printer = scanner.printer
    fits, screws = _around(printer.fit_clearance_mm), _around(printer.screw_clearance_mm)
    rows = [(f"{stack.shaft_diameter:g}", stack.shaft_diameter, fits)]
    for name in sorted({scanner.lidar.mount_screw, scanner.servo.case_screw}):
        rows.append((name, SCREWS[name].nominal, screws))
    return rows if trap_of(NUT, printer) is None else [*rows, (POCKETS, NUT.nut_across, fits)]


def _letters(text: str, x: float, y: float, stroke: float, top: Flat) -> list[shapely.Polygon]:
    """Outlines of a word whose lower left corner is at (x, y) on the plate, in the axes of its upper face."""
    corner = np.array([x, y, THICKNESS])

    def put(points: Array) -> Array:
        return top.along(corner + np.column_stack([points, np.zeros(len(points))]))

    return [shapely.transform(outline, put) for outline in letters(text, LETTER, stroke)]


def _around(clearance: float) -> list[float]:
    """Clearances about that of the profile, or from the least on where it is small."""
    below = min(COLUMNS // 2, int(clearance / STEP + 1e-9))
    return [round(clearance + (i - below) * STEP, 3) for i in range(COLUMNS)]
