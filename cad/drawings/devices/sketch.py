"""A dimensioned sketch of a device: a view onto each face that has holes, one from above and one from the side."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from scanwright.cad import outlines
from scanwright.cad.drawings.devices.outline import DeviceOutline, Spot, outline_of
from scanwright.cad.drawings.dimensions import Callout, callouts_right, centre_mark, ordinates
from scanwright.cad.drawings.patterns import counted, number
from scanwright.cad.drawings.pen import Pen, Point, document_at
from scanwright.cad.drawings.sheet import Sheet
from scanwright.cad.drawings.write import drawn_on, svg_bytes
from scanwright.cad.layout.drive import Rod
from scanwright.design.arrays import Array
from scanwright.design.catalogue.product_base import Product

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
    """Return the sketch of a product as SVG.

    Raises:
        TaskError: its record has no dimensions.
    """
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
