"""`bom.csv`: everything to print, turn and buy for one scanner, with quantities and prices.

Prices are those of the catalogue, each with its source and year, or a range of `prices.py` in separate columns. The
last row adds up both and names the rows that have neither.
"""

import csv
import io
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.assembly.print_settings import hours_in_words, print_hours, print_words
from scanwright.cad.assembly.scenes import tied_at
from scanwright.cad.checks.access import NO_BLADES
from scanwright.cad.drawings.files import drawing_number
from scanwright.cad.files.bom_item import COLUMNS, JOINTS, STEPS, WIRING_TEXT, BomItem
from scanwright.cad.files.bom_tools import tools_and_consumables
from scanwright.cad.files.prices import EACH_USD, ESTIMATED, RECENT, UNSURE, year_of
from scanwright.cad.layout.drive import DriveLayout, products_of
from scanwright.cad.layout.joints import Joint
from scanwright.cad.screws import INSERT_LENGTH
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.product_base import Product
from scanwright.design.catalogue.products import Bearing, Belt
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.electrics.wiring import connectors_of, network_of, plug_of, uart_adapter
from scanwright.design.scanner import Scanner

CATALOGUE_CABLES = "cables of the catalogue"
PAPER = "Schubert 2016, section 3.5: two USB connections and a 12 V supply"
PAPER_V = 12.0  # of its supply
WASTE = 0.1  # of the plastic of the parts, more for supports and failed prints
FILAMENT_USD_PER_KG = (15.0, 35.0)


def items_of(
    assembly: Assembly,
    masses_g: dict[str, float],
    plates: Sequence[Sequence[str]] = (),
    blades_mm: Mapping[Joint, int] = NO_BLADES,
) -> list[BomItem]:
    """Return all rows, the total last.

    Args:
        assembly: the scanner.
        masses_g: of the made parts.
        plates: the parts printed together.
        blades_mm: of the joints that need a long key, see `access.blades_mm`.
    """
    items, scanner, joints = [], assembly.layout.scanner, assembly.layout.joints
    for name in assembly.made:
        part, number = assembly.parts[name], drawing_number(name, assembly)
        how = f"{scanner.printer.name}, {print_words(scanner.printer)}, from print/{name}.3mf"
        if part.metal:
            how = f"{', '.join(filter(None, (part.material, part.work)))}, after parts/{name}.step"
        note, estimate = f"{how}; drawing drawings/{name}.pdf", name if name in EACH_USD else part.process
        mass_g = round(masses_g[name], 1)
        items.append(BomItem(part.process, name, number, mass_g=mass_g, note=note, estimate=estimate))
    items.append(_filament(scanner, items, plates))
    items += _products(scanner, assembly.layout.drive)
    items += _screws(joints)
    items += _wiring(scanner)
    items += _ties(assembly)
    items += _electrics(scanner)
    items += tools_and_consumables(assembly, blades_mm)
    items = [_ranged(item) for item in items]
    return [*items, _total(items)]


def bom_text(items: list[BomItem]) -> str:
    """Return the CSV file."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for item in items:
        writer.writerow(["" if getattr(item, name) is None else getattr(item, name) for name in COLUMNS])
    return text.getvalue()


def _products(scanner: Scanner, drive: DriveLayout) -> Iterator[BomItem]:
    for product in products_of(scanner, drive):
        if not isinstance(product, Lidar | Servo | SlipRing | Bearing | Belt):
            continue
        orders = (station.order for station in drive.stations if station.product == product and station.order)
        number, quantity = next(orders, product.name), max(1, drive.products.count(product))
        origin, price = product.provenance().get("price_usd"), product.price_usd
        yield BomItem(
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
        )


def _screws(joints: Sequence[Joint]) -> Iterator[BomItem]:
    screws: dict[str, list[Joint]] = {}
    small: Counter[tuple[int, str, str, str, str]] = Counter()  # by place in the list, kind, name, number, note
    for joint in joints:
        screw = joint.screw
        if joint.protrudes_mm is None:
            screws.setdefault(joint.number, []).append(joint)
        if joint.fixing in ("nut", "deck") or joint.traps:
            small[0, "nut", "hexagon nut", f"{screw.nut_standard} {screw.name}", ""] += joint.count
        if joint.washer_mm is not None:
            small[1, "washer", "plain washer", f"ISO {7093 if screw.nominal >= 3 else 7089} {screw.name}", ""] += (
                joint.count
            )
        if joint.inserts:
            note = f"length {INSERT_LENGTH:g}, for a hole of {screw.insert:g} mm"
            small[2, "insert", "heat-set insert", screw.name, note] += joint.count
    for number, used in sorted(screws.items()):
        kind = "grub screw" if used[0].fixing == "grub" else "cap screw"
        places = ", ".join(f"{joint.count} {joint.part} to {joint.onto}" for joint in used)
        total = sum(joint.count for joint in used)
        yield BomItem("screw", kind, number, total, source=JOINTS, note=places, estimate="screw")
    for (_, kind, name, number, note), count in sorted(small.items()):
        yield BomItem(kind, name, number, count, source=JOINTS, note=note, estimate=kind)


def _wiring(scanner: Scanner) -> Iterator[BomItem]:
    lidar, ring = scanner.lidar, scanner.slip_ring
    supply = f"power supply, {PAPER_V:g} V, {network_of(scanner).supply_a:g} A"
    note = f"for mains; on a robot a DC/DC converter from its battery to {PAPER_V:g} V"
    yield BomItem("wiring", supply, source=PAPER, note=note, estimate="power supply")
    yield from _servo_wiring(scanner.servo)
    if lidar.cables is None:
        yield _unknown_wiring(lidar)
    for cable, connector in connectors_of(lidar):
        if not cable.fixed:
            to = "bare ends" if cable.end == "bare" else f"a plug {cable.end}"
            lead, source = f"lead for the plug of the lidar, to {to}, {cable.length_mm:g} mm", CATALOGUE_CABLES
            yield BomItem("wiring", lead, source=source, note=lidar.connector or "", estimate="power cable")
        if ring is not None:
            note = "on the rotor, on leads of the slip ring"
            yield BomItem("wiring", connector.words, source=WIRING_TEXT, note=note, estimate="plug and socket")
    if adapter := uart_adapter(lidar):
        note = "joins the lidar's data to the computer; not RS-232, not 5 V"
        yield BomItem("wiring", adapter, source=WIRING_TEXT, note=note, estimate="UART adapter")
    elif ring is not None:
        yield BomItem(
            "wiring", f"{plug_of(lidar)} plug with bare leads", source=WIRING_TEXT, estimate="plug and socket"
        )
    if ring is not None:
        part, source = "crimps and heat shrink for the leads of the slip ring", f"circuits: {ring.circuits}"
        yield BomItem("wiring", part, source=source, estimate="crimps")


def _ties(assembly: Assembly) -> Iterator[BomItem]:
    """Yield the cable ties, one for each place that the steps name."""
    places = Counter(tied_at(assembly.layout))
    if places:
        note = ", ".join(f"{count} at the {place}" for place, count in places.items())
        count = places.total()
        yield BomItem("wiring", "cable tie, 2.5 mm", quantity=count, source=STEPS, note=note, estimate="cable tie")


def _servo_wiring(servo: Servo) -> Iterator[BomItem]:
    """Yield the adapter and the cable of a servo from the catalogue."""
    if servo.adapter is None:
        yield _unknown_wiring(servo)
    both = "one whole for data, one to cut for power"
    for field, price, count, note, estimate in (
        ("adapter", servo.adapter_usd, 1, "", "adapter"),
        ("cable", None, 2, both, "servo cable"),
    ):
        part, origin = getattr(servo, field), servo.provenance().get(field)
        if part is not None:
            source = origin.source if origin is not None else ""
            yield BomItem("wiring", part, "", count, "", "", price, price, source=source, note=note, estimate=estimate)


def _unknown_wiring(product: Product) -> BomItem:
    part, source = f"cables and power of {product.name}", "not in the catalogue"
    return BomItem(
        "wiring", part, quantity=None, source=source, note="read its data sheet", estimate="cables and power"
    )


def _filament(scanner: Scanner, items: list[BomItem], plates: Sequence[Sequence[str]]) -> BomItem:
    hours = {item.part: print_hours(item.mass_g or 0.0, scanner.printer) for item in items if item.kind == "printed"}
    parts_g = sum(item.mass_g or 0.0 for item in items if item.kind == "printed")
    grams = (1 + WASTE) * parts_g
    each = (
        f"plate {n} {hours_in_words(sum(hours[part] for part in plate))}" for n, plate in enumerate(plates, start=1)
    )
    of_plates = f" ({', '.join(each)})" if len(plates) > 1 else ""
    time = f"{hours_in_words(sum(hours.values()))} to print with supports{of_plates}"
    contains = f"{parts_g:.1f} g of parts, {WASTE:.0%} more for supports and failed prints"
    a_kg = f"a kg for {FILAMENT_USD_PER_KG[0]:g} to {FILAMENT_USD_PER_KG[1]:g} USD"
    low, high = (round(grams / 1000 * usd, 2) for usd in FILAMENT_USD_PER_KG)
    return BomItem(
        kind="material",
        part="plastic to print, by mass",
        low_usd=low,
        high_usd=high,
        mass_g=round(grams, 1),
        source=ESTIMATED,
        note=f"{time}; {contains}; {scanner.printer.maker}; {a_kg}",
    )


def _electrics(scanner: Scanner) -> Iterator[BomItem]:
    """Yield the parts of the wiring other than devices."""
    network = network_of(scanner)
    fuses = Counter(branch.fuse_a for branch in network.branches)
    main = next(box for box in network.boxes if box.name == "switch").lines[0]
    rows = [
        *(
            (f"blade fuse, {amps:g} A", "ISO 8820-3", count + 1, f"{count} in use, 1 spare", "fuse")
            for amps, count in sorted(fuses.items())
        ),
        ("main fuse with holder", "ISO 8820-3", 1, main, "main fuse"),
        ("switch, 12 V DC", "", 1, main, "switch"),
        ("distribution with fuse holders, and a ground bar", "", 1, "", "distribution"),
        *((box.title, "", 1, ", ".join(box.lines), "converter") for box in network.boxes if box.bought),
        *(
            (f"stranded wire, {mm2:g} mm², red and black", "IEC 60228", 1, "5 m each", "wire")
            for mm2 in sorted({wire.mm2 for wire in network.wires if wire.mm2 > 0})
        ),
    ]
    for part, number, quantity, note, estimate in rows:
        yield BomItem("wiring", part, number, quantity, source=WIRING_TEXT, note=note, estimate=estimate)


def _ranged(item: BomItem) -> BomItem:
    """Return the row with its price range: of its price, wider if that is unverified or old, or of an estimate."""
    if item.low_usd is not None:
        return item
    if item.total_usd is not None:
        year = year_of(item.source)
        low, high = (1.0, 1.0) if item.verified == "yes" and year >= RECENT else UNSURE
        usd = item.total_usd
        return replace(item, low_usd=round(low * usd, 2), high_usd=round(high * usd, 2), priced=year)
    if not item.estimate:
        return replace(item, note="; ".join(filter(None, (item.note, "price unknown"))))
    low, high = (round((item.quantity or 1) * usd, 2) for usd in EACH_USD[item.estimate])
    note = "; ".join(filter(None, (item.note, "" if item.kind == "printed" else ESTIMATED)))
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
        f"{'not in the range: ' + ', '.join(open_) if open_ else 'every row has an estimate'}; no tax, no shipping"
    )
    low, high = (
        round(sum(usd for item in items if (usd := getattr(item, end)) is not None)) for end in ("low_usd", "high_usd")
    )
    return BomItem(
        kind="total",
        part="all rows with a price",
        quantity=None,
        total_usd=round(sum(known), 2),
        low_usd=low,
        high_usd=high,
        note=note,
    )
