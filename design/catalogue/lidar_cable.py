"""Cables of a lidar, and their mating connectors. Millimetres, grams."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pydantic import Field

from scanwright.design.files.record import Record

End = Literal["bare", "USB-A", "RJ45", "XH2.54", "M12"]


class Cable(Record):
    """One cable of a lidar, as its maker sells it; never cut or stripped."""

    carries: Literal["power", "data", "both"]
    end: End = Field(description="its end away from the lidar: a plug, or bare wires")
    fixed: bool = Field(description="whether it cannot be unplugged from the lidar")
    lengths_mm: tuple[float, ...] = Field(min_length=1, description="as delivered, then the other ones that are sold")
    diameter_mm: float = Field(gt=0)
    g_per_m: float = Field(gt=0)

    @property
    def length_mm(self) -> float:
        """Length as delivered."""
        return self.lengths_mm[0]

    @property
    def mass_g(self) -> float:
        """Mass without its plug."""
        return self.g_per_m * self.length_mm / 1000

    def takes(self, net: str) -> bool:
        """Return whether it has a wire for a net of the lidar; + and - are power, all others are data."""
        return self.carries in ("both", "power" if net in ("+", "-") else "data")


@dataclass(frozen=True, slots=True)
class Connector:
    """A plug in its socket, ready for use."""

    words: str  # name of the part to buy
    size_mm: tuple[float, float, float]  # of the mated pair: along the cable, across it, and height
    mass_g: float  # of the mated pair


CONNECTORS: dict[End, Connector] = {  # sizes and masses assumed: usual parts, with 10 mm of straight cable
    "USB-A": Connector("USB-A socket with bare leads", (50.0, 16.5, 9.0), 12.0),
    "RJ45": Connector("RJ45 socket with bare leads", (50.0, 16.5, 14.0), 14.0),
    "XH2.54": Connector("XH2.54 socket with bare leads", (30.0, 16.0, 8.0), 3.0),
    "M12": Connector("M12 socket with bare leads", (80.0, 15.0, 15.0), 30.0),
}
POLE_MM, POLE_G = 5.0, 1.5  # of a terminal block with springs: assumed
BLOCK_MM = (25.0, 12.0)  # across it, with the wires in it, and height


def connector_for(end: End, poles: int) -> Connector:
    """Return the mate of an end of a cable with `poles` wires: a socket, or a terminal block for bare wires."""
    if end != "bare":
        return CONNECTORS[end]
    return Connector(f"terminal block, {poles} poles", (POLE_MM * poles, *BLOCK_MM), POLE_G * poles)
