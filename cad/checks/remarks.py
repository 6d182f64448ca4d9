"""What a person should know before the parts are made: findings, and what was left out."""

from __future__ import annotations

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.assembly.masses import rotor_weight
from scanwright.cad.checks.mechanics import load_checks
from scanwright.cad.findings import PartFinding
from scanwright.cad.geometry.inertia import Inertial
from scanwright.cad.layout.belt.stack import BeltStack
from scanwright.cad.layout.cables.ties import hub_tie_of, plate_ties_of
from scanwright.cad.layout.direct.cage import share_weight
from scanwright.cad.layout.direct.misalignment import SHARE, worst_moment_nm
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.drive import DriveLayout, Mounted
from scanwright.cad.layout.joints import Joint
from scanwright.cad.layout.loads import RATED_AT_MM, rated_moment_nm
from scanwright.cad.layout.modules.unasked import unasked
from scanwright.cad.layout.names import BASE_MOUNT, SERVO_CASE, TRIPOD_FOOT
from scanwright.cad.screws import passing_hole
from scanwright.design.catalogue.holes import Hole, what_holds
from scanwright.design.catalogue.measuring import how_to_measure
from scanwright.design.catalogue.products import Printer, Product
from scanwright.design.left_out import LeftOut
from scanwright.design.scanner import Scanner

# Values of a product that shape no part alone.
SHAPING = {
    "lidar.holes": "the screws of the lidar",
    "printer.screw_clearance_mm": "every screw hole",
    "servo.holes": "the screws of the servo's case",
}


def findings_of(scanner: Scanner, assembly: Assembly, bodies: dict[str, Inertial]) -> tuple[PartFinding, ...]:
    """Everything worth a line, in the order of the parts."""
    layout = assembly.layout
    found = [
        _turn_from_metal(part.name, part.why_metal) for part in assembly.parts.values() if part.process == "turned"
    ]
    if isinstance(layout.stack, BeltStack):
        found += [
            PartFinding(check.kind, "warning", check.where, check.message)
            for check in load_checks(scanner, layout.stack, bodies)
            if check.severity in ("warning", "error")
        ]
    else:
        found += _tilt_moment(scanner, layout.stack, bodies)
    if layout.deck.flat:
        found.append(_held_by_screws(scanner, layout.drive.mounted))
    for product in products_of(scanner, layout.drive):
        found += unverified(product, assembly)
    return tuple(found)


def products_of(scanner: Scanner, drive: DriveLayout) -> list[Product]:
    """Every product that shapes parts, each once."""
    found: list[Product | None] = [scanner.lidar, scanner.servo, scanner.slip_ring, *drive.products, scanner.printer]
    return list({product.name: product for product in found if product is not None}.values())


def left_out_of(assembly: Assembly) -> tuple[LeftOut, ...]:
    """Parts that this scanner does not need."""
    layout = assembly.layout
    out = [*layout.drive.left_out]
    if isinstance(layout.counterweight, LeftOut):
        out.append(layout.counterweight)
    ties = hub_tie_of(layout.scanner, layout.linkage), plate_ties_of(layout.scanner.lidar, layout.linkage)
    out += [tie for tie in ties if isinstance(tie, LeftOut)]
    if layout.deck.tripod is None:
        out.append(unasked(TRIPOD_FOOT))
    if layout.deck.flat:
        out.append(LeftOut(BASE_MOUNT, "the axis stands upright: the servo is screwed flat to the deck", 1, "parts"))
    return tuple(out)


def without_traps(printer: Printer, joints: list[Joint]) -> list[PartFinding]:
    """Screws that hold in plain threads although the printer's profile asks for nuts."""
    if printer.thread != "nut":
        return []
    return [
        PartFinding(
            "no_nut_trap",
            "note",
            joint.holder,
            f"{joint.holder}: no nut trap fits at its {joint.count} {joint.screw.name}: they hold in plain threads",
        )
        for joint in joints
        if joint.thread is not None and not joint.traps
    ]


def _turn_from_metal(part: str, why: str) -> PartFinding:
    message = f"{part}: {why}: have it turned from aluminium or steel after its STEP file"
    return PartFinding("turn_from_metal", "note", part, message)


def _tilt_moment(scanner: Scanner, stack: DirectStack, bodies: dict[str, Inertial]) -> list[PartFinding]:
    """What the weight of all that turns puts on a horn that carries it, against its rating."""
    rated, servo, weight = rated_moment_nm(scanner), scanner.servo, rotor_weight(scanner, stack, bodies)
    moment = share_weight(scanner, stack, weight).horn_moment_nm
    if rated is not None and stack.bearing is not None:
        rated, moment = SHARE * rated, max(worst_moment_nm(scanner, stack, weight).values())
    if rated is None or moment <= rated:
        return []
    help_ = "lighten what turns, or raise the axis"
    if stack.bearing is None:
        help_ = "support the shaft with a bearing near the hub; none of the catalogue fits it"
    message = (
        f"{stack.shaft}: the tilted axis puts {moment:.2f} N m on the horn of {servo.name}, allowed {rated:.2f} N m "
        f"(rated {servo.radial_load_n:g} N at {RATED_AT_MM:g} mm): {help_}"
    )
    return [PartFinding("tilt_moment", "warning", stack.shaft, message)]


def _held_by_screws(scanner: Scanner, mounted: Mounted) -> PartFinding:
    hole = passing_hole(mounted.screw, scanner.printer)
    named = ", ".join(f"({x:g}, {y:g})" for x, y in mounted.holes)
    what = f"{scanner.servo.name} by its rear holes" if mounted.onto == SERVO_CASE else f"{mounted.onto} by its feet"
    message = (
        f"{BASE_MOUNT}: left out, the axis stands upright: hold {what} with 4 x {mounted.screw.name} from below "
        f"through the deck, {hole:g} mm holes at {named} mm from the axis; leave room for the plugs"
    )
    return PartFinding("servo_on_deck", "note", BASE_MOUNT, message)


def unverified(product: Product, assembly: Assembly) -> list[PartFinding]:
    """Values of a product that nobody has verified and that shape a part."""
    provenance, shaping = product.provenance(), dict(SHAPING)
    for field in product.unverified():
        parts = [part.name for part in assembly.parts.values() if f"{product.kind}.{field}" in part.shaped_by]
        if parts:
            shaping[f"{product.kind}.{field}"] = " and ".join(parts)
    for part in reversed(assembly.parts.values()):  # of two parts that say more of a value, the first does
        shaping |= part.shapes
    return [
        PartFinding(
            "unverified",
            "warning",
            product.name,
            f"{product.name}: {field} = {_shown(getattr(product, field))} is not verified "
            f"({provenance[field].source}): {how_to_measure(field)}, it shapes {shaping[f'{product.kind}.{field}']}",
            f"{field} = {_shown(getattr(product, field))}",
        )
        for field in product.unverified()
        if f"{product.kind}.{field}" in shaping
    ]


def _shown(value: object) -> str:
    if isinstance(value, tuple) and value and isinstance(value[0], Hole):
        return what_holds(value)
    text = str(list(value)) if isinstance(value, tuple) else str(value)
    return text if len(text) < 60 else text[:57] + "..."
