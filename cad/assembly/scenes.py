"""Assembly steps in order, and the scene of each: present bodies, new bodies, their direction, and their screws.

A step is on the scanner, or on the bench, for an assembly that is later inserted as one piece.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.layout.cables.leads import RotorLead, tied_mm
from scanwright.cad.layout.joints import ALL_SCREWS, Joint, screws
from scanwright.cad.layout.layout import Layout
from scanwright.cad.layout.names import (
    DECK,
    FIXED_CABLES,
    LIDAR,
    LIDAR_BODY,
    ROTOR_LEADS,
    SERVO,
    SERVO_CABLE,
    SERVO_CASE,
    SERVO_FRAME,
    STATOR_LEADS,
)
from scanwright.cad.layout.rotor.counterweight import Counterweight
from scanwright.cad.parts.part_spec import Step
from scanwright.design.arrays import Rotation, Vector
from scanwright.design.electrics.wiring import connectors_of

OTHER_HOLES = "For a mount with other holes, write them as [deck] in the task and build again."
ON_DECK = Step(
    "Servo on the deck",
    "The axis is upright, so no mount is needed: drill the pattern of the servo's rear holes into the deck "
    "(`template.pdf`). "
    f"{screws(SERVO_CASE, DECK)} Leave space for the plugs. {OTHER_HOLES}",
    "the horn turns freely, and the case is flat on the deck",
    (SERVO,),
)
FRAME_ON_DECK = Step(
    "Frame on the deck",
    "The axis is upright, so no mount is needed: drill the pattern of the frame's feet into the deck "
    "(`template.pdf`). Lay a nut into the slot of each foot, where it cannot turn. "
    f"{screws(SERVO_FRAME, DECK)} Connect both cables of the servo now (`wiring.md`, "
    "Servo on the bench), and lead them out of a window of the frame. "
    f"{OTHER_HOLES}",
    "the horn turns freely, and the frame does not rock on its four feet",
)
LEADS_TITLE = "Leads between lidar and ring"
LEADS_CHECK = "turned by hand through its entire range, no lead touches a fixed part, and none pulls at its ends"
CABLES_TITLE = "Cables that do not turn"
CABLES_CHECK = "turned by hand, nothing comes near a cable; a pull on a cable does not reach its plug"
BUNDLES = {SERVO_CABLE: "The cables for data and power", STATOR_LEADS: "The stator's leads"}  # each drawn as one
PLATE_TIE = (
    "A cable tie through the two slots of each tab behind the plate, crossed between tab and cable, holds the lidar's "
    "cable."
)
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
        lines.append(PLATE_TIE)
    return lines


def _one(layout: Layout, lead: RotorLead) -> str:
    assert lead.path is not None
    x, y, _ = lead.path.corners[2]
    azimuth = math.degrees(math.atan2(y, x)) % 360.0
    return (
        f"The leads for the cable at y = {lead.y:g} mm leave {layout.drive.leads_leave} at {azimuth:.0f} deg "
        "(counter-clockwise from above, 90 at the index groove); the path to the lidar's outlet "
        f"is {lead.path.length():.0f} mm long, with bend radii of {lead.radius:g} mm or more."
    )


def cables_text(layout: Layout) -> str:
    """Return the instructions for the cables that do not turn."""
    lines = []
    for lead in layout.cables:
        what = f"{BUNDLES[lead.name]} of {lead.device}"
        if lead.path is None:
            lines.append(f"{what}: no path, see `lead_bend` in `checks.json`.")
        elif layout.deck.flat and len(lead.path.corners) == 2:
            x, y, _ = lead.path.corners[0]
            lines.append(
                f"{what} leave into the deck: drill a hole for their plugs at ({x:g}, {y:g}) mm from the axis."
            )
        else:
            ends = "next to the case" if layout.deck.flat else "over the edge of the mount's foot"
            bent = f"{lead.path.length():.0f} mm to there, with bend radii of {lead.radius:g} mm or more"
            lines.append(f"{what} run as the picture shows and end {ends}: {bent}.")
    if layout.deck.flat:
        lines.append("Tape each cable to the deck where it leaves the case: the tape takes the pull off its plug.")
    else:
        lines.append("Close the cable tie in the two slots of the foot around them: it takes the pull off them.")
    held = "tape" if layout.deck.flat else "tie"
    lines.append(f"The exits of these cables are undocumented: if yours differ, keep the bends and the {held}.")
    return " ".join(lines)


def steps_of(assembly: Assembly) -> list[tuple[str, Step]]:
    """Return each step with the part or product that it adds."""
    layout = assembly.layout
    specs = [assembly.parts[name] for name in assembly.made]
    steps = {spec.name: spec.step for spec in specs if spec.step is not None}
    for spec in assembly.parts.values():
        steps |= {
            name: step for name, step in spec.steps.items() if name in assembly.made or name not in assembly.parts
        }
    if any(lead.path is not None for lead in layout.leads):
        steps[ROTOR_LEADS] = Step(LEADS_TITLE, leads_text(layout), LEADS_CHECK)
    if any(cable.path is not None for cable in layout.cables):
        steps[FIXED_CABLES] = Step(CABLES_TITLE, cables_text(layout), CABLES_CHECK)
    if layout.deck.flat:
        steps[DECK] = ON_DECK if layout.drive.mounted.onto == SERVO_CASE else FRAME_ON_DECK
    order = list(layout.drive.built)
    for spec in assembly.parts.values():
        if spec.after:
            order.insert(order.index(spec.after) + 1, spec.name)
    return sorted(steps.items(), key=lambda item: order.index(item[0]))


@dataclass(frozen=True, slots=True)
class StepScene:
    """One step."""

    thing: str  # part or product that it adds
    step: Step  # its text
    # that it closes, each with its mark in the text; an empty mark if the text has none
    joints: tuple[tuple[Joint, str], ...]
    there: tuple[str, ...]  # present bodies, in alphabetical order
    comes: tuple[str, ...]  # new bodies
    against: tuple[str, ...]  # those of them that come from the opposite side
    along: Vector  # unit vector, rotation frame, from which they come; 0 for cables, which are shown in place
    R_rot_picture: Rotation  # the frame that is upright in the picture: the lidar's, or the rotation frame


def scenes_of(assembly: Assembly) -> list[StepScene]:
    """Return all steps in order; every joint is in one of them, and the last one has those that no text names."""
    steps = steps_of(assembly)
    present: set[str] = set()
    benches: list[set[str]] = []
    scenes = []
    for (thing, step), own in zip(steps, _closed(steps, assembly.layout.joints), strict=True):
        ready = _bench_of({thing}, benches)
        comes = {thing, *step.brings} | ready
        joined = {assembly.thing(body) for joint, _ in own for body in (joint.part, joint.onto)} - {DECK}
        neighbours = joined - comes
        if neighbours & present:
            comes |= _bench_of(neighbours, benches)
            neighbours -= comes
        alone = bool(own and present and not neighbours and not ready)
        on_bench = alone or bool(neighbours - present)
        there = (neighbours | _bench_of(neighbours, benches)) if on_bench else present
        scenes.append(_scene(assembly, thing, step, own, there, comes))
        benches = [bench for bench in benches if not bench & (there | comes)]
        if on_bench:
            benches.append(there | comes)
        else:
            present = present | comes
    return scenes


def _bench_of(things: set[str], benches: Sequence[set[str]]) -> set[str]:
    """Return everything on the bench that is joined to some things."""
    return {other for bench in benches if bench & things for other in bench}


def _closed(steps: Sequence[tuple[str, Step]], joints: Sequence[Joint]) -> list[tuple[tuple[Joint, str], ...]]:
    """Return for each step the joints whose screws its text names, and the marks."""
    seat = next((joint.part for joint in joints if joint.onto == LIDAR_BODY), "")
    left = list(joints)
    closed = []
    for thing, step in steps:
        carrier = seat if thing == LIDAR else thing
        own = []
        for joint in list(left):
            marks = [screws(joint.onto, joint.part)]
            marks += [screws(joint.onto), ALL_SCREWS] if joint.part == carrier else []
            place = next((mark for mark in marks if mark in step.words), None)
            if place is not None:
                own.append((joint, place))
                left.remove(joint)
        closed.append(tuple(own))
    if left:
        closed[-1] += tuple((joint, "") for joint in left)
    return closed


def _scene(
    assembly: Assembly, thing: str, step: Step, own: tuple[tuple[Joint, str], ...], there: set[str], comes: set[str]
) -> StepScene:
    if not there and comes - {thing}:  # the first of all
        there, comes = {thing}, comes - {thing}
    along, R = _from(assembly, thing, there, comes)
    names = sorted((*assembly.made, *assembly.bought))
    present, come = (tuple(name for name in names if assembly.thing(name) in things) for things in (there, comes))
    against = tuple(name for name in come if name in assembly.bodies and assembly.bodies[name].from_below)
    return StepScene(thing, step, own, present, come, against if thing not in comes else (), along, R)


def _from(assembly: Assembly, thing: str, there: set[str], comes: set[str]) -> tuple[Vector, Rotation]:
    """Return the direction it comes from: as in the exploded view, from below if all present bodies are above it."""
    lifted = "lidar" if thing == LIDAR else assembly.parts[thing].lifted if thing in assembly.parts else "axis"
    R = assembly.layout.stack.R()
    if thing in (ROTOR_LEADS, FIXED_CABLES):
        return np.zeros(3), np.eye(3)
    if lifted == "lidar":
        return R[:, 2], R
    bar = assembly.layout.counterweight
    if lifted == "deck":
        return -np.array(assembly.layout.deck.normal), np.eye(3)
    if lifted == "radius" and isinstance(bar, Counterweight):
        return np.array([math.cos(bar.ear.azimuth), math.sin(bar.ear.azimuth), 0.0]), np.eye(3)
    order = {name: i for i, name in enumerate(assembly.layout.drive.stacked)}
    below = [order[name] for name in comes if name in order]
    above = [order[name] for name in there if name in order]
    up = -1.0 if below and above and max(below) < min(above) else 1.0
    return np.array([0.0, 0.0, up]), np.eye(3)
