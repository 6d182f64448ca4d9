"""`drawings/<part>.pdf`, `.dxf` and `.svg` of every made part."""

from __future__ import annotations

import math

from cad.assembly.assembly import Assembly
from cad.assembly.joints import Joint
from cad.drawings.part import Part, azimuth_deg, part_of, planes_across
from cad.drawings.patterns import number
from cad.drawings.sheet import Sheet, Title, sheet_of
from cad.drawings.write import dxf_bytes, pdf_bytes, svg_bytes
from cad.files.bom import drawing_number
from cad.geometry.holes import Round
from cad.layout.balance import PART as COUNTERWEIGHT
from cad.layout.balance import SCREW as BAR_SCREW
from cad.layout.balance import Counterweight
from cad.layout.fits import OnSheet
from design.scanner import Scanner

HOLDS = ("thread", "trap")  # what of a joint a part holds itself
AT_M = 10.0  # distance at which a wrong angle is judged


def drawing_files(
    scanner: Scanner,
    assembly: Assembly,
    rounds: dict[str, list[Round]],
    joints: list[Joint],
    masses_g: dict[str, float],
    metal: set[str],
    config_hash: str,
) -> dict[str, bytes]:
    """Draw every made part; `rounds` are its cylinders, the other arguments those of `bom.items_of`."""
    files: dict[str, bytes] = {}
    for name in assembly.made:
        sheet = drawing_of(name, scanner, assembly, rounds[name], joints, masses_g[name], metal, config_hash)
        files[f"drawings/{name}.pdf"] = pdf_bytes(sheet)
        files[f"drawings/{name}.svg"] = svg_bytes(sheet)
        files[f"drawings/{name}.dxf"] = dxf_bytes(sheet)
    return files


def drawing_of(
    name: str,
    scanner: Scanner,
    assembly: Assembly,
    rounds: list[Round],
    joints: list[Joint],
    mass_g: float,
    metal: set[str],
    config_hash: str,
) -> Sheet:
    """The sheet of one part."""
    lidar_axis = assembly.stack.R()[:, 2] if name in _carriers(joints) else None
    lathed = name in assembly.drive.turned()
    said = assembly.drive.on_sheets().get(name, OnSheet())
    part = part_of(assembly.made[name], rounds, lidar_axis, said)
    material = "aluminium or steel, turned" if lathed else f"{scanner.printer.name}, solid"
    if isinstance(assembly.counterweight, Counterweight) and name == COUNTERWEIGHT:
        material = assembly.counterweight.stock
    cells = (
        ("part", name),
        ("task", scanner.angles.task),
        ("drawing number", drawing_number(config_hash, name, assembly)),
        ("material", material),
        ("mass", f"{mass_g:.1f} g"),
        ("configuration", config_hash),
        ("general tolerances", "ISO 2768-m" if name in metal else "ISO 2768-c"),
        ("made by", "scanwright"),
    )
    notes = _notes(scanner, part, said, [] if lathed else [_making(scanner, name)])
    return sheet_of(part, Title(cells, tuple(notes)), f"{name} {config_hash}")


def _carriers(joints: list[Joint]) -> set[str]:
    """The part that the lidar is screwed to, and the one that this is screwed to in turn."""
    seats = {joint.part for joint in joints if joint.onto.startswith("lidar")}
    return seats | {joint.onto for joint in joints if joint.part in seats and joint.fixing in HOLDS} - {
        "lidar_body",
        COUNTERWEIGHT,
    }


def _making(scanner: Scanner, name: str) -> str:
    """What the model says, and does not say, to whoever makes the part."""
    printer = scanner.printer
    if name == COUNTERWEIGHT:
        return f"Holes of {number(BAR_SCREW.core)}: thread {BAR_SCREW.name} all through."
    return (
        f"Clearances of {printer.name} are in the model: screws {number(printer.screw_clearance_mm)}, "
        f"fits {number(printer.fit_clearance_mm)} on the diameter."
    )


def _notes(scanner: Scanner, part: Part, said: OnSheet, making: list[str]) -> list[str]:
    angles = scanner.angles.angles_deg
    box = part.solid.BoundingBox()
    axis, zero = "rotation axis", "Z 0 is"
    if any(said.axis):
        axis, zero = "axis of the servo's horn", "Their zero is X {}, Y {}, Z".format(*map(number, said.axis))
    notes = [
        f"Millimetres. Ordinates run from the {axis} (X, Y) and the lowest point (Z), azimuths from +Y.",
        f"{zero} {number(part.datum)} in the rotation frame of the STEP file (0: optical centre; +Y: index marks).",
        f"Envelope {number(box.xlen)} x {number(box.ylen)} x {number(box.zlen)} along X, Y, Z.",
        *said.notes,
        *(f"Ø{number(fit.diameter)} {fit.tolerance}: {fit.why}." for fit in part.fits),
        *making,
    ]
    inclined = [p for p in part.patterns if len(p.holes) >= 3 and abs(p.direction[2]) < 1 - 1e-6]
    for pattern in inclined[:1]:
        x, y, z = (number(float(c)) for c in pattern.centre - [0.0, 0.0, part.datum])
        notes.append(f"Middle of {pattern.words()}, lower ends: X {x}, Y {y}, Z {z}.")
    if part.lidar_axis is not None:
        normal = part.lidar_axis
        tilt = math.degrees(math.acos(min(1.0, float(normal[2]))))
        limit = math.degrees(math.atan2(scanner.lidar.range_sigma_mm, AT_M * 1000))
        notes.append(
            f"alpha_laser {angles.alpha_laser:g}°, beta_laser {angles.beta_laser:g}°: tilt {number(tilt)}°"
            + (
                f" towards {number(azimuth_deg(normal))}° from +Y, counter-clockwise from above."
                if tilt > 0.01
                else "."
            )
        )
        seat = -planes_across(part.solid, normal)[0]
        notes.append(f"The largest face across the lidar's axis lies {number(seat)} below the optical centre.")
        if any(item.hole for item in part.axial):
            notes.append(
                f"Seat to bore within {limit:.2f}°: more moves a point at {AT_M:g} m by the noise of "
                f"{scanner.lidar.name} ({scanner.lidar.range_sigma_mm:g} mm)."
            )
    elif inclined:
        notes.append(f"alpha_rot {angles.alpha_rot:g}°, beta_rot {angles.beta_rot:g}°: the axis on the deck.")
    return notes
