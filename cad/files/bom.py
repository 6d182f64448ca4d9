"""`bom.csv`: everything to print, turn and buy for one scanner, with what is known of numbers and prices.

Prices are those of the catalogue, each with its source and year. Where it has none, a range of `prices.py` stands in
columns of its own, stated as an estimate; the last row adds both up and names what has not even that.
"""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.assembly.cable_instructions import tied_at
from scanwright.cad.assembly.print_settings import print_words
from scanwright.cad.checks.remarks import products_of
from scanwright.cad.drawings.files import drawing_number
from scanwright.cad.files.prices import ESTIMATED, FILAMENT_USD_PER_KG, RECENT, UNSURE, estimate_usd, year_of
from scanwright.cad.layout.drive import DriveLayout
from scanwright.cad.layout.joints import Joint
from scanwright.cad.parts.part_spec import Row
from scanwright.cad.screws import INSERT_LENGTH, SCREWS
from scanwright.design.catalogue.products import Bearing, Belt, Lidar, Product, Servo, SlipRing
from scanwright.design.electrics.wiring import network_of
from scanwright.design.scanner import Scanner

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
        kind: printed, turned, sawn, material, bought, screw, nut, insert, wiring, consumable, tool or total.
        part: what it is.
        number: drawing number of a made part, designation of a standard part.
        quantity: pieces.
        supplier: maker.
        supplier_number: what to order there.
        unit_usd: price of one.
        total_usd: price of all.
        low_usd: least that all of them may cost: from the price, or an estimate.
        high_usd: most.
        priced: year of the price.
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
    low_usd: float | None = None
    high_usd: float | None = None
    priced: str = ""
    mass_g: float | None = None
    source: str = ""
    verified: str = ""
    note: str = ""


def items_of(
    scanner: Scanner,
    assembly: Assembly,
    joints: Sequence[Joint],
    masses_g: dict[str, float],
    config_hash: str,
) -> list[BomItem]:
    """All rows; the total last.

    Args:
        scanner: angles and products.
        assembly: the solids.
        joints: of the layout.
        masses_g: of the made parts.
        config_hash: of what shapes the parts.
    """
    items = []
    for name in assembly.made:
        part, number = assembly.parts[name], drawing_number(config_hash, name, assembly)
        how = f"{scanner.printer.name}, {print_words(scanner.printer)}, from print/{name}.3mf"
        if part.metal:
            how = f"{', '.join(filter(None, (part.material, part.work)))}, after parts/{name}.step"
        note = f"{how}; drawing drawings/{name}.pdf"
        items.append(BomItem(part.process, name, number, 1, mass_g=round(masses_g[name], 1), note=note))
    items.append(_filament(scanner, items))
    items += _products(scanner, assembly.layout.drive)
    items += _screws(joints)
    items += _wiring(scanner)
    items += _ties(assembly)
    items += _electrics(scanner)
    items += _with_it(assembly, joints)
    items = [_ranged(item) for item in items]
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
            orders = (station.order for station in drive.stations if station.product == product and station.order)
            yield _bought(product, max(1, drive.products.count(product)), next(orders, product.name))


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


def _screws(joints: Sequence[Joint]) -> Iterator[BomItem]:
    screws: dict[str, list[Joint]] = {}
    nuts: dict[str, int] = {}
    inserts: dict[str, int] = {}
    standards = {joint.screw.name: joint.screw.nut_standard for joint in joints}
    for joint in joints:
        if joint.stands_out_mm is None:
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
        yield BomItem("nut", "hexagon nut", f"{standards[name]} {name}", count, source=JOINTS, note="price unknown")
    for name, count in sorted(inserts.items()):
        note = f"length {INSERT_LENGTH:g}, for a hole of {SCREWS[name].insert:g} mm; price unknown"
        yield BomItem("insert", "heat-set insert", name, count, source=JOINTS, note=note)


def _wiring(scanner: Scanner) -> Iterator[BomItem]:
    supply = f"power supply, {PAPER_V:g} V, {network_of(scanner).supply_a:g} A"
    yield BomItem("wiring", supply, quantity=1, source=PAPER, note="price unknown")
    yield from _servo_wiring(scanner.servo)
    needs = WIRING.get(scanner.lidar.name)
    if needs is None:
        yield _unknown_wiring(scanner.lidar)
    for part, quantity, source in needs or ():
        yield BomItem("wiring", part, quantity=quantity, source=source, note="price unknown")
    if scanner.slip_ring is not None:
        circuits = scanner.slip_ring.circuits
        part = "plug, socket, crimps and heat shrink for the leads of the slip ring"
        yield BomItem(
            "wiring", part, quantity=1, source=f"circuits: {circuits}", note="no plug passes a ring; price unknown"
        )


def _ties(assembly: Assembly) -> Iterator[BomItem]:
    """Cable ties, one for each place that the steps name."""
    places = Counter(tied_at(assembly.layout))
    if places:
        note = f"{', '.join(f'{count} at the {place}' for place, count in places.items())}; price unknown"
        yield BomItem("wiring", "cable tie, 2.5 mm", quantity=places.total(), source="assembly.md", note=note)


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


def _filament(scanner: Scanner, items: list[BomItem]) -> BomItem:
    """Plastic of all printed parts, a tenth more for supports and what fails."""
    grams = 1.1 * sum(item.mass_g or 0.0 for item in items if item.kind == "printed")
    low, high = (round(grams / 1000 * usd, 2) for usd in FILAMENT_USD_PER_KG)
    return BomItem(
        kind="material",
        part="plastic to print, by mass",
        quantity=1,
        low_usd=low,
        high_usd=high,
        mass_g=round(grams, 1),
        source=ESTIMATED,
        note=f"{scanner.printer.maker}; a kg for {FILAMENT_USD_PER_KG[0]:g} to {FILAMENT_USD_PER_KG[1]:g} USD",
    )


def _electrics(scanner: Scanner) -> Iterator[BomItem]:
    """What the wiring needs beside the devices themselves."""
    network, source = network_of(scanner), "wiring.md"
    blades: dict[float, int] = {}
    for branch in network.branches:
        blades[branch.fuse_a] = blades.get(branch.fuse_a, 0) + 1
    for amps, count in sorted(blades.items()):
        note = f"{count} in use, 1 spare"
        yield BomItem("wiring", f"blade fuse, {amps:g} A", "ISO 8820-3", count + 1, source=source, note=note)
    main = next(box for box in network.boxes if box.name == "switch")
    yield BomItem("wiring", "main fuse with holder", "ISO 8820-3", 1, source=source, note=main.lines[0])
    yield BomItem("wiring", "switch, 12 V DC", quantity=1, source=source, note=main.lines[0])
    yield BomItem("wiring", "distribution with fuse holders, and a ground bar", quantity=1, source=source)
    for box in network.boxes:
        if box.name.endswith("converter"):
            yield BomItem("wiring", box.title, quantity=1, source=source, note=", ".join(box.lines))
    for mm2 in sorted({wire.mm2 for wire in network.wires if wire.mm2 > 0}):
        yield BomItem(
            "wiring", f"stranded wire, {mm2:g} mm², red and black", "IEC 60228", 1, source=source, note="5 m each"
        )


def _with_it(assembly: Assembly, joints: Sequence[Joint]) -> Iterator[BomItem]:
    """Small things of the parts, what is used up, and tools."""
    rows = dict.fromkeys(row for name in assembly.made for row in assembly.parts[name].rows)
    yield from (_row(row) for row in rows if row.kind != "tool")
    locked = "screws that end in metal or nuts"
    yield BomItem(
        "consumable", "threadlocker, medium strength", quantity=1, source=locked, note="a few drops; price unknown"
    )
    sizes = ", ".join(sorted({joint.screw.name for joint in joints}))
    yield BomItem("tool", "hexagon keys", quantity=1, source=JOINTS, note=f"for {sizes}; price unknown")
    yield BomItem("tool", "torque screwdriver, 0.1 to 1 N m", quantity=1, source="assembly.md", note="price unknown")
    yield BomItem("tool", "multimeter", quantity=1, source="wiring.md", note="price unknown")
    yield from (_row(row) for row in rows if row.kind == "tool")
    if any(joint.inserts for joint in joints):
        yield BomItem("tool", "soldering iron", quantity=1, source="assembly.md", note="for the inserts; price unknown")


def _row(row: Row) -> BomItem:
    note = "; ".join(filter(None, (row.note, "price unknown")))
    return BomItem(row.kind, row.part, quantity=1, source=row.source, note=note)


def _ranged(item: BomItem) -> BomItem:
    """The row with what it may cost: its price, wider where that is doubtful, or an estimate."""
    if item.low_usd is not None:
        return item
    if item.total_usd is not None:
        year = year_of(item.source)
        low, high = (1.0, 1.0) if item.verified == "yes" and year >= RECENT else UNSURE
        usd = item.total_usd
        return replace(item, low_usd=round(low * usd, 2), high_usd=round(high * usd, 2), priced=year)
    each = estimate_usd(item.kind, item.part)
    if each is None:
        return item
    low, high = (round((item.quantity or 1) * usd, 2) for usd in each)
    said = item.note.replace("price unknown", "").rstrip("; ")
    note = "; ".join(filter(None, (said, "" if item.kind == "printed" else ESTIMATED)))
    return replace(item, low_usd=low, high_usd=high, note=note)


def _total(items: list[BomItem]) -> BomItem:
    known = [item.total_usd for item in items if item.total_usd is not None]
    unknown = sum(item.total_usd is None for item in items)
    doubtful = sum(item.total_usd is not None and item.verified == "no" for item in items)
    open_ = [item.part for item in items if item.low_usd is None]
    tools = sum(item.high_usd or 0.0 for item in items if item.kind == "tool")
    note = (
        f"sum of {len(known)} known prices, {doubtful} of them not verified; {unknown} rows without a price: the range "
        f"counts them by estimates, tools up to {tools:.0f}; "
        f"{'not in the range: ' + ', '.join(open_) if open_ else 'nothing is without an estimate'}; no tax, no carriage"
    )
    low, high = (
        round(sum(usd for item in items if (usd := getattr(item, end)) is not None)) for end in ("low_usd", "high_usd")
    )
    return BomItem(
        "total", "all rows with a price", total_usd=round(sum(known), 2), low_usd=low, high_usd=high, note=note
    )
