"""The table of all checks: code, subject, limit, and the source of the limit. A page of the docs prints it.

Constant limits are here, with their reason; limits of products, printer or layout are described.
"""

from dataclasses import replace
from typing import NamedTuple

from scanwright.cad.layout.tightening import HELD_G, LEAST_MARGIN, SHOCK_G
from scanwright.design.arrays import Array
from scanwright.design.findings import Finding, Severity

CLEARANCE_MM = 0.4  # two printed faces, each off by half a nozzle of 0.4 mm at most
SEATED_SHARE, SLOT_SHARE = 0.75, 0.3  # of a head, over a round hole and over a slot
OVERLAP_MM3 = 0.05  # of the meshes of two bodies that touch: their chords
LINKAGE_HIDES_SHARE = 0.03  # of the field of view, beyond servo, ring and shaft; J with parts accounts for it
FREQUENCY_RATIO = 1.2  # of the first natural frequency to the lidar's mirror: clear of its resonance
LEAN_DEG = 1.0  # more than a pose on a robot is usually known to
THIN_SHARE = 0.01  # of the surface: below it a thin spot is a flaw, above it the part is unusable
SMALLEST_HOLE_MM = 1.5  # diameter: smaller ones close when printed


class CheckRow(NamedTuple):
    """One row of the table; `code` is `kind` in `checks.json`, an empty limit means that the check only informs."""

    code: str
    subject: str
    limit: str = ""
    source: str = ""


NOISE = "range noise of the lidar, as an angle at 10 m"
TABLE = (
    CheckRow("unverified", "value of a product that shapes a part and is not verified"),
    CheckRow("module", "module that the task requires", "has a place", "task"),
    CheckRow(
        "clearance", "turning and fixed bodies, over a full turn", f"at least {CLEARANCE_MM:g} mm", "print accuracy"
    ),
    CheckRow("interference", "bodies that move together", f"at most {OVERLAP_MM3:g} mm3", "accuracy of the meshes"),
    CheckRow(
        "driver_access",
        "straight line for a key on every screw's head, in the step of assembly that needs it",
        "none blocked",
        "lengths of keys, ISO 2936",
    ),
    CheckRow(
        "screw_seat",
        "hole of every screw on both sides, and share of the faces around it",
        f"at least {SEATED_SHARE:.0%}, over a slot {SLOT_SHARE:.0%}",
        "chosen",
    ),
    CheckRow("beams_hidden", "beams hidden at every axis angle"),
    CheckRow("beams_partly_hidden", "beams hidden on average over a turn"),
    CheckRow(
        "beams_linkage",
        "beams hidden by the linkage alone",
        f"at most {LINKAGE_HIDES_SHARE:.0%} of the field of view",
        "chosen",
    ),
    CheckRow("centre_of_mass", "distance of the rotor's centre of mass from the axis"),
    CheckRow(
        "static_torque", "torque of the imbalance", "a fifth of the servo's stall torque", "catalogue; rule of thumb"
    ),
    CheckRow(
        "spin_up_torque", "torque to full speed", "a fifth of the servo's stall torque", "catalogue; rule of thumb"
    ),
    CheckRow("flanks", "torque of the imbalance, through the backlash", "friction of ring and bearing", "assumed"),
    CheckRow(
        "tilt_moment", "moment on the servo's horn", "radial load at 10 mm; half of it with a bearing", "catalogue"
    ),
    CheckRow(
        "axial_load",
        "weight along the servo's axis",
        f"axial load of the servo; warning if {SHOCK_G:g} g exceed it",
        "catalogue",
    ),
    CheckRow("bearing_load", f"load across a bearing at {SHOCK_G:g} g", "static load of the bearing", "catalogue"),
    CheckRow("bearing_axial", "load along a bearing"),
    CheckRow("belt_tension", "tighter strand of the belt", "working tension of the belt", "catalogue"),
    CheckRow("belt_angle", "angle between axis and servo encoder", NOISE, "catalogue"),
    CheckRow(
        "waist_torque", "stall torque on the shaft's waist", "yield of aluminium and of steel", "EN 755-2, EN ISO 683-2"
    ),
    CheckRow("shaft_slope", "bend of the shaft at the hub, which `deflection` includes"),
    CheckRow(
        "retention", "each joint under a shock", f"margin {LEAST_MARGIN:g} at {SHOCK_G:g} g; error below 1", "assumed"
    ),
    CheckRow("angle_held", "friction of the hub on its shaft", f"margin {LEAST_MARGIN:g} at {HELD_G:g} g", "assumed"),
    CheckRow(
        "screw", "thread engagement of each joint", "length that carries its preload", "ISO 3506-1; makers' tables"
    ),
    CheckRow(
        "wiring", "circuits, wires, fuses, supply, voltages", "the rules of `design.electrics.rules`", "catalogue"
    ),
    CheckRow("ring_data", "data rating of the slip ring", "data that the lidar sends", "catalogue"),
    CheckRow("leads", "cables between slip ring and lidar, if there are none"),
    CheckRow("lead_bend", "bend radius of a cable", "bend radius of the cable", "catalogue"),
    CheckRow("lead_joint", "straight piece of a cable for its joint", "length of its shrink tube", "chosen"),
    CheckRow("lead_length", "length of a cable"),
    CheckRow("lead_tie", "distance of a cable from its cable-tie anchor"),
    CheckRow("deflection", "constant bend by gravity", f"{NOISE}; error above 1 deg", "catalogue"),
    CheckRow("deflection_turning", "bend by gravity that changes over a turn", NOISE, "catalogue"),
    CheckRow("mount_lean", "lean of the mount", f"warning above {LEAN_DEG:g} deg", "chosen"),
    CheckRow("deck_height", "optical centre above the deck", "10 mm off the height of the task", "chosen"),
    CheckRow(
        "natural_frequency",
        "first natural frequency of linkage, shaft, servo and mount; deck rigid, servo keeps its position",
        f"warning below {FREQUENCY_RATIO:g} times the lidar's scan rate",
        "chosen",
    ),
    CheckRow("bed", "size of a part in its print pose", "bed of the printer", "catalogue"),
    CheckRow("support", "volume of support in the print pose"),
    CheckRow("islands", "layers that start in the air", "warning above 0", "a slicer must support them"),
    CheckRow("wall", "area thinner than min_wall_mm", f"{THIN_SHARE:.0%} of the surface; warning above 0", "printer"),
    CheckRow(
        "smallest_hole", "diameter of the smallest hole", f"at least {SMALLEST_HOLE_MM:g} mm", "smaller ones close"
    ),
)


OTHER_MOUNT = "change [angles] in the task: other values, or ranges that exclude this mount"
LIGHTER = "choose a lighter lidar (sensor)"
STRONGER = "choose a stronger servo (servo) or a lighter lidar (sensor)"
STIFFER = f"{LIGHTER}, or a printer profile with a stiffer plastic (printer)"
LEADS = "choose a ring with thinner or more flexible leads (slip_ring)"
CHANGES = {
    "module": "remove it from [modules] in the task, or change what it needs",
    "clearance": OTHER_MOUNT,
    "interference": OTHER_MOUNT,
    "driver_access": OTHER_MOUNT,
    "screw_seat": OTHER_MOUNT,
    "beams_linkage": OTHER_MOUNT,
    "static_torque": STRONGER,
    "spin_up_torque": f"take a longer period_s in [motion], or {STRONGER}",
    "tilt_moment": STRONGER,
    "axial_load": STRONGER,
    "bearing_load": LIGHTER,
    "belt_tension": f"take a longer period_s in [motion], a ring with a bore (slip_ring), or {LIGHTER}",
    "waist_torque": "choose a servo with a smaller stall torque (servo)",
    "retention": "if a printed part yields, choose a printer profile with nuts or inserts (printer); otherwise a servo "
    "with metal threads (servo), or a lighter lidar (sensor)",
    "angle_held": f"{LIGHTER}, or {OTHER_MOUNT}",
    "screw": "choose a printer profile with another thread (printer)",
    "wiring": "correct the value in the catalogue file, or choose another device",
    "lead_bend": LEADS,
    "lead_joint": LEADS,
    "deflection": f"{STIFFER}, or a shorter ring (slip_ring)",
    "deflection_turning": STIFFER,
    "mount_lean": "correct the holes in [deck] of the task",
    "bed": "choose a printer with a larger bed (printer), or other [angles]",
    "wall": "choose a printer profile with thinner walls (printer), or other [angles]",
    "smallest_hole": "choose a lidar or servo with larger screws",
}
"""What to change if a check fails whose finding has no hint, by the code of the check."""


def with_change(finding: Finding) -> Finding:
    """Return a finding, with what to change as its hint if it fails and has none."""
    if finding.severity != "error" or finding.hint:
        return finding
    return replace(finding, hint=CHANGES.get(finding.code, ""))


def table_page() -> str:
    """Return the table as a page of Markdown."""
    rows = "\n".join(f"| `{row.code}` | {row.subject} | {row.limit or 'informs'} | {row.source} |" for row in TABLE)
    return (
        "# Checks\n\n`scanwright build` writes the result of each check to `checks.json`, where `kind` is the code. "
        "An error fails the build.\n\n| code | what is checked | limit | source of the limit |\n"
        f"| --- | --- | --- | --- |\n{rows}\n"
    )


def at_most(
    code: str,
    value: float,
    limit: float,
    unit: str,
    subject: str,
    what: str,
    error: float | None = None,
    hint: str = "",
) -> Finding:
    """Return an error if the value exceeds the limit or is NaN, a warning if value + error does.

    `subject` is a part or product, `what` the name of the value, `hint` what to do if it does not pass.
    """
    within, surely = value <= limit, value + (error or 0.0) <= limit
    severity: Severity = "ok" if surely else "warning" if within else "error"
    message = f"{subject}: {what}: {with_error(value, error)} {unit} (at most {figures(limit)})"
    return Finding(code, severity, subject, message, tidy(value), tidy(limit), unit, "" if surely else hint)


def at_least(code: str, value: float, limit: float, unit: str, subject: str, what: str) -> Finding:
    """Return an error if the value is below the limit; arguments as for `at_most`."""
    message = f"{subject}: {what}: {figures(value)} {unit} (at least {figures(limit)})"
    return Finding(code, "error" if value < limit else "ok", subject, message, tidy(value), tidy(limit), unit)


def note(code: str, value: float, unit: str, subject: str, what: str, error: float | None = None) -> Finding:
    """Return a value that has no limit; arguments as for `at_most`."""
    message = f"{subject}: {what}: {with_error(value, error)} {unit}"
    return Finding(code, "note", subject, message, tidy(value), None, unit)


def rated(
    code: str, value: float, rating: float | None, unit: str, subject: str, what: str, by: str = "", hint: str = ""
) -> Finding:
    """Return `at_most` of a maker's rating, whose origin is `by`, or a note if the maker states none."""
    if rating is None:
        return note(code, value, unit, subject, f"{what}, unrated by its maker")
    return at_most(code, value, rating, unit, subject, f"{what}{by}", hint=hint)


def with_error(value: float, error: float | None) -> str:
    """Return a value with its uncertainty, if that is known."""
    return figures(value) if error is None else f"{figures(value)} ± {error:.1g}"


def figures(value: float) -> str:
    """Return three significant figures, without an exponent for large numbers."""
    short = f"{value:.3g}"
    return f"{float(short):,.0f}" if "e+" in short else short


def spot(point: Array) -> str:
    """Return a point [mm], shape (3,), for a message, to a tenth."""
    x, y, z = (f"{round(float(c), 1) + 0.0:g}" for c in point)
    return f"at ({x}, {y}, {z}) in the rotation frame"


def tidy(value: float) -> float:
    """Round to four significant digits: further ones depend on the kernel's version."""
    return float(f"{value:.4g}") + 0.0
