"""`bom.csv`: everything to print, turn and buy for one scanner, with what is known of numbers and prices.

Prices are those of the catalogue, each with its source; a price that nobody has looked up stays empty and is counted in
the last row, never guessed.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from dataclasses import dataclass, fields

from cad.assembly.assembly import Assembly
from cad.checks.remarks import products_of
from cad.drawings.files import drawing_number
from cad.layout.belt.stack import BeltStack
from cad.layout.drive import DriveLayout
from cad.layout.joints import Joint
from cad.screws import INSERT_LENGTH, SCREWS
from design.catalogue.products import Bearing, Belt, Lidar, Product, Servo, SlipRing
from design.scanner import Scanner

JOINTS = "joints of the layout"
PAPER = "Schubert 2016, section 3.5: two USB connections and a 12 V supply"

PAPER_V = 12.0

# What else a lidar needs: name, quantity, source. One that is not here asks for its data sheet.
WIRING: dict[str, tuple[tuple[str, int, str], ...]] = {
    "UTM-30LX": (
        ("USB 2.0 cable of the lidar, type A", 1, PAPER),
        ("power lead of the lidar, 12 V, 1 A (brown +, blue 0 V)", 1, "data sheet figures: 12 V, 0.7 A, 1.0 A at most"),
    ),
    "URG-04LX": (
        ("USB 2.0 cable of the lidar, type A", 1, PAPER),
        ("power lead of the lidar, 5 V", 1, "not in the sources of the catalogue: read its data sheet"),
    ),
}


@dataclass(frozen=True, slots=True)
class BomItem:
    """One row. Empty texts and None are unknown.

    Attributes:
        kind: printed, turned, sawn, bought, screw, nut, insert, wiring or total.
        part: what it is.
        number: drawing number of a made part, designation of a standard part.
        quantity: pieces.
        supplier: maker.
        supplier_number: what to order there.
        unit_usd: price of one.
        total_usd: price of all.
        mass_g: of one.
        source: where the price, or the row, comes from.
        verified: whether that value is verified; empty where there is none.
        note: for the person who buys.
    """

    kind: str
    part: str
    number: str = ""
    quantity: int | None = None
    supplier: str = ""
    supplier_number: str = ""
    unit_usd: float | None = None
    total_usd: float | None = None
    mass_g: float | None = None
    source: str = ""
    verified: str = ""
    note: str = ""


def items_of(
    scanner: Scanner,
    assembly: Assembly,
    joints: list[Joint],
    masses_g: dict[str, float],
    config_hash: str,
) -> list[BomItem]:
    """All rows; the total last.

    Args:
        scanner: angles and products.
        assembly: the solids.
        joints: of `joints_of`.
        masses_g: of the made parts.
        config_hash: of what shapes the parts.
    """
    items = []
    for name in assembly.made:
        part, number = assembly.parts[name], drawing_number(config_hash, name, assembly)
        how = f"{scanner.printer.name}, solid, from print/{name}.3mf"
        if part.metal:
            how = f"{', '.join(filter(None, (part.material, part.work)))}, after parts/{name}.step"
        note = f"{how}; drawing drawings/{name}.pdf"
        items.append(BomItem(part.process, name, number, 1, mass_g=round(masses_g[name], 1), note=note))
    items += _products(scanner, assembly.layout.drive)
    items += _screws(joints)
    items += _wiring(scanner, assembly.layout.drive)
    return [*items, _total(items)]


def bom_text(items: list[BomItem]) -> str:
    """The CSV file."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    names = [field.name for field in fields(BomItem)]
    writer.writerow(names)
    for item in items:
        writer.writerow(["" if getattr(item, name) is None else getattr(item, name) for name in names])
    return text.getvalue()


def _products(scanner: Scanner, drive: DriveLayout) -> Iterator[BomItem]:
    for product in products_of(scanner, drive):
        if isinstance(product, Lidar | Servo | SlipRing | Bearing | Belt):
            number = _order_number(product, drive)
            yield _bought(product, max(1, drive.products.count(product)), number)


def _order_number(product: Product, drive: DriveLayout) -> str:
    """What to ask a shop for: a belt comes in lengths."""
    stack = drive.stack
    if isinstance(stack, BeltStack) and product == stack.belt:
        return f"{product.name}, {stack.belt_teeth} teeth, {stack.belt_teeth * stack.belt.pitch_mm:g} mm"
    return product.name


def _bought(product: Lidar | Servo | SlipRing | Bearing | Belt, quantity: int, number: str) -> BomItem:
    origin = product.provenance().get("price_usd")
    price = product.price_usd
    return BomItem(
        kind="bought",
        part=product.kind.replace("_", " "),
        number=number,
        quantity=quantity,
        supplier=product.maker,
        supplier_number=number,
        unit_usd=price,
        total_usd=None if price is None else quantity * price,
        mass_g=product.mass_g,
        source=origin.source if origin is not None else "",
        verified="" if origin is None else "yes" if origin.verified else "no",
        note="" if price is not None else "price unknown",
    )


def _screws(joints: list[Joint]) -> Iterator[BomItem]:
    screws: dict[str, list[Joint]] = {}
    nuts: dict[str, int] = {}
    inserts: dict[str, int] = {}
    for joint in joints:
        screws.setdefault(joint.number, []).append(joint)
        if joint.fixing in ("nut", "deck") or joint.traps:
            nuts[joint.screw.name] = nuts.get(joint.screw.name, 0) + joint.count
        if joint.inserts:
            inserts[joint.screw.name] = inserts.get(joint.screw.name, 0) + joint.count
    for number, used in sorted(screws.items()):
        kind = "grub screw" if number.startswith("ISO 4026") else "cap screw"
        where = ", ".join(f"{joint.count} {joint.part} to {joint.onto}" for joint in used)
        total = sum(joint.count for joint in used)
        yield BomItem("screw", kind, number, total, source=JOINTS, note=f"{where}; price unknown")
    for name, count in sorted(nuts.items()):
        yield BomItem("nut", "hexagon nut", f"ISO 4032 {name}", count, source=JOINTS, note="price unknown")
    for name, count in sorted(inserts.items()):
        note = f"length {INSERT_LENGTH:g}, for a hole of {SCREWS[name].insert:g} mm; price unknown"
        yield BomItem("insert", "heat-set insert", name, count, source=JOINTS, note=note)


def _wiring(scanner: Scanner, drive: DriveLayout) -> Iterator[BomItem]:
    yield BomItem("wiring", f"power supply, {PAPER_V:g} V", quantity=1, source=PAPER, note="price unknown")
    if scanner.servo.rated_v != PAPER_V:
        yield BomItem(
            "wiring", f"power supply of the servo, {scanner.servo.rated_v:g} V", quantity=1, note="price unknown"
        )
    yield from _servo_wiring(scanner.servo)
    needs = WIRING.get(scanner.lidar.name)
    if needs is None:
        yield _unknown_wiring(scanner.lidar)
    for part, quantity, source in needs or ():
        yield BomItem("wiring", part, quantity=quantity, source=source, note="price unknown")
    for part, source in drive.needs:
        yield BomItem("wiring", part, quantity=1, source=source, note="price unknown")
    if scanner.slip_ring is not None:
        circuits = scanner.slip_ring.circuits
        part = "plug, socket and heat shrink for the leads of the slip ring"
        yield BomItem(
            "wiring", part, quantity=1, source=f"circuits: {circuits}", note="no plug passes a ring; price unknown"
        )


def _servo_wiring(servo: Servo) -> Iterator[BomItem]:
    """The adapter and the cable of a servo, as the catalogue has them."""
    if servo.adapter is None:
        yield _unknown_wiring(servo)
    for field, price in (("adapter", servo.adapter_usd), ("cable", None)):
        part, origin = getattr(servo, field), servo.provenance().get(field)
        if part is not None:
            yield BomItem(
                "wiring",
                part,
                quantity=1,
                unit_usd=price,
                total_usd=price,
                source=origin.source if origin is not None else "",
                note="" if price is not None else "price unknown",
            )


def _unknown_wiring(product: Product) -> BomItem:
    part = f"cables and power of {product.name}"
    return BomItem("wiring", part, source="not in the catalogue", note="read its data sheet; price unknown")


def _total(items: list[BomItem]) -> BomItem:
    known = [item.total_usd for item in items if item.total_usd is not None]
    unknown = sum(item.total_usd is None for item in items)
    doubtful = sum(item.total_usd is not None and item.verified == "no" for item in items)
    note = f"sum of {len(known)} known prices, {doubtful} of them not verified; {unknown} rows without a price"
    return BomItem("total", "all rows with a price", total_usd=round(sum(known), 2), note=note)
