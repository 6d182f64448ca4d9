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
from cad.assembly.joints import Joint
from cad.checks.remarks import products_of
from cad.drives.drive import Drive
from cad.layout.balance import PART as COUNTERWEIGHT
from cad.layout.balance import SCREW, Counterweight
from cad.screws import INSERT_LENGTH, SCREWS
from design.catalogue.products import Bearing, Belt, Lidar, Servo, SlipRing
from design.scanner import Scanner

PAPER = "Schubert 2016, section 3.5: two USB connections and a 12 V supply"

# What else a product needs: name, quantity, source. A product that is not here asks for its data sheet.
WIRING: dict[str, tuple[tuple[str, int, str], ...]] = {
    "UTM-30LX": (
        ("USB 2.0 cable of the lidar, type A", 1, PAPER),
        ("power lead of the lidar, 12 V, 1 A (brown +, blue 0 V)", 1, "data sheet figures: 12 V, 0.7 A, 1.0 A at most"),
    ),
    "URG-04LX": (
        ("USB 2.0 cable of the lidar, type A", 1, PAPER),
        ("power lead of the lidar, 5 V", 1, "not in the sources of the catalogue: read its data sheet"),
    ),
    "MX-64R": (
        ("USB adapter to RS-485 servos, such as ROBOTIS U2D2", 1, PAPER),
        ("servo cable, 4 pins, with power", 1, "ROBOTIS e-manual mx-64: RS-485, 10 to 14.8 V"),
    ),
    "AX-12A": (
        ("USB adapter to TTL servos, such as ROBOTIS U2D2", 1, PAPER),
        ("servo cable, 3 pins, with power", 1, "ROBOTIS e-manual ax-12a: TTL, 9 to 12 V"),
    ),
}


@dataclass(frozen=True, slots=True)
class Item:
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


def drawing_number(config_hash: str, part: str, assembly: Assembly) -> str:
    """The number of a made part: configuration and place in the assembly."""
    return f"{config_hash}-{list(assembly.made).index(part) + 1}"


def items_of(
    scanner: Scanner,
    assembly: Assembly,
    joints: list[Joint],
    masses_g: dict[str, float],
    metal: set[str],
    config_hash: str,
) -> list[Item]:
    """All rows; the total last.

    Args:
        scanner: angles and products.
        assembly: the solids.
        joints: of `joints_of`.
        masses_g: of the made parts.
        metal: made parts that no printer makes.
        config_hash: of what shapes the parts.
    """
    items = []
    for part in assembly.made:
        number = drawing_number(config_hash, part, assembly)
        made = "turned" if part in metal else "printed"
        file = f"parts/{part}.step" if part in metal else f"print/{part}.3mf"
        how = "aluminium or steel, after" if part in metal else f"{scanner.printer.name}, solid, from"
        bar = assembly.counterweight
        if isinstance(bar, Counterweight) and part == COUNTERWEIGHT:
            made, how = "sawn", f"{bar.stock}, {len(bar.screws)} threads {SCREW.name}, after"
        note = f"{how} {file}; drawing drawings/{part}.pdf"
        items.append(Item(made, part, number, 1, mass_g=round(masses_g[part], 1), note=note))
    items += _products(scanner, assembly.drive)
    items += _screws(joints)
    items += _wiring(scanner, assembly.drive)
    return [*items, _total(items)]


def bom_text(items: list[Item]) -> str:
    """The CSV file."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    names = [field.name for field in fields(Item)]
    writer.writerow(names)
    for item in items:
        writer.writerow(["" if getattr(item, name) is None else getattr(item, name) for name in names])
    return text.getvalue()


def _products(scanner: Scanner, drive: Drive) -> Iterator[Item]:
    for product in products_of(scanner, drive):
        if isinstance(product, Lidar | Servo | SlipRing | Bearing | Belt):
            number = drive.order_number(product)
            yield _bought(product, max(1, drive.products().count(product)), number)


def _bought(product: Lidar | Servo | SlipRing | Bearing | Belt, quantity: int, number: str) -> Item:
    origin = product.provenance().get("price_usd")
    price = product.price_usd
    return Item(
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


def _screws(joints: list[Joint]) -> Iterator[Item]:
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
        where = ", ".join(f"{joint.count} {joint.part} to {joint.onto or 'deck'}" for joint in used)
        total = sum(joint.count for joint in used)
        yield Item("screw", kind, number, total, source="holes of the solids", note=f"{where}; price unknown")
    for name, count in sorted(nuts.items()):
        yield Item("nut", "hexagon nut", f"ISO 4032 {name}", count, source="holes of the solids", note="price unknown")
    for name, count in sorted(inserts.items()):
        note = f"length {INSERT_LENGTH:g}, for a hole of {SCREWS[name].insert:g} mm; price unknown"
        yield Item("insert", "heat-set insert", name, count, source="holes of the solids", note=note)


def _wiring(scanner: Scanner, drive: Drive) -> Iterator[Item]:
    yield Item("wiring", "power supply, 12 V", quantity=1, source=PAPER, note="price unknown")
    for product in (scanner.lidar, scanner.servo):
        needs = WIRING.get(product.name)
        if needs is None:
            part = f"cables and power of {product.name}"
            yield Item("wiring", part, source="not in the catalogue", note="read its data sheet; price unknown")
            continue
        for part, quantity, source in needs:
            yield Item("wiring", part, quantity=quantity, source=source, note="price unknown")
    if scanner.slip_ring is not None:
        circuits = scanner.slip_ring.circuits
        for part, source in drive.wiring():
            yield Item("wiring", part, quantity=1, source=source, note="price unknown")
        part = "plug, socket and heat shrink for the leads of the slip ring"
        yield Item(
            "wiring", part, quantity=1, source=f"circuits: {circuits}", note="no plug passes a ring; price unknown"
        )


def _total(items: list[Item]) -> Item:
    known = [item.total_usd for item in items if item.total_usd is not None]
    unknown = sum(item.total_usd is None for item in items)
    doubtful = sum(item.total_usd is not None and item.verified == "no" for item in items)
    note = f"sum of {len(known)} known prices, {doubtful} of them not verified; {unknown} rows without a price"
    return Item("total", "all rows with a price", total_usd=round(sum(known), 2), note=note)
