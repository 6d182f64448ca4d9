"""Findings for a person to read before the parts are made, and the parts that this scanner does not need."""

from collections.abc import Sequence

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.layout.deck import USUAL
from scanwright.cad.layout.joints import Joint
from scanwright.cad.layout.names import BASE_MOUNT, SERVO_CASE
from scanwright.cad.screws import passing_hole
from scanwright.design.catalogue.products import Printer
from scanwright.design.findings import Finding
from scanwright.design.scanner import Scanner


def remarks_of(scanner: Scanner, assembly: Assembly) -> tuple[Finding, ...]:
    """Return the remarks on parts; those on products are checks."""
    deck, mounted = assembly.layout.deck, assembly.layout.drive.mounted
    hint = "have it turned from aluminium or steel after its STEP file"
    remarks = [
        Finding("turn_from_metal", "note", part.name, f"{part.name}: {part.why_metal}", hint=hint)
        for part in assembly.parts.values()
        if part.process == "turned"
    ]
    if deck.flat:
        hole = passing_hole(mounted.screw, scanner.printer)
        bottom = f"{scanner.servo.name} by its rear holes"
        what = bottom if mounted.onto == SERVO_CASE else f"{mounted.onto} by its feet"
        places = ", ".join(f"({x:g}, {y:g})" for x, y in mounted.holes)
        message = f"{BASE_MOUNT}: not included, the axis is upright"
        hint = (
            f"hold {what} with 4 x {mounted.screw.name} from below through the deck, {hole:g} mm "
            f"holes at {places} mm from the axis; leave space for the plugs; to get a mount for other holes, write "
            "them as [deck] in the task"
        )
        remarks.append(Finding("servo_on_deck", "note", BASE_MOUNT, message, hint=hint))
    elif scanner.deck is None:
        places = ", ".join(f"({x:g}, {y:g})" for x, y in USUAL.holes())
        message = f"{BASE_MOUNT}: the deck needs {deck.screw.name} holes at {places} mm"
        hint = "if your robot has other holes, write them as [deck] in the task, and build again"
        remarks.append(Finding("usual_deck_holes", "note", BASE_MOUNT, message, hint=hint))
    return tuple(remarks)


def without_traps(printer: Printer, joints: Sequence[Joint]) -> list[Finding]:
    """Return a note for each joint with plain threads although the printer's profile requires nuts."""
    if printer.thread != "nut":
        return []
    return [
        Finding(
            "no_nut_trap",
            "note",
            joint.holder,
            f"{joint.holder}: no nut pocket fits at its {joint.count} {joint.screw.name}, which have plain threads",
        )
        for joint in joints
        if joint.thread is not None and not joint.traps
    ]
