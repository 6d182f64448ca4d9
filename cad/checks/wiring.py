"""The electrical rule check of the wiring, and the values that it lacks."""

from dataclasses import replace

from scanwright.cad.layout.names import RING
from scanwright.design.electrics.cautions import data_fault
from scanwright.design.electrics.rules import check_network
from scanwright.design.electrics.wiring import network_of
from scanwright.design.findings import Finding
from scanwright.design.scanner import Scanner


def wiring_checks(scanner: Scanner) -> list[Finding]:
    """Return every broken rule of the wiring, or one finding if none is; then the missing values."""
    network = network_of(scanner)
    summary = (
        f"wiring: all {len(network.wires)} wires end in pins, every pin is used or spare, no circuit, wire, fuse or "
        "supply is overloaded, and every device gets its voltage"
    )
    ok = Finding("wiring", "ok", f"{scanner.lidar.name} and {scanner.servo.name}", summary)
    broken = [replace(fault, code="wiring") for fault in check_network(network)]
    slow = "" if scanner.slip_ring is None else data_fault(scanner.slip_ring, scanner.lidar)
    hint = "test the link through the turning ring before you build"
    data = [Finding("ring_data", "warning", RING, f"{slow}: data can be lost", hint=hint)] if slow else []
    return [*(broken or [ok]), *network.unknown, *data]
