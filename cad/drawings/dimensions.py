"""Dimensions of one view as marks on paper: ordinates from the view's origin, call-outs with leaders, angles.

Ordinates are the running dimensions of ISO 129: every value is measured from 0, nothing adds up, and what lies close
together is spread without crossing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from cad.drawings.marks import TEXT, Bow, Head, Mark, Point, Stroke, Text
from cad.drawings.patterns import number

GAP = 1.5  # between an edge and the line that starts at it
REACH = 6.0  # from the view to the bend of an ordinate
STEP = TEXT * 1.35  # between two texts


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


def thinned(values: dict[float, float]) -> dict[float, float]:
    """One of several values that read the same on paper to a tenth."""
    out: dict[float, float] = {}
    for value in sorted(values):
        if not out or value - max(out) > 0.05:
            out[value] = values[value]
    return out


def ordinates_below(values: dict[float, float], scale: float, edge: float, sign: float = 1.0) -> list[Mark]:
    """Horizontal positions under a view.

    Args:
        values: model position: height [paper mm] of the feature that it belongs to.
        scale: paper over model.
        edge: lower edge of the view [paper mm].
        sign: -1 where the axis that is measured points to the left.
    """
    marks: list[Mark] = []
    order = sorted(values)
    for value, place in zip(order, spread([v * scale for v in order], STEP), strict=True):
        x = value * scale
        bend = edge - REACH / 2
        line = ((x, values[value] - GAP), (x, bend), (place, edge - REACH), (place, edge - REACH - 1.5))
        marks.append(Stroke("dimension", line))
        marks.append(
            Text((place + TEXT / 2 - 0.3, edge - REACH - 2.0), number(sign * value), anchor="right", angle=90.0)
        )
    return marks


def ordinates_left(values: dict[float, float], scale: float, edge: float) -> list[Mark]:
    """Vertical positions at the left of a view; `values` maps to the x of the feature, `edge` is the left edge."""
    marks: list[Mark] = []
    order = sorted(values)
    for value, place in zip(order, spread([v * scale for v in order], STEP), strict=True):
        y = value * scale
        bend = edge - REACH / 2
        line = ((values[value] - GAP, y), (bend, y), (edge - REACH, place), (edge - REACH - 1.5, place))
        marks.append(Stroke("dimension", line))
        marks.append(Text((edge - REACH - 2.0, place - TEXT / 2 + 0.2), number(value), anchor="right"))
    return marks


def callouts_right(targets: list[tuple[Point, str]], edge: float) -> list[Mark]:
    """Texts in a column at the right of a view, each with a leader to its target [paper mm]."""
    marks: list[Mark] = []
    order = sorted(targets, key=lambda target: (target[0][1], -target[0][0], target[1]))
    places = spread([point[1] for point, _ in order], TEXT * 1.7)
    for (point, words), y in zip(order, places, strict=True):
        bend = (edge + REACH, y)
        marks.append(Stroke("dimension", (point, bend, (edge + REACH + 2.0, y))))
        marks.append(Head(point, math.atan2(point[1] - y, point[0] - bend[0])))
        marks.append(Text((edge + REACH + 2.8, y - TEXT / 2 + 0.2), words))
    return marks


def angle_between(at: Point, first: float, second: float, radius: float, words: str) -> list[Mark]:
    """An angle between two directions [rad] with a common end, in a box: theoretically exact (ISO 1101)."""
    low, high = sorted((first, second))
    if high - low > math.pi:
        low, high = high, low + 2 * math.pi
    x, y = at
    marks: list[Mark] = [Bow("dimension", at, radius, low, high)]
    for angle, turn in ((low, -1.0), (high, 1.0)):
        reach = radius + 4.0
        end = (x + reach * math.cos(angle), y + reach * math.sin(angle))
        marks.append(Stroke("centre", (at, end)))
        tip = (x + radius * math.cos(angle), y + radius * math.sin(angle))
        marks.append(Head(tip, angle + turn * math.pi / 2))
    middle = (low + high) / 2
    half, height = Text(at, words).width / 2 + 0.8, TEXT + 1.6
    cx = x + (radius + 2.5 + half * abs(math.cos(middle))) * math.cos(middle)
    cy = y + (radius + 2.5 + height / 2 * abs(math.sin(middle))) * math.sin(middle)
    box = ((cx - half, cy - height / 2), (cx + half, cy - height / 2), (cx + half, cy + height / 2))
    marks.append(Stroke("dimension", (*box, (cx - half, cy + height / 2), (cx - half, cy - height / 2))))
    marks.append(Text((cx, cy - TEXT / 2 + 0.2), words, anchor="middle"))
    return marks


def centre_mark(at: Point, radius: float) -> list[Mark]:
    """A cross through a hole."""
    reach = radius + 1.5
    x, y = at
    return [
        Stroke("centre", ((x - reach, y), (x + reach, y))),
        Stroke("centre", ((x, y - reach), (x, y + reach))),
    ]
