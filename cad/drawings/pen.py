"""Draw on the modelspace of a DXF document in millimetres of paper: strokes, arcs, texts and dimensions on layers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from ezdxf.document import Drawing
from ezdxf.enums import TextEntityAlignment
from ezdxf.filemanagement import new
from ezdxf.layouts.base import BaseLayout
from ezdxf.units import MM

Layer = Literal["VISIBLE", "HIDDEN", "CENTRE", "DIMENSION", "FRAME"]
Point = tuple[float, float]

WIDTHS: dict[Layer, float] = {"VISIBLE": 0.35, "HIDDEN": 0.18, "CENTRE": 0.13, "DIMENSION": 0.13, "FRAME": 0.5}
DASHES: dict[Layer, tuple[float, ...]] = {"HIDDEN": (1.6, 0.8), "CENTRE": (6.0, 1.2, 0.8, 1.2)}
COLOURS: dict[Layer, int] = {"VISIBLE": 7, "HIDDEN": 8, "CENTRE": 1, "DIMENSION": 5, "FRAME": 7}  # AutoCAD's index
ANCHORS = {
    "left": (TextEntityAlignment.LEFT, 0.0),
    "middle": (TextEntityAlignment.CENTER, 0.5),
    "right": (TextEntityAlignment.RIGHT, 1.0),
}
CAPITAL = 0.72  # height of capitals and figures over the size of the font (Helvetica)
GLYPH_WIDTH = 0.6 / CAPITAL  # of the height, on average
TEXT_MM = 2.5  # height of letters, one of ISO 3098-1
ARROW_MM = (2.2, 0.35)  # length and half width
TURN_RAD = 2 * math.pi
ORDINATE_X, ORDINATE_Y, DIAMETER, ANGLE = 32 + 64 + 6, 32 + 6, 32 + 128 + 3, 32 + 128 + 5  # kinds of DIMENSION


def document_at(scale: float) -> Drawing:
    """Return an empty DXF R2010 whose views are full size and whose lines, texts and arrows grow by 1 / scale."""
    document = new("R2010", units=MM)
    document.header["$LTSCALE"] = 1 / scale
    for layer, width in WIDTHS.items():
        linetype = layer if layer in DASHES else "CONTINUOUS"
        if layer in DASHES:
            lengths = [length * (-1) ** i for i, length in enumerate(DASHES[layer])]
            document.linetypes.add(layer, pattern=[sum(DASHES[layer]), *lengths])
        document.layers.add(layer, color=COLOURS[layer], linetype=linetype, lineweight=round(width * 100))
    sizes = {"dimscale": 1 / scale, "dimtxt": TEXT_MM, "dimasz": ARROW_MM[0], "dimexo": 1.5}
    document.dimstyles.new("SHEET", dxfattribs={**sizes, "dimdec": 2, "dimadec": 2, "dimzin": 8, "dimazin": 2})
    return document


@dataclass(frozen=True, slots=True)
class Pen:
    """Draws about an origin and records the extent."""

    space: BaseLayout | None  # to draw on; None to measure only
    scale: float  # paper over model
    origin: Point = (0.0, 0.0)  # on the paper
    reached: list[Point] = field(default_factory=list)  # corners of the drawn entities, about the origin

    def box(self) -> tuple[float, float, float, float]:
        """Return left, bottom, right and top of the drawn entities, about the origin."""
        xs, ys = zip(*self.reached, strict=True)
        return min(xs), min(ys), max(xs), max(ys)

    def paper(self, point: Point) -> Point:
        """Return a point of the model on the paper, both about the origin."""
        return point[0] * self.scale, point[1] * self.scale

    def stroke(self, layer: Layer, points: Sequence[Point]) -> None:
        """Draw straight pieces through points."""
        self.reached.extend(points)
        if self.space is None:
            return
        placed = [self._model(point) for point in points]
        if len(placed) == 2:
            self.space.add_line(placed[0], placed[1], dxfattribs={"layer": layer})
        else:
            self.space.add_lwpolyline(placed, dxfattribs={"layer": layer})

    def arc(self, layer: Layer, centre: Point, radius: float, start: float = 0.0, end: float = TURN_RAD) -> None:
        """Draw part of a circle, counter-clockwise from start to end [rad]."""
        turns = [start + (end - start) * k / 16 for k in range(17)]
        self.reached.extend((centre[0] + radius * math.cos(t), centre[1] + radius * math.sin(t)) for t in turns)
        if self.space is None:
            return
        placed, size = self._model(centre), radius / self.scale
        if end - start > TURN_RAD - 1e-6:
            self.space.add_circle(placed, size, dxfattribs={"layer": layer})
        else:
            self.space.add_arc(placed, size, math.degrees(start), math.degrees(end), dxfattribs={"layer": layer})

    def text(self, at: Point, words: str, height: float = TEXT_MM, anchor: str = "left", angle: float = 0.0) -> None:
        """Write one line; `at` is its left end, middle or right end on the base line; angle in degrees."""
        align, share = ANCHORS[anchor]
        width = width_of(words, height)
        c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
        for u in (-share * width, (1 - share) * width):
            self.reached.extend((at[0] + u * c - v * s, at[1] + u * s + v * c) for v in (0.0, height))
        if self.space is not None:
            attributes = {"layer": "DIMENSION", "height": height / self.scale, "rotation": angle}
            written = words.replace("Ø", "%%c").replace("°", "%%d")
            self.space.add_text(written, dxfattribs=attributes).set_placement(self._model(at), align=align)

    def head(self, tip: Point, angle: float) -> None:
        """Draw a filled arrow head that points along an angle [rad]."""
        (length, half), (c, s) = ARROW_MM, (math.cos(angle), math.sin(angle))
        back = tip[0] - length * c, tip[1] - length * s
        corners = (tip, (back[0] - half * s, back[1] + half * c), (back[0] + half * s, back[1] - half * c))
        self.reached.extend(corners)
        if self.space is not None:
            self.space.add_solid([self._model(corner) for corner in corners], dxfattribs={"layer": "DIMENSION"})

    def dimension(self, kind: int, words: str, text_at: Point, **points: Point) -> Pen:
        """Add a DIMENSION entity and return the pen that draws its picture.

        ezdxf can draw one too, but centres texts by the fonts of the machine, without boxes and bent leaders.

        Args:
            kind: ORDINATE_X, ORDINATE_Y, DIAMETER or ANGLE.
            words: around `<>`, which represents the measured value.
            text_at: middle of the text.
            points: defpoint, defpoint2, defpoint3, defpoint4 of the kind of DIMENSION.
        """
        if self.space is None:
            return self
        assert self.space.doc is not None
        block = self.space.doc.blocks.new_anonymous_block(type_char="D")
        placed = {name: self._model(point) for name, point in (*points.items(), ("text_midpoint", text_at))}
        attributes = {"layer": "DIMENSION", "dimstyle": "SHEET", "dimtype": kind, "geometry": block.name, **placed}
        self.space.new_entity("DIMENSION", {**attributes, "text": words.replace("°", "%%d").replace("Ø", "%%c")})
        return replace(self, space=block)

    def _model(self, point: Point) -> Point:
        x, y = ((c + start) / self.scale for c, start in zip(point, self.origin, strict=True))
        return round(x, 6), round(y, 6)


def width_of(words: str, height: float = TEXT_MM) -> float:
    """Return the approximate width of a text."""
    return len(words) * height * GLYPH_WIDTH
