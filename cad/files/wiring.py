"""`wiring.svg` and `wiring.md`: the wiring of a scanner as a drawing and as text, with the load of each wire."""

from scanwright.cad.files.schematic import schematic_svg
from scanwright.cad.parts.part_spec import BENCH
from scanwright.design.electrics.loads import COMPUTER_W, LEADS_M, SUPPLY_V
from scanwright.design.electrics.network import Network
from scanwright.design.electrics.rules import check_network
from scanwright.design.electrics.sizing import OVER_PEAK
from scanwright.design.electrics.wiring import network_of
from scanwright.design.findings import sentence
from scanwright.design.scanner import Scanner

GROUND = (
    "One ground: connect every - to the - bar of the distribution, the case of a mains supply to protective earth, and "
    "the shield of a data cable at the computer's end only. Wire with the supply off and F0 removed; measure from each "
    "+ to - before you insert F0."
)
STALLED = (
    "A blocked servo draws its stall current until its own protection acts: the supply, F0 and its branch carry that "
    "current, and everything else keeps running."
)
Section = tuple[list[str], list[str]]  # items of a list, then paragraphs


def wiring_files(scanner: Scanner, digest: str) -> dict[str, bytes]:
    """Return both files by name; `digest` identifies the configuration."""
    network = network_of(scanner)
    title = f"{scanner.angles.task}: wiring ({digest})"
    return {
        "wiring.svg": schematic_svg(network, title).encode("utf-8"),
        "wiring.md": wiring_text(network, title).encode("utf-8"),
    }


def wiring_text(network: Network, title: str) -> str:
    """Return the text: paragraphs and lists, no tables, as the report shows them."""
    sections: dict[str, Section] = {
        "Do not build this wiring": ([sentence(broken) for broken in check_network(network)], []),
        "Caution": ([*network.cautions], [GROUND]),
        BENCH: (_bench(network), []),
        "Power": _power(network),
        "Slip ring": _ring(network),
        "Wires": _wires(network),
        "Data through the ring": ([], [*network.risks]),
        "Unknown": ([sentence(unknown) for unknown in network.unknown], []),
    }
    blocks = [f"# {title}"]
    for heading, (items, paragraphs) in sections.items():
        if items or paragraphs:
            listed = ["\n".join(f"- {item}" for item in items)] if items else []
            blocks += [f"## {heading}", *listed, *paragraphs]
    return "\n\n".join(blocks) + "\n"


def _bench(network: Network) -> list[str]:
    """Return how to power and connect the servo before it is built in."""
    titles = {box.name: box.title for box in network.boxes}
    plus, minus = (next(wire for wire in network.wires if wire.end == ("servo", pin)) for pin in ("V", "GND"))
    feed = f"{titles[plus.start[0]]} {plus.start[1]}"
    return [
        f"Wire the supply up to {feed}. Insert F0, switch on, measure {plus.net} from {plus.start[1]} to "
        f"{minus.start[1]}, and switch off.",
        f"Power: cut one servo cable, join its V to {plus.start[1]} and its GND to {minus.start[1]}, and insulate its "
        f"data wires. Switch on, measure {plus.net} from V to GND at its plug, switch off, and plug it in.",
        "Data: plug the second servo cable, whole, into the servo's other socket and the adapter, and the adapter "
        "into the computer. Switch on.",
    ]


def _power(network: Network) -> Section:
    continuous, peak = (
        sum(getattr(branch, name) for branch in network.branches) for name in ("continuous_a", "peak_a")
    )
    items = [
        *(
            f"{branch.name}, {branch.feeds}: {branch.continuous_a:.2g} A continuous, {branch.peak_a:.2g} A at most, "
            f"fuse {branch.fuse_a:g} A, wires {branch.mm2:g} mm²"
            for branch in network.branches
        ),
        f"all at 12 V: {continuous:.2g} A continuous ({12 * continuous:.0f} W), {peak:.2g} A at most "
        f"({12 * peak:.0f} W); supply {network.supply_a:g} A",
        *(
            f"{drop.device} gets {drop.idle_v:.2f} V at rest and {drop.volts:.2f} V at its largest current, and "
            f"accepts {drop.least:g} to {drop.most:g} V ({LEADS_M:g} m of wires, and the ring if it is behind it)"
            for drop in network.drops
        ),
    ]
    sources = (
        "Currents are those of the catalogue: `scanwright catalogue NAME` prints source and uncertainty; the computer "
        f"is assumed to use {COMPUTER_W:g} W. A fuse carries {OVER_PEAK:g} times the peak of its branch, a wire its "
        f"fuse. {STALLED}"
    )
    return items, [_on_robot(network, peak), sources]


def _on_robot(network: Network, peak_a: float) -> str:
    """Return what replaces the mains supply on a robot."""
    words = (
        f"On a robot, a DC/DC converter from its battery to {SUPPLY_V:g} V and at least {peak_a:.2g} A replaces the "
        "mains supply; its input must accept the battery full and empty."
    )
    direct = [drop for drop in network.drops if drop.idle_v == SUPPLY_V]  # without a converter
    if not direct:
        return words
    least, most = max(drop.least + drop.idle_v - drop.volts for drop in direct), min(drop.most for drop in direct)
    return (
        f"{words} A battery within {least:.1f} to {most:g} V needs none if each converter behind it accepts that; "
        f"below {SUPPLY_V:g} V the servo has less torque than the checks assume."
    )


def _ring(network: Network) -> Section:
    items = []
    for circuit in network.circuits:
        use = f"spare, {circuit.rated_a:g} A"
        if circuit.net:
            load = f"{circuit.amps:g} A of {circuit.rated_a:g}, factor {circuit.rated_a / (circuit.amps or 1):.2g}"
            use = f"{circuit.net}, {load if circuit.amps else 'signal'}"
        items.append(f"{circuit.number}: {use}")
    numbers = (
        "The numbers are assigned here: the makers of these rings number no circuits. If the leads differ in "
        "thickness, the thick ones are the circuits with the higher current. Set a multimeter to continuity, find the "
        "two ends of each circuit, stator and rotor, and write its number on both."
    )
    return items, [numbers] if items else []


def _wires(network: Network) -> Section:
    titles = {box.name: box.title for box in network.boxes}
    items = [
        f"{titles[wire.start[0]]} {wire.start[1]} to {titles[wire.end[0]]} {wire.end[1]}: {wire.words}"
        + (f", {wire.amps:.2g} A" if wire.amps else "")
        for wire in network.wires
    ]
    sources = {wire.source: None for wire in network.wires if wire.source}
    return items, [f"Sources of the colours: {'; '.join(sources)}. A wire without a colour may have any."]
