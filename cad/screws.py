"""Metric cap screws (ISO 4762 heads), in mm: holes, heads, drivers, nuts, and threads in printed parts."""

import math
from dataclasses import dataclass

from scanwright.design.catalogue.products import Printer


@dataclass(frozen=True, slots=True)
class Screw:
    """Thread and head of one size [mm]."""

    name: str
    nominal: float
    head_diameter: float
    head_height: float
    core: float  # hole that the thread is cut into, ISO 2306
    nut_across: float  # across the flats of a hexagon nut, ISO 4032
    nut_height: float  # at most, ISO 4032
    insert: float | None = None  # hole for a heat-set insert: Accu's chart (-0, +0.1), NopSCADlib
    nut_standard: str = "ISO 4032"

    @property
    def driver_radius(self) -> float:
        """Radius that the head and a driver or socket around it need."""
        return self.head_diameter / 2 + 0.4


SCREWS = {
    screw.name: screw
    for screw in (
        Screw("M1.6", 1.6, 3.0, 1.6, 1.25, 3.2, 1.3),
        Screw("M2", 2.0, 3.8, 2.0, 1.6, 4.0, 1.6),
        Screw("M2.5", 2.5, 4.5, 2.5, 2.05, 5.0, 2.0),
        Screw("M3", 3.0, 5.5, 3.0, 2.5, 5.5, 2.4, 4.0),
        Screw("M4", 4.0, 7.0, 4.0, 3.3, 7.0, 3.2),
        Screw("M5", 5.0, 8.5, 5.0, 4.2, 8.0, 4.7),
        Screw("M6", 6.0, 10.0, 6.0, 5.0, 10.0, 5.2),
        Screw("M8", 8.0, 13.0, 8.0, 6.8, 13.0, 6.8),
    )
}
# of a hexagon key: radius over its corners with clearance, and length of its long arm (ISO 2936)
KEYS_MM = {
    "M1.6": (1.2, 46.5),
    "M2": (1.2, 46.5),
    "M2.5": (1.4, 52.0),
    "M3": (1.6, 58.5),
    "M4": (1.9, 66.0),
    "M5": (2.4, 74.0),
    "M6": (3.0, 85.0),
    "M8": (3.6, 96.0),
}
TRIPOD_SCREW = Screw("1/4-20 UNC", 6.35, 9.53, 6.35, 5.1, 11.11, 5.74, nut_standard="ASME B18.2.2")
"""Of tripods (ISO 1222), with the head of a cap screw of its size; core and nut of ASME B1.1 and B18.2.2."""

INSERT_LENGTH = 5.7  # of the usual M3 insert: every threaded hole of the parts is deeper


@dataclass(frozen=True, slots=True)
class Trap:
    """Pocket for a hexagon nut in a part, and the hole through it."""

    hole: float  # diameter, with half of a screw's clearance
    across: float  # across the flats of the pocket
    depth: float  # of a pocket, thickness of a slot

    @property
    def corner(self) -> float:
        """Distance from the axis to a corner of the pocket."""
        return self.across / math.sqrt(3)


def trap_of(screw: Screw, printer: Printer, *, carries: bool = False) -> Trap | None:
    """Return the nut pocket of a screw; None if the profile uses none.

    If the lidar hangs on the screw (`carries`), a thread in bare plastic always gets a nut, since plastic creeps.
    """
    bare = printer.thread == "cut" or screw.insert is None
    if printer.thread != "nut" and not (carries and bare):
        return None
    fit = printer.fit_clearance_mm
    return Trap(screw.nominal + printer.screw_clearance_mm / 2, screw.nut_across + fit, screw.nut_height + fit)


@dataclass(frozen=True, slots=True)
class Thread:
    """Thread of a screw in a printed part: cut, an insert, or a nut in a pocket."""

    hole: float  # diameter
    trap: Trap | None  # pocket of the nut, if there is one
    insert: bool  # whether it is an insert


def thread_in_part(screw: Screw, printer: Printer, *, nut_fits: bool = True, carries: bool = False) -> Thread:
    """Return the thread that a printer's profile gives a screw.

    If no nut fits and the lidar hangs on the screw (`carries`), an insert is used.
    """
    trap = trap_of(screw, printer, carries=carries)
    if trap is not None and not nut_fits:
        if carries and screw.insert is not None:
            return Thread(screw.insert, None, True)
        trap = None
    insert = screw.insert if printer.thread == "insert" else None
    return Thread(trap.hole if trap is not None else insert or screw.core, trap, insert is not None)


def passing_hole(screw: Screw, printer: Printer) -> float:
    """Return the diameter of the hole in a part that a screw passes through."""
    return screw.nominal + printer.screw_clearance_mm
