"""The electrical rule check of a wiring."""

from __future__ import annotations

from collections.abc import Iterator

from scanwright.design.electrics.network import Network, Pin
from scanwright.design.electrics.sizing import OVER_PEAK, wire_a
from scanwright.design.findings import Finding


def check_network(network: Network) -> list[Finding]:
    """Return an error for every broken rule, about its box, branch or device; empty if the wiring is correct."""
    rules = (_open, _joined, _circuits, _branches, _volts, _colours)
    return [finding for rule in rules for finding in rule(network)]


def _open(network: Network) -> Iterator[Finding]:
    """Every pin has a wire or is free on purpose; every wire ends in pins that exist."""
    wired = {pin for wire in network.wires for pin in (wire.start, wire.end)}
    known: set[Pin] = set()
    for box in network.boxes:
        for name in (*box.left, *box.right):
            known.add((box.name, name))
            if (box.name, name) not in wired and name not in box.free:
                yield Finding("open_pin", "error", box.name, f"pin {name} is not connected")
    for missing in sorted(wired - known):
        yield Finding("open_pin", "error", missing[0], f"a wire ends in {missing[1]}, which is not a pin of it")


def _joined(network: Network) -> Iterator[Finding]:
    """No pin joins two nets; grounds are one net, whatever they are called."""
    ground = {"0 V", "GND"}
    nets: dict[Pin, set[str]] = {}
    for wire in network.wires:
        for pin in (wire.start, wire.end):
            nets.setdefault(pin, set()).add("0 V" if wire.net in ground else wire.net)
    for (name, pin_name), joined in sorted(nets.items()):
        if len(joined) > 1:
            yield Finding("joined_nets", "error", name, f"pin {pin_name} joins {' and '.join(sorted(joined))}")


def _circuits(network: Network) -> Iterator[Finding]:
    for circuit in network.circuits:
        if circuit.amps > circuit.rated_a:
            yield Finding(
                "circuit_current",
                "error",
                "ring",
                f"circuit {circuit.number} ({circuit.net}) carries {circuit.amps:g} A, rated {circuit.rated_a:g}: "
                "choose a ring with stronger circuits",
            )


def _branches(network: Network) -> Iterator[Finding]:
    """A fuse carries the peak, its wires carry the fuse, the supply carries all."""
    for branch in network.branches:
        if branch.fuse_a < OVER_PEAK * branch.peak_a:
            yield Finding(
                "branch_current",
                "error",
                branch.name,
                f"{branch.fuse_a:g} A blows at the {branch.peak_a:.2g} A of {branch.feeds}",
            )
        if wire_a(branch.mm2) < branch.fuse_a:
            yield Finding(
                "branch_current",
                "error",
                branch.name,
                f"{branch.mm2:g} mm² carries {wire_a(branch.mm2):g} A, its fuse {branch.fuse_a:g}",
            )
    peak = sum(branch.peak_a for branch in network.branches)
    if peak > network.supply_a:
        yield Finding(
            "branch_current", "error", "supply", f"gives {network.supply_a:g} A, all together draw {peak:.2g}"
        )


def _volts(network: Network) -> Iterator[Finding]:
    for drop in network.drops:
        for volts in (drop.volts, drop.idle_v):
            if not drop.least <= volts <= drop.most:
                yield Finding(
                    "voltage", "error", drop.device, f"gets {volts:.2f} V, wants {drop.least:g} to {drop.most:g}"
                )
                break


def _colours(network: Network) -> Iterator[Finding]:
    """No colour without a source: a wrong one makes a person join + to -."""
    for wire in network.wires:
        if wire.colour and not wire.source:
            yield Finding(
                "colour_source", "error", wire.end[0], f"the colour {wire.colour} of {wire.end[1]} has no source"
            )
