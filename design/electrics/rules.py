"""Electrical rule check of a wiring."""

from __future__ import annotations

from collections.abc import Iterator

from scanwright.design.electrics.network import Network, Pin
from scanwright.design.electrics.sizing import OVER_PEAK, wire_a
from scanwright.design.findings import Finding


def check_network(network: Network) -> list[Finding]:
    """Return an error for each broken rule."""
    rules = (_open, _joined, _circuits, _branches, _volts, _colours)
    return [finding for rule in rules for finding in rule(network)]


def _open(network: Network) -> Iterator[Finding]:
    """Every pin has a wire, or is free on purpose; every wire ends in existing pins."""
    wired = {pin for wire in network.wires for pin in (wire.start, wire.end)}
    known: set[Pin] = set()
    for box in network.boxes:
        for name in (*box.left, *box.right):
            known.add((box.name, name))
            if (box.name, name) not in wired and name not in box.free:
                yield _broken(box.name, f"pin {name} is not connected")
    for missing in sorted(wired - known):
        yield _broken(missing[0], f"a wire ends in {missing[1]}, which is not a pin of it")


def _joined(network: Network) -> Iterator[Finding]:
    """No pin joins two nets; grounds are one net, whatever they are called."""
    ground = {"0 V", "GND"}
    nets: dict[Pin, set[str]] = {}
    for wire in network.wires:
        for pin in (wire.start, wire.end):
            nets.setdefault(pin, set()).add("0 V" if wire.net in ground else wire.net)
    for (name, joined), found in sorted(nets.items()):
        if len(found) > 1:
            yield _broken(name, f"pin {joined} joins {' and '.join(sorted(found))}")


def _circuits(network: Network) -> Iterator[Finding]:
    for circuit in network.circuits:
        if circuit.amps > circuit.rated_a:
            yield _broken(
                "ring",
                f"circuit {circuit.number} ({circuit.net}) carries {circuit.amps:g} A, rated {circuit.rated_a:g}",
                "choose a ring with stronger circuits",
            )


def _branches(network: Network) -> Iterator[Finding]:
    """A fuse carries the peak, its wires carry the fuse, the supply carries all."""
    for branch in network.branches:
        if branch.fuse_a < OVER_PEAK * branch.peak_a:
            yield _broken(branch.name, f"{branch.fuse_a:g} A blows at the {branch.peak_a:.2g} A of {branch.feeds}")
        if wire_a(branch.mm2) < branch.fuse_a:
            yield _broken(
                branch.name, f"{branch.mm2:g} mm² carries {wire_a(branch.mm2):g} A, its fuse {branch.fuse_a:g}"
            )
    peak = sum(branch.peak_a for branch in network.branches)
    if peak > network.supply_a:
        yield _broken("supply", f"gives {network.supply_a:g} A, all together draw {peak:.2g}")


def _volts(network: Network) -> Iterator[Finding]:
    for drop in network.drops:
        for volts in (drop.volts, drop.idle_v):
            if not drop.least <= volts <= drop.most:
                yield _broken(drop.device, f"gets {volts:.2f} V, accepts {drop.least:g} to {drop.most:g}")
                break


def _colours(network: Network) -> Iterator[Finding]:
    """No colour without a source: a wrong one makes a person join + to -."""
    for wire in network.wires:
        if wire.colour and not wire.source:
            yield _broken(wire.end[0], f"the colour {wire.colour} of {wire.end[1]} has no source")


def _broken(subject: str, message: str, hint: str = "") -> Finding:
    return Finding("wiring", "error", subject, f"{subject}: {message}", hint=hint)
