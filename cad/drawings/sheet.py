"""A sheet: views in first-angle projection, notes, title block. Paper millimetres.

A3 at full size or larger; else A2 at full size, else what is reduced least.
"""

from __future__ import annotations

from dataclasses import dataclass

from cad.drawings.marks import GLYPH_WIDTH, Bow, Mark, Point, Stroke, Text, box_of, moved
from cad.drawings.part import Part
from cad.drawings.views import View, draw

A3, A2 = (420.0, 297.0), (594.0, 420.0)
LEFT, EDGE = 20.0, 10.0  # margins of the frame (ISO 5457)
STRIP = 46.0  # height of notes and title block
BLOCK = 180.0  # width of the title block
SCALES = ((5.0, A3), (2.0, A3), (1.0, A3), (1.0, A2), (0.5, A3), (0.5, A2), (0.2, A2), (0.1, A2))
PAD = 8.0  # between views

Size = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Title:
    """What the title block and the notes say: name and content of each cell, then lines of text."""

    cells: tuple[tuple[str, str], ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Sheet:
    """All marks of a drawing, the scale of its views (paper over model), and the size of the paper."""

    marks: tuple[Mark, ...]
    scale: float
    size: Size
    name: str


def sheet_of(part: Part, views: list[View], title: Title, name: str) -> Sheet:
    """Lay out a drawing."""
    for scale, size in SCALES:
        blocks = [draw(view, part, scale) for view in views]
        placed = _placed(blocks, size, 4) or _placed(blocks, size, 3, force=(scale, size) == SCALES[-1])
        if placed is not None:
            break
    ratio = f"{scale:g}:1" if scale >= 1 else f"1:{1 / scale:g}"
    ratio += "   A3" if size == A3 else "   A2"
    marks = (*(placed or ()), *_frame(size), *_notes(title), *_title_block(title, ratio, size))
    return Sheet(marks, scale, size, name)


def _placed(blocks: list[list[Mark]], size: Size, joined: int, *, force: bool = False) -> list[Mark] | None:
    """Views in their places; None if they do not fit.

    First angle: the top view below the front view, the view from the left at its right; they share their origins.
    Where four are joined the isometric stands below that; the others are in columns further right, and it is the first
    of them where three are joined, as a long part wants it.
    """
    boxes = [box_of(block) for block in blocks]
    room_x, room_y = size[0] - LEFT - EDGE - 2 * PAD, size[1] - 2 * EDGE - STRIP - 2 * PAD
    left = max(-boxes[0][0], -boxes[1][0])
    right = max(boxes[0][2], boxes[1][2])
    above = max(boxes[0][3], boxes[2][3])
    below = max(-boxes[0][1], -boxes[2][1])
    x0, y0 = left, -above
    x1 = x0 + right + PAD - boxes[2][0]
    y1 = y0 - below - PAD - boxes[1][3]
    start = x0 + right + PAD
    at: list[Point] = [(x0, y0), (x0, y1), (x1, y0), (start - boxes[3][0], y0 - below - PAD - boxes[3][3])][:joined]
    column = max(box[2] - box[0] for box in boxes[2:joined])
    bottom = min(y + box[1] for (_, y), box in zip(at[1:], boxes[1:joined], strict=True))
    x, y, wide = start + column + PAD, 0.0, 0.0
    for box in boxes[joined:]:
        height, width = box[3] - box[1], box[2] - box[0]
        if y - height < -room_y and y < 0:
            x, y, wide = x + wide + PAD, 0.0, 0.0
        at.append((x - box[0], y - box[3]))
        y -= height + PAD
        wide = max(wide, width)
        bottom = min(bottom, y + PAD)
    total = x + wide if boxes[joined:] else start + column
    if (total > room_x or -bottom > room_y) and not force:
        return None
    dx = LEFT + PAD + max(0.0, (room_x - total) / 2)
    dy = size[1] - EDGE - PAD - max(0.0, (room_y + bottom) / 2)
    return [moved(mark, x + dx, y + dy) for block, (x, y) in zip(blocks, at, strict=True) for mark in block]


def _frame(size: Size) -> list[Mark]:
    left, bottom, right, top = LEFT, EDGE, size[0] - EDGE, size[1] - EDGE
    return [Stroke("frame", ((left, bottom), (right, bottom), (right, top), (left, top), (left, bottom)))]


def _notes(title: Title) -> list[Mark]:
    top = EDGE + STRIP - 5.0
    return [Text((LEFT + 4.0, top - 4.2 * i), line, height=2.2) for i, line in enumerate(title.notes)]


def _title_block(title: Title, ratio: str, size: Size) -> list[Mark]:
    """Cells in rows of three; the last one holds the scale and the symbol of first-angle projection."""
    bottom, right = EDGE, size[0] - EDGE
    left = right - BLOCK
    rows = -(-(len(title.cells) + 1) // 3)
    height, width = STRIP / rows, BLOCK / 3
    marks: list[Mark] = [Stroke("frame", ((left, bottom), (left, bottom + STRIP), (right, bottom + STRIP)))]
    cells = [*title.cells, ("scale, projection (ISO 5456-2)", ratio)]
    for i, (name, content) in enumerate(cells):
        x, y = left + width * (i % 3), bottom + STRIP - height * (i // 3 + 1)
        marks.append(Stroke("dimension", ((x, y), (x + width, y), (x + width, y + height))))
        marks.append(Text((x + 1.5, y + height - 3.2), name, height=1.8))
        fitting = min(3.5, (width - 3.0) / max(len(content), 1) / GLYPH_WIDTH)
        marks.append(Text((x + 1.5, y + 2.2), content, height=fitting))
    x, y = left + width * ((len(cells) - 1) % 3) + width - 22.0, bottom + height / 2 - 1.0
    return [*marks, *_first_angle(x, y)]


def _first_angle(x: float, y: float) -> list[Mark]:
    """The cone: seen from its side, then from its small end at the right."""
    turn = 6.283185307179586
    return [
        Stroke("visible", ((x, y - 1.5), (x + 7.0, y - 3.0), (x + 7.0, y + 3.0), (x, y + 1.5), (x, y - 1.5))),
        Stroke("centre", ((x - 1.5, y), (x + 8.5, y))),
        Bow("visible", (x + 14.0, y), 1.5, 0.0, turn),
        Bow("visible", (x + 14.0, y), 3.0, 0.0, turn),
        Stroke("centre", ((x + 9.8, y), (x + 18.2, y))),
        Stroke("centre", ((x + 14.0, y - 4.2), (x + 14.0, y + 4.2))),
    ]
