"""What a person should know before the parts are made: findings, and what was left out."""

from __future__ import annotations

from collections.abc import Sequence

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.assembly.masses import rotor_of, rotor_weight
from scanwright.cad.checks.loads.belt import belt_loads
from scanwright.cad.checks.mechanics import spin_up_nm
from scanwright.cad.findings import PartFinding
from scanwright.cad.geometry.inertia import Inertial
from scanwright.cad.layout.direct.cage import BearingCage, share_weight
from scanwright.cad.layout.direct.misalignment import SHARE, worst_moment_nm
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.drive import DriveLayout, Mounted
from scanwright.cad.layout.joints import Joint
from scanwright.cad.layout.loads import RATED_AT_MM, rated_moment_nm
from scanwright.cad.layout.names import BASE_MOUNT
from scanwright.cad.layout.placement import Placement
from scanwright.cad.screws import passing_hole
from scanwright.design.catalogue.products import Printer, Product
from scanwright.design.scanner import Scanner

# Values of a product that shape no part alone.
SHAPING = {
    "lidar.mount_thread_depth_mm": "the length of the screws in the lidar",
    "printer.screw_clearance_mm": "every screw hole",
    "servo.case_rear_holes_mm": "the holes in the deck",
}


def findings_of(scanner: Scanner, assembly: Assembly, bodies: dict[str, Inertial]) -> tuple[PartFinding, ...]:
    """Everything worth a line, in the order of the parts."""
    layout = assembly.layout
    found = [
        _turn_from_metal(part.name, part.why_metal) for part in assembly.parts.values() if part.process == "turned"
    ]
    found += _overloads(layout, bodies)
    found += _tilt_moment(layout, bodies)
    if layout.deck.flat:
        found.append(_held_by_screws(scanner, layout.drive.mounted))
    for product in products_of(scanner, layout.drive):
        found += unverified(product, assembly)
    return tuple(found)


def products_of(scanner: Scanner, drive: DriveLayout) -> list[Product]:
    """Every product that shapes parts, each once."""
    found: list[Product | None] = [scanner.lidar, scanner.servo, scanner.slip_ring, *drive.products, scanner.printer]
    return list({product.name: product for product in found if product is not None}.values())


def without_traps(printer: Printer, joints: Sequence[Joint]) -> list[PartFinding]:
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


def _overloads(layout: Placement, bodies: dict[str, Inertial]) -> list[PartFinding]:
    """What a belt, its bearings and the horn under it carry too much of."""
    rotor, weight = rotor_of(layout.scanner, bodies), rotor_weight(layout.scanner, layout.stack, bodies)
    return [
        PartFinding(check.kind, "warning", check.where, check.message)
        for check in belt_loads(layout, rotor, weight, spin_up_nm(layout.scanner, rotor, weight))
        if check.severity in ("warning", "error")
    ]


def _tilt_moment(layout: Placement, bodies: dict[str, Inertial]) -> list[PartFinding]:
    """What the weight of all that turns puts on a horn that carries it, against its rating."""
    scanner, stack, cage = layout.scanner, layout.drive.of(DirectStack), layout.drive.of(BearingCage)
    if stack is None:
        return []
    rated, servo, weight = rated_moment_nm(scanner), scanner.servo, rotor_weight(scanner, stack, bodies)
    moment = share_weight(scanner, stack, cage, weight).horn_moment_nm
    if rated is not None and cage is not None:
        rated, moment = SHARE * rated, max(worst_moment_nm(cage, weight).values())
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
    message = (
        f"{BASE_MOUNT}: left out, the axis stands upright: hold {scanner.servo.name} by its rear holes with 4 x "
        f"{mounted.screw.name} from below through the deck, {hole:g} mm holes at "
        f"{named} mm from the axis; leave room for the plugs"
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
            f"({provenance[field].source}): measure yours, it shapes {shaping[f'{product.kind}.{field}']}",
            f"{field} = {_shown(getattr(product, field))}",
        )
        for field in product.unverified()
        if f"{product.kind}.{field}" in shaping
    ]


def _shown(value: object) -> str:
    text = str(list(value)) if isinstance(value, tuple) else str(value)
    return text if len(text) < 60 else text[:57] + "..."
