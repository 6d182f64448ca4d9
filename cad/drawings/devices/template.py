"""`template.pdf`: every hole pattern that a scanner uses at 1:1, with a scale to check the printer."""

from collections.abc import Sequence

import numpy as np

from scanwright.cad.drawings.dimensions import centre_mark, ordinates
from scanwright.cad.drawings.patterns import counted
from scanwright.cad.drawings.pen import Pen, document_at
from scanwright.cad.drawings.sheet import Sheet
from scanwright.cad.drawings.write import drawn_on, pdf_bytes
from scanwright.cad.layout.joints import ScrewPattern
from scanwright.cad.layout.names import DECK, LIDAR_BODY, RING_STATOR, SERVO_CASE, SERVO_HORN, SERVO_OUTPUT
from scanwright.design.scanner import Scanner

A4, A3 = (210.0, 297.0), (297.0, 420.0)
MARGIN_MM, HEAD_MM, LINE_MM = 15.0, 45.0, 5.0
SCALE_MM = 100
AROUND_MM = 20.0  # of a pattern, for its dimensions


def template_pdf(scanner: Scanner, patterns: Sequence[ScrewPattern]) -> bytes:
    """Return the template, a page for each pattern."""
    names = {LIDAR_BODY: scanner.lidar.name, RING_STATOR: getattr(scanner.slip_ring, "name", ""), DECK: "deck"}
    names |= dict.fromkeys((SERVO_CASE, SERVO_HORN, SERVO_OUTPUT), scanner.servo.name)
    words = {SERVO_HORN: ", horn", SERVO_OUTPUT: ", horn", SERVO_CASE: ", case"}
    sheets = [_page(pattern, names[pattern.device] + words.get(pattern.device, "")) for pattern in patterns]
    return pdf_bytes([(sheet, list(drawn_on(sheet))) for sheet in sheets])


def _page(pattern: ScrewPattern, device: str) -> Sheet:
    places = np.array(pattern.places)
    low, high = places.min(axis=0) - AROUND_MM, places.max(axis=0) + AROUND_MM
    wide, tall = np.maximum(high, 0) - np.minimum(low, 0)
    size = A4 if wide <= A4[0] - 2 * MARGIN_MM and tall <= A4[1] - 2 * MARGIN_MM - HEAD_MM else A3
    document = document_at(1.0)
    pen = Pen(document.modelspace(), 1.0)
    title = f"{device}: {counted(len(places))}{pattern.screw.name} that hold {pattern.part}"
    lines = (
        title,
        "Print at 100 % (actual size), then measure the scale below: 100 mm.",
        "Lay the paper on the device's face, printed side up, and push a screw of this size through each cross.",
        f"Millimetres from {pattern.origin}.",
    )
    for i, line in enumerate(lines):
        pen.text((MARGIN_MM, size[1] - MARGIN_MM - LINE_MM * (i + 1)), line, height=3.0 if i else 4.0)
    middle = (size[0] / 2, (size[1] - HEAD_MM + MARGIN_MM) / 2)
    start = (middle[0] - float(low[0] + high[0]) / 2, middle[1] - float(low[1] + high[1]) / 2)
    drawing = Pen(document.modelspace(), 1.0, start)
    for x, y in pattern.places:
        drawing.arc("VISIBLE", (x, y), pattern.screw.nominal / 2)
        centre_mark(drawing, (x, y), pattern.screw.nominal)
    centre_mark(drawing, (0.0, 0.0), 1.0)
    left, bottom, _, _ = drawing.box()
    ordinates(drawing, dict(pattern.places) | {0.0: 0.0}, bottom, below=True)
    ordinates(drawing, {y: x for x, y in pattern.places} | {0.0: 0.0}, left, below=False)
    foot = Pen(document.modelspace(), 1.0, ((size[0] - SCALE_MM) / 2, MARGIN_MM))
    foot.stroke("VISIBLE", ((0.0, 0.0), (float(SCALE_MM), 0.0)))
    for tick in range(0, SCALE_MM + 1, 10):
        foot.stroke("VISIBLE", ((float(tick), 0.0), (float(tick), 4.0 if tick % 50 == 0 else 2.0)))
        foot.text((float(tick), 5.0), f"{tick}", anchor="middle")
    return Sheet(document, 1.0, size, title)
