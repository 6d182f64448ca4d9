"""Estimated prices for rows of the parts list without a price in the catalogue.

The ranges are usual prices in small numbers without tax and shipping, not quotes. A price of the catalogue that is
unverified or older than RECENT is multiplied by UNSURE.
"""

import re

from scanwright.cad.layout.names import JOURNAL_SLEEVE

ESTIMATED = "estimate of usual prices in 2026, not a quote"
UNSURE = (0.7, 1.5)  # least and most over an unverified or old price: assumed
RECENT = "2024"  # first year whose prices count as they are
EACH_USD: dict[str, tuple[float, float]] = {
    "printed": (0.0, 0.0),  # its plastic has a separate row
    "turned": (50.0, 180.0),
    JOURNAL_SLEEVE: (25.0, 90.0),
    "sawn": (8.0, 30.0),
    "screw": (0.05, 0.35),
    "nut": (0.03, 0.20),
    "washer": (0.01, 0.10),
    "insert": (0.10, 0.40),
    "power supply": (15.0, 45.0),
    "converter": (4.0, 15.0),
    "distribution": (6.0, 20.0),
    "main fuse": (2.0, 8.0),
    "fuse": (0.3, 1.5),
    "switch": (3.0, 10.0),
    "wire": (5.0, 15.0),
    "adapter": (25.0, 60.0),
    "UART adapter": (3.0, 15.0),
    "servo cable": (3.0, 10.0),
    "power cable": (3.0, 15.0),
    "cables and power": (10.0, 60.0),
    "plug and socket": (3.0, 12.0),
    "crimps": (2.0, 8.0),
    "cable tie": (0.05, 0.20),
    "soft tube": (1.0, 5.0),
    "threadlocker": (6.0, 15.0),
    "tape": (2.0, 8.0),
    "hexagon keys": (8.0, 25.0),
    "long driver": (5.0, 15.0),
    "torque screwdriver": (30.0, 150.0),
    "dial indicator": (25.0, 70.0),
    "spring scale": (5.0, 20.0),
    "crimping pliers": (15.0, 50.0),
    "soldering iron": (20.0, 70.0),
    "multimeter": (15.0, 60.0),
    "caliper": (10.0, 60.0),
}
"""Least and most for one piece, by the `estimate` of a row."""


def year_of(source: str) -> str:
    """Return the year in the source of a price; empty if there is none."""
    year = re.search(r"\b(19|20)\d\d\b", source)
    return "" if year is None else year[0]
