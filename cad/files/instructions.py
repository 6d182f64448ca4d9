"""`assembly.md`: how to put one scanner together, in words, with the screws that its own parts ask for."""

from __future__ import annotations

import re
from collections.abc import Iterator

from cad.assembly.assembly import Assembly
from cad.assembly.steps import steps_of
from cad.checks.retention import material_of
from cad.layout.joints import ALL_SCREWS, CASE_EAR, DECK_MM, Joint, screws
from cad.layout.names import FIT_COUPON, LIDAR, LIDAR_BODY
from cad.layout.tightening import hold_of
from design.scanner import Scanner

NUTS = (
    "Put the nuts into their traps before anything else: those of a plate or an arm from below; those of a boss from "
    "above into the slots; those of a foot from its corners. Pull each home with a screw. What has no trap is a plain "
    "thread."
)
LOCKED = (
    "Where a screw ends in metal or in a nut, put a small drop of medium threadlocker on its thread, none on plastic, "
    "which it makes crack. Tighten to the torque that stands behind each screw, and once more after a day, since "
    "plastic under a head gives way. `checks.json` tells under `retention` and `screw` what each joint holds, and why."
)
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
        f"Print `print/{FIT_COUPON}.3mf` first: the clearances that fit on your printer belong in its catalogue file "
        f"(now fits {scanner.printer.fit_clearance_mm:g}, screws {scanner.printer.screw_clearance_mm:g} mm).",
        "",
        f"Lengths of screws with nuts assume {CASE_EAR:g} mm of servo case before the nut and a deck of {DECK_MM:g} "
        "mm; all others follow from the parts.",
        "",
    ]
    lines += [LOCKED, ""]
    if any(joint.inserts for joint in joints):
        lines += ["Melt the inserts in before anything else, flush with the face that the screw comes from.", ""]
    if any(joint.traps for joint in joints):
        lines += [NUTS, ""]
    for number, (title, text) in enumerate(_filled(scanner, assembly, joints), start=1):
        lines += [f"## {number}. {title}", "", text, ""]
    return "\n".join(lines)


def screws_in_words(assembly: Assembly, joint: Joint) -> str:
    """One joint as a sentence, with the torque of its screws."""
    what = f"{joint.count} x {joint.number}"
    where = {
        "thread": f"from {joint.part} into {joint.onto}",
        "trap": f"from {joint.part} onto {joint.count} nuts {joint.screw.name} in {joint.onto}",
        "nut": f"through {joint.part} into {joint.onto}, with {joint.count} nuts {joint.screw.name}",
        "deck": f"through the foot into the deck, with {joint.count} nuts {joint.screw.name}",
        "grub": f"in {joint.part}, against {joint.onto}",
    }[joint.fixing]
    held = ", in heat-set inserts" if joint.inserts else ""
    if joint.traps and joint.fixing == "grub":
        held = f", through {joint.count} nuts {joint.screw.name} in its bore"
    hold = hold_of(joint, material_of(assembly, joint.part), material_of(assembly, joint.onto))
    torque = "hand-tight" if hold is None else f"{hold.torque_nm:g} N m"
    return f"{what} {where}{held}, {torque}."


def _filled(scanner: Scanner, assembly: Assembly, joints: list[Joint]) -> Iterator[tuple[str, str]]:
    """Title and words of each step, every joint in one of them."""
    done: set[int] = set()
    seat = next((joint.part for joint in joints if joint.onto == LIDAR_BODY), "")
    for thing, step in steps_of(assembly):
        text, carrier = step.words, seat if thing == LIDAR else thing
        for i, joint in enumerate(joints):
            marks = [screws(joint.onto, joint.part)]
            marks += [screws(joint.onto), ALL_SCREWS] if joint.part == carrier else []
            place = next((mark for mark in marks if mark in text), None)
            if place is not None and i not in done:
                text = text.replace(place, f"**{screws_in_words(assembly, joint)}** {place}")
                done.add(i)
        yield step.title, " ".join(re.sub(r"\{.*?\}", "", text).split())
    for i, joint in enumerate(joints):
        if i not in done:
            yield f"{joint.part} to {joint.onto}", f"**{screws_in_words(assembly, joint)}**"
    yield "Look, then wire", LAST + (IN_A_LOOP if scanner.slip_ring is None else THROUGH_RING)
