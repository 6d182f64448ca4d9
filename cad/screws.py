"""Metric cap screws (ISO 4762 heads), in mm: what a hole, a head and a driver need."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Screw:
    """Thread, head and driver of one size."""

    name: str
    nominal: float
    head_diameter: float
    head_height: float
    core: float  # hole that the thread is cut into, ISO 2306

    @property
    def head_room(self) -> float:
        """Radius that the head and a driver or socket around it need."""
        return self.head_diameter / 2 + 0.4


SCREWS = {
    screw.name: screw
    for screw in (
        Screw("M2", 2.0, 3.8, 2.0, 1.6),
        Screw("M2.5", 2.5, 4.5, 2.5, 2.05),
        Screw("M3", 3.0, 5.5, 3.0, 2.5),
        Screw("M4", 4.0, 7.0, 4.0, 3.3),
    )
}
