"""The holes of the robot's deck for the base mount, from the task [mm], about the centre of the mount.

x and y are those of the world frame, whose origin is the centre of the pattern on the face of the deck.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from scanwright.design.files.record import Record

Length = Annotated[float, Field(gt=0, le=400)]
DeckScrew = Literal["M3", "M4", "M5", "M6"]


class Rectangle(Record):
    """Four holes in the corners of a rectangle; `size_mm` is between their centres, along x and y."""

    shape: Literal["rectangle"] = Field(description="four holes in its corners")
    size_mm: tuple[Length, Length] = Field(default=(80.0, 80.0), description="between the holes, along x and y")
    screw: DeckScrew = Field(default="M4", description="that goes through the holes")

    def holes(self) -> tuple[tuple[float, float], ...]:
        """Return the centres [mm]."""
        x, y = self.size_mm[0] / 2, self.size_mm[1] / 2
        return (x, y), (-x, y), (-x, -y), (x, -y)


class Circle(Record):
    """Holes spread evenly on a circle, the first at `first_deg` from x."""

    shape: Literal["circle"] = Field(description="holes spread evenly on it")
    diameter_mm: Length = Field(description="of the circle of holes")
    count: int = Field(default=4, ge=3, le=16, description="of holes")
    first_deg: float = Field(default=45.0, ge=-360, le=360, description="of one hole, from x towards y")
    screw: DeckScrew = Field(default="M4", description="that goes through the holes")

    def holes(self) -> tuple[tuple[float, float], ...]:
        """Return the centres [mm]."""
        turns = [math.radians(self.first_deg + 360 * i / self.count) for i in range(self.count)]
        r = self.diameter_mm / 2
        return tuple((round(r * math.cos(a), 6), round(r * math.sin(a), 6)) for a in turns)


DeckHoles = Annotated[Rectangle | Circle, Field(discriminator="shape")]
