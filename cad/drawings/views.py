"""Which views a part needs, and each of them drawn with its dimensions. Paper millimetres about the view's origin.

Three views along the rotation frame's axes and an isometric; a view onto every pattern of three holes or more that is
inclined to all of them; and, where no view shows the angle of such a pattern to the axis in true size, one that does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cadquery as cq
import numpy as np

from cad import solids
from cad.drawings import dimensions as dim
from cad.drawings.marks import Bow, Layer, Mark, Point, Stroke, Text, box_of
from cad.drawings.part import SIDE_MM2, STRAIGHT, Part, azimuth_deg, parallel, planes_across
from cad.drawings.patterns import Pattern, along_pattern, number
from cad.drawings.project import Arc, Chain, Curve, Line, project
from cad.drawings.slots import slot_words
from design.frames import Array

Z = np.array([0.0, 0.0, 1.0])
NEARLY = 0.2  # an extent that differs less from a radius is that radius, notched
OVER = 3.0  # of a centre line beyond the part


@dataclass(frozen=True, slots=True)
class View:
    """A view and what it shows.

    Attributes:
        title: above the view.
        right: unit vector to the right, in the rotation frame.
        up: unit vector upwards.
        origin: point whose projection is 0 of the ordinates.
        curves: lines of the part about that origin, model mm.
        kind: front and top carry ordinates of planes too, angle and iso none.
    """

    title: str
    right: Array
    up: Array
    origin: Array
    curves: list[Curve]
    kind: str

    @property
    def towards(self) -> Array:
        """From the part to the viewer."""
        return np.cross(self.right, self.up)

    def flat(self, point: Array | Point3) -> Point:
        """A point of the rotation frame in the view, model mm."""
        away = np.asarray(point) - self.origin
        return float(away @ self.right), float(away @ self.up)


Point3 = tuple[float, float, float]


def views_of(part: Part) -> list[View]:
    """All views of a part: front, top, left, isometric, then the others."""
    inclined = [pattern for pattern in part.patterns if _has_view(pattern)]
    upright = [p for p in part.patterns if len(p.holes) >= 2 and parallel(p.direction, Z)]
    tilt = _level(_outwards(inclined[0], part)) if inclined else np.array([1.0, 0.0, 0.0])
    along = _along(part, upright) if upright else tilt
    away = np.cross(Z, along)
    base = np.array([0.0, 0.0, part.datum])
    name = "X" if abs(along[0] - 1) < STRAIGHT else f"azimuth {number(azimuth_deg(along))}°"
    views = [
        _view(part, f"FRONT  ({name} right, Z up)", along, Z, base, "front"),
        _view(part, f"TOP  ({name} right)", along, away, base, "top"),
        _view(part, "FROM THE LEFT  (Z up)", -away, Z, base, "left"),
    ]
    corner = (along - away + Z) / math.sqrt(3)
    right = (along + away) / math.sqrt(2)
    views.append(_view(part, "", right, np.cross(corner, right), base, "iso"))
    letters = iter("ABCDEF")
    for pattern in inclined:
        if not any(parallel(pattern.direction, view.towards) for view in views):
            outwards = _outwards(pattern, part)
            side = along_pattern(pattern, outwards)
            title = f"{next(letters)}  onto the inclined holes"
            up = np.cross(outwards, side)
            views.append(_view(part, title, side, up, pattern.centre, "onto"))
    for pattern in inclined[:1]:
        if not any(_shows_angle(view, pattern) for view in views[:3]):
            level = _level(pattern.direction)
            views.append(_view(part, f"{next(letters)}  angle in true size", level, Z, base, "angle"))
    return views


def draw(view: View, part: Part, scale: float) -> list[Mark]:
    """The marks of one view at a scale."""
    marks = [mark for curve in view.curves for mark in _curve(curve, scale)]
    left, low, right, high = box_of(marks)
    if view.kind != "iso":
        marks += _centre_lines(view, part, scale, (left, low, right, high))
    if view.kind in ("front", "top", "left", "onto"):
        marks += _hole_marks(view, part, scale, (left, low, right, high))
    for pattern in part.patterns:
        if view.kind in ("front", "left", "angle") and len(pattern.holes) >= 3 and _shows_angle(view, pattern):
            marks += _angle(view, pattern, part, scale, high + OVER)
            break
    if view.title:
        box = box_of(marks)
        marks.append(Text(((left + right) / 2, box[3] + 2.5), view.title, anchor="middle"))
    return marks


def _along(part: Part, upright: list[Pattern]) -> Array:
    """X, or the line of two holes where the part has faces across that line, but none across X: a bar."""
    x = np.array([1.0, 0.0, 0.0])
    if len(upright[0].holes) != 2 or planes_across(part.solid, x):
        return x
    first, last = (np.array(hole.low) for hole in upright[0].holes)
    line = (last - first) / np.linalg.norm(last - first)
    line = line if float(line @ first) > 0 else -line  # outwards
    return line if planes_across(part.solid, line) else x


def _view(part: Part, title: str, right: Array, up: Array, origin: Array, kind: str) -> View:
    curves = project(part.solid, right, up, hidden=kind != "iso")
    shift = (float(origin @ right), float(origin @ up))
    return View(title, right, up, origin, [_shifted(curve, shift) for curve in curves], kind)


def _shifted(curve: Curve, by: Point) -> Curve:
    def at(point: Point) -> Point:
        return point[0] - by[0], point[1] - by[1]

    if isinstance(curve, Line):
        return Line(at(curve.start), at(curve.end), curve.hidden)
    if isinstance(curve, Arc):
        return Arc(at(curve.centre), curve.radius, curve.start, curve.end, curve.hidden)
    return Chain(tuple(at(point) for point in curve.points), curve.hidden)


def _curve(curve: Curve, scale: float) -> list[Mark]:
    layer: Layer = "hidden" if curve.hidden else "visible"

    def on_paper(point: Point) -> Point:
        return point[0] * scale, point[1] * scale

    if isinstance(curve, Line):
        return [Stroke(layer, (on_paper(curve.start), on_paper(curve.end)))]
    if isinstance(curve, Arc):
        return [Bow(layer, on_paper(curve.centre), curve.radius * scale, curve.start, curve.end)]
    return [Stroke(layer, tuple(on_paper(point) for point in curve.points))]


def _centre_lines(view: View, part: Part, scale: float, box: tuple[float, float, float, float]) -> list[Mark]:
    """The rotation axis and, where the lidar sits, the optical centre."""
    marks: list[Mark] = []
    left, low, right, high = box
    if parallel(view.up, Z) and view.kind != "onto":
        top = high + OVER
        if part.lidar_axis is not None:
            x, y = (c * scale for c in view.flat((0.0, 0.0, 0.0)))
            top = max(top, y + OVER)
            marks += [Bow("dimension", (x, y), 1.5, 0.0, 2 * math.pi), *dim.centre_mark((x, y), 1.5)]
            if view.kind != "left":
                marks.append(Text((x - 3.0, y + 1.0), "OPTICAL CENTRE", anchor="right"))
        marks.append(Stroke("centre", ((0.0, low - OVER), (0.0, top))))
    elif parallel(view.towards, Z):
        marks.append(Stroke("centre", ((0.0, low - OVER), (0.0, high + OVER))))
        marks.append(Stroke("centre", ((left - OVER, 0.0), (right + OVER, 0.0))))
    return marks


def _hole_marks(view: View, part: Part, scale: float, box: tuple[float, float, float, float]) -> list[Mark]:
    left, low, right, _ = box
    marks: list[Mark] = []
    below: dict[float, float] = {}
    beside: dict[float, float] = {}
    callouts: list[tuple[Point, str]] = []
    for pattern in part.patterns:
        flat = [view.flat(hole.low) for hole in pattern.holes]
        radius = pattern.holes[0].diameter / 2 * scale
        if parallel(pattern.direction, view.towards):
            for x, y in flat:
                marks += dim.centre_mark((x * scale, y * scale), radius)
            if pattern.circle:
                cx, cy = view.flat(pattern.centre)
                marks.append(Bow("centre", (cx * scale, cy * scale), pattern.circle / 2 * scale, 0.0, 2 * math.pi))
            else:
                for x, y in flat:
                    below[_key(x)] = min(y * scale, below.get(_key(x), math.inf))
                    beside[_key(y)] = min(x * scale, beside.get(_key(y), math.inf))
            x, y = max(flat, key=lambda p: (round(p[0], 2), round(p[1], 2)))
            diagonal = radius * math.sqrt(0.5)
            callouts.append(((x * scale + diagonal, y * scale + diagonal), pattern.words()))
        elif view.kind == "top" and not _seen_along(pattern, view, part):
            callouts.append(_slanted(view, pattern, part, scale))
    for slots in part.slots:
        if parallel(slots[0].direction, view.towards):
            flat = [view.flat(slot.middle) for slot in slots]
            for x, y in flat:
                marks += dim.centre_mark((x * scale, y * scale), slots[0].length / 2 * scale)
                below[_key(x)] = min(y * scale, below.get(_key(x), math.inf))
                beside[_key(y)] = min(x * scale, beside.get(_key(y), math.inf))
            x, y = max(flat, key=lambda p: (round(p[0], 2), round(p[1], 2)))
            callouts.append(((x * scale + slots[0].width / 2 * scale, y * scale), slot_words(slots)))
    if view.kind == "front":
        for item in part.axial:
            z = (item.low[2] + item.high[2]) / 2 - part.datum
            words = f"Ø{number(item.diameter)}{part.tolerance(item)}"
            if item.hole and not item.through:
                words += f" x {number(item.length)} DEEP"
            callouts.append(((item.diameter / 2 * scale, z * scale), words))
        ends = [end[2] for item in part.axial for end in (item.low, item.high)]
        optical = [] if part.lidar_axis is None else [0.0]
        for z in (*planes_across(part.solid, view.up), *ends, *optical):
            beside[_key(z - part.datum)] = left
    elif view.kind in ("top", "onto"):
        for value in planes_across(part.solid, view.right, SIDE_MM2):
            below.setdefault(_key(value - float(view.origin @ view.right)), low)
        for value in planes_across(part.solid, view.up, SIDE_MM2):
            beside.setdefault(_key(value - float(view.origin @ view.up)), left)
    if view.kind in ("front", "top"):
        (x0, y0), (x1, y1) = _extent(part.solid, view)
        rim = max((item.diameter / 2 for item in part.axial if not item.hole), default=0.0)
        known = [rim, -rim] if view.kind == "top" else []  # a diameter says it already
        for y in (y0, y1):
            if all(abs(y - other) > NEARLY for other in known):
                beside.setdefault(_key(y), left)
        for x in (x0, x1) if view.kind == "top" else ():
            if all(abs(x - other) > NEARLY for other in known):
                below.setdefault(_key(x), low)
    if below:
        below.setdefault(0.0, 0.0 if view.kind == "onto" else low)
        sign = -1.0 if view.kind == "left" else 1.0  # it looks along the axis that points to the left
        marks += dim.ordinates_below(dim.thinned(below), scale, low, sign)
    if beside:
        beside.setdefault(0.0, 0.0 if view.kind == "onto" else left)
        marks += dim.ordinates_left(dim.thinned(beside), scale, left)
    return [*marks, *dim.callouts_right(callouts, right)]


def _slanted(view: View, pattern: Pattern, part: Part, scale: float) -> tuple[Point, str]:
    """Call-out of a hole that no view looks along: where it points, and its height."""
    hole = max(pattern.holes, key=lambda h: round(float(np.hypot(*h.high[:2])), 3))
    outer = max(hole.low, hole.high, key=lambda end: round(math.hypot(end[0], end[1]), 3))
    x, y = view.flat(outer)
    azimuth = azimuth_deg(np.array(outer))
    way = "RADIAL" if abs(hole.direction[2]) < STRAIGHT else "INCLINED"
    words = f"{pattern.words()}, {way} AT {number(azimuth)}°, Z {number(outer[2] - part.datum)}"
    return (x * scale, y * scale), words


def _extent(solid: cq.Solid, view: View) -> tuple[Point, Point]:
    """Lower left and upper right corner of what a view shows, exact."""
    frame = np.stack([view.right, view.up, view.towards], axis=1)
    box = solid.moved(solids.location(frame).inverse).BoundingBox()
    x, y = float(view.origin @ view.right), float(view.origin @ view.up)
    return (box.xmin - x, box.ymin - y), (box.xmax - x, box.ymax - y)


def _seen_along(pattern: Pattern, top: View, part: Part) -> bool:
    """Whether another view looks along the holes: from the front, from the left, or onto inclined ones."""
    onto = [other.direction for other in part.patterns if _has_view(other)]
    return any(parallel(pattern.direction, along) for along in (top.right, top.up, *onto))


def _has_view(pattern: Pattern) -> bool:
    """Whether a view looks at this pattern for its own sake."""
    return len(pattern.holes) >= 3 and not parallel(pattern.direction, Z)


def _angle(view: View, pattern: Pattern, part: Part, scale: float, above: float) -> list[Mark]:
    """The angle between rotation axis and holes: at the optical centre where the lidar sits, else above the view."""
    outwards = _outwards(pattern, part)
    outwards = outwards if outwards[2] > -1e-9 else -outwards
    across, along = float(outwards @ view.right), float(outwards @ view.up)
    tilt = math.degrees(math.acos(max(-1.0, min(1.0, float(outwards[2])))))
    point = (0.0, above)
    if part.lidar_axis is not None:
        x, y = view.flat((0.0, 0.0, 0.0))
        point = (x * scale, y * scale)
    return dim.angle_between(point, math.pi / 2, math.atan2(along, across), 12.0, f"{number(tilt)}°")


def _outwards(pattern: Pattern, part: Part) -> Array:
    """Along the holes: to the lidar, or away from the middle of the part."""
    if part.lidar_axis is not None and parallel(pattern.direction, part.lidar_axis):
        return part.lidar_axis
    middle = np.array(part.solid.Center().toTuple())
    return pattern.direction if (pattern.centre - middle) @ pattern.direction > 0 else -pattern.direction


def _shows_angle(view: View, pattern: Pattern) -> bool:
    direction = pattern.direction
    return not parallel(direction, Z) and parallel(view.up, Z) and abs(float(direction @ view.towards)) < STRAIGHT


def _level(direction: Array) -> Array:
    """The horizontal part of a direction, as a unit vector."""
    level = np.array([direction[0], direction[1], 0.0])
    return level / np.linalg.norm(level)


def _key(value: float) -> float:
    return round(value, 2) + 0.0
