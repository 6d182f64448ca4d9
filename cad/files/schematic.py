"""`wiring.svg`: boxes in columns from the supply to the lidar, and wires between their pins. Lengths in pixels.

A wire leaves a box at its right and enters another at its left. Each wire between two columns has its own lane to
change height, then space for its text. Wires that pass a column run below all boxes, so no texts overlap; a wire
between two pins of a box is at its right.
"""

import textwrap
from dataclasses import dataclass
from xml.sax.saxutils import escape

from scanwright.design.electrics.network import Box, Network, Wire
from scanwright.design.electrics.rules import check_network
from scanwright.design.findings import sentence

ROW_PX = 22.0  # from pin to pin
LINE_PX = 15.0  # from line to line of text in a box
CHAR_PX = 6.0  # of a letter of the text, the widest included
PAGE_PX = 1100.0  # largest width of cautions: read without scrolling
BOLD_CHAR_PX = 7.0  # likewise, bold
LANE_PX = 9.0
APART_PX = 34.0  # boxes of a column
EDGE_PX = 24.0
HEAD_PX = 54.0
INKS = {
    "red": "#c62828",
    "black": "#222222",
    "brown": "#7b4a1e",
    "blue": "#1f5fbf",
    "green": "#2e7d32",
    "orange": "#d97706",
    "yellow": "#b59a00",
    "white": "#8d8d8d",
    "white-orange": "#e8a33d",
    "white-green": "#66a86a",
}
INK = "#555555"
DANGER = "#c62828"


@dataclass(frozen=True, slots=True)
class _Placed:
    """A box on the sheet."""

    box: Box
    x: float
    y: float
    width: float

    @property
    def first(self) -> float:
        """Return the height of its first pin."""
        return self.y + 24.0 + LINE_PX * len(self.box.lines) + ROW_PX / 2

    @property
    def bottom(self) -> float:
        """Return its lower edge."""
        return self.first + ROW_PX * (max(len(self.box.left), len(self.box.right)) - 0.5) + 4.0

    def left(self, pin: str) -> tuple[float, float]:
        """Return the place of a pin of its left side."""
        return self.x, self.first + ROW_PX * self.box.left.index(pin)

    def right(self, pin: str) -> tuple[float, float]:
        """Return the place of a pin of its right side."""
        return self.x + self.width, self.first + ROW_PX * self.box.right.index(pin)


def schematic_svg(network: Network, title: str) -> str:
    """Return the picture; equal networks give equal text."""
    columns = sorted({box.column for box in network.boxes})
    place = {box.name: columns.index(box.column) for box in network.boxes}
    spans = [(place[wire.start[0]], place[wire.end[0]]) for wire in network.wires]
    width = _right_edge(network, _placed(network, columns, spans, HEAD_PX))
    warnings = _warnings(network, width)
    boxes = _placed(network, columns, spans, HEAD_PX + LINE_PX * len(warnings))
    floor = max(placed.bottom for placed in boxes.values()) + 26.0
    lanes = [0] * len(columns)
    far, drawn = 0, []
    for wire, (first, last) in zip(network.wires, spans, strict=True):
        if wire.start[0] == wire.end[0]:
            drawn.append(_bridge(wire, boxes[wire.start[0]]))
            continue
        start, end = boxes[wire.start[0]].right(wire.start[1]), boxes[wire.end[0]].left(wire.end[1])
        points = [start, *_turn(boxes, columns[first], lanes, first, start[1])]
        if last > first + 1:
            low = floor + 14.0 * far
            far += 1
            entry = _turn(boxes, columns[last - 1], lanes, last - 1, low)
            points += [(points[-1][0], low), *entry, (entry[0][0], end[1])]
        else:
            points.append((points[-1][0], end[1]))
        drawn.append(_line(wire, [*points, end]))
        drawn.append(_text(end[0] - 8.0, end[1] - 4.0, wire.words, ink=_ink(wire), anchor="end"))
    height = floor + 14.0 * far + 34.0
    note = "Wires cross without a joint. A wire without a colour may have any: only its pins count."
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_n(width)} {_n(height)}" width="{_n(width)}" '
            f'height="{_n(height)}" font-family="DejaVu Sans, Helvetica, Arial, sans-serif" font-size="11">',
            '<rect width="100%" height="100%" fill="#ffffff"/>',
            _text(EDGE_PX, 30.0, title, size=16, bold=True),
            *(_text(EDGE_PX, HEAD_PX + LINE_PX * i, line, bold=True, ink=DANGER) for i, line in enumerate(warnings)),
            *drawn,
            *(line for placed in boxes.values() for line in _box(placed)),
            _text(EDGE_PX, height - 14.0, note),
            "</svg>",
            "",
        ]
    )


def _warnings(network: Network, width: float) -> list[str]:
    """Return the lines of broken rules, as wide as the sheet, and a reference to the cautions."""
    broken = [f"DO NOT BUILD THIS: {sentence(fault)}." for fault in check_network(network)]
    cautions = [f"CAUTION: read the {len(network.cautions)} cautions of wiring.md before you join a wire."]
    return [
        line
        for text in (*broken, *cautions)
        for line in textwrap.wrap(text, int((min(width, PAGE_PX) - 2 * EDGE_PX) / BOLD_CHAR_PX))
    ]


def _right_edge(network: Network, boxes: dict[str, _Placed]) -> float:
    """Return the width of the sheet: boxes, and the bridges with their text right of the last one."""
    words = [len(wire.words) for wire in network.wires if wire.start[0] == wire.end[0]]
    bridges = 3 * LANE_PX + CHAR_PX * max(words) if words else 0.0
    return max(placed.x + placed.width for placed in boxes.values()) + bridges + EDGE_PX


def _placed(network: Network, columns: list[int], spans: list[tuple[int, int]], top: float) -> dict[str, _Placed]:
    """Place columns as wide as their text, gaps as wide as their lanes and the text on the wires that end there."""
    placed: dict[str, _Placed] = {}
    x = EDGE_PX
    for i, column in enumerate(columns):
        boxes = [box for box in network.boxes if box.column == column]
        width = max(_width(box) for box in boxes)
        y = top
        for box in boxes:
            # pins of neighbouring columns are half a row apart: no two wires lie on one line
            y += (i % 2 * ROW_PX / 2 - _Placed(box, x, y, width).first) % ROW_PX
            placed[box.name] = _Placed(box, x, y, width)
            y = placed[box.name].bottom + APART_PX
        words = [len(wire.words) for wire, (_, last) in zip(network.wires, spans, strict=True) if last == i + 1]
        crossing = sum((first == i) + (last == i + 1 and last > first + 1) for first, last in spans)
        x += width + LANE_PX * (crossing + 2) + CHAR_PX * max(words, default=0) + 14.0
    return placed


def _width(box: Box) -> float:
    pins = max((len(pin) for pin in box.left), default=0) + max((len(pin) for pin in box.right), default=0) + 4
    longest = max(1.15 * len(box.title), *(len(line) for line in box.lines), pins)
    return CHAR_PX * longest + 18.0


def _turn(boxes: dict[str, _Placed], column: int, lanes: list[int], gap: int, y: float) -> list[tuple[float, float]]:
    """Return the next free lane right of a column, at a height."""
    edge = next(placed.x + placed.width for placed in boxes.values() if placed.box.column == column)
    lanes[gap] += 1
    return [(edge + LANE_PX * (lanes[gap] + 0.5), y)]


def _bridge(wire: Wire, placed: _Placed) -> str:
    """Draw a wire from a pin on the right of a box to another one there."""
    (x, start), (_, end) = placed.right(wire.start[1]), placed.right(wire.end[1])
    words = _text(x + 2.5 * LANE_PX, (start + end) / 2 + 4.0, wire.words)
    return _line(wire, [(x, start), (x + 2 * LANE_PX, start), (x + 2 * LANE_PX, end), (x, end)]) + "\n" + words


def _line(wire: Wire, points: list[tuple[float, float]]) -> str:
    thick = 1.2 if wire.mm2 == 0 else 1.6 + 0.6 * wire.mm2
    path = " ".join(f"{_n(x)},{_n(y)}" for x, y in points)
    return f'<polyline points="{path}" fill="none" stroke="{_ink(wire)}" stroke-width="{_n(thick)}"/>'


def _ink(wire: Wire) -> str:
    return INKS.get(wire.colour, INK)


def _box(placed: _Placed) -> list[str]:
    box, x, y = placed.box, placed.x, placed.y
    lines = [
        f'<rect x="{_n(x)}" y="{_n(y)}" width="{_n(placed.width)}" height="{_n(placed.bottom - y)}" rx="4" '
        'fill="#f6f6f4" stroke="#222222" stroke-width="1.4"/>',
        _text(x + 9.0, y + 18.0, box.title, bold=True),
        *(_text(x + 9.0, y + 18.0 + LINE_PX * (i + 1), line) for i, line in enumerate(box.lines)),
    ]
    sides = [(placed.left(pin), pin, "start", 9.0) for pin in box.left]
    sides += [(placed.right(pin), pin, "end", -9.0) for pin in box.right]
    for (at, height), pin, anchor, inwards in sides:
        fill = "#ffffff" if pin in box.free else "#222222"
        lines.append(f'<circle cx="{_n(at)}" cy="{_n(height)}" r="3" fill="{fill}" stroke="#222222"/>')
        lines.append(_text(at + inwards, height + 4.0, pin, anchor=anchor))
    return lines


def _text(
    x: float, y: float, words: str, *, size: int = 11, bold: bool = False, ink: str = "#222222", anchor: str = "start"
) -> str:
    weight = ' font-weight="bold"' if bold else ""
    return (
        f'<text x="{_n(x)}" y="{_n(y)}" font-size="{size}" fill="{ink}" text-anchor="{anchor}"{weight}>'
        f"{escape(words)}</text>"
    )


def _n(value: float) -> str:
    return f"{round(value, 1) + 0.0:g}"
