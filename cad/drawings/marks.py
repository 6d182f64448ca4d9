"""What a sheet is made of: strokes, arcs, texts and arrow heads on layers. Paper millimetres, y up."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

Layer = Literal["visible", "hidden", "centre", "dimension", "frame"]
Point = tuple[float, float]

WIDTHS: dict[Layer, float] = {"visible": 0.35, "hidden": 0.18, "centre": 0.13, "dimension": 0.13, "frame": 0.5}
DASHES: dict[Layer, tuple[float, ...]] = {"hidden": (1.6, 0.8), "centre": (6.0, 1.2, 0.8, 1.2)}
CAPITAL = 0.72  # height of capitals and figures over the size of the font (Helvetica)
GLYPH_WIDTH = 0.6 / CAPITAL  # of the height, on average: what room a text needs
TEXT = 2.5
ARROW = (2.2, 0.35)  # length and half width


@dataclass(frozen=True, slots=True)
class Stroke:
    """Straight pieces through points."""

    layer: Layer
    points: tuple[Point, ...]


@dataclass(frozen=True, slots=True)
class Bow:
    """Part of a circle, counter-clockwise from start to end [rad]."""

    layer: Layer
    centre: Point
    radius: float
    start: float
    end: float


@dataclass(frozen=True, slots=True)
class Text:
    """One line of text; `at` is its left end, middle or right end on the base line; angle in degrees."""

    at: Point
    text: str
    height: float = TEXT
    anchor: Literal["left", "middle", "right"] = "left"
    angle: float = 0.0

    @property
    def width(self) -> float:
        """Room that the text takes, roughly."""
        return len(self.text) * self.height * GLYPH_WIDTH


@dataclass(frozen=True, slots=True)
class Head:
    """A filled arrow head."""

    tip: Point
    angle: float  # rad, where it points

    def corners(self) -> tuple[Point, Point, Point]:
        """Of the triangle."""
        length, half = ARROW
        c, s = math.cos(self.angle), math.sin(self.angle)
        x, y = self.tip
        left = (x - length * c - half * s, y - length * s + half * c)
        right = (x - length * c + half * s, y - length * s - half * c)
        return self.tip, left, right


Mark = Stroke | Bow | Text | Head


def moved(mark: Mark, dx: float, dy: float) -> Mark:
    """The mark somewhere else."""

    def shift(point: Point) -> Point:
        return point[0] + dx, point[1] + dy

    if isinstance(mark, Stroke):
        return replace(mark, points=tuple(shift(p) for p in mark.points))
    if isinstance(mark, Bow):
        return replace(mark, centre=shift(mark.centre))
    if isinstance(mark, Text):
        return replace(mark, at=shift(mark.at))
    return replace(mark, tip=shift(mark.tip))


def box_of(marks: list[Mark]) -> tuple[float, float, float, float]:
    """Left, bottom, right and top of marks."""
    xs: list[float] = []
    ys: list[float] = []
    for mark in marks:
        for x, y in _extremes(mark):
            xs.append(x)
            ys.append(y)
    return min(xs), min(ys), max(xs), max(ys)


def _extremes(mark: Mark) -> list[Point]:
    if isinstance(mark, Stroke):
        return list(mark.points)
    if isinstance(mark, Head):
        return list(mark.corners())
    if isinstance(mark, Bow):
        turn = [mark.start + (mark.end - mark.start) * k / 16 for k in range(17)]
        x, y = mark.centre
        return [(x + mark.radius * math.cos(a), y + mark.radius * math.sin(a)) for a in turn]
    before = {"left": 0.0, "middle": 0.5, "right": 1.0}[mark.anchor] * mark.width
    c, s = math.cos(math.radians(mark.angle)), math.sin(math.radians(mark.angle))
    corners = [(-before, 0.0), (mark.width - before, 0.0), (-before, mark.height), (mark.width - before, mark.height)]
    return [(mark.at[0] + u * c - v * s, mark.at[1] + u * s + v * c) for u, v in corners]
