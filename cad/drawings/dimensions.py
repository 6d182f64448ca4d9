"""Dimensions of one view: ordinates from the view's origin, leaders with text, angles.

Ordinates are the running dimensions of ISO 129; close ones are spread without crossing. Places are millimetres of
paper.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.optimize import isotonic_regression

from scanwright.cad.drawings.patterns import number
from scanwright.cad.drawings.pen import (
    ANCHORS,
    ANGLE,
    ARROW_MM,
    DIAMETER,
    ORDINATE_X,
    ORDINATE_Y,
    TEXT_MM,
    Pen,
    Point,
    width_of,
)
from scanwright.design.arrays import Array

GAP_MM = 1.5  # between an edge and the line that starts at it
REACH_MM = 6.0  # from the view to the bend of an ordinate
STEP_MM = TEXT_MM * 1.35  # between two texts
ARMS_MM = 4.0  # of an angle, beyond its arc: longer than an arrow
CLEAR_MM = 0.5  # around a text: the width of two lines
RIGHT_RAD = 0.5 * math.pi


@dataclass(frozen=True, slots=True)
class Callout:
    """Text with a leader to a point of a view [mm of the model]; a diameter comes first, after a count."""

    at: Point
    words: str
    centre: Point | None = None


def spread(wanted: Sequence[float], step: float) -> Array:
    """Return places at least `step` apart in the order of `wanted` (ascending), nearest to it by least squares."""
    steps = step * np.arange(len(wanted))
    return steps + isotonic_regression(np.asarray(wanted) - steps).x if len(wanted) else steps


def ordinates(pen: Pen, values: dict[float, float], edge: float, *, below: bool, sign: float = 1.0) -> None:
    """Draw horizontal positions under a view, or vertical ones at its left.

    `values` are places across them by position [mm of the model]; `edge` is the lower or left one of the view; `sign`
    is -1 if the measured axis points to the left.
    """
    places = thinned(values)
    for (value, aside), place in zip(places, spread([v * pen.scale for v, _ in places], STEP_MM), strict=True):
        feature = (aside * pen.scale, value * pen.scale)
        bends = ((feature[0] - GAP_MM, feature[1]), (edge - REACH_MM / 2, feature[1]), (edge - REACH_MM, place))
        words, end = number(sign * value), edge - REACH_MM - 2.0
        base = place + (TEXT_MM / 2 - 0.3 if below else 0.2 - TEXT_MM / 2)
        middle = (end - width_of(words) / 2, place)
        path = [*bends, (edge - REACH_MM - GAP_MM, place), (end, base), middle, feature]
        points = [(y, x) if below else (x, y) for x, y in path]
        own = pen.dimension(
            ORDINATE_X if below else ORDINATE_Y,
            "<>" if sign > 0 and value >= 0 else words,  # some readers drop the sign of a negative one
            points[5],
            defpoint=(0.0, 0.0),
            defpoint2=points[6],
            defpoint3=points[3],
        )
        own.stroke("DIMENSION", points[:4])
        own.text(points[4], words, anchor="right", angle=90.0 if below else 0.0)


def thinned(values: dict[float, float]) -> list[tuple[float, float]]:
    """Return positions in ascending order; of several that print the same to a tenth the first one."""
    out: list[tuple[float, float]] = []
    for value in sorted(values):
        if not out or value - out[-1][0] > 0.05:
            out.append((value, values[value]))
    return out


def leaders_right(callouts: list[Callout], edge: float, scale: float) -> list[tuple[Callout, Point, Point]]:
    """Return the callouts at the right of a view from below, the tip of each leader, and its bend to the text."""
    order = sorted(callouts, key=lambda callout: (callout.at[1], -callout.at[0], callout.words))
    places = spread([callout.at[1] * scale for callout in order], TEXT_MM * 1.7)
    tips = [(callout.at[0] * scale, callout.at[1] * scale) for callout in order]
    return [(callout, tip, (edge + REACH_MM, y)) for callout, tip, y in zip(order, tips, places, strict=True)]


def callouts_right(pen: Pen, callouts: list[Callout], edge: float) -> None:
    """Draw texts in a column at the right of a view, each with its leader."""
    for callout, tip, (x, y) in leaders_right(callouts, edge, pen.scale):
        own = pen
        if callout.centre is not None:
            across = 2 * callout.centre[0] * pen.scale - tip[0], 2 * callout.centre[1] * pen.scale - tip[1]
            size = f"Ø{number(2 * math.dist(callout.at, callout.centre))}"
            text_at = (x + 2.8 + width_of(callout.words) / 2, y)
            own = pen.dimension(DIAMETER, callout.words.replace(size, "<>", 1), text_at, defpoint=across, defpoint4=tip)
        own.stroke("DIMENSION", (tip, (x, y), (x + 2.0, y)))
        own.head(tip, math.atan2(tip[1] - y, tip[0] - x))
        own.text((x + 2.8, y - TEXT_MM / 2 + 0.2), callout.words)


def free_text(
    pen: Pen,
    words: str,
    choices: Sequence[tuple[Point, str]],
    lines: Sequence[Sequence[Point]],
    height: float = TEXT_MM,
) -> None:
    """Write a text at the first of some places, each with an anchor, that no line meets, else at the first."""

    def space(at: Point, anchor: str) -> shapely.Polygon:
        width = width_of(words, height)
        left = at[0] - ANCHORS[anchor][1] * width
        return shapely.box(left - CLEAR_MM, at[1] - CLEAR_MM, left + width + CLEAR_MM, at[1] + height + CLEAR_MM)

    drawn = [shapely.LineString(line) for line in lines]
    free = (choice for choice in choices if not any(line.intersects(space(*choice)) for line in drawn))
    place, anchor = next(free, choices[0])
    pen.text(place, words, height=height, anchor=anchor)


def angle_between(pen: Pen, at: Point, first: float, second: float, radius: float, words: str) -> None:
    """Draw an angle between two directions [rad] with a common end, in a box: theoretically exact (ISO 1101)."""
    low, high = sorted((first, second))
    if high - low > math.pi:
        low, high = high, low + 2 * math.pi

    def out(angle: float, reach: float, wide: float = 0.0, tall: float = 0.0) -> Point:
        c, s = math.cos(angle), math.sin(angle)
        return at[0] + (reach + wide * abs(c)) * c, at[1] + (reach + tall * abs(s)) * s

    middle, half, height = (low + high) / 2, width_of(words) / 2 + 0.8, TEXT_MM / 2 + 0.8
    narrow = (high - low) * radius < 3 * ARROW_MM[0]  # no space for heads between the arms, nor for the box
    x, y = out(middle, radius + (ARMS_MM + 1.5 if narrow else 2.5), half, height)
    ends = {"defpoint2": out(low, radius), "defpoint3": out(high, radius), "defpoint4": at}
    own = pen.dimension(ANGLE, "<>", (x, y), defpoint=out(middle, radius), **ends)
    beyond = 2 * ARROW_MM[0] / radius if narrow else 0.0
    own.arc("DIMENSION", at, radius, low - beyond, high + beyond)
    for angle, turn in ((low, RIGHT_RAD if narrow else -RIGHT_RAD), (high, -RIGHT_RAD if narrow else RIGHT_RAD)):
        own.stroke("CENTRE", (at, out(angle, radius + ARMS_MM)))
        own.head(out(angle, radius), angle + turn)
    box = [(x - half, y - height), (x + half, y - height), (x + half, y + height), (x - half, y + height)]
    own.stroke("DIMENSION", [*box, box[0]])
    own.text((x, y - TEXT_MM / 2 + 0.2), words, anchor="middle")


def centre_mark(pen: Pen, at: Point, radius: float) -> None:
    """Draw a cross through a hole."""
    reach, (x, y) = radius + 1.5, at
    pen.stroke("CENTRE", ((x - reach, y), (x + reach, y)))
    pen.stroke("CENTRE", ((x, y - reach), (x, y + reach)))
