"""A sheet as SVG, PDF and DXF: the same bytes for the same sheet, and nothing of this machine's fonts in them."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from contextlib import contextmanager
from xml.sax.saxutils import escape, quoteattr

import ezdxf
from ezdxf import units
from ezdxf.enums import TextEntityAlignment
from ezdxf.filemanagement import new
from ezdxf.layouts.layout import Modelspace
from reportlab.pdfgen.canvas import Canvas

from cad.drawings.marks import CAPITAL, DASHES, WIDTHS, Bow, Head, Layer, Mark, Stroke, Text
from cad.drawings.sheet import Sheet

POINTS = 72 / 25.4
COLOURS: dict[Layer, int] = {"visible": 7, "hidden": 8, "centre": 1, "dimension": 5, "frame": 7}  # AutoCAD's index
ALIGNMENTS = {
    "left": TextEntityAlignment.LEFT,
    "middle": TextEntityAlignment.CENTER,
    "right": TextEntityAlignment.RIGHT,
}
TURN = 2 * math.pi


def svg_bytes(sheet: Sheet) -> bytes:
    """A page; a group per layer."""
    width, height = sheet.size
    groups: dict[Layer, list[str]] = {layer: [] for layer in WIDTHS}
    for mark in sheet.marks:
        if isinstance(mark, Stroke):
            points = " ".join(f"{_n(x)},{_n(height - y)}" for x, y in mark.points)
            groups[mark.layer].append(f'<polyline points="{points}"/>')
        elif isinstance(mark, Bow):
            groups[mark.layer].append(_svg_bow(mark, height))
        elif isinstance(mark, Head):
            points = " ".join(f"{_n(x)},{_n(height - y)}" for x, y in mark.corners())
            groups["dimension"].append(f'<polygon points="{points}" fill="black"/>')
        else:
            x, y = _n(mark.at[0]), _n(height - mark.at[1])
            anchor = {"left": "start", "middle": "middle", "right": "end"}[mark.anchor]
            turn = f' transform="rotate({_n(-mark.angle)} {x} {y})"' if mark.angle else ""
            size = f'font-size="{_n(mark.height / CAPITAL)}" text-anchor="{anchor}"'
            words = escape(mark.text)
            groups["dimension"].append(f'<text x="{x}" y="{y}" {size}{turn} fill="black" stroke="none">{words}</text>')
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}mm" height="{height:g}mm" '
        f'viewBox="0 0 {width:g} {height:g}">',
        f"<title>{escape(sheet.name)}</title>",
        '<rect width="100%" height="100%" fill="white"/>',
    ]
    for layer, entries in groups.items():
        dash = f' stroke-dasharray="{" ".join(map(_n, DASHES[layer]))}"' if layer in DASHES else ""
        style = f'fill="none" stroke="black" stroke-width="{WIDTHS[layer]:g}" stroke-linecap="round"{dash}'
        lines.append(f'<g id={quoteattr(layer)} {style} font-family="Helvetica, Arial, sans-serif">')
        lines += [*entries, "</g>"]
    return "\n".join([*lines, "</svg>", ""]).encode("utf-8")


def pdf_bytes(sheet: Sheet) -> bytes:
    """A page in Helvetica, one of the fonts that every reader has."""
    file = io.BytesIO()
    # not compressed: what a compressor makes of it depends on its version
    canvas = Canvas(file, pagesize=(sheet.size[0] * POINTS, sheet.size[1] * POINTS), invariant=1, pageCompression=0)
    canvas.setTitle(sheet.name)
    canvas.setCreator("scanwright")
    canvas.scale(POINTS, POINTS)
    canvas.setLineCap(1)
    for mark in sheet.marks:
        if isinstance(mark, Text):
            _pdf_text(canvas, mark)
            continue
        path = canvas.beginPath()
        if isinstance(mark, Bow):
            x, y = mark.centre
            box = (x - mark.radius, y - mark.radius, x + mark.radius, y + mark.radius)
            path.arc(*box, math.degrees(mark.start), math.degrees(mark.end - mark.start))
        else:
            first, *rest = mark.corners() if isinstance(mark, Head) else mark.points
            path.moveTo(*first)
            for point in rest:
                path.lineTo(*point)
        layer: Layer = "dimension" if isinstance(mark, Head) else mark.layer
        canvas.setLineWidth(WIDTHS[layer])
        canvas.setDash(list(DASHES.get(layer, ())))
        canvas.drawPath(path, stroke=0 if isinstance(mark, Head) else 1, fill=1 if isinstance(mark, Head) else 0)
    canvas.showPage()
    canvas.save()
    return file.getvalue()


def dxf_text(sheet: Sheet) -> str:
    """DXF R2010 with the views at 1:1 in millimetres; the frame is scaled with them."""
    with _fixed_dates():
        document = new("R2010", units=units.MM)
        document.header["$LTSCALE"] = 1 / sheet.scale
        for layer, width in WIDTHS.items():
            linetype = "CONTINUOUS"
            if layer in DASHES:
                linetype = layer.upper()
                lengths = [v * (-1) ** i for i, v in enumerate(DASHES[layer])]
                document.linetypes.add(linetype, pattern=[sum(DASHES[layer]), *lengths], description=layer)
            weight = round(width * 100)
            document.layers.add(layer.upper(), color=COLOURS[layer], linetype=linetype, lineweight=weight)
        space = document.modelspace()
        for mark in sheet.marks:
            _dxf_entity(space, mark, 1 / sheet.scale)
        for name in sorted(document.entitydb.dxf_types_in_use()):
            document.classes.add_class(name)  # else in the order of a set, which the hash seed decides
        file = io.StringIO()
        document.write(file)
        return file.getvalue()


@contextmanager
def _fixed_dates() -> Iterator[None]:
    """The library's own switch, else dates and GUIDs differ from run to run; it is global, so put back."""
    before = ezdxf.options.write_fixed_meta_data_for_testing  # type: ignore[attr-defined]
    ezdxf.options.write_fixed_meta_data_for_testing = True  # type: ignore[attr-defined]
    try:
        yield
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = before  # type: ignore[attr-defined]


def _dxf_entity(space: Modelspace, mark: Mark, k: float) -> None:
    """One mark, k times as large."""
    if isinstance(mark, Text):
        text = mark.text.replace("Ø", "%%c").replace("°", "%%d")
        attributes = {"layer": "DIMENSION", "height": mark.height * k, "rotation": mark.angle}
        at = (mark.at[0] * k, mark.at[1] * k)
        space.add_text(text, dxfattribs=attributes).set_placement(at, align=ALIGNMENTS[mark.anchor])
    elif isinstance(mark, Head):
        space.add_solid([(x * k, y * k) for x, y in mark.corners()], dxfattribs={"layer": "DIMENSION"})
    elif isinstance(mark, Bow):
        layered = {"layer": mark.layer.upper()}
        centre, radius = (mark.centre[0] * k, mark.centre[1] * k), mark.radius * k
        if mark.end - mark.start > TURN - 1e-6:
            space.add_circle(centre, radius, dxfattribs=layered)
        else:
            space.add_arc(centre, radius, math.degrees(mark.start), math.degrees(mark.end), dxfattribs=layered)
    else:
        layered = {"layer": mark.layer.upper()}
        points = [(x * k, y * k) for x, y in mark.points]
        if len(points) == 2:
            space.add_line(points[0], points[1], dxfattribs=layered)
        else:
            space.add_lwpolyline(points, dxfattribs=layered)


def _svg_bow(mark: Bow, height: float) -> str:
    x, y = mark.centre
    if mark.end - mark.start > TURN - 1e-6:
        return f'<circle cx="{_n(x)}" cy="{_n(height - y)}" r="{_n(mark.radius)}"/>'
    r = _n(mark.radius)
    ends = [(x + mark.radius * math.cos(a), height - y - mark.radius * math.sin(a)) for a in (mark.start, mark.end)]
    large = int(mark.end - mark.start > math.pi)
    (x0, y0), (x1, y1) = ends
    return f'<path d="M{_n(x0)},{_n(y0)} A{r},{r} 0 {large} 0 {_n(x1)},{_n(y1)}"/>'


def _pdf_text(canvas: Canvas, mark: Text) -> None:
    canvas.saveState()
    canvas.translate(*mark.at)
    canvas.rotate(mark.angle)
    canvas.setFont("Helvetica", mark.height / CAPITAL)
    draw = {"left": canvas.drawString, "middle": canvas.drawCentredString, "right": canvas.drawRightString}
    draw[mark.anchor](0, 0, mark.text)
    canvas.restoreState()


def _n(value: float) -> str:
    """A coordinate to a micrometre, without trailing zeros."""
    text = f"{value:.3f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text
