"""A sheet: views in first-angle projection, notes, title block. Paper millimetres.

A3 at full size or larger; else A2 at full size, else the smallest reduction.
"""

from dataclasses import dataclass

from ezdxf.document import Drawing
from reportlab.lib.utils import simpleSplit

from scanwright.cad.drawings.patterns import Part
from scanwright.cad.drawings.pen import CAPITAL, GLYPH_WIDTH, Pen, Point, document_at
from scanwright.cad.drawings.sizes import draw, sizes_of
from scanwright.cad.drawings.views import views_of

A3, A2 = (420.0, 297.0), (594.0, 420.0)
LEFT_MM, EDGE_MM = 20.0, 10.0  # margins of the frame (ISO 5457)
STRIP_MM = 46.0  # height of notes and title block
BLOCK_MM = 180.0  # width of the title block
NARROWER = 0.83  # than Helvetica: a browser without it shows DejaVu Sans, which is that much wider
NOTE_MM, LINE_MM = 2.2, 4.2  # height of a note, and from one to the next if the space allows it
SCALES = ((5.0, A3), (2.0, A3), (1.0, A3), (1.0, A2), (0.5, A3), (0.5, A2), (0.2, A2), (0.1, A2))
PAD_MM = 8.0  # between views

Size = tuple[float, float]
Box = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Title:
    """Title block and notes: name and content of each cell, then lines of text."""

    cells: tuple[tuple[str, str], ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Sheet:
    """A drawing, its views full size; the scale of its views on paper, and the size of the paper."""

    document: Drawing
    scale: float
    size: Size
    name: str


def sheet_of(part: Part, title: Title, name: str) -> Sheet:
    """Lay out a drawing."""
    views = [(view, sizes_of(view, part)) for view in views_of(part)]
    for scale, size in SCALES:
        pens = [Pen(None, scale) for _ in views]
        for pen, (view, sizes) in zip(pens, views, strict=True):
            draw(pen, view, sizes, part)
        boxes = [pen.box() for pen in pens]
        places = _placed(boxes, size, 4) or _placed(boxes, size, 3, force=(scale, size) == SCALES[-1])
        if places is not None:
            break
    document = document_at(scale)
    space = document.modelspace()
    for place, (view, sizes) in zip(places or (), views, strict=True):
        draw(Pen(space, scale, place), view, sizes, part)
    ratio = f"{scale:g}:1" if scale >= 1 else f"1:{1 / scale:g}"
    _frame(Pen(space, scale), title, f"{ratio}   {'A3' if size == A3 else 'A2'}", size)
    return Sheet(document, scale, size, name)


def _placed(boxes: list[Box], size: Size, joined: int, *, force: bool = False) -> list[Point] | None:
    """Return the places of the views' origins, each view's box being about it; None if they do not fit.

    First angle: the top view below the front view, the view from the left at its right; they share their origins.
    If four are joined, the isometric is below that, and the others are in columns further right; if three are joined,
    it is the first of these, which suits a long part.
    """
    room_x, room_y = size[0] - LEFT_MM - EDGE_MM - 2 * PAD_MM, size[1] - 2 * EDGE_MM - STRIP_MM - 2 * PAD_MM
    left = max(-boxes[0][0], -boxes[1][0])
    right = max(boxes[0][2], boxes[1][2])
    above = max(boxes[0][3], boxes[2][3])
    below = max(-boxes[0][1], -boxes[2][1])
    x0, y0 = left, -above
    x1 = x0 + right + PAD_MM - boxes[2][0]
    y1 = y0 - below - PAD_MM - boxes[1][3]
    start = x0 + right + PAD_MM
    at: list[Point] = [(x0, y0), (x0, y1), (x1, y0), (start - boxes[3][0], y0 - below - PAD_MM - boxes[3][3])][:joined]
    column = max(box[2] - box[0] for box in boxes[2:joined])
    bottom = min(y + box[1] for (_, y), box in zip(at[1:], boxes[1:joined], strict=True))
    x, y, wide = start + column + PAD_MM, 0.0, 0.0
    for box in boxes[joined:]:
        height, width = box[3] - box[1], box[2] - box[0]
        if y - height < -room_y and y < 0:
            x, y, wide = x + wide + PAD_MM, 0.0, 0.0
        at.append((x - box[0], y - box[3]))
        y -= height + PAD_MM
        wide = max(wide, width)
        bottom = min(bottom, y + PAD_MM)
    total = x + wide if boxes[joined:] else start + column
    if (total > room_x or -bottom > room_y) and not force:
        return None
    dx = LEFT_MM + PAD_MM + max(0.0, (room_x - total) / 2)
    dy = size[1] - EDGE_MM - PAD_MM - max(0.0, (room_y + bottom) / 2)
    return [(x + dx, y + dy) for x, y in at]


def _frame(pen: Pen, title: Title, ratio: str, size: Size) -> None:
    """Draw frame, notes, and title block: rows of three cells, the last one with scale and symbol of projection."""
    bottom, right, top = EDGE_MM, size[0] - EDGE_MM, size[1] - EDGE_MM
    pen.stroke("FRAME", ((LEFT_MM, bottom), (right, bottom), (right, top), (LEFT_MM, top), (LEFT_MM, bottom)))
    wide = right - BLOCK_MM - LEFT_MM - 12.0
    lines = [
        line for note in title.notes for line in simpleSplit(note, "Helvetica", NOTE_MM / CAPITAL, NARROWER * wide)
    ]
    step = min(LINE_MM, (STRIP_MM - 8.0) / max(1, len(lines) - 1))
    for i, line in enumerate(lines):
        pen.text((LEFT_MM + 4.0, EDGE_MM + STRIP_MM - 5.0 - step * i), line, height=NOTE_MM)
    left = right - BLOCK_MM
    rows = -(-(len(title.cells) + 1) // 3)
    height, width = STRIP_MM / rows, BLOCK_MM / 3
    pen.stroke("FRAME", ((left, bottom), (left, bottom + STRIP_MM), (right, bottom + STRIP_MM)))
    cells = [*title.cells, ("scale, projection (ISO 5456-2)", ratio)]
    for i, (name, content) in enumerate(cells):
        x, y = left + width * (i % 3), bottom + STRIP_MM - height * (i // 3 + 1)
        pen.stroke("DIMENSION", ((x, y), (x + width, y), (x + width, y + height)))
        pen.text((x + 1.5, y + height - 3.2), name, height=1.8)
        fitting = min(3.5, (width - 3.0) / max(len(content), 1) / GLYPH_WIDTH)
        pen.text((x + 1.5, y + 2.2), content, height=fitting)
    x = left + width * ((len(cells) - 1) % 3) + width - 22.0
    _first_angle(pen, x, bottom + height / 2 - 1.0)


def _first_angle(pen: Pen, x: float, y: float) -> None:
    """Draw the cone: seen from its side, then from its small end at the right."""
    pen.stroke("VISIBLE", ((x, y - 1.5), (x + 7.0, y - 3.0), (x + 7.0, y + 3.0), (x, y + 1.5), (x, y - 1.5)))
    pen.stroke("CENTRE", ((x - 1.5, y), (x + 8.5, y)))
    pen.arc("VISIBLE", (x + 14.0, y), 1.5)
    pen.arc("VISIBLE", (x + 14.0, y), 3.0)
    pen.stroke("CENTRE", ((x + 9.8, y), (x + 18.2, y)))
    pen.stroke("CENTRE", ((x + 14.0, y - 4.2), (x + 14.0, y + 4.2)))
