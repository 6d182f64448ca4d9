"""A dimensioned sketch of a device from its catalogue record: views onto faces with holes, from above and the side."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import singledispatch

import numpy as np

from scanwright.cad import outlines
from scanwright.cad.drawings.dimensions import Callout, callouts_right, centre_mark, ordinates
from scanwright.cad.drawings.patterns import counted, number
from scanwright.cad.drawings.pen import Pen, Point, document_at
from scanwright.cad.drawings.sheet import Sheet
from scanwright.cad.drawings.write import drawn_on, svg_bytes
from scanwright.cad.layout.drive import Point as Point3
from scanwright.cad.layout.drive import Rod
from scanwright.cad.layout.envelope import Box
from scanwright.cad.layout.joints import triple
from scanwright.cad.screws import SCREWS
from scanwright.design.arrays import Array
from scanwright.design.catalogue.holes import Hole
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.product_base import Product
from scanwright.design.catalogue.products import Bearing
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.errors import TaskError

MARGIN_MM, TITLE_MM, LINE_MM, PAD_MM = 8.0, 5.0, 4.5, 10.0
COLUMNS = 2
LARGEST_MM = 90.0  # of a view on paper
SCALES = (5.0, 2.0, 1.0, 0.5, 0.2, 0.1)
ALONG = 0.9  # cosine: a hole is shown in the view that it faces
VIEWS: tuple[tuple[str, tuple[float, float, float], tuple[float, float, float]], ...] = (
    ("FROM ABOVE  (X right, Y up)", (1, 0, 0), (0, 1, 0)),
    ("FROM BELOW  (X left, Y up)", (-1, 0, 0), (0, 1, 0)),
    ("FROM THE RIGHT  (X right, Z up)", (1, 0, 0), (0, 0, 1)),
    ("FROM THE LEFT  (X left, Z up)", (-1, 0, 0), (0, 0, 1)),
    ("FROM THE FRONT  (Y right, Z up)", (0, 1, 0), (0, 0, 1)),
    ("FROM BEHIND  (Y left, Z up)", (0, -1, 0), (0, 0, 1)),
)
ALWAYS = (0, 2)

Draw = Callable[[Array, Array], list[Array]]
"""Draws a device in the plane of a view (right, up): closed polygons, shape (n, 2)."""
AXES = {f"{sign}{axis}": (1 if sign == "+" else -1) * np.eye(3)[i] for i, axis in enumerate("xyz") for sign in "+-"}


@dataclass(frozen=True, slots=True)
class Spot:
    """A hole to draw: middle of its mouth, direction out of the device, radius, call-out of its kind."""

    at: Point3
    out: Point3
    radius: float
    words: str


@dataclass(frozen=True, slots=True)
class DeviceOutline:
    """A device to draw."""

    solids: tuple[Box | Rod, ...]  # its bodies
    spots: tuple[Spot, ...] = ()  # its holes
    heights: tuple[float, ...] = ()  # other heights that get a dimension, such as that of the optical centre
    unverified: tuple[str, ...] = ()  # fields of the sketch that are not verified


def spots_of(holes: Iterable[Hole], mark: str = "") -> tuple[Spot, ...]:
    """Return the holes of a sketch; `mark` follows the call-out of unverified ones."""
    spots = []
    for hole in holes:
        depth = f"{number(hole.depth_mm)} {'THICK' if hole.kind == 'through' else 'DEEP'}"
        words = f"{hole.size} {hole.kind.replace('_', ' ').upper()}, {depth}{mark}"
        axis = AXES[hole.axis] if isinstance(hole.axis, str) else np.asarray(hole.axis, dtype=float)
        spots.append(Spot(hole.at_mm, triple(axis / np.linalg.norm(axis)), SCREWS[hole.size].nominal / 2, words))
    return tuple(spots)


@singledispatch
def outline_of(product: Product) -> DeviceOutline:
    """Return the geometry of a product's sketch; TaskError if its record has no dimensions."""
    raise TaskError(f"{product.name}: a {product.kind} has no dimensions to draw")


@outline_of.register
def _lidar(product: Lidar) -> DeviceOutline:
    x, y, z = product.body_mm
    window = Rod(product.window_radius_mm, *product.window_z_mm)
    body = ((-x / 2, -y / 2, 0.0), (x / 2, y / 2, z))
    fields = ("body_mm", "ears_mm", "window_z_mm", "window_radius_mm", "holes", "optical_height_mm")
    unverified = _open(product, fields)
    spots = spots_of(product.holes, "?" if "holes" in unverified else "")
    return DeviceOutline((body, *(product.ears_mm or ()), window), spots, (product.optical_height_mm,), unverified)


@outline_of.register
def _servo(product: Servo) -> DeviceOutline:
    horn = Rod(product.horn_diameter_mm / 2, -product.horn_thickness_mm, 0.0)
    boss = Rod(product.horn_boss_diameter_mm / 2, 0.0, product.horn_boss_height_mm)
    horn_fields = ("horn_circle_mm", "horn_holes", "horn_first_hole_deg", "horn_screw", "horn_thread_depth_mm")
    fields = ("case_min_mm", "case_max_mm", "horn_diameter_mm", "horn_thickness_mm", *horn_fields, "holes")
    unverified = _open(product, fields)
    mark = "?" if set(horn_fields) & set(unverified) else ""
    turns = math.radians(product.horn_first_hole_deg) + 2 * math.pi * np.arange(product.horn_holes) / product.horn_holes
    circle = product.horn_circle_mm / 2
    words = f"{product.horn_screw} TAPPED, {number(product.horn_thread_depth_mm)} DEEP ON Ø{number(2 * circle)}{mark}"
    radius = SCREWS[product.horn_screw].nominal / 2
    on_horn = [Spot((-circle * math.sin(t), circle * math.cos(t), 0.0), (0.0, 0.0, 1.0), radius, words) for t in turns]
    solids: list[Box | Rod] = [(product.case_min_mm, product.case_max_mm), horn]
    spots = (*on_horn, *spots_of(product.holes, "?" if "holes" in unverified else ""))
    return DeviceOutline((*solids, *([boss] if boss.radius else [])), spots, (), unverified)


@outline_of.register
def _slip_ring(product: SlipRing) -> DeviceOutline:
    length = product.length_mm
    solids = [Rod(product.outer_diameter_mm / 2, 0.0, length)]
    if product.bore_mm:
        solids.append(Rod(product.bore_mm / 2, 0.0, length))
    spots: list[Spot] = []
    if product.flange is not None:
        flange = product.flange
        top = length - flange.below_top_mm
        solids.append(Rod(flange.diameter_mm / 2, top - flange.thickness_mm, top))
        words = f"Ø{number(flange.hole_mm)} FOR {flange.screw}"
        for turn in 2 * math.pi * np.arange(flange.holes) / flange.holes:
            x, y = flange.circle_mm / 2 * math.cos(turn), flange.circle_mm / 2 * math.sin(turn)
            spots.append(Spot((x, y, top), (0.0, 0.0, 1.0), flange.hole_mm / 2, words))
    if product.rotor is not None:
        solids.append(Rod(product.rotor.diameter_mm / 2, length, length + product.rotor.length_mm))
    fields = ("bore_mm", "outer_diameter_mm", "length_mm", "flange", "rotor")
    return DeviceOutline(tuple(solids), tuple(spots), (), _open(product, fields))


@outline_of.register
def _bearing(product: Bearing) -> DeviceOutline:
    outer = Rod(product.outer_mm / 2, 0.0, product.width_mm)
    bore = Rod(product.bore_mm / 2, 0.0, product.width_mm)
    return DeviceOutline((outer, bore), (), (), _open(product, ("bore_mm", "outer_mm", "width_mm")))


def _open(product: Product, fields: Sequence[str]) -> tuple[str, ...]:
    return tuple(field for field in product.unverified() if field in fields)


@dataclass(slots=True)
class SketchView:
    """A view in its own plane, millimetres of the device; `sign` is -1 if the frame's axis points to the left."""

    title: str
    sign: float
    polygons: list[Array]
    holes: list[tuple[Point, float]] = field(default_factory=list)
    callouts: list[Callout] = field(default_factory=list)
    below: dict[float, float] = field(default_factory=dict)
    heights: dict[float, float] = field(default_factory=dict)


def sketch_svg(product: Product) -> bytes:
    """Return the sketch of a product as SVG; TaskError if its record has no dimensions."""
    outline = outline_of(product)
    notes = ["Millimetres, frame of the catalogue."]
    if outline.unverified:
        notes.append(f"Not verified, measure yours: {', '.join(outline.unverified)}.")
    heights = [*outline.heights]
    for solid in outline.solids:
        heights += (solid.low, solid.high) if isinstance(solid, Rod) else (solid[0][2], solid[1][2])
    views = views_of(outline.spots, lambda right, up: _polygons(outline, right, up), heights)
    for solid in outline.solids:
        if isinstance(solid, Rod):
            aside = float(solid.radius * np.sqrt(0.5))
            views[0].callouts.append(Callout((aside, aside), f"Ø{number(2 * solid.radius)}"))
    return sketch_of(f"{product.name} ({product.maker})", views, notes)


def views_of(spots: Sequence[Spot], draw: Draw, heights: Sequence[float] = ()) -> list[SketchView]:
    """Return the views of a device with holes and dimensions; `heights` are z that get a dimension as well."""
    views = []
    for i, (title, right, up) in enumerate(VIEWS):
        r, u = np.asarray(right, dtype=float), np.asarray(up, dtype=float)
        facing = [spot for spot in spots if np.asarray(spot.out) @ np.cross(r, u) > ALONG]
        if i not in ALWAYS and not facing:
            continue
        view = SketchView(title, float(r.sum()), draw(r, u))
        corners = np.concatenate(view.polygons)
        for x in (corners[:, 0].min(), corners[:, 0].max()):
            view.below[round(float(x), 3)] = float(corners[:, 1].min())
        for y in (corners[:, 1].min(), corners[:, 1].max(), *(heights if up[2] else ())):
            view.heights[round(float(y), 3)] = float(corners[:, 0].min())
        groups: dict[str, list[Spot]] = {}
        for spot in facing:
            x, y = float(np.asarray(spot.at) @ r), float(np.asarray(spot.at) @ u)
            view.holes.append(((x, y), spot.radius))
            view.below.setdefault(round(x, 3), y)
            view.heights.setdefault(round(y, 3), x)
            groups.setdefault(spot.words, []).append(spot)
        for words, alike in groups.items():
            places = [(float(np.asarray(spot.at) @ r), float(np.asarray(spot.at) @ u)) for spot in alike]
            x, y = max(places)
            at = (x + alike[0].radius, y)
            view.callouts.append(Callout(at, f"{counted(len(alike))}{words}"))
        views.append(view)
    return views


def sketch_of(title: str, views: Sequence[SketchView], notes: Sequence[str]) -> bytes:
    """Return views in rows of two with a title and notes, as SVG."""
    size = max(float(np.ptp(np.concatenate(view.polygons), axis=0).max()) for view in views)
    scale = next((scale for scale in SCALES if size * scale <= LARGEST_MM), SCALES[-1])
    boxes = []
    for view in views:
        pen = Pen(None, scale)
        _draw(pen, view)
        boxes.append(pen.box())
    rows = [range(i, min(i + COLUMNS, len(views))) for i in range(0, len(views), COLUMNS)]
    places, y, width = {}, 0.0, 0.0
    for row in rows:
        x, tall = 0.0, max(boxes[i][3] - boxes[i][1] for i in row)
        for i in row:
            places[i] = (x - boxes[i][0], y - boxes[i][3])
            x += boxes[i][2] - boxes[i][0] + PAD_MM
        width, y = max(width, x - PAD_MM), y - tall - PAD_MM
    lines = [f"{title}   {f'{scale:g}:1' if scale >= 1 else f'1:{1 / scale:g}'}", *notes]
    height = -y - PAD_MM + 2 * MARGIN_MM + TITLE_MM + LINE_MM * len(lines)
    document = document_at(scale)
    space = document.modelspace()
    text = Pen(space, scale)
    for i, line in enumerate(lines):
        text.text((MARGIN_MM, height - MARGIN_MM - LINE_MM * (i + 1)), line)
    top = height - MARGIN_MM - TITLE_MM - LINE_MM * len(lines)
    for i, view in enumerate(views):
        _draw(Pen(space, scale, (MARGIN_MM + places[i][0], top + places[i][1])), view)
    width = max(width, text.box()[2] - MARGIN_MM) + 2 * MARGIN_MM
    sheet = Sheet(document, scale, (round(width, 1), round(height, 1)), title)
    return svg_bytes(sheet, list(drawn_on(sheet)))


def _draw(pen: Pen, view: SketchView) -> None:
    for polygon in view.polygons:
        points = [pen.paper((float(x), float(y))) for x, y in polygon]
        pen.stroke("VISIBLE", [*points, points[0]])
    left, low, right, _ = pen.box()
    for middle, radius in view.holes:
        pen.arc("VISIBLE", pen.paper(middle), radius * pen.scale)
        centre_mark(pen, pen.paper(middle), radius * pen.scale)
    ordinates(pen, view.below, low, below=True, sign=view.sign)
    ordinates(pen, view.heights, left, below=False)
    callouts_right(pen, view.callouts, right)
    pen.text(((left + right) / 2, pen.box()[3] + 2.5), view.title, anchor="middle")


def _polygons(outline: DeviceOutline, right: Array, up: Array) -> list[Array]:
    """Return the outlines of bodies in a view; from below a box covers the cylinders on it."""
    towards = float(np.cross(right, up)[2])
    boxed = not all(isinstance(solid, Rod) for solid in outline.solids)
    polygons = []
    for solid in outline.solids:
        if not isinstance(solid, Rod):
            corners = np.array(solid) @ np.stack([right, up], axis=1)
        elif abs(towards) < ALONG:
            corners = np.array([[-solid.radius, solid.low], [solid.radius, solid.high]])
        else:
            if towards > 0 or not boxed:
                polygons.append(outlines.polygon(solid.radius, 72))
            continue
        (left, low), (right_, high) = corners.min(axis=0), corners.max(axis=0)
        polygons.append(np.array([[left, low], [right_, low], [right_, high], [left, high]]))
    return polygons
