"""`drawings/<part>.pdf`, `.dxf` and `.svg` of every made part, and `template.pdf`: every hole pattern at 1:1."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.drawings.dimensions import centre_mark, ordinates
from scanwright.cad.drawings.patterns import Part, azimuth_deg, counted, number, part_of, planes_across
from scanwright.cad.drawings.pen import Pen, document_at
from scanwright.cad.drawings.sheet import Sheet, Title, sheet_of
from scanwright.cad.drawings.write import drawn_on, dxf_bytes, pdf_bytes, svg_bytes
from scanwright.cad.layout.drive import products_of
from scanwright.cad.layout.joints import ScrewPattern
from scanwright.cad.layout.loads import FAR_MM, noise_deg
from scanwright.cad.layout.names import DECK, LIDAR_BODY, RING_STATOR, SERVO_CASE, SERVO_HORN, SERVO_OUTPUT
from scanwright.cad.parts.part_spec import PartSpec, Process
from scanwright.design.catalogue.measuring import measure_first
from scanwright.design.catalogue.products import Printer
from scanwright.design.scanner import Scanner

MADE: dict[Process, str] = {"printed": "as printed, sanded or reamed to it", "turned": "turned", "sawn": "drilled"}
AT_M = FAR_MM / 1000  # distance up to which a wrong angle is judged
A4, A3 = (210.0, 297.0), (297.0, 420.0)
MARGIN_MM, HEAD_MM, LINE_MM = 15.0, 45.0, 5.0
SCALE_MM = 100
AROUND_MM = 20.0  # of a pattern, for its dimensions


def drawing_files(assembly: Assembly, masses_g: dict[str, float]) -> dict[str, bytes]:
    """Draw every made part; `masses_g` are of the made parts."""
    files: dict[str, bytes] = {}
    for name in assembly.made:
        sheet = drawing_of(name, assembly, masses_g[name])
        shown = list(drawn_on(sheet))
        files[f"drawings/{name}.pdf"] = pdf_bytes([(sheet, shown)])
        files[f"drawings/{name}.svg"] = svg_bytes(sheet, shown)
        files[f"drawings/{name}.dxf"] = dxf_bytes(sheet)
    return files


def drawing_of(name: str, assembly: Assembly, mass_g: float) -> Sheet:
    """Return the sheet of one part."""
    spec, scanner, digest = assembly.parts[name], assembly.layout.scanner, assembly.layout.digest
    lidar_axis = None if spec.seat is None else assembly.layout.stack.R()[:, 2]
    part = part_of(spec, assembly.made[name], lidar_axis, assembly.layout.joints)
    material = f"{spec.material}, turned" if spec.process == "turned" else spec.material
    cells = (
        ("part", name),
        ("task", scanner.angles.task),
        ("drawing number", drawing_number(name, assembly)),
        ("material", material or f"{scanner.printer.name}, solid"),
        ("mass", f"{mass_g:.1f} g"),
        ("configuration", digest),
        ("general tolerances", "ISO 2768-mK" if spec.metal else "ISO 2768-cL"),
        ("made by", "scanwright"),
    )
    notes = _notes(scanner, part, spec)
    products = products_of(scanner, assembly.layout.drive)
    notes += [words for product in products if (words := measure_first(product, *spec.values_of(product)))]
    return sheet_of(part, Title(cells, tuple(notes)), f"{name} {digest}")


def drawing_number(part: str, assembly: Assembly) -> str:
    """Return the number of a made part: configuration and place in the assembly."""
    return f"{assembly.layout.digest}-{list(assembly.made).index(part) + 1}"


def _making(process: Process, printer: Printer, part: Part) -> list[str]:
    """Return the notes on finish and on the clearances of the model."""
    if process != "printed":
        threads = ", threads countersunk to their diameter" if part.patterns else ""
        finish = "Ra 3.2, faces with a fit Ra 0.8" if part.fits else "Ra 3.2"
        return [f"{finish} (ISO 21920-1). Edges broken 0.2 to 0.4 x 45°{threads}."]
    return [
        f"Clearances of {printer.name} are in the model: screws {number(printer.screw_clearance_mm)}, "
        f"fits {number(printer.fit_clearance_mm)} on the diameter.",
        "Printed in the pose of its print file, which also has the engraved label.",
        "Tight screw holes drilled to size; all else as printed.",
    ]


def _notes(scanner: Scanner, part: Part, spec: PartSpec) -> list[str]:
    angles = scanner.angles.angles_deg
    box = part.solid.BoundingBox()
    axis, zero = "rotation axis", "Z 0 is"
    if any(spec.axis):
        axis, zero = "axis of the servo's horn", "Their zero is X {}, Y {}, Z".format(*map(number, spec.axis))
    notes = [
        f"Millimetres. Ordinates run from the {axis} (X, Y) and the lowest point (Z), azimuths from +Y.",
        f"{zero} {number(part.datum)} in the rotation frame of the STEP file (0: optical centre; +Y: index marks).",
        f"Envelope {number(box.xlen)} x {number(box.ylen)} x {number(box.zlen)} along X, Y, Z.",
        *spec.notes,
        *(f"Ø{number(fit.diameter)} {fit.tolerance}: {fit.why}, {MADE[spec.process]}." for fit in part.fits),
        *_making(spec.process, scanner.printer, part),
    ]
    inclined = [p for p in part.patterns if len(p.holes) >= 3 and abs(p.direction[2]) < 1 - 1e-6]
    for pattern in inclined[:1]:
        x, y, z = (number(float(c)) for c in pattern.centre - [0.0, 0.0, part.datum])
        bare = replace(pattern, heads=0.0, holds="")
        notes.append(f"Middle of {bare.words()}, lower ends: X {x}, Y {y}, Z {z}.")
        notes.append(f"What they pass, without recesses for heads, is {number(pattern.holes[0].length)} thick.")
    if part.lidar_axis is not None:
        normal = part.lidar_axis
        tilt = math.degrees(math.acos(min(1.0, float(normal[2]))))
        towards = (
            f" towards {number(azimuth_deg(normal))}° from +Y, counter-clockwise from above" if tilt > 0.01 else ""
        )
        laser = f"alpha_laser {angles.alpha_laser:g}°, beta_laser {angles.beta_laser:g}°"
        notes.append(f"{laser}: tilt {number(tilt)}°{towards}.")
        seat = -planes_across(part.solid, normal)[0]
        notes.append(f"The largest face across the lidar's axis lies {number(seat)} below the optical centre.")
        if any(item.hole for item in part.axial):
            notes.append(
                f"Seat to bore within {noise_deg(scanner):.2f}°: more moves a point within {AT_M:g} m by the range "
                f"noise of {scanner.lidar.name}."
            )
    elif inclined:
        notes.append(f"alpha_rot {angles.alpha_rot:g}°, beta_rot {angles.beta_rot:g}°: the axis on the deck.")
    return notes


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
