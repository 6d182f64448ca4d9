"""Instructions for laying the cables: exit from the device, length, joints and ties."""

import math

from scanwright.cad.layout.cables.leads import RotorLead, tied_mm
from scanwright.cad.layout.layout import Layout
from scanwright.design.electrics.wiring import connectors_of

HUB, SHAFT, NECK, COIL, PLATE, FOOT = "hub", "shaft", "neck", "coil", "plate", "foot of the mount"  # tied there


def leads_text(layout: Layout) -> str:
    """Return the instructions for the leads of the ring's rotor: no cable of the lidar is cut or stripped."""
    leads, lidar = layout.leads, layout.scanner.lidar
    lines = [
        "Do not cut or strip a cable of the lidar. The leads of the ring run as the picture shows and end in sockets "
        "next to the linkage; coil the rest of each cable flat around the hub, clear of the beams and of all fixed "
        "parts, and tie the coil with two cable ties.",
        *(_one(layout, lead) for lead in leads if lead.path is not None),
    ]
    for cable, connector in connectors_of(lidar):
        what = {"power": "Power", "data": "Data", "both": "Power and data"}[cable.carries]
        if cable.end == "bare":
            lines.append(f"{what}: put the leads and the bare ends of the lidar's cable into the {connector.words}.")
        else:
            lines.append(
                f"{what}: crimp the leads of a {cable.end} socket to those of the ring, a shrink tube over each, and "
                f"plug the lidar's {cable.end} plug into it."
            )
    lines += ["The wiring diagram shows the pin of each circuit.", *_ties(layout)]
    missing = [lead for lead in leads if lead.path is None]
    lines += [
        f"The cable at y = {lead.y:g} mm of the lidar has no path: see `lead_bend` in `checks.json`."
        for lead in missing
    ]
    return " ".join(lines)


def tied_at(layout: Layout) -> list[str]:
    """Return the place of each cable tie; cables without a path, which a person lays, count too."""
    leads, seat, places = layout.leads, layout.linkage.hub_tie, [PLATE] * len(layout.linkage.plate_ties)
    places = [COIL] * 2 + places if leads else places
    if seat is not None and all(tied_mm(lead, seat) is not None for lead in leads if lead.path is not None):
        places.insert(0, HUB)
    elif leads:
        places.insert(0, layout.drive.tied_to)
    return places if layout.deck.flat else [*places, FOOT]


def _ties(layout: Layout) -> list[str]:
    seat, places, lines = layout.linkage.hub_tie, tied_at(layout), list[str]()
    if seat is not None and HUB in places:
        tie = (
            "Close the cable tie that is in the groove of the hub's slotted tab, under the bar, "
            if seat.grooved  # inserted with the bar, since none gets under it later
            else "Pull a cable tie through the two slots of the hub's tab, over the tab, and close it "
        )
        lines.append(f"{tie}around the leads of the ring: it takes the pull off them.")
    elif SHAFT in places:
        lines.append("Close a cable tie around shaft and bundles, directly below the hub: it takes the pull off them.")
    elif NECK in places:
        lines.append("A cable tie around bundle and neck takes the pull off the ring.")
    if PLATE in places:
        lines.append(
            "Another through the two slots of each tab behind the plate, crossed between tab and cable, holds the "
            "lidar's cable."
        )
    return lines


def _one(layout: Layout, lead: RotorLead) -> str:
    assert lead.path is not None
    x, y, _ = lead.path.corners[2]
    azimuth = math.degrees(math.atan2(y, x)) % 360.0
    return (
        f"The leads for the cable at y = {lead.y:g} mm leave {layout.drive.leads_leave} at {azimuth:.0f} deg "
        "(counter-clockwise from above, 90 at the index); the path to the lidar's outlet "
        f"is {lead.path.length():.0f} mm long, with bend radii of {lead.radius:g} mm or more."
    )


def cables_text(layout: Layout) -> str:
    """Return the instructions for the cables that do not turn."""
    lines = []
    for lead in layout.cables:
        what = f"The {lead.name.replace('_', ' ')} of {lead.device}"
        if lead.path is None:
            lines.append(f"The {lead.name.replace('_', ' ')} has no path: see `lead_bend` in `checks.json`.")
        elif layout.deck.flat and len(lead.path.corners) == 2:
            x, y, _ = lead.path.corners[0]
            lines.append(f"{what} leaves into the deck: drill a hole for its plug at ({x:g}, {y:g}) mm from the axis.")
        else:
            ends = "next to the case" if layout.deck.flat else "over the edge of the mount's foot"
            bent = f"{lead.path.length():.0f} mm to there, with bend radii of {lead.radius:g} mm or more"
            runs, stops = ("run", "end") if lead.name.endswith("s") else ("runs", "ends")
            lines.append(f"{what} {runs} as the picture shows and {stops} {ends}: {bent}.")
    if not layout.deck.flat:
        lines.append("Close the cable tie in the two slots of the foot around them: it takes the pull off them.")
    lines.append("Their exits are undocumented: if yours differ, keep the bends and the ties.")
    return " ".join(lines)
