"""`assembly.md`: how to put one scanner together, in words, with the screws that its own parts ask for."""

from __future__ import annotations

import re
from collections.abc import Iterator

from cad.assembly import Assembly
from cad.joints import CASE_EAR, DECK, Joint
from design.scanner import Scanner

# The order that always works: what comes over the shaft follows what carries it. `{...}` is filled with the screws.
STEPS: dict[str, tuple[str, str]] = {
    "base_mount": (
        "Servo into the mount",
        "Put the case between the rails of the base mount, plugs to the channel behind it. {servo_case} Connect the "
        "servo's cable now. {deck}",
    ),
    "deck": (
        "Servo on the deck",
        "The axis stands upright, so no mount is needed: drill the pattern of the servo's rear holes into the deck. "
        "{servo_case} Leave room for the plugs.",
    ),
    "servo_shaft": (
        "Shaft on the horn",
        "Turn the servo to its centre (position 2048 of 4096, 512 of 1024). Put the flange of the shaft on the horn so "
        "that its index groove points to the servo's +Y face, the end of the case nearest to the horn. {servo_horn}",
    ),
    "slip_ring_adapter": (
        "Adapter on the servo",
        "Slide the fork round the flange of the shaft. {servo_case}",
    ),
    "cage_base": ("Base of the cage on the servo", "Lower the base over the shaft. {servo_case}"),
    "ring": (
        "Slip ring",
        "Lower the ring over the shaft, the rotor's leads upwards, and clamp its rotor to the shaft with its own set "
        "screws. A cable tie in the grooves of the adapter holds the stator: it may move a little, it may not turn.",
    ),
    "bearing_cage": (
        "Bearing and cage",
        "Put the bearing into its seat and lower the cage onto its base. Put the screws of the cage "
        "in loosely: {*} Tighten them last, when the linkage is on and turns freely, so that the bearing finds the "
        "journal.",
    ),
    "lidar": (
        "Lidar on its seat",
        "On the bench: put the lidar on its seat, its front to the V in the edge (FRONT), its cables over the square "
        "notch. {lidar_body}",
    ),
    "sub_plate": (
        "Lidar and sub-plate on the linkage",
        "The hub covers one of the lidar's screws, so the lidar came on a plate of its own: put this plate on the "
        "linkage, FRONT over FRONT, and drive the screws of its ears from the lidar's side. {alignment_linkage}",
    ),
    "alignment_linkage": (
        "Linkage on the shaft",
        "Lower the hub onto the upper end of the shaft until it sits on the end; the flat of the shaft fits one way "
        "only, and the groove of the hub then stands above the groove of the flange. {servo_shaft}",
    ),
}
ORDER = tuple(STEPS)
CLOSED_ADAPTER = "Lower the plate over the shaft. {servo_case}"  # the one that carries a cage is no fork
LAST = "Turn the linkage by hand through its whole range: nothing touches, no cable pulls tight. "
THROUGH_RING = "Then join the leads of the lidar to those of the ring's rotor, those of the stator to USB and power."
IN_A_LOOP = "Leave the lidar's cables a loose loop for the whole sweep, then join them to USB and power."


def instructions_text(scanner: Scanner, assembly: Assembly, joints: list[Joint], config_hash: str) -> str:
    """The Markdown file."""
    angles = scanner.angles.angles_deg
    lines = [
        f"# {scanner.angles.task}: putting it together",
        "",
        f"Configuration {config_hash}: {scanner.lidar.name} on {scanner.servo.name}, alpha_rot {angles.alpha_rot:g}, "
        f"beta_rot {angles.beta_rot:g}, alpha_laser {angles.alpha_laser:g}, beta_laser {angles.beta_laser:g} deg. "
        "Look at `exploded.glb` beside these steps; `bom.csv` lists what you need.",
        "",
        "Print `print/fit_coupon.3mf` first: the clearances that fit on your printer belong in its catalogue file "
        f"(now fits {scanner.printer.fit_clearance_mm:g}, screws {scanner.printer.screw_clearance_mm:g} mm).",
        "",
        f"Lengths of screws with nuts assume {CASE_EAR:g} mm of servo case before the nut and a deck of {DECK:g} mm; "
        "all others follow from the parts.",
        "",
    ]
    if any(joint.inserts for joint in joints):
        lines += ["Melt the inserts in before anything else, flush with the face that the screw comes from.", ""]
    for number, (title, text) in enumerate(_steps(scanner, assembly, joints), start=1):
        lines += [f"## {number}. {title}", "", text, ""]
    return "\n".join(lines)


def screws_in_words(joint: Joint) -> str:
    """One joint as a sentence."""
    what = f"{joint.count} x {joint.number}"
    where = {
        "thread": f"from {joint.part} into {joint.onto}",
        "nut": f"through {joint.part} into {joint.onto}, with {joint.count} nuts {joint.screw.name}",
        "deck": f"through the foot into the deck, with {joint.count} nuts {joint.screw.name}",
        "grub": f"in {joint.part}, against {joint.onto}",
    }[joint.fixing]
    left = ""
    if joint.covered:
        left = f" Leave the other {joint.covered} of the holes empty: no driver reaches them."
    return f"{what} {where}{', in heat-set inserts' if joint.inserts else ''}.{left}"


def _steps(scanner: Scanner, assembly: Assembly, joints: list[Joint]) -> Iterator[tuple[str, str]]:
    done: set[int] = set()
    seat = next((joint.part for joint in joints if joint.onto.startswith("lidar")), "")
    things = [*assembly.made, "lidar"]
    if scanner.slip_ring is not None:
        things.append("ring")
    if "base_mount" not in assembly.made:
        things.append("deck")
    for thing in sorted(things, key=lambda name: ORDER.index(name) if name in ORDER else len(ORDER)):
        title, text = STEPS.get(thing, (thing, "{*}"))
        if thing == "slip_ring_adapter" and "bearing_cage" in assembly.made:
            text = CLOSED_ADAPTER
        carrier = seat if thing == "lidar" else thing
        for i, joint in enumerate(joints):
            mark = "{" + (joint.onto or "deck") + "}"
            if joint.part == carrier and i not in done and (mark in text or "{*}" in text):
                place = mark if mark in text else "{*}"
                text = text.replace(place, f"**{screws_in_words(joint)}** {place}")
                done.add(i)
        yield title, " ".join(re.sub(r"\{.*?\}", "", text).split())
    for i, joint in enumerate(joints):
        if i not in done:
            yield f"{joint.part} to {joint.onto or 'deck'}", f"**{screws_in_words(joint)}**"
    yield "Look, then wire", LAST + (IN_A_LOOP if scanner.slip_ring is None else THROUGH_RING)
