"""Dimensions of one view: ordinates from the view's origin, diameters and other call-outs with leaders, angles.

Ordinates are the running dimensions of ISO 129: every value is measured from 0, nothing adds up, and what lies close
together is spread without crossing. Places are millimetres of paper.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from scanwright.cad.drawings.patterns import number
from scanwright.cad.drawings.pen import (
    ANCHORS,
    ANGLE,
    ARROW,
    DIAMETER,
    ORDINATE_X,
    ORDINATE_Y,
    TEXT,
    Pen,
    Point,
    width_of,
)

GAP = 1.5  # between an edge and the line that starts at it
REACH = 6.0  # from the view to the bend of an ordinate
STEP = TEXT * 1.35  # between two texts
ARMS = 4.0  # of an angle, beyond its arc
CLEAR = 0.5  # around a text
RIGHT = 0.5 * math.pi


@dataclass(frozen=True, slots=True)
class Callout:
    """Words that point at a place in a view [mm of the model]; with a diameter they say it first, after a count."""

    at: Point
    words: str
    centre: Point | None = None


def spread(wanted: Sequence[float], step: float) -> list[float]:
    """Places in the order of `wanted` (ascending), at least `step` apart, as near to it as least squares allow."""
    blocks: list[tuple[float, int]] = []  # mean of wanted - i step, and how many
    for i, value in enumerate(wanted):
        mean, count = value - i * step, 1
        while blocks and blocks[-1][0] > mean:
            other, size = blocks.pop()
            mean, count = (mean * count + other * size) / (count + size), count + size
        blocks.append((mean, count))
    places: list[float] = []
    for mean, count in blocks:
        places += [mean + (len(places) + k) * step for k in range(count)]
    return places


def ordinates(pen: Pen, values: dict[float, float], edge: float, *, below: bool, sign: float = 1.0) -> None:
    """Horizontal positions under a view, or vertical ones at its left.

    Args:
        pen: about the view's origin.
        values: position: where across it the feature lies that it belongs to [mm of the model].
        edge: of the view, lower or left.
        below: which of them.
        sign: -1 where the axis that is measured points to the left.
    """
    places = thinned(values)
    for (value, aside), place in zip(places, spread([v * pen.scale for v, _ in places], STEP), strict=True):
        feature = (aside * pen.scale, value * pen.scale)
        bends = ((feature[0] - GAP, feature[1]), (edge - REACH / 2, feature[1]), (edge - REACH, place))
        words, end = number(sign * value), edge - REACH - 2.0
        base = place + (TEXT / 2 - 0.3 if below else 0.2 - TEXT / 2)
        middle = (end - width_of(words) / 2, place)
        path = [*bends, (edge - REACH - GAP, place), (end, base), middle, feature]
        points = [(y, x) if below else (x, y) for x, y in path]
        own = pen.dimension(
            ORDINATE_X if below else ORDINATE_Y,
            "<>" if sign > 0 and value >= 0 else words,  # of a negative one some readers tell the sign, some do not
            points[5],
            defpoint=(0.0, 0.0),
            defpoint2=points[6],
            defpoint3=points[3],
        )
        own.stroke("DIMENSION", points[:4])
        own.text(points[4], words, anchor="right", angle=90.0 if below else 0.0)


def thinned(values: dict[float, float]) -> list[tuple[float, float]]:
    """Positions in ascending order; of several that read the same on paper to a tenth the first one."""
    out: list[tuple[float, float]] = []
    for value in sorted(values):
        if not out or value - out[-1][0] > 0.05:
            out.append((value, values[value]))
    return out


def leaders_right(callouts: list[Callout], edge: float, scale: float) -> list[tuple[Callout, Point, Point]]:
    """What is told at the right of a view, from below: the tip of each leader, and where it bends to its text."""
    order = sorted(callouts, key=lambda callout: (callout.at[1], -callout.at[0], callout.words))
    places = spread([callout.at[1] * scale for callout in order], TEXT * 1.7)
    tips = [(callout.at[0] * scale, callout.at[1] * scale) for callout in order]
    return [(callout, tip, (edge + REACH, y)) for callout, tip, y in zip(order, tips, places, strict=True)]


def callouts_right(pen: Pen, callouts: list[Callout], edge: float) -> None:
    """Texts in a column at the right of a view, each with a leader to what it tells of."""
    for callout, tip, (x, y) in leaders_right(callouts, edge, pen.scale):
        own = pen
        if callout.centre is not None:
            across = 2 * callout.centre[0] * pen.scale - tip[0], 2 * callout.centre[1] * pen.scale - tip[1]
            said = f"Ø{number(2 * math.dist(callout.at, callout.centre))}"
            text_at = (x + 2.8 + width_of(callout.words) / 2, y)
            own = pen.dimension(DIAMETER, callout.words.replace(said, "<>", 1), text_at, defpoint=across, defpoint4=tip)
        own.stroke("DIMENSION", (tip, (x, y), (x + 2.0, y)))
        own.head(tip, math.atan2(tip[1] - y, tip[0] - x))
        own.text((x + 2.8, y - TEXT / 2 + 0.2), callout.words)


def text_box(at: Point, words: str, height: float = TEXT, anchor: str = "left") -> tuple[float, float, float, float]:
    """Left, bottom, right and top of the room around a line of text."""
    width = width_of(words, height)
    left = at[0] - ANCHORS[anchor][1] * width
    return left - CLEAR, at[1] - CLEAR, left + width + CLEAR, at[1] + height + CLEAR


def meets(path: Sequence[Point], box: tuple[float, float, float, float]) -> bool:
    """Whether straight pieces through points enter a box."""
    for (x0, y0), (x1, y1) in pairwise(path):
        first, last = 0.0, 1.0
        for start, step, low, high in ((x0, x1 - x0, box[0], box[2]), (y0, y1 - y0, box[1], box[3])):
            if step == 0.0:
                inside = low < start < high
                first, last = (first, last) if inside else (1.0, 0.0)
                continue
            near, far = sorted(((low - start) / step, (high - start) / step))
            first, last = max(first, near), min(last, far)
        if first < last:
            return True
    return False


def angle_between(pen: Pen, at: Point, first: float, second: float, radius: float, words: str) -> None:
    """An angle between two directions [rad] with a common end, in a box: theoretically exact (ISO 1101)."""
    low, high = sorted((first, second))
    if high - low > math.pi:
        low, high = high, low + 2 * math.pi

    def out(angle: float, reach: float, wide: float = 0.0, tall: float = 0.0) -> Point:
        c, s = math.cos(angle), math.sin(angle)
        return at[0] + (reach + wide * abs(c)) * c, at[1] + (reach + tall * abs(s)) * s

    middle, half, height = (low + high) / 2, width_of(words) / 2 + 0.8, TEXT / 2 + 0.8
    narrow = (high - low) * radius < 3 * ARROW[0]  # no room for heads between the arms, nor for the box
    x, y = out(middle, radius + (ARMS + 1.5 if narrow else 2.5), half, height)
    ends = {"defpoint2": out(low, radius), "defpoint3": out(high, radius), "defpoint4": at}
    own = pen.dimension(ANGLE, "<>", (x, y), defpoint=out(middle, radius), **ends)
    beyond = 2 * ARROW[0] / radius if narrow else 0.0
    own.arc("DIMENSION", at, radius, low - beyond, high + beyond)
    for angle, turn in ((low, RIGHT if narrow else -RIGHT), (high, -RIGHT if narrow else RIGHT)):
        own.stroke("CENTRE", (at, out(angle, radius + ARMS)))
        own.head(out(angle, radius), angle + turn)
    box = [(x - half, y - height), (x + half, y - height), (x + half, y + height), (x - half, y + height)]
    own.stroke("DIMENSION", [*box, box[0]])
    own.text((x, y - TEXT / 2 + 0.2), words, anchor="middle")


def centre_mark(pen: Pen, at: Point, radius: float) -> None:
    """A cross through a hole."""
    reach, (x, y) = radius + 1.5, at
    pen.stroke("CENTRE", ((x - reach, y), (x + reach, y)))
    pen.stroke("CENTRE", ((x, y - reach), (x, y + reach)))
