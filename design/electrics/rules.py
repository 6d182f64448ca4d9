"""Electrical rule check of a wiring."""

from __future__ import annotations

from collections.abc import Iterator

from scanwright.design.electrics.network import Network, Pin
from scanwright.design.electrics.sizing import OVER_PEAK, wire_a
from scanwright.design.findings import Finding

Faults = Iterator[tuple[str, str]]  # subject and message


def check_network(network: Network) -> list[Finding]:
    """Return an error for every broken rule, about its box, branch or device; empty if the wiring is correct."""
    rules = {
        "open_pin": _open,
        "joined_nets": _joined,
        "circuit_current": _circuits,
        "branch_current": _branches,
        "voltage": _volts,
        "colour_source": _colours,
    }
    faults = [(code, *fault) for code, rule in rules.items() for fault in rule(network)]
    return [Finding(code, "error", subject, f"{subject}: {message}") for code, subject, message in faults]


def _open(network: Network) -> Faults:
    """Every pin has a wire or is free on purpose; every wire ends in pins that exist."""
    wired = {pin for wire in network.wires for pin in (wire.start, wire.end)}
    known: set[Pin] = set()
    for box in network.boxes:
        for name in (*box.left, *box.right):
            known.add((box.name, name))
            if (box.name, name) not in wired and name not in box.free:
                yield box.name, f"pin {name} is not connected"
    for box_name, pin in sorted(wired - known):
        yield box_name, f"a wire ends in {pin}, which is not a pin of it"


def _joined(network: Network) -> Faults:
    """No pin joins two nets; grounds are one net, whatever they are called."""
    nets: dict[Pin, set[str]] = {}
    for wire in network.wires:
        for pin in (wire.start, wire.end):
            nets.setdefault(pin, set()).add("0 V" if wire.net in ("0 V", "GND") else wire.net)
    for (box_name, pin_name), joined in sorted(nets.items()):
        if len(joined) > 1:
            yield box_name, f"pin {pin_name} joins {' and '.join(sorted(joined))}"


def _circuits(network: Network) -> Faults:
    for circuit in network.circuits:
        if circuit.amps > circuit.rated_a:
            rated = f"carries {circuit.amps:g} A, rated {circuit.rated_a:g}: choose a ring with stronger circuits"
            yield "ring", f"circuit {circuit.number} ({circuit.net}) {rated}"


def _branches(network: Network) -> Faults:
    """A fuse carries the peak, its wires carry the fuse, the supply carries all."""
    for branch in network.branches:
        if branch.fuse_a < OVER_PEAK * branch.peak_a:
            yield branch.name, f"{branch.fuse_a:g} A blows at the {branch.peak_a:.2g} A of {branch.feeds}"
        if wire_a(branch.mm2) < branch.fuse_a:
            yield branch.name, f"{branch.mm2:g} mm² carries {wire_a(branch.mm2):g} A, its fuse {branch.fuse_a:g}"
    peak = sum(branch.peak_a for branch in network.branches)
    if peak > network.supply_a:
        yield "supply", f"gives {network.supply_a:g} A, all together draw {peak:.2g}"


def _volts(network: Network) -> Faults:
    for drop in network.drops:
        volts = next((v for v in (drop.volts, drop.idle_v) if not drop.least <= v <= drop.most), None)
        if volts is not None:
            yield drop.device, f"gets {volts:.2f} V, requires {drop.least:g} to {drop.most:g}"


def _colours(network: Network) -> Faults:
    """No colour without a source: a wrong one makes a person join + to -."""
    for wire in network.wires:
        if wire.colour and not wire.source:
            yield wire.end[0], f"the colour {wire.colour} of {wire.end[1]} has no source"
