"""What rows of the parts list cost where the catalogue tells no price: ranges of an estimate, stated as such.

Nobody has asked a shop: the ranges are what such things usually cost in small numbers, without tax and carriage. A
price of the catalogue that is not verified, or years old, is taken to be right within a stated share.
"""

from __future__ import annotations

import re

from scanwright.cad.layout.names import JOURNAL_SLEEVE

ESTIMATED = "estimate of 2026 of what shops usually ask, none was asked"
FILAMENT_USD_PER_KG = (15.0, 35.0)
UNSURE = (0.7, 1.5)  # times a catalogue price that nobody verified, or of before RECENT
RECENT = "2024"
EACH: dict[str, tuple[tuple[str, float, float], ...]] = {
    "printed": (("", 0.0, 0.0),),  # its plastic has a row of its own
    "turned": ((JOURNAL_SLEEVE, 25.0, 90.0), ("", 50.0, 180.0)),
    "sawn": (("", 8.0, 30.0),),
    "screw": (("", 0.05, 0.35),),
    "nut": (("", 0.03, 0.20),),
    "insert": (("", 0.10, 0.40),),
    "wiring": (
        ("power supply", 15.0, 45.0),
        ("step-", 4.0, 15.0),
        ("distribution", 6.0, 20.0),
        ("main fuse", 2.0, 8.0),
        ("fuse", 0.3, 1.5),
        ("switch", 3.0, 10.0),
        ("wire", 5.0, 15.0),
        ("adapter", 25.0, 60.0),
        ("servo cable", 3.0, 10.0),
        ("USB", 4.0, 12.0),
        ("power lead", 3.0, 15.0),
        ("cables and power", 10.0, 60.0),
        ("plug, socket", 5.0, 15.0),
        ("socket of", 2.0, 8.0),
        ("cable tie", 0.05, 0.20),
        ("soft tube", 1.0, 5.0),
    ),
    "consumable": (
        ("threadlocker", 6.0, 15.0),
        ("retaining compound", 8.0, 20.0),
        ("epoxy", 6.0, 15.0),
        ("retaining ring", 0.2, 1.0),
    ),
    "tool": (
        ("hexagon keys", 8.0, 25.0),
        ("torque", 30.0, 150.0),
        ("indicator", 25.0, 70.0),
        ("crimping", 15.0, 50.0),
        ("soldering", 20.0, 70.0),
        ("meter", 15.0, 60.0),
    ),
}


def estimate_usd(kind: str, part: str) -> tuple[float, float] | None:
    """Least and most for one piece; None where there is not even an estimate."""
    return next(((low, high) for word, low, high in EACH.get(kind, ()) if word in part), None)


def year_of(source: str) -> str:
    """Year that a source of a price names; empty where it names none."""
    found = re.search(r"\b(19|20)\d\d\b", source)
    return "" if found is None else found[0]
