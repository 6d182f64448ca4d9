"""The wiring of one scanner: a 12 V supply, a fuse and a switch, a fused branch for each device, the ring between."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator

from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.lidar_cable import Cable, Connector, connector_for
from scanwright.design.catalogue.product_base import Circuits
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.electrics.cautions import MEASURE, RISKS, cautions_of
from scanwright.design.electrics.loads import (
    CHANGER,
    SUPPLY_V,
    UNKNOWN_A,
    ElectricLoad,
    branch_of,
    drops_of,
    loads_of,
    most_a,
)
from scanwright.design.electrics.network import Box, Branch, Circuit, Network, Pin, Wire
from scanwright.design.electrics.sizing import fuse_for, supply_for, wire_for
from scanwright.design.errors import BuildError
from scanwright.design.findings import Finding
from scanwright.design.scanner import Scanner

USB_A = 0.5  # of a port: USB 2.0 specification, 7.2.1
LINE_CHARS = 36  # width of the text in a box
DATA = {
    "usb": ("VBUS", "D-", "D+", "GND"),
    "usb-powered": ("VBUS", "D-", "D+", "GND"),
    "ethernet": ("TX+", "TX-", "RX+", "RX-"),
    "serial": ("TX", "RX", "GND"),
}
PLUG = {"usb": "USB", "usb-powered": "USB", "ethernet": "Ethernet", "serial": "serial port"}
SIGNALS = {"rs485": ("D+", "D-"), "ttl": ("DATA",)}
OWN = {"+": "red", "-": "black"}  # wires that the user cuts between the boxes of the supply
OWN_SOURCE = "your own wires: red is +, black is -"
USB = {"VBUS": "red", "D-": "white", "D+": "green", "GND": "black"}
ETHERNET = {"TX+": "white-orange", "TX-": "orange", "RX+": "white-green", "RX-": "green"}
LEADS = {  # of plugs and sockets that are bought with bare leads
    "usb": (USB, "USB 2.0 specification, chapter 6"),
    "usb-powered": (USB, "USB 2.0 specification, chapter 6"),
    "ethernet": (ETHERNET, "TIA-568-B"),
}
BARE_PLUG, OWN_CABLE = "a plug with bare leads", "its cable"
CROSSED = {"TX": "RX", "RX": "TX"}  # one side sends what the other receives


def network_of(scanner: Scanner) -> Network:
    """Return the wiring of one scanner.

    Raises:
        ValueError: a device draws more than any fuse of the table carries.
    """
    lidar, ring = scanner.lidar, scanner.slip_ring
    loads = loads_of(scanner)
    branches = [branch_of(number, load) for number, load in enumerate(loads, start=1)]
    circuits = () if ring is None else circuits_of(ring, lidar)
    wires = _wires(scanner, loads, branches, circuits)
    return Network(
        boxes=tuple(_boxes(scanner, loads, branches, circuits)),
        wires=tuple(wires),
        circuits=circuits,
        branches=tuple(branches),
        drops=tuple(drops_of(loads, branches)),
        supply_a=supply_for(sum(branch.peak_a for branch in branches)),
        risks=() if ring is None or lidar.link is None else (RISKS[lidar.link],),
        cautions=tuple(cautions_of(scanner, loads, wires)),
        unknown=tuple(_unknown(scanner)),
    )


def plug_of(lidar: Lidar) -> str:
    """Return the port of the computer for the data of a lidar."""
    return "USB lidar" if uart_adapter(lidar) else "data port" if lidar.link is None else PLUG[lidar.link]


def uart_adapter(lidar: Lidar) -> str:
    """Return the adapter between a serial line of logic levels and the computer; empty for RS-232 and other links."""
    return f"USB to {lidar.signal_v:g} V UART adapter" if lidar.link == "serial" and lidar.signal_v else ""


def _data(lidar: Lidar) -> tuple[str, ...]:
    """Return the nets of its data cable, named from the lidar's side; none if the catalogue has no `link`."""
    nets = () if lidar.link is None else DATA[lidar.link]
    return tuple(net for net in nets if not (lidar.sends_only and net == "RX"))


def _shield(lidar: Lidar) -> tuple[str, ...]:
    """Return the shield of its data cable; a plug with a single line has none."""
    return () if lidar.sends_only else ("shield",)


def _nets(lidar: Lidar) -> list[tuple[str, float]]:
    """Return the nets that the lidar needs in a ring: power, data, and last the shield, which is optional."""
    most = most_a(lidar)
    power = [] if lidar.link == "usb-powered" else [("+", most), ("-", most)]
    amps = most if lidar.link == "usb-powered" else USB_A
    data = [(net, amps if net in ("VBUS", "GND") else 0.0) for net in _data(lidar)]
    return [*power, *data, *((net, 0.0) for net in _shield(lidar))]


def circuits_of(ring: SlipRing, lidar: Lidar) -> tuple[Circuit, ...]:
    """Return for each net the first circuit that carries its current, of its use if possible; the others are spare."""
    assumed = (Circuits(count=len(_nets(lidar)), amps=UNKNOWN_A, use="any"),)
    rated = [(group.amps, group.use) for group in ring.ways or assumed for _ in range(group.count)]
    left, used = list(range(len(rated))), dict[int, tuple[str, float]]()
    for net, amps in _nets(lidar):
        uses = ("power" if net in ("+", "-") else "signal", "any")
        fit = [i for i in left if net != "shield" or rated[i][1] in uses]
        if fit:
            best = min(fit, key=lambda i: (rated[i][0] < amps, rated[i][1] not in uses, i))
            used[best] = net, amps
            left.remove(best)
    return tuple(Circuit(i + 1, amps, *used.get(i, ("", 0.0))) for i, (amps, _) in enumerate(rated))


def require_circuits(ring: SlipRing, lidar: Lidar, others: Iterable[SlipRing] = ()) -> None:
    """Check that each circuit of a ring carries the lidar's largest current.

    Raises:
        BuildError: one does not; the message names those of the other rings that do.
    """
    weak = _weak_circuit(ring, lidar)
    if weak is not None:
        strong = [other.name for other in others if _weak_circuit(other, lidar) is None]
        raise BuildError(
            f"slip_ring {ring.name}: circuits: {lidar.name} draws up to {weak.amps:g} A by {weak.net}, a circuit is "
            f"rated for {weak.rated_a:g} A; take {', '.join(strong) or 'a ring with stronger circuits'}, or no ring"
        )


def _weak_circuit(ring: SlipRing, lidar: Lidar) -> Circuit | None:
    return next((each for each in circuits_of(ring, lidar) if each.amps > each.rated_a), None)


def _boxes(
    scanner: Scanner,
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
            "supply",
            f"supply 12 V, {supply:g} A",
            ("mains side: as its maker states",),
            (),
            ("+", "-", "PE"),
            0,
            ("PE",),
        ),
        Box("switch", "main fuse and switch", (f"F0: {fuse:g} A, S1: both in +",), ("+ in",), ("+ out",), 1),
        Box("bus", "distribution", (*protects, "- bar: the one ground of all"), ("+", "-"), bus, 2),
    ]
    for load in loads:
        if load.volts != SUPPLY_V:
            title = f"{CHANGER[load.volts]} for the {load.name}"
            size = (f"at least {load.peak_a:.2g} A, set to {load.set_v:g} V",)
            sides = ("in +", "in -"), ("out +", "out -")
            boxes.append(Box(f"{load.name} converter", title, size, *sides, 3, bought=True))
    signals = SIGNALS[servo.bus or "ttl"]
    plug = plug_of(lidar)
    boxes += [
        Box("computer", "computer", ("its USB ports",), ("5 V", "0 V"), ("USB servo", plug), 4),
        Box("adapter", "servo adapter", ("such as U2D2: data only",), ("USB",), (*signals, "GND"), 5),
        Box(
            "servo",
            servo.name,
            (*textwrap.wrap(servo.connector or "connector unknown", LINE_CHARS), "two plugs: power, and data"),
            ("V", "GND", *signals, "GND data"),
            (),
            6,
        ),
    ]
    data = _data(lidar)
    power = () if lidar.link == "usb-powered" else ("+", "-")
    shielded = not circuits or any(circuit.net == "shield" for circuit in circuits)
    pins = (*power, *data, *(_shield(lidar) if shielded else ()))
    ends = (*(CROSSED.get(net, net) for net in data), "shield")
    bare = bool(circuits) or lidar.link in (None, "serial")
    words, adapter = BARE_PLUG if bare else OWN_CABLE, uart_adapter(lidar)
    if adapter:
        boxes.append(Box("plug", adapter, ("not RS-232",), ("USB",), ends, 5, ("shield",)))
    else:
        boxes.append(Box("plug", f"{plug} of the computer", (words,), (plug,), ends, 5, ("shield",)))
    if circuits:
        ring = scanner.slip_ring
        assert ring is not None
        still = tuple(f"{circuit.number} {circuit.net or 'spare'}" for circuit in circuits)
        spare = tuple(pin for pin, circuit in zip(still, circuits, strict=True) if not circuit.net)
        boxes.append(Box("ring", ring.name, ("left: stator, right: rotor",), still, still, 6, spare))
        for name, connector, nets in _sockets(lidar, circuits):
            boxes.append(
                Box(
                    name,
                    connector.words,
                    ("on the rotor: takes the lidar's", "cable, which stays whole"),
                    nets,
                    nets,
                    7,
                )
            )
    ties = lidar.tied_pins or ()
    ends_bare = any(cable.end == "bare" for cable in lidar.cables or ())
    tied_words = tuple(f"join {tie.pin} to {tie.to} at its {'bare end' if ends_bare else 'plug'}" for tie in ties)
    tied = tuple(dict.fromkeys(pin for tie in ties for pin in (tie.pin, tie.to)))
    plug_words = textwrap.wrap(lidar.connector or "connector unknown", LINE_CHARS)
    boxes.append(Box("lidar", lidar.name, (*plug_words, *tied_words), pins, tied, 8))
    return boxes


def connectors_of(lidar: Lidar) -> list[tuple[Cable, Connector]]:
    """Return each cable of a lidar and the mate of its far end on the rotor; none if the catalogue has no cables."""
    nets = [net for net, _ in _nets(lidar)]
    tied = len({tie.pin for tie in lidar.tied_pins or ()})
    return [
        (cable, connector_for(cable.end, sum(map(cable.takes, nets)) + (tied if cable.carries != "power" else 0)))
        for cable in lidar.cables or ()
    ]


def _sockets(lidar: Lidar, circuits: tuple[Circuit, ...]) -> list[tuple[str, Connector, tuple[str, ...]]]:
    """Return name, connector and nets of each box between ring and lidar."""
    used = [circuit.net for circuit in circuits if circuit.net]
    return [
        (f"socket {number}", connector, tuple(net for net in used if cable.takes(net)))
        for number, (cable, connector) in enumerate(connectors_of(lidar), start=1)
    ]


def _wires(
    scanner: Scanner,
    loads: list[ElectricLoad],
    branches: list[Branch],
    circuits: tuple[Circuit, ...],
) -> list[Wire]:
    lidar, servo = scanner.lidar, scanner.servo
    total = sum(branch.peak_a for branch in branches)
    thick = wire_for(fuse_for(total))
    wires = [
        _own(("supply", "+"), ("switch", "+ in"), total, thick),
        _own(("switch", "+ out"), ("bus", "+"), total, thick),
        _own(("supply", "-"), ("bus", "-"), total, thick),
    ]
    ends = {"computer": ("5 V", "0 V"), "servo": ("V", "GND"), "lidar": ("+", "-")}
    inside = {circuit.net: f"{circuit.number} {circuit.net}" for circuit in circuits if circuit.net}
    for load, branch in zip(loads, branches, strict=True):
        target = "ring" if load.name == "lidar" and circuits else load.name
        feeds = [(("bus", f"{branch.name} {sign}")) for sign in "+-"]
        amps = branch.peak_a
        if load.volts != SUPPLY_V:
            box = f"{load.name} converter"
            wires += [_own(feed, (box, f"in {sign}"), amps, branch.mm2) for feed, sign in zip(feeds, "+-", strict=True)]
            feeds, amps = [(box, "out +"), (box, "out -")], load.peak_a
        mm2 = max(branch.mm2, wire_for(fuse_for(amps)))
        for feed, sign, end in zip(feeds, "+-", ends[load.name], strict=True):
            net = f"{load.volts:g} V" if sign == "+" else "0 V"
            pin = inside.get(end, end) if target == "ring" else end
            lead = _lead(lidar, sign) if target == "lidar" else {}
            wires.append(Wire(feed, (target, pin), net, amps, mm2, **lead))
            if target == "ring" and pin != end:
                wires += _on_rotor(lidar, ("ring", pin), end, net, load.peak_a, circuits)
    plug = plug_of(lidar)
    end = "USB" if uart_adapter(lidar) else plug
    wires += [
        Wire(("computer", "USB servo"), ("adapter", "USB"), "USB", 0.0, 0.0, note=OWN_CABLE),
        Wire(("computer", plug), ("plug", end), end, 0.0, 0.0, note=OWN_CABLE),
    ]
    signals = SIGNALS[servo.bus or "ttl"]
    joined = {**{pin: pin for pin in signals}, "GND": "GND data"}
    wires += [Wire(("adapter", pin), ("servo", end), pin, 0.0, 0.0, note="servo cable") for pin, end in joined.items()]
    peaks = dict(_nets(lidar))
    for net in (*_data(lidar), *_shield(lidar)):
        start = ("plug", CROSSED.get(net, net))
        if not circuits:
            note = _data_note(net) if lidar.link in (None, "serial") else OWN_CABLE
            wires.append(Wire(start, ("lidar", net), net, peaks[net], 0.0, note=note))
        elif net in inside:
            wires.append(Wire(start, ("ring", inside[net]), net, peaks[net], 0.0, **_bought(lidar, net)))
            wires += _on_rotor(lidar, ("ring", inside[net]), net, net, peaks[net], circuits)
    wires += [
        Wire(("lidar", tie.pin), ("lidar", tie.to), "GND", 0.0, 0.0, note="join these two")
        for tie in lidar.tied_pins or ()
    ]
    return wires


def _own(start: Pin, end: Pin, amps: float, mm2: float) -> Wire:
    """Return a 12 V wire between boxes of the supply; its sign is that of the pin at its end."""
    sign = "+" if "+" in end[1] else "-"
    return Wire(start, end, "12 V" if sign == "+" else "0 V", amps, mm2, OWN[sign], OWN_SOURCE)


def _lead(lidar: Lidar, sign: str) -> dict[str, str]:
    """Return colour and source of a power lead of the lidar if its cables have only one, else the note to measure."""
    colours = lidar.lead_colours().get(sign, ())
    if len(colours) != 1:
        return {"note": MEASURE}
    return {"colour": colours[0], "source": lidar.provenance()["leads"].source}


def _on_rotor(
    lidar: Lidar, ring: Pin, pin: str, net: str, amps: float, circuits: tuple[Circuit, ...]
) -> Iterator[Wire]:
    """Yield the wires from a circuit of the ring to a pin of the lidar: by its socket or terminal, if it has one."""
    cable = next((cable for cable in lidar.cables or () if cable.takes(pin)), None)
    socket = next((name for name, _, nets in _sockets(lidar, circuits) if pin in nets), "")
    own = _lead(lidar, pin) if pin in ("+", "-") else {"note": _data_note(pin)}
    if cable is None or not socket:
        yield Wire(ring, ("lidar", pin), net, amps, 0.0, **own)
        return
    bought = {} if cable.end == "bare" else _bought(lidar, pin)
    yield Wire(ring, (socket, pin), net, amps, 0.0, **bought)
    yield Wire((socket, pin), ("lidar", pin), net, amps, 0.0, **(own if cable.end == "bare" else {"note": OWN_CABLE}))


def _bought(lidar: Lidar, net: str) -> dict[str, str]:
    """Return colour and source of a lead that a plug or socket is bought with."""
    colours, source = LEADS.get(lidar.link or "", ({}, ""))
    if net in colours:
        return {"colour": colours[net], "source": source}
    return {"note": MEASURE if net in ("+", "-") else _data_note(net)}


def _data_note(net: str) -> str:
    """Return the note on a data wire without a colour: wires that carry power are measured."""
    return {"shield": "braid", "VBUS": MEASURE, "GND": MEASURE}.get(net, "")


def _unknown(scanner: Scanner) -> Iterator[Finding]:
    """Yield a warning for each value that the catalogue lacks."""
    lidar, servo, ring = scanner.lidar, scanner.servo, scanner.slip_ring
    values: list[tuple[str, str, object]] = [
        (lidar.name, "supply_v", lidar.supply_v),
        (lidar.name, "current_a and peak_a", lidar.peak_a),
        (lidar.name, "link", lidar.link),
        (servo.name, "supply_v", servo.supply_v),
        (servo.name, "stall_a", servo.stall_a),
        (servo.name, "bus", servo.bus),
    ]
    if lidar.link != "usb-powered":
        values.append((lidar.name, "leads (the colours of its power cable)", lidar.leads))
    if ring is not None:
        values += [(ring.name, "ways", ring.ways), (lidar.name, "cables", lidar.cables)]
    for product, field, value in values:
        if value is None:
            message = f"{product}: {field} is not in the catalogue"
            yield Finding("wiring", "warning", product, message, hint="measure it, or ask its maker")
