"""`wiring.svg` and `wiring.md`: how a scanner is wired, drawn and in words, with what each wire and circuit carries."""

from __future__ import annotations

from collections.abc import Iterator

from scanwright.cad.files.schematic import schematic_svg
from scanwright.design.electrics.loads import COMPUTER_W, LEADS_M
from scanwright.design.electrics.network import Network
from scanwright.design.electrics.rules import check_network
from scanwright.design.electrics.sizing import OVER_PEAK
from scanwright.design.electrics.wiring import network_of
from scanwright.design.scanner import Scanner

GROUND = (
    "One ground: every - comes back to the - bar of the distribution, the case of the supply to the protective earth "
    "of its mains side, the shield of a data cable to the computer's end only. Wire with the supply off and F0 out; "
    "measure from each + to - before F0 goes in."
)
STALLED = (
    "A servo that is stopped by force draws its stall current until its own guard lets go: the supply, F0 and its "
    "branch carry that for as long, everything else keeps running."
)


def wiring_files(scanner: Scanner, digest: str) -> dict[str, bytes]:
    """Both files by name.

    Args:
        scanner: angles and products.
        digest: of what shapes the parts.
    """
    network = network_of(scanner)
    title = f"{scanner.angles.task}: wiring ({digest})"
    return {
        "wiring.svg": schematic_svg(network, title).encode("utf-8"),
        "wiring.md": wiring_text(network, title).encode("utf-8"),
    }


def wiring_text(network: Network, title: str) -> str:
    """The words: paragraphs and lists, no tables, so that the report shows the same."""
    blocks = [f"# {title}"]
    for heading, lines in (
        ("Do not build this wiring", [f"- {fault.subject}: {fault.message}" for fault in check_network(network)]),
        ("Caution", [*(f"- {caution}" for caution in network.cautions), GROUND]),
        ("Power", list(_power(network))),
        ("Slip ring", list(_ring(network))),
        ("Wires", list(_wires(network))),
        ("Data through the ring", list(network.risks)),
        ("Not known", [f"- {fact}: measure or ask its maker" for fact in network.unknown]),
    ):
        if lines:
            listed = [line for line in lines if line.startswith("- ")]
            said = [line for line in lines if not line.startswith("- ")]
            blocks += [f"## {heading}", *(["\n".join(listed)] if listed else []), *said]
    return "\n\n".join(blocks) + "\n"


def _power(network: Network) -> Iterator[str]:
    for branch in network.branches:
        yield (
            f"- {branch.name}, {branch.feeds}: {branch.continuous_a:.2g} A lasting, {branch.peak_a:.2g} A at most, "
            f"fuse {branch.fuse_a:g} A, wires {branch.mm2:g} mm²"
        )
    lasting, peak = (sum(getattr(branch, name) for branch in network.branches) for name in ("continuous_a", "peak_a"))
    yield (
        f"- all at 12 V: {lasting:.2g} A lasting ({12 * lasting:.0f} W), {peak:.2g} A at most ({12 * peak:.0f} W); "
        f"supply {network.supply_a:g} A"
    )
    for drop in network.drops:
        yield (
            f"- {drop.device} gets {drop.idle_v:.2f} V at rest and {drop.volts:.2f} V at its largest current, and "
            f"accepts {drop.least:g} to {drop.most:g} V ({LEADS_M:g} m of leads, and the ring if it is behind it)"
        )
    yield (
        "Currents are those of the catalogue, where `scanwright catalogue NAME` tells source and doubt; the computer "
        f"is taken to use {COMPUTER_W:g} W. A fuse carries {OVER_PEAK:g} times the peak of its branch, a wire its "
        f"fuse. {STALLED}"
    )


def _ring(network: Network) -> Iterator[str]:
    for circuit in network.circuits:
        if not circuit.net:
            yield f"- {circuit.number}: spare, {circuit.rated_a:g} A"
            continue
        load = (
            f"{circuit.amps:g} A of {circuit.rated_a:g}, {circuit.rated_a / circuit.amps:.2g} times"
            if circuit.amps
            else "signal"
        )
        yield f"- {circuit.number}: {circuit.net}, {load}"
    if network.circuits:
        yield (
            "The numbers are ours: the makers of these rings number no circuit. If the leads differ in thickness, the "
            "thick ones are the circuits with the higher current. Set a multimeter to continuity, find the two ends of "
            "each circuit, stator and rotor, and write its number on both."
        )


def _wires(network: Network) -> Iterator[str]:
    titles = {box.name: box.title for box in network.boxes}
    for wire in network.wires:
        carries = f", {wire.amps:.2g} A" if wire.amps else ""
        yield (
            f"- {titles[wire.start[0]]} {wire.start[1]} to {titles[wire.end[0]]} {wire.end[1]}: {wire.words}{carries}"
        )
    sources = {wire.source: None for wire in network.wires if wire.source}
    yield f"Where the colours come from: {'; '.join(sources)}. A wire without a colour may have any."
