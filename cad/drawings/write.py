"""A sheet as DXF, SVG and PDF: the same bytes for the same sheet, independent of the fonts of the machine.

SVG and PDF are written from the DXF's entities. ezdxf's drawing add-on draws texts as outlines, which no reader can
search, in SVGs 2.5 to 5 times as large and 0.2 to 0.9 s a sheet more.
"""

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from xml.sax.saxutils import escape

import ezdxf
from ezdxf.disassemble import recursive_decompose
from ezdxf.entities.text import Text
from ezdxf.math import Matrix44
from ezdxf.path import Path, make_path
from ezdxf.path.commands import Curve4To
from reportlab.pdfgen.canvas import Canvas

from scanwright.cad.drawings.pen import ANCHORS, CAPITAL, DASHES, WIDTHS, Layer, Point
from scanwright.cad.drawings.sheet import Sheet

POINTS_PER_MM = 72 / 25.4  # of PDF
ALIGNED = {alignment: anchor for anchor, (alignment, _) in ANCHORS.items()}


@dataclass(frozen=True, slots=True)
class Outline:
    """Lines and curves on a layer, millimetres of paper; the inside of some is filled instead."""

    layer: Layer
    path: Path
    filled: bool


@dataclass(frozen=True, slots=True)
class Words:
    """One line of text; `at` is its left end, middle or right end on the base line; angle in degrees."""

    at: Point
    text: str
    height: float
    anchor: str
    angle: float


Drawn = Sequence[Outline | Words]


def drawn_on(sheet: Sheet) -> Iterator[Outline | Words]:
    """Yield all that a sheet shows, in the order in which it was drawn."""
    on_paper = Matrix44.scale(sheet.scale)
    for entity in recursive_decompose(sheet.document.modelspace()):
        if isinstance(entity, Text):
            alignment, start, end = entity.get_placement()
            at = on_paper.transform(start if end is None else end)
            height = entity.dxf.height * sheet.scale
            yield Words((at.x, at.y), entity.plain_text(), height, ALIGNED[alignment], entity.dxf.rotation)
        else:
            yield Outline(entity.dxf.layer, make_path(entity).transform(on_paper), entity.dxftype() == "SOLID")


def svg_bytes(sheet: Sheet, shown: Drawn) -> bytes:
    """Return a page of the `drawn_on` entities; a group per layer."""
    width, height = sheet.size
    groups: dict[Layer, list[str]] = {layer: [] for layer in WIDTHS}
    for item in shown:
        if isinstance(item, Outline):
            steps = " ".join(
                name + ",".join(f"{_n(x)} {_n(height - y)}" for x, y in points) for name, points in _steps(item.path)
            )
            groups[item.layer].append(f'<path d="{steps}"' + (' fill="black" stroke="none"/>' if item.filled else "/>"))
            continue
        x, y = _n(item.at[0]), _n(height - item.at[1])
        anchor = {"left": "start", "middle": "middle", "right": "end"}[item.anchor]
        turn = f' transform="rotate({_n(-item.angle)} {x} {y})"' if item.angle else ""
        style = f'font-size="{_n(item.height / CAPITAL)}" text-anchor="{anchor}" fill="black" stroke="none"'
        groups["DIMENSION"].append(f'<text x="{x}" y="{y}" {style}{turn}>{escape(item.text)}</text>')
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
        lines.append(f'<g id="{layer.lower()}" {style} font-family="Helvetica, Arial, sans-serif">')
        lines += [*entries, "</g>"]
    return "\n".join([*lines, "</svg>", ""]).encode("utf-8")


def pdf_bytes(pages: Sequence[tuple[Sheet, Drawn]]) -> bytes:
    """Return a file of sheets, each with its `drawn_on` entities, in Helvetica; its title is the name of the first."""
    file = io.BytesIO()
    # not compressed: the output of a compressor depends on its version
    canvas = Canvas(file, invariant=1, pageCompression=0)
    canvas.setTitle(pages[0][0].name)
    canvas.setCreator("scanwright")
    for sheet, shown in pages:
        canvas.setPageSize((sheet.size[0] * POINTS_PER_MM, sheet.size[1] * POINTS_PER_MM))
        _draw_page(canvas, shown)
        canvas.showPage()
    canvas.save()
    return file.getvalue()


def _draw_page(canvas: Canvas, shown: Drawn) -> None:
    canvas.scale(POINTS_PER_MM, POINTS_PER_MM)
    canvas.setLineCap(1)
    write = {"left": canvas.drawString, "middle": canvas.drawCentredString, "right": canvas.drawRightString}
    for item in shown:
        if isinstance(item, Words):
            canvas.saveState()
            canvas.translate(*item.at)
            canvas.rotate(item.angle)
            canvas.setFont("Helvetica", item.height / CAPITAL)
            write[item.anchor](0, 0, item.text)
            canvas.restoreState()
            continue
        outline = canvas.beginPath()
        step = {"M": outline.moveTo, "L": outline.lineTo, "C": outline.curveTo}
        for name, points in _steps(item.path):
            step[name](*(c for point in points for c in point))
        canvas.setLineWidth(WIDTHS[item.layer])
        canvas.setDash(list(DASHES.get(item.layer, ())))
        canvas.drawPath(outline, stroke=int(not item.filled), fill=int(item.filled))


def dxf_bytes(sheet: Sheet) -> bytes:
    """Return DXF R2010 with the views at 1:1 in millimetres; the frame is scaled with them."""
    for name in sorted(sheet.document.entitydb.dxf_types_in_use()):
        sheet.document.classes.add_class(name)  # else in the order of a set, which the hash seed decides
    sheet.document.ezdxf_metadata()["CREATED_BY_EZDXF"] = "scanwright"  # else with the time
    file = io.StringIO()
    with _fixed_dates():
        sheet.document.write(file)
    return file.getvalue().encode("utf-8")


@contextmanager
def _fixed_dates() -> Iterator[None]:
    """Yield with fixed dates and GUIDs in DXF files: a global switch of the library, restored at the end."""
    before = ezdxf.options.write_fixed_meta_data_for_testing  # type: ignore[attr-defined]
    ezdxf.options.write_fixed_meta_data_for_testing = True  # type: ignore[attr-defined]
    try:
        yield
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = before  # type: ignore[attr-defined]


def _steps(path: Path) -> Iterator[tuple[str, list[Point]]]:
    """Yield a move to the start, then lines and cubic curves: M, L or C as SVG has them, and their points."""
    yield "M", [(path.start.x, path.start.y)]
    for command in path.commands():
        controls = [command.ctrl1, command.ctrl2] if isinstance(command, Curve4To) else []
        yield "C" if controls else "L", [(point.x, point.y) for point in (*controls, command.end)]


def _n(value: float) -> str:
    """Return a coordinate to a micrometre, without trailing zeros."""
    text = f"{value:.3f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text
