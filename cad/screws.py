"""Metric cap screws (ISO 4762 heads), in mm: what a hole, a head and a driver need, and what a thread in a part."""

from __future__ import annotations

from dataclasses import dataclass

from design.catalogue import Printer


@dataclass(frozen=True, slots=True)
class Screw:
    """Thread, head and driver of one size."""

    name: str
    nominal: float
    head_diameter: float
    head_height: float
    core: float  # hole that the thread is cut into, ISO 2306
    insert: float | None = None  # hole for a heat-set insert: Accu's chart (-0, +0.1), NopSCADlib

    @property
    def head_room(self) -> float:
        """Radius that the head and a driver or socket around it need."""
        return self.head_diameter / 2 + 0.4


SCREWS = {
    screw.name: screw
    for screw in (
        Screw("M2", 2.0, 3.8, 2.0, 1.6),
        Screw("M2.5", 2.5, 4.5, 2.5, 2.05),
        Screw("M3", 3.0, 5.5, 3.0, 2.5, 4.0),
        Screw("M4", 4.0, 7.0, 4.0, 3.3),
        Screw("M5", 5.0, 8.5, 5.0, 4.2),
        Screw("M6", 6.0, 10.0, 6.0, 5.0),
    )
}
INSERT_LENGTH = 5.7  # of the usual M3 insert: every threaded hole of the parts is deeper


def thread_hole(screw: Screw, printer: Printer) -> float:
    """Diameter of the hole in a part that a screw holds on to: the core of a thread, or the seat of an insert."""
    return screw.insert if printer.thread == "insert" and screw.insert is not None else screw.core
