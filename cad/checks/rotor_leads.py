"""The leads on the rotor and the cables to the deck: that each has a way, keeps its bend radius, is tied. mm.

What they touch, and the beams that they hide, is checked with all other bodies: they are bodies of the assembly.
"""

from __future__ import annotations

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.checks.check import Check, at_least, note, tidy
from scanwright.cad.layout.cables import joint
from scanwright.cad.layout.cables.leads import RotorLead, tied_mm
from scanwright.cad.layout.names import ROTOR_LEAD, ROTOR_LEADS
from scanwright.cad.layout.tie_seat import TieSeat


def cable_checks(assembly: Assembly) -> list[Check]:
    """Bend and length of every cable that does not turn."""
    found = []
    for lead in assembly.layout.cables:
        if lead.path is None:
            what = (
                f"{lead.name}: from {lead.device} no way to the deck bends by {lead.radius:g} mm or more and clears "
                f"all parts with {lead.diameter:g} mm: lead it away by hand"
            )
            found.append(Check("lead_bend", "warning", None, lead.radius, "mm", lead.name, what))
            continue
        length = lead.path.length()
        found.append(note("lead_length", length, "mm", lead.name, f"from {lead.device} to the edge of foot or deck"))
        if len(lead.path.corners) > 2:
            bend = lead.path.least_radius()
            found.append(at_least("lead_bend", bend, lead.radius, "mm", lead.name, "least bend radius of its middle"))
    return found


def lead_checks(assembly: Assembly) -> list[Check]:
    """Four values of every lead; one word where there are none to check."""
    ring, leads = assembly.layout.scanner.slip_ring, assembly.layout.leads
    if not leads:
        what = "no ring: the cables of the lidar need a loose loop for the sweep"
        if ring is not None:
            what = f"lead_diameter_mm of {ring.name} is not in the catalogue, nor how its leads bend: no way was laid"
        return [Check("leads", "note", None, None, "", ROTOR_LEADS, f"{ROTOR_LEADS}: {what}")]
    seat = assembly.layout.linkage.hub_tie
    return [check for i, lead in enumerate(leads, start=1) for check in _checks(lead, f"{ROTOR_LEAD}_{i}", seat)]


def _checks(lead: RotorLead, where: str, seat: TieSeat | None) -> list[Check]:
    if lead.path is None:
        what = (
            f"{where}: from the outlet at y = {lead.y:g} mm no way to the ring bends by {lead.radius:g} mm or more and "
            f"clears all parts with a bundle of {lead.diameter:g} mm: thinner leads, or another azimuth of the cable"
        )
        return [Check("lead_bend", "warning", None, lead.radius, "mm", where, what)]
    longest = max((piece.length for piece in joint.straights(lead.path)), default=0.0)
    straight = longest if lead.joint is None else lead.joint.piece.length
    tied = None if seat is None else tied_mm(lead, seat)
    what = f"{where}: no tongue of the hub holds it: tie it to what is near"
    if tied is not None:
        what = f"{where}: runs {tied:.1f} mm below the tongue of the hub that it is tied to"
    return [
        at_least("lead_bend", lead.path.least_radius(), lead.radius, "mm", where, "least bend radius of its middle"),
        at_least("lead_joint", straight, joint.LENGTH, "mm", where, "straight piece for its joint"),
        note(
            "lead_length", lead.path.length(), "mm", where, "from the ring's rotor to the jacket of the lidar's cable"
        ),
        Check(
            "lead_tie",
            "note" if tied is None else "pass",
            None if tied is None else tidy(tied),
            None,
            "mm",
            where,
            what,
        ),
    ]
