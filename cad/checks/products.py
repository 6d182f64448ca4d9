"""Values of the products that are not verified, wiring, required modules that do not fit, and remarks for a person."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.layout.deck import USUAL
from scanwright.cad.layout.drive import products_of
from scanwright.cad.layout.joints import Joint
from scanwright.cad.layout.names import BASE_MOUNT, COUNTERWEIGHT, RING, SERVO_CASE
from scanwright.cad.screws import passing_hole
from scanwright.design.catalogue.holes import Hole, what_holds
from scanwright.design.catalogue.measuring import how_to_measure
from scanwright.design.catalogue.product_base import Product
from scanwright.design.catalogue.products import Printer
from scanwright.design.electrics.cautions import data_fault
from scanwright.design.electrics.rules import check_network
from scanwright.design.electrics.wiring import network_of
from scanwright.design.findings import Finding
from scanwright.design.scanner import Scanner

# Values of a product that shape more than one part.
SHAPING = {
    "lidar.holes": "the screws of the lidar",
    "printer.screw_clearance_mm": "every screw hole",
    "slip_ring.friction_nm": f"whether there is a {COUNTERWEIGHT}",
    "servo.holes": "the screws of the servo's case",
}
SHOWN_CHARS = 60  # of a value in a message; a longer one is cut


def module_checks(assembly: Assembly) -> list[Finding]:
    """Return an error for each required module that does not fit; a module has the name of the part that it adds."""
    what = "the task requires it (modules.{0} = true), but it does not fit"
    return [
        Finding("module", "error", part.what, f"{part.what}: {what.format(part.what)}: {part.why}")
        for part in assembly.layout.left_out
        if getattr(assembly.layout.scanner.modules, part.what, False)
    ]


def unverified_checks(assembly: Assembly) -> Iterator[Finding]:
    """Yield a warning for each unverified value of the products that shapes a part."""
    for product in products_of(assembly.layout.scanner, assembly.layout.drive):
        yield from _unverified(product, assembly)


def _unverified(product: Product, assembly: Assembly) -> Iterator[Finding]:
    """Yield a warning for each unverified value of a product that shapes a part."""
    provenance, shaping = product.provenance(), dict(SHAPING)
    for field in product.unverified():
        parts = [part.name for part in assembly.parts.values() if f"{product.kind}.{field}" in part.shaped_by]
        if parts:
            shaping[f"{product.kind}.{field}"] = " and ".join(parts)
    for part in reversed(assembly.parts.values()):  # the first part that describes a value wins
        shaping |= part.shapes
    for field in product.unverified():
        if f"{product.kind}.{field}" in shaping:
            value, source = _shown(getattr(product, field)), provenance[field].source
            message = f"{product.name}: {field}{value} is not verified ({source})"
            hint = f"{how_to_measure(field)}: it shapes {shaping[f'{product.kind}.{field}']}"
            yield Finding("unverified", "warning", product.name, message, hint=hint)


def _shown(value: object) -> str:
    if isinstance(value, tuple) and value and isinstance(value[0], Hole):
        return f" = {what_holds(value)}"
    text = str(list(value)) if isinstance(value, tuple) else str(value)
    return f" = {text}" if len(text) < SHOWN_CHARS else ""


def wiring_checks(scanner: Scanner) -> list[Finding]:
    """Return every broken rule of the wiring, or one finding if none is; then the missing values."""
    network = network_of(scanner)
    summary = (
        f"wiring: all {len(network.wires)} wires end in pins, every pin is used or spare, no circuit, wire, fuse or "
        "supply is overloaded, and every device gets its voltage"
    )
    ok = Finding("wiring", "ok", f"{scanner.lidar.name} and {scanner.servo.name}", summary)
    broken = [replace(fault, code="wiring") for fault in check_network(network)]
    slow = "" if scanner.slip_ring is None else data_fault(scanner.slip_ring, scanner.lidar)
    hint = "test the link through the turning ring before you build"
    data = [Finding("ring_data", "warning", RING, f"{slow}: data can be lost", hint=hint)] if slow else []
    return [*(broken or [ok]), *network.unknown, *data]


def remarks_of(assembly: Assembly) -> tuple[Finding, ...]:
    """Return the remarks on parts; those on products are checks."""
    scanner, deck, mounted = assembly.layout.scanner, assembly.layout.deck, assembly.layout.drive.mounted
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
