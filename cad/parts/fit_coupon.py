"""Fit coupon: a plate to print first, which tells the clearances of one printer.

Frame: its own, mm, lying on the bed. One row of bores for the shaft's spigot, one of holes for each screw that the
scanner's catalogue parts take; the number under each hole is its clearance on the diameter, and that of the printer's
profile is among them. The bore that slides without play, and the hole that the screw just falls through, belong in the
profile (`fit_clearance_mm`, `screw_clearance_mm`).
"""

from __future__ import annotations

from dataclasses import dataclass

import cadquery as cq

from cad import solids
from cad.glyphs import grooves, text_width
from cad.screws import SCREWS
from cad.sizing import Stack
from cad.solids import building, checked
from design.scanner import Scanner

PART = "fit_coupon"
THICKNESS = 5.0
DEPTH = 0.6  # of the lettering
LETTER = 4.5
STEP = 0.1  # from one clearance to the next
COLUMNS = 5
PITCH = 20.0
MARGIN = 4.0


@dataclass(frozen=True, slots=True, kw_only=True)
class FitCoupon:
    """Rows of (heading, nominal diameter, clearances)."""

    title: str
    rows: tuple[tuple[str, float, tuple[float, ...]], ...]


def coupon_of(scanner: Scanner, stack: Stack) -> FitCoupon:
    """Parameters of the coupon of one scanner's printer."""
    printer = scanner.printer
    fits = _around(printer.fit_clearance_mm)
    rows = [(f"{stack.shaft_diameter:g}", stack.shaft_diameter, fits)]
    for name in sorted({scanner.lidar.mount_screw, scanner.servo.case_screw}):
        rows.append((name, SCREWS[name].nominal, _around(printer.screw_clearance_mm)))
    return FitCoupon(title=printer.name, rows=tuple(rows))


def fit_coupon(p: FitCoupon) -> cq.Solid:
    """Make the coupon.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    heading = max(text_width(name, LETTER) for name, _, _ in p.rows) + 3.0
    heights = [max(nominal + max(fits), LETTER) + LETTER + 5.0 for _, nominal, fits in p.rows]
    width = 2 * MARGIN + heading + PITCH * COLUMNS
    depth = 2 * MARGIN + sum(heights) + LETTER + 3.0
    holes, letters = [], []
    y = depth - MARGIN - LETTER
    letters += grooves(p.title, LETTER, MARGIN, y, THICKNESS, DEPTH)
    for (name, nominal, fits), height in zip(p.rows, heights, strict=True):
        y -= height
        middle = y + LETTER + 2.0 + (height - LETTER - 5.0) / 2 + 1.5
        letters += grooves(name, LETTER, MARGIN, middle - LETTER / 2, THICKNESS, DEPTH)
        for i, fit in enumerate(fits):
            x = MARGIN + heading + PITCH * (i + 0.5)
            holes.append(solids.upright((nominal + fit) / 2, -1.0, THICKNESS + 1.0, x, middle))
            mark = f"{fit:.2f}".rstrip("0").ljust(3, "0")
            letters += grooves(mark, LETTER, x - text_width(mark, LETTER) / 2, y, THICKNESS, DEPTH)
    with building(PART, "plate and holes", "rows", len(p.rows)):
        plate = solids.box((0.0, 0.0, 0.0), (width, depth, THICKNESS)).cut(*holes)
        plate = checked(plate, PART, "plate and holes", "rows", len(p.rows))
    with building(PART, "lettering", "title", p.title):
        return checked(plate.cut(*letters).clean(), PART, "lettering", "title", p.title)


def _around(clearance: float) -> tuple[float, ...]:
    """Clearances about that of the profile, or from the least on where it is small."""
    below = min(COLUMNS // 2, int(clearance / STEP + 1e-9))
    return tuple(round(clearance + (i - below) * STEP, 3) for i in range(COLUMNS))
