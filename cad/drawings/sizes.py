"""Dimensions of a view, and the view drawn with them."""

import math
from dataclasses import dataclass

import numpy as np

from scanwright.cad import solids
from scanwright.cad.drawings.dimensions import (
    Callout,
    angle_between,
    callouts_right,
    centre_mark,
    free_text,
    leaders_right,
    ordinates,
)
from scanwright.cad.drawings.patterns import (
    SIDE_MM2,
    STRAIGHT,
    Part,
    Pattern,
    azimuth_deg,
    number,
    parallel,
    planes_across,
)
from scanwright.cad.drawings.pen import TEXT_MM, Layer, Pen, Point
from scanwright.cad.drawings.project import Arc
from scanwright.cad.drawings.views import View, Z, has_view, outwards_of, shows_angle

NEARLY_MM = 0.2  # an extent that differs less from a radius is that radius, notched
OVER_MM = 3.0  # of a centre line beyond the part
MARK_MM = 4.0  # length of the thick ends of a cut
LETTER_MM = 5.0  # space for the letter next to them
CAPITALS_MM = 3.5  # its height
CENTRE_GAP_MM = 3.0  # between the optical centre and its name


@dataclass(frozen=True, slots=True)
class Sizes:
    """Sizes of a view, about its origin, model mm."""

    box: tuple[float, float, float, float]  # left, bottom, right and top of its lines
    below: dict[float, float]  # horizontal positions, and the height of their features
    heights: dict[float, float]  # vertical positions, and the place of their features across them
    callouts: list[Callout]  # diameters, holes and slots
    holes: list[tuple[Point, float]]  # middle and half of the size of each cross
    circles: list[tuple[Point, float]]  # middle and radius of circles through holes


def sizes_of(view: View, part: Part) -> Sizes:
    """Return the sizes of holes and slots along the view; in front and top view also those of the entire part."""
    measure = Pen(None, 1.0)
    _outline(measure, view)
    sizes = Sizes(measure.box(), {}, {}, [], [], [])
    if view.kind not in ("iso", "angle", "section"):
        _holes(sizes, view, part)
        if view.kind == "front":
            _cylinders(sizes, part)
        _faces(sizes, view, part)
        left, low, _, _ = sizes.box
        for values, edge in ((sizes.below, low), (sizes.heights, left)):
            if values:
                values.setdefault(0.0, 0.0 if view.kind == "onto" else edge)
    return sizes


def draw(pen: Pen, view: View, sizes: Sizes, part: Part) -> None:
    """Draw one view with its dimensions, about its origin."""
    left, low, right, high = (c * pen.scale for c in sizes.box)
    pen.reached.extend(((left, low), (right, high)))
    if pen.space is not None:
        _outline(pen, view)
        for line in view.hatching:
            pen.stroke("DIMENSION", [pen.paper(point) for point in line])
    aside = OVER_MM + MARK_MM + LETTER_MM if view.kind == "top" and part.fits else 0.0  # for the marks of the cut
    # past the axis, which is free if the part is at its side
    beyond = max(right, 0.0 if view.kind == "onto" else OVER_MM) + aside
    if view.kind != "iso":
        _centre_lines(pen, view, part, (left, low, right, high))
        if view.kind == "top" and part.fits:
            leaders = [[tip, bend] for _, tip, bend in leaders_right(sizes.callouts, beyond, pen.scale)]
            at_left = [[(left - aside, y * pen.scale), (left, y * pen.scale)] for y in sizes.heights]
            _cut_marks(pen, left - OVER_MM, right + OVER_MM, [*leaders, *at_left])
    for middle, radius in sizes.circles:
        pen.arc("CENTRE", pen.paper(middle), radius * pen.scale)
    for middle, radius in sizes.holes:
        centre_mark(pen, pen.paper(middle), radius * pen.scale)
    sign = -1.0 if view.kind == "left" else 1.0  # it looks along the axis that points to the left
    ordinates(pen, sizes.below, low, below=True, sign=sign)
    ordinates(pen, sizes.heights, left - aside, below=False)
    callouts_right(pen, sizes.callouts, beyond)
    angled = [p for p in part.patterns if len(p.holes) >= 3 and shows_angle(view, p)]
    if angled and view.kind in ("front", "left", "angle"):
        _angle(pen, view, angled[0], part, high + OVER_MM)
    if view.title:
        pen.text(((left + right) / 2, pen.box()[3] + 2.5), view.title, anchor="middle")


def _outline(pen: Pen, view: View) -> None:
    for curve in view.curves:
        layer: Layer = "HIDDEN" if curve.hidden else "VISIBLE"
        if isinstance(curve, Arc):
            pen.arc(layer, pen.paper(curve.centre), curve.radius * pen.scale, curve.start, curve.end)
        else:
            pen.stroke(layer, [pen.paper(point) for point in curve.points])


def _centre_lines(pen: Pen, view: View, part: Part, box: tuple[float, float, float, float]) -> None:
    """Draw the rotation axis and, if the part carries the lidar, the optical centre."""
    left, low, right, high = box
    if parallel(view.up, Z) and view.kind != "onto":
        top = high + OVER_MM
        if part.lidar_axis is not None:
            x, y = pen.paper(view.flat((0.0, 0.0, 0.0)))
            top = max(top, y + OVER_MM)
            pen.arc("DIMENSION", (x, y), 1.5)
            centre_mark(pen, (x, y), 1.5)
            if view.kind != "left":
                _name_centre(pen, view, (x, y))
        pen.stroke("CENTRE", ((0.0, low - OVER_MM), (0.0, top)))
    elif parallel(view.towards, Z):
        pen.stroke("CENTRE", ((0.0, low - OVER_MM), (0.0, high + OVER_MM)))
        pen.stroke("CENTRE", ((left - OVER_MM, 0.0), (right + OVER_MM, 0.0)))


def _name_centre(pen: Pen, view: View, at: Point) -> None:
    """Write the name at the optical centre, on the first side without a line of the part."""
    (x, y), right = at, at[0] + CENTRE_GAP_MM
    below = y - 1.0 - TEXT_MM
    choices = [((x - CENTRE_GAP_MM, y + 1.0), "right"), ((right, below), "left"), ((x - CENTRE_GAP_MM, below), "right")]
    lines = [[pen.paper(point) for point in curve.points] for curve in view.curves]
    free_text(pen, "OPTICAL CENTRE", choices, lines)


def _cut_marks(pen: Pen, left: float, right: float, lines: list[list[Point]]) -> None:
    """Mark the section: thick ends, arrows along the line of sight, and its letter clear of all lines."""
    for x, out in ((left, -1.0), (right, 1.0)):
        end = x + out * MARK_MM
        pen.stroke("FRAME", ((x, 0.0), (end, 0.0)))
        pen.stroke("DIMENSION", ((end, -2 * MARK_MM), (end, 0.0)))
        pen.head((end, 0.0), 0.5 * math.pi)
        choices = [
            ((end + out * 1.5, -2 * MARK_MM), "left" if out > 0 else "right"),
            ((end, -2 * MARK_MM - CAPITALS_MM - 1.5), "middle"),
            ((end, 1.5), "middle"),
        ]
        free_text(pen, "S", choices, lines, CAPITALS_MM)


def _holes(sizes: Sizes, view: View, part: Part) -> None:
    for pattern in part.patterns:
        if not parallel(pattern.direction, view.towards):
            if view.kind == "top" and not _seen_along(pattern, view, part):
                sizes.callouts.append(_slanted(view, pattern, part))
            continue
        flat = [view.flat(hole.low) for hole in pattern.holes]
        radius = pattern.holes[0].diameter / 2
        half = max(pattern.slot / 2, radius)
        if pattern.circle:
            sizes.circles.append((view.flat(pattern.centre), pattern.circle / 2))
        last = _crossed(sizes, flat, half, placed=not pattern.circle)
        diagonal = radius * math.sqrt(0.5)
        sizes.callouts.append(
            Callout((last[0] + diagonal, last[1] + diagonal), pattern.words(), None if pattern.slot else last)
        )


def _crossed(sizes: Sizes, middles: list[Point], half: float, *, placed: bool) -> Point:
    """Mark holes, with their positions or without; return the last one, which gets the call-out."""
    for x, y in middles:
        sizes.holes.append(((x, y), half))
        if placed:
            sizes.below[_key(x)] = min(y, sizes.below.get(_key(x), math.inf))
            sizes.heights[_key(y)] = min(x, sizes.heights.get(_key(y), math.inf))
    return max(middles, key=lambda p: (round(p[0], 2), round(p[1], 2)))


def _cylinders(sizes: Sizes, part: Part) -> None:
    """Add diameters and ends of the cylinders about the axis, seen from the front."""
    for item in part.axial:
        z = (item.low[2] + item.high[2]) / 2 - part.datum
        words = f"Ø{number(item.diameter)}{part.tolerance(item)}"
        if item.hole and not item.through:
            words += f" x {number(item.length)} DEEP"
        sizes.callouts.append(Callout((item.diameter / 2, z), words, (0.0, z)))
        for end in (item.low, item.high):
            sizes.heights[_key(end[2] - part.datum)] = sizes.box[0]


def _faces(sizes: Sizes, view: View, part: Part) -> None:
    """Add positions of plane faces, and the extent."""
    left, low, _, _ = sizes.box
    if view.kind == "front":
        optical = [] if part.lidar_axis is None else [0.0]
        for z in (*planes_across(part.solid, view.up), *optical):
            sizes.heights[_key(z - part.datum)] = left
    elif view.kind in ("top", "onto"):
        for values, axis, edge in ((sizes.below, view.right, low), (sizes.heights, view.up, left)):
            for value in planes_across(part.solid, axis, SIDE_MM2):
                values.setdefault(_key(value - float(view.origin @ axis)), edge)
    if view.kind in ("front", "top"):
        xs, ys = _extent(part, view)
        rim = max((item.diameter / 2 for item in part.axial if not item.hole), default=0.0)
        known = [rim, -rim] if view.kind == "top" else []  # a diameter states it already
        for values, ends, edge in ((sizes.heights, ys, left), (sizes.below, xs if view.kind == "top" else (), low)):
            for end in ends:
                if all(abs(end - other) > NEARLY_MM for other in known):
                    values.setdefault(_key(end), edge)


def _slanted(view: View, pattern: Pattern, part: Part) -> Callout:
    """Return the call-out of a hole that no view looks along: its direction and its height."""
    hole = max(pattern.holes, key=lambda h: round(float(np.hypot(*h.high[:2])), 3))
    outer = max(hole.low, hole.high, key=lambda end: round(math.hypot(end[0], end[1]), 3))
    azimuth = azimuth_deg(np.array(outer))
    direction = "RADIAL" if abs(hole.direction[2]) < STRAIGHT else "INCLINED"
    words = f"{pattern.words()}, {direction} AT {number(azimuth)}°, Z {number(outer[2] - part.datum)}"
    return Callout(view.flat(outer), words)


def _extent(part: Part, view: View) -> tuple[Point, Point]:
    """Return the exact extent of a view, from left to right and from the lowest to the highest point."""
    frame = np.stack([view.right, view.up, view.towards], axis=1)
    box = part.solid.moved(solids.location(frame).inverse).BoundingBox()
    x, y = float(view.origin @ view.right), float(view.origin @ view.up)
    return (box.xmin - x, box.xmax - x), (box.ymin - y, box.ymax - y)


def _seen_along(pattern: Pattern, top: View, part: Part) -> bool:
    """Return whether another view looks along the holes: from the front, from the left, or onto inclined ones."""
    onto = [other.direction for other in part.patterns if has_view(other)]
    return any(parallel(pattern.direction, along) for along in (top.right, top.up, *onto))


def _angle(pen: Pen, view: View, pattern: Pattern, part: Part, above: float) -> None:
    """Draw the angle between rotation axis and holes: at the optical centre if it is on the part, else above."""
    outwards = outwards_of(pattern, part)
    outwards = outwards if outwards[2] > -1e-9 else -outwards
    across, along = float(outwards @ view.right), float(outwards @ view.up)
    tilt = math.degrees(math.acos(max(-1.0, min(1.0, float(outwards[2])))))
    at = (0.0, above) if part.lidar_axis is None else pen.paper(view.flat((0.0, 0.0, 0.0)))
    angle_between(pen, at, math.pi / 2, math.atan2(along, across), 12.0, f"{number(tilt)}°")


def _key(value: float) -> float:
    return round(value, 2) + 0.0
