"""The wiring of one scanner: a 12 V supply, a fuse and a switch, a fused branch for each device, the ring between."""

from __future__ import annotations

from design.catalogue.products import Lidar, SlipRing, SlotSwitch, Ways
from design.electrics.loads import (
    CHANGER,
    SUPPLY_V,
    UNKNOWN_A,
    ElectricLoad,
    branch_of,
    drops_of,
    loads_of,
)
from design.electrics.network import Box, Branch, Circuit, Network, Wire
from design.electrics.sizing import fuse_for, supply_for, wire_for
from design.scanner import Scanner

USB_A = 0.5  # that a port gives
DATA = {
    "usb": ("VBUS", "D-", "D+", "GND"),
    "usb-powered": ("VBUS", "D-", "D+", "GND"),
    "ethernet": ("TX+", "TX-", "RX+", "RX-"),
    "serial": ("TX", "RX", "GND"),
}
PLUG = {"usb": "USB", "usb-powered": "USB", "ethernet": "Ethernet", "serial": "serial port"}
SIGNALS = {"rs485": ("D+", "D-"), "ttl": ("DATA",)}
HOMING = ("+", "-", "OUT")
FLAG_SWITCH = "switch of the flag"
COMPUTER_SIDE = {  # net and colour at pins of the computer; the input pulls up to its own voltage
    "5 V out": ("5 V", "brown"),
    "0 V out": ("0 V", "blue"),
    "input with pull-up": ("home", "black"),
}
COLOURS = {
    "VBUS": "red",
    "D-": "white",
    "D+": "green",
    "GND": "black",
    "shield": "braid",
    "TX+": "white-orange",
    "TX-": "orange",
    "RX+": "white-green",
    "RX-": "green",
    "TX": "yellow",
    "RX": "green",
}
ORDER = ("black", "brown", "red", "orange", "yellow", "green", "blue", "violet", "grey", "white", "pink", "turquoise")
RISKS = {
    "usb": (
        "USB through a ring: full speed (12 Mbit/s) passes good contacts, high speed (480 Mbit/s) only rings made for "
        "it. Keep D- and D+ on neighbouring circuits, twisted on both sides, the shield on a circuit of its own, the "
        "way between the plugs under 2 m; power the lidar by its own lead, not by VBUS. A contact that bounces for "
        "microseconds loses the device: `scan` takes the turn again; a powered hub at the lidar or a ring with gold "
        "contacts ends it."
    ),
    "ethernet": (
        "Ethernet through a ring: 100BASE-TX needs two pairs, each twisted up to the ring on neighbouring circuits, "
        "and asks for a data-rated ring; a cheap capsule loses frames while it turns. Watch the counters of the port "
        "during a turn; 10BASE-T by a switch that forces it is the way out."
    ),
    "serial": "A serial line passes any ring: at 500 kBaud and more use RS-422 and twist the pairs.",
}
RISKS["usb-powered"] = RISKS["usb"].replace("power the lidar by its own lead, not by VBUS", "VBUS feeds the lidar")


def network_of(scanner: Scanner, switch: SlotSwitch | None = None) -> Network:
    """The wiring of one scanner, and of the switch that its homing flag passes, where it has one.

    Raises:
        ValueError: a device draws more than any fuse of the table carries.
    """
    lidar, ring = scanner.lidar, scanner.slip_ring
    loads = loads_of(scanner)
    branches = [branch_of(number, load) for number, load in enumerate(loads, start=1)]
    circuits = () if ring is None else _circuits(ring, lidar)
    return Network(
        boxes=tuple(_boxes(scanner, switch, loads, branches, circuits)),
        wires=tuple(_wires(scanner, switch, loads, branches, circuits)),
        circuits=circuits,
        branches=tuple(branches),
        drops=tuple(drops_of(loads, branches)),
        supply_a=supply_for(sum(branch.peak_a for branch in branches)),
        risks=() if ring is None or lidar.link is None else (RISKS[lidar.link],),
        unknown=tuple(_unknown(scanner)),
    )


def _data(lidar: Lidar) -> tuple[str, ...]:
    """Nets of its data cable; none where nobody tells how its data leave."""
    return () if lidar.link is None else DATA[lidar.link]


def _nets(lidar: Lidar) -> list[tuple[str, float]]:
    """What the lidar needs of a ring: its power first, then its data; the shield last, which it can do without."""
    peak = lidar.peak_a or UNKNOWN_A
    power = [] if lidar.link == "usb-powered" else [("+", peak), ("-", peak)]
    amps = peak if lidar.link == "usb-powered" else USB_A
    data = [(net, amps if net in ("VBUS", "GND") else 0.0) for net in _data(lidar)]
    return [*power, *data, ("shield", 0.0)]


def _circuits(ring: SlipRing, lidar: Lidar) -> tuple[Circuit, ...]:
    """Power on the strongest circuits, signals on those for signals; what is left is spare."""
    nobody_tells = (Ways(count=len(_nets(lidar)), amps=UNKNOWN_A, use="any"),)
    ways = [(group.amps, group.use) for group in ring.ways or nobody_tells for _ in range(group.count)]
    left, taken = list(range(len(ways))), dict[int, tuple[str, float]]()
    for net, amps in _nets(lidar):
        wanted = "power" if net in ("+", "-") else "signal"
        fit = [i for i in left if ways[i][1] in (wanted, "any")] or [i for i in left if net != "shield"]
        if fit:
            taken[fit[0]] = net, amps
            left.remove(fit[0])
    return tuple(
        Circuit(i + 1, ORDER[i % len(ORDER)], amps, *taken.get(i, ("", 0.0))) for i, (amps, _) in enumerate(ways)
    )


def _feed(load: ElectricLoad) -> str:
    return f"{load.volts:g} V"


def _boxes(
    scanner: Scanner,
    switch: SlotSwitch | None,
    loads: list[ElectricLoad],
    branches: list[Branch],
    circuits: tuple[Circuit, ...],
) -> list[Box]:
    lidar, servo = scanner.lidar, scanner.servo
    total = sum(branch.peak_a for branch in branches)
    supply, fuse = supply_for(total), fuse_for(total)
    bus = tuple(pin for branch in branches for pin in (f"{branch.name} +", f"{branch.name} -"))
    protects = tuple(f"{branch.name}: {branch.fuse_a:g} A, {branch.feeds}" for branch in branches)
    boxes = [
        Box(
            "supply", f"supply 12 V, {supply:g} A", ("mains side: as its maker says",), (), ("+", "-", "PE"), 0, ("PE",)
        ),
        Box("switch", "main fuse and switch", (f"F0: {fuse:g} A, S1: both in +",), ("+ in",), ("+ out",), 1),
        Box("bus", "distribution", (*protects, "- bar: the one ground of all"), ("+", "-"), bus, 2),
    ]
    for load in loads:
        if load.volts != SUPPLY_V:
            title = f"{CHANGER[load.volts]} for the {load.name}"
            size = (f"at least {load.peak_a:.2g} A, set to {load.set_v:g} V",)
            boxes.append(Box(f"{load.name} converter", title, size, ("in +", "in -"), ("out +", "out -"), 3))
    signals = SIGNALS[servo.bus or "ttl"]
    plug = "data port" if lidar.link is None else PLUG[lidar.link]
    homing = () if switch is None else tuple(COMPUTER_SIDE)
    boxes += [
        Box("computer", "computer", ("its USB ports",), ("5 V", "0 V"), ("USB servo", plug, *homing), 4),
        Box("adapter", "servo adapter", ("such as U2D2: data only",), ("USB",), (*signals, "GND"), 5),
        Box(
            "servo",
            servo.name,
            (f"{servo.connector or 'connector unknown'}; it has two", "one for power, one for data"),
            ("V", "GND", *signals, "GND data"),
            (),
            6,
        ),
    ]
    if switch is not None:
        boxes.append(Box(FLAG_SWITCH, switch.name, (switch.output,), (*HOMING, "L"), (), 6, ("L",)))
    data = _data(lidar)
    power = () if lidar.link == "usb-powered" else ("+", "-")
    shielded = not circuits or any(circuit.net == "shield" for circuit in circuits)
    pins = (*power, *data, *(("shield",) if shielded else ()))
    boxes.append(Box("plug", f"{plug} of the computer", ("a cut cable",), (plug,), (*data, "shield"), 5, ("shield",)))
    if circuits:
        ring = scanner.slip_ring
        assert ring is not None
        still = tuple(f"{circuit.number} {circuit.net or 'spare'}" for circuit in circuits)
        spare = tuple(pin for pin, circuit in zip(still, circuits, strict=True) if not circuit.net)
        boxes.append(Box("ring", ring.name, ("left: stator, right: rotor",), still, still, 6, spare))
    boxes.append(Box("lidar", lidar.name, (lidar.connector or "connector unknown",), pins, (), 7))
    return boxes


def _wires(
    scanner: Scanner,
    switch: SlotSwitch | None,
    loads: list[ElectricLoad],
    branches: list[Branch],
    circuits: tuple[Circuit, ...],
) -> list[Wire]:
    lidar, servo = scanner.lidar, scanner.servo
    total = sum(branch.peak_a for branch in branches)
    thick = wire_for(fuse_for(total))
    wires = [
        Wire(("supply", "+"), ("switch", "+ in"), "12 V", total, thick, "red"),
        Wire(("switch", "+ out"), ("bus", "+"), "12 V", total, thick, "red"),
        Wire(("supply", "-"), ("bus", "-"), "0 V", total, thick, "black"),
    ]
    ends = {"computer": ("5 V", "0 V"), "servo": ("V", "GND"), "lidar": ("+", "-")}
    inside = {circuit.net: f"{circuit.number} {circuit.net}" for circuit in circuits if circuit.net}
    leads = {lead.net: lead.colour for lead in lidar.leads or ()}
    for load, branch in zip(loads, branches, strict=True):
        target = "ring" if load.name == "lidar" and circuits else load.name
        feeds = [(("bus", f"{branch.name} {sign}")) for sign in "+-"]
        amps = branch.peak_a
        if load.volts != SUPPLY_V:
            box = f"{load.name} converter"
            for feed, sign, colour in zip(feeds, "+-", ("red", "black"), strict=True):
                net = "12 V" if sign == "+" else "0 V"
                wires.append(Wire(feed, (box, f"in {sign}"), net, amps, branch.mm2, colour))
            feeds, amps = [(box, "out +"), (box, "out -")], load.peak_a
        for feed, sign, end in zip(feeds, "+-", ends[load.name], strict=True):
            net = _feed(load) if sign == "+" else "0 V"
            pin = inside.get(end, end) if target == "ring" else end
            colour = leads.get("+" if sign == "+" else "-", "") if target == "lidar" else ""
            mm2 = max(branch.mm2, wire_for(fuse_for(amps)))
            wires.append(Wire(feed, (target, pin), net, amps, mm2, colour or ("red" if sign == "+" else "black")))
            if target == "ring" and pin != end:
                other = leads.get("+" if sign == "+" else "-", "lead's colour unknown")
                wires.append(Wire(("ring", pin), ("lidar", end), net, load.peak_a, 0.0, other))
    plug = "data port" if lidar.link is None else PLUG[lidar.link]
    wires += [
        Wire(("computer", "USB servo"), ("adapter", "USB"), "USB", 0.0, 0.0, "its cable"),
        Wire(("computer", plug), ("plug", plug), plug, 0.0, 0.0, "its cable"),
    ]
    signals = SIGNALS[servo.bus or "ttl"]
    wires += [Wire(("adapter", pin), ("servo", pin), pin, 0.0, 0.0, "servo cable") for pin in signals]
    wires.append(Wire(("adapter", "GND"), ("servo", "GND data"), "GND", 0.0, 0.0, "servo cable"))
    if switch is not None:
        for (pin, (net, colour)), end in zip(COMPUTER_SIDE.items(), HOMING, strict=True):
            amps = 0.0 if end == "OUT" else switch.current_a
            wires.append(Wire(("computer", pin), (FLAG_SWITCH, end), net, amps, 0.0, colour))
    peaks = dict(_nets(lidar))
    for net in (*_data(lidar), "shield"):
        colour = COLOURS[net]
        if not circuits:
            wires.append(Wire(("plug", net), ("lidar", net), net, peaks[net], 0.0, colour))
        elif net in inside:
            wires.append(Wire(("plug", net), ("ring", inside[net]), net, peaks[net], 0.0, colour))
            wires.append(Wire(("ring", inside[net]), ("lidar", net), net, peaks[net], 0.0, colour))
    return wires


def _unknown(scanner: Scanner) -> list[str]:
    lidar, servo, ring = scanner.lidar, scanner.servo, scanner.slip_ring
    facts: dict[str, object] = {
        f"{lidar.name}: supply_v": lidar.supply_v,
        f"{lidar.name}: current_a and peak_a": lidar.peak_a,
        f"{lidar.name}: link": lidar.link,
        f"{servo.name}: supply_v": servo.supply_v,
        f"{servo.name}: stall_a": servo.stall_a,
        f"{servo.name}: bus": servo.bus,
    }
    if lidar.link != "usb-powered":
        facts[f"{lidar.name}: leads (the colours of its power lead)"] = lidar.leads
    if ring is not None:
        facts[f"{ring.name}: ways"] = ring.ways
    return [name for name, value in facts.items() if value is None]
