"""Instructions for laying the cables: where each leaves its device, how long it is, where its joint is."""

from __future__ import annotations

import math

from scanwright.cad.layout.cables.joint import LENGTH
from scanwright.cad.layout.cables.leads import RotorLead, tied_mm
from scanwright.cad.layout.layout import Layout

SPARE = 15.0  # mm more than its way, so that a joint can be made once again
HUB, SHAFT, NECK, PLATE, FOOT = "hub", "shaft", "neck", "plate", "foot of the mount"  # where cables are tied


def leads_text(layout: Layout) -> str:
    """Return the instructions for the leads between lidar and ring."""
    leads = layout.leads
    straight = layout.scanner.lidar.cable_straight_mm
    laid = [lead for lead in leads if lead.path is not None]
    lines = [
        f"Take the jacket of the lidar's cable off {straight:g} mm behind the lidar: that much stays straight, and the "
        "bare wires behind it go on as one bundle with the leads of the ring, the way that the picture shows.",
        *(_one(layout, lead) for lead in laid),
        f"Crimp the wires of each bundle side by side on a straight piece, with {LENGTH:g} mm of shrink tube "
        "over all of them; the wiring diagram tells which belong together. "
        f"The {SPARE:g} mm that are left go back along the joint, under the same tube.",
        *_ties(layout),
    ]
    missing = [lead for lead in leads if lead.path is None]
    lines += [
        f"For the cable that leaves the lidar at y = {lead.y:g} mm no way was found: see `lead_bend` in `checks.json`."
        for lead in missing
    ]
    return " ".join(lines)


def tied_at(layout: Layout) -> list[str]:
    """Return where cables are tied, a place for each tie; leads without a path, which a person lays, count too."""
    leads, seat, places = layout.leads, layout.linkage.hub_tie, [PLATE] * len(layout.linkage.plate_ties)
    if seat is not None and all(tied_mm(lead, seat) is not None for lead in leads if lead.path is not None):
        places.insert(0, HUB)
    elif leads:
        places.insert(0, layout.drive.tied_to)
    return places if layout.deck.flat else [*places, FOOT]


def _ties(layout: Layout) -> list[str]:
    """How they are tied."""
    seat, places, lines = layout.linkage.hub_tie, tied_at(layout), list[str]()
    if seat is not None and HUB in places:
        tie = (
            "Close the cable tie that waits in the groove of the hub's tongue, under the bar, "
            if seat.grooved  # laid in with the bar, since none gets under it later
            else "Pull a cable tie through the two slots of the hub's tongue, over the tongue, and close it "
        )
        lines.append(f"{tie}around what leaves the ring below: a pull on it ends there.")
    elif SHAFT in places:
        lines.append("Close a cable tie around shaft and bundles, just below the hub: a pull on them ends there.")
    elif NECK in places:
        lines.append("A cable tie around bundle and neck takes the pull off the ring.")
    if PLATE in places:
        lines.append(
            "Another through the two slots of each tongue behind the plate, crossed between tongue and cable, holds "
            "the jacket of the lidar's cable."
        )
    return lines


def _one(layout: Layout, lead: RotorLead) -> str:
    assert lead.path is not None
    x, y, _ = lead.path.corners[2]
    azimuth = math.degrees(math.atan2(y, x)) % 360.0
    joint = lead.joint
    where = "" if joint is None else f", its joint {math.dist(joint.middle, lead.path.corners[-1]):.0f} mm from there"
    return (
        f"The cable at y = {lead.y:g} mm: the bundle leaves {layout.drive.leads_leave} at {azimuth:.0f} deg "
        "(counter-clockwise from above, "
        f"90 at the index), is {lead.path.length():.0f} mm long to the jacket{where}, and is bent by no less than "
        f"{lead.radius:g} mm; cut it {lead.path.length() + SPARE:.0f} mm long."
    )


def cables_text(layout: Layout) -> str:
    """Return the instructions for the cables that do not turn."""
    lines = []
    for lead in layout.cables:
        what = f"The {lead.name.replace('_', ' ')} of {lead.device}"
        if lead.path is None:
            lines.append(f"For the {lead.name.replace('_', ' ')} no way was found: see `lead_bend` in `checks.json`.")
        elif layout.deck.flat and len(lead.path.corners) == 2:
            x, y, _ = lead.path.corners[0]
            lines.append(f"{what} leaves into the deck: drill a hole for its plug at ({x:g}, {y:g}) mm from the axis.")
        else:
            ends = "beside the case" if layout.deck.flat else "over the edge of the mount's foot"
            bent = f"{lead.path.length():.0f} mm to there, bent by no less than {lead.radius:g} mm"
            runs, stops = ("run", "end") if lead.name.endswith("s") else ("runs", "ends")
            lines.append(f"{what} {runs} as the picture shows and {stops} {ends}: {bent}.")
    if not layout.deck.flat:
        lines.append("Close the cable tie in the two slots of the foot around what lies there: a pull ends there.")
    lines.append("No drawing shows where they leave their devices: if yours differ, keep the bends and the ties.")
    return " ".join(lines)
