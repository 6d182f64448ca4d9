"""`wiring.svg` and `wiring.md`: the wiring of a scanner as a drawing and as text, with the load of each wire.

The drawing has boxes in columns from the supply to the lidar, and wires between their pins; lengths in pixels. A wire
leaves a box at its right and enters another at its left. Each wire between two columns has its own lane to change
height, then space for its text. Wires that pass a column run below all boxes, so no texts overlap; a wire between two
pins of a box is at its right.
"""

import textwrap
from dataclasses import dataclass
from xml.sax.saxutils import escape

from scanwright.cad.parts.part_spec import BENCH
from scanwright.design.electrics.loads import COMPUTER_W, LEADS_M, SUPPLY_V
from scanwright.design.electrics.network import Box, Network, Wire
from scanwright.design.electrics.rules import check_network
from scanwright.design.electrics.sizing import OVER_PEAK
from scanwright.design.electrics.wiring import network_of
from scanwright.design.findings import sentence
from scanwright.design.scanner import Scanner

GROUND = (
    "One ground: connect every - to the - bar of the distribution, the case of a mains supply to protective earth, and "
    "the shield of a data cable at the computer's end only. Wire with the supply off and F0 removed; measure from each "
    "+ to - before you insert F0."
)
STALLED = (
    "A blocked servo draws its stall current until its own protection acts: the supply, F0 and its branch carry that "
    "current, and everything else keeps running."
)
Section = tuple[list[str], list[str]]  # items of a list, then paragraphs
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


def wiring_files(scanner: Scanner, digest: str) -> dict[str, bytes]:
    """Return both files by name; `digest` identifies the configuration."""
    network = network_of(scanner)
    title = f"{scanner.angles.task}: wiring ({digest})"
    return {
        "wiring.svg": schematic_svg(network, title).encode("utf-8"),
        "wiring.md": wiring_text(network, title).encode("utf-8"),
    }


def wiring_text(network: Network, title: str) -> str:
    """Return the text: paragraphs and lists, no tables, as the report shows them."""
    sections: dict[str, Section] = {
        "Do not build this wiring": ([sentence(broken) for broken in check_network(network)], []),
        "Caution": ([*network.cautions], [GROUND]),
        BENCH: (_bench(network), []),
        "Power": _power(network),
        "Slip ring": _ring(network),
        "Wires": _wires(network),
        "Data through the ring": ([], [*network.risks]),
        "Unknown": ([sentence(unknown) for unknown in network.unknown], []),
    }
    blocks = [f"# {title}"]
    for heading, (items, paragraphs) in sections.items():
        if items or paragraphs:
            listed = ["\n".join(f"- {item}" for item in items)] if items else []
            blocks += [f"## {heading}", *listed, *paragraphs]
    return "\n\n".join(blocks) + "\n"


def _bench(network: Network) -> list[str]:
    """Return how to power and connect the servo before it is built in."""
    titles = {box.name: box.title for box in network.boxes}
    plus, minus = (next(wire for wire in network.wires if wire.end == ("servo", pin)) for pin in ("V", "GND"))
    feed = f"{titles[plus.start[0]]} {plus.start[1]}"
    return [
        f"Wire the supply up to {feed}. Insert F0, switch on, measure {plus.net} from {plus.start[1]} to "
        f"{minus.start[1]}, and switch off.",
        f"Power: cut one servo cable, join its V to {plus.start[1]} and its GND to {minus.start[1]}, and insulate its "
        f"data wires. Switch on, measure {plus.net} from V to GND at its plug, switch off, and plug it in.",
        "Data: plug the second servo cable, whole, into the servo's other socket and the adapter, and the adapter "
        "into the computer. Switch on.",
    ]


def _power(network: Network) -> Section:
    continuous, peak = (
        sum(getattr(branch, name) for branch in network.branches) for name in ("continuous_a", "peak_a")
    )
    items = [
        *(
            f"{branch.name}, {branch.feeds}: {branch.continuous_a:.2g} A continuous, {branch.peak_a:.2g} A at most, "
            f"fuse {branch.fuse_a:g} A, wires {branch.mm2:g} mm²"
            for branch in network.branches
        ),
        f"all at 12 V: {continuous:.2g} A continuous ({12 * continuous:.0f} W), {peak:.2g} A at most "
        f"({12 * peak:.0f} W); supply {network.supply_a:g} A",
        *(
            f"{drop.device} gets {drop.idle_v:.2f} V at rest and {drop.volts:.2f} V at its largest current, and "
            f"accepts {drop.least:g} to {drop.most:g} V ({LEADS_M:g} m of wires, and the ring if it is behind it)"
            for drop in network.drops
        ),
    ]
    sources = (
        "Currents are those of the catalogue: `scanwright catalogue NAME` prints source and uncertainty; the computer "
        f"is assumed to use {COMPUTER_W:g} W. A fuse carries {OVER_PEAK:g} times the peak of its branch, a wire its "
        f"fuse. {STALLED}"
    )
    return items, [_on_robot(network, peak), sources]


def _on_robot(network: Network, peak_a: float) -> str:
    """Return what replaces the mains supply on a robot."""
    words = (
        f"On a robot, a DC/DC converter from its battery to {SUPPLY_V:g} V and at least {peak_a:.2g} A replaces the "
        "mains supply; its input must accept the battery full and empty."
    )
    direct = [drop for drop in network.drops if drop.idle_v == SUPPLY_V]  # without a converter
    if not direct:
        return words
    least, most = max(drop.least + drop.idle_v - drop.volts for drop in direct), min(drop.most for drop in direct)
    return (
        f"{words} A battery within {least:.1f} to {most:g} V needs none if each converter behind it accepts that; "
        f"below {SUPPLY_V:g} V the servo has less torque than the checks assume."
    )


def _ring(network: Network) -> Section:
    items = []
    for circuit in network.circuits:
        use = f"spare, {circuit.rated_a:g} A"
        if circuit.net:
            load = f"{circuit.amps:g} A of {circuit.rated_a:g}, factor {circuit.rated_a / (circuit.amps or 1):.2g}"
            use = f"{circuit.net}, {load if circuit.amps else 'signal'}"
        items.append(f"{circuit.number}: {use}")
    numbers = (
        "The numbers are assigned here: the makers of these rings number no circuits. If the leads differ in "
        "thickness, the thick ones are the circuits with the higher current. Set a multimeter to continuity, find the "
        "two ends of each circuit, stator and rotor, and write its number on both."
    )
    return items, [numbers] if items else []


def _wires(network: Network) -> Section:
    titles = {box.name: box.title for box in network.boxes}
    items = [
        f"{titles[wire.start[0]]} {wire.start[1]} to {titles[wire.end[0]]} {wire.end[1]}: {wire.words}"
        + (f", {wire.amps:.2g} A" if wire.amps else "")
        for wire in network.wires
    ]
    sources = {wire.source: None for wire in network.wires if wire.source}
    return items, [f"Sources of the colours: {'; '.join(sources)}. A wire without a colour may have any."]
