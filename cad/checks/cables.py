"""Paths of the cables: bend radius, length, straight piece for a joint, tie. Millimetres.

Clearance and hidden beams are checked with all other bodies, since cables are bodies of the assembly.
"""

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.checks.table import at_least, note, tidy
from scanwright.cad.layout.cables.lead_joint import JOINT_LENGTH, straights
from scanwright.cad.layout.cables.leads import RotorLead, tied_mm
from scanwright.cad.layout.cables.route import Path
from scanwright.cad.layout.names import ROTOR_LEAD, ROTOR_LEADS
from scanwright.cad.layout.tie_seat import TieSeat
from scanwright.design.findings import Finding


def fixed_cable_checks(assembly: Assembly) -> list[Finding]:
    """Check bend and length of every cable that does not turn."""
    checks = []
    for cable in assembly.layout.cables:
        if cable.path is None:
            what = f"no path from {cable.device} to the deck"
            checks.append(_no_path(cable.name, what, cable.radius, cable.diameter, "lay it yourself"))
            continue
        length = cable.path.length()
        checks.append(note("lead_length", length, "mm", cable.name, f"from {cable.device} to the edge of foot or deck"))
        if len(cable.path.corners) > 2:
            checks.append(_bend(cable.name, cable.path, cable.radius))
    return checks


def rotor_cable_checks(assembly: Assembly) -> list[Finding]:
    """Check bend, joint, length and tie of every cable between slip ring and lidar; a note if there is none."""
    ring, leads = assembly.layout.scanner.slip_ring, assembly.layout.leads
    if not leads:
        what = "no ring: the cables of the lidar need a loose loop for the sweep"
        if ring is not None:
            what = f"no path: the catalogue has no lead_diameter_mm or bend radius of {ring.name}"
        return [Finding("leads", "note", ROTOR_LEADS, f"{ROTOR_LEADS}: {what}")]
    seat = assembly.layout.linkage.hub_tie
    return [check for i, lead in enumerate(leads, start=1) for check in _checks(lead, f"{ROTOR_LEAD}_{i}", seat)]


def _checks(lead: RotorLead, subject: str, seat: TieSeat | None) -> list[Finding]:
    if lead.path is None:
        what = f"no path from the outlet at y = {lead.y:g} mm to the ring"
        hint = "choose thinner leads, or another azimuth of the cable"
        return [_no_path(subject, what, lead.radius, lead.diameter, hint)]
    longest = max((piece.length for piece in straights(lead.path)), default=0.0)
    straight = longest if lead.joint is None else lead.joint.piece.length
    tied = None if seat is None else tied_mm(lead, seat)
    what, hint = f"{subject}: no slotted tab of the hub is near", "tie it to the part next to it"
    tie = Finding("lead_tie", "note", subject, what, hint=hint)
    if tied is not None:
        what = f"{subject}: runs {tied:.1f} mm below the slotted tab of the hub that it is tied to"
        tie = Finding("lead_tie", "ok", subject, what, tidy(tied), None, "mm")
    return [
        _bend(subject, lead.path, lead.radius),
        at_least("lead_joint", straight, JOINT_LENGTH, "mm", subject, "straight piece for its joint"),
        note("lead_length", lead.path.length(), "mm", subject, "from the ring's rotor to the jacket of the cable"),
        tie,
    ]


def _bend(subject: str, path: Path, radius: float) -> Finding:
    return at_least("lead_bend", path.least_radius(), radius, "mm", subject, "least bend radius of its centre line")


def _no_path(subject: str, what: str, radius: float, diameter: float, hint: str) -> Finding:
    message = f"{subject}: {what} allows bend radii of {radius:g} mm or more and a diameter of {diameter:g} mm"
    return Finding("lead_bend", "warning", subject, message, None, radius, "mm", hint)
