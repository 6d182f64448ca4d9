"""Cautions before wiring: what can destroy a device, and how a slip ring affects data."""

from __future__ import annotations

from collections.abc import Iterator

from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.electrics.loads import SUPPLY_V, ElectricLoad
from scanwright.design.electrics.network import Wire
from scanwright.design.scanner import Scanner

MEASURE = "measure first"  # marks a power wire whose colour has no verified source
NARROW_V = 0.5  # margin above 12 V: supplies can be trimmed by more than this
HOW = (
    "switch all power off, unplug the lidar, set a multimeter to continuity, and find the pin of the plug that each "
    "lead beeps to (its data sheet names the pins)"
)
RISKS = {
    "usb": (
        "USB through a ring: full speed (12 Mbit/s) passes good contacts, high speed (480 Mbit/s) only rings made for "
        "it. Keep D- and D+ on neighbouring circuits, twisted on both sides, the shield on its own circuit, the "
        "cables of lidar and computer together under 5 m; power the lidar by its own lead, not by VBUS. A contact that "
        "bounces for microseconds loses the device: `scan` takes the turn again; a powered hub at the lidar or a ring "
        "with gold contacts ends it."
    ),
    "ethernet": (
        "Ethernet through a ring: 100BASE-TX needs two pairs, each twisted up to the ring on neighbouring circuits, "
        "and requires a data-rated ring; a cheap capsule loses frames while it turns. Watch the counters of the port "
        "during a turn; 10BASE-T by a switch that forces it is the way out."
    ),
    "serial": "A serial line passes any ring: at 500 kBaud and more use RS-422 and twist the pairs.",
}
RISKS["usb-powered"] = RISKS["usb"].replace("power the lidar by its own lead, not by VBUS", "VBUS feeds the lidar")


CARRIES = {
    "usb": ("usb2",),
    "usb-powered": ("usb2",),
    "ethernet": ("ethernet100",),
    "serial": ("usb2", "ethernet100", "none"),
}


def data_fault(ring: SlipRing, lidar: Lidar) -> str:
    """Return why a ring is not rated for a lidar's data; empty if it is, or if the catalogue does not know."""
    if ring.data is None or lidar.link is None or ring.data in CARRIES[lidar.link]:
        return ""
    rated = {"usb2": "USB 2.0", "ethernet100": "Ethernet of 100 Mbit/s", "none": "no data"}[ring.data]
    needed = "Ethernet of 100 Mbit/s" if lidar.link == "ethernet" else "USB 2.0"
    return f"{ring.name} is rated for {rated}, and {lidar.name} needs {needed}"


def cautions_of(scanner: Scanner, loads: list[ElectricLoad], wires: list[Wire]) -> Iterator[str]:
    """Yield one or two sentences for each danger."""
    for load in loads:
        yield from _voltage(load)
    yield from _revisions(scanner.lidar)
    if any(wire.note == MEASURE for wire in wires):
        yield f'A swapped + and - can destroy {scanner.lidar.name}. Find each lead marked "{MEASURE}" like this: {HOW}.'
    yield from _levels(scanner.lidar)
    yield from _ties(scanner.lidar)
    pins = scanner.servo.connector or "its data sheet names them"
    yield f"Find V and GND of {scanner.servo.name} by the pins of its plug, not by colour ({pins})."


def _voltage(load: ElectricLoad) -> Iterator[str]:
    if load.bounds_v is not None and not load.bounds_v[0] <= load.volts <= load.bounds_v[1]:
        yield (
            f"Do not connect {load.title}: it accepts {load.bounds_v[0]:g} to {load.bounds_v[1]:g} V, and this wiring "
            f"has no converter for that, only {load.volts:g} V."
        )
    elif load.volts != SUPPLY_V:
        limit = (
            "" if load.bounds_v is None else f" {load.title} accepts {load.bounds_v[0]:g} to {load.bounds_v[1]:g} V."
        )
        yield (
            f"Set the converter that feeds the {load.name} to {load.set_v:g} V, measured with a multimeter, before you "
            f"connect anything to its output.{limit}"
        )
    elif load.bounds_v is not None and load.bounds_v[1] - SUPPLY_V < NARROW_V:
        yield (
            f"Check with a multimeter that the supply gives {SUPPLY_V:g} V before you connect {load.title}. It accepts "
            f"{load.bounds_v[0]:g} to {load.bounds_v[1]:g} V."
        )


def _revisions(lidar: Lidar) -> Iterator[str]:
    colours = lidar.lead_colours()
    if any(len(of_net) > 1 for of_net in colours.values()):
        named = " and ".join(f"{', '.join(of_net)} for {net}" for net, of_net in colours.items())
        yield f"Cables of {lidar.name} differ by revision: its maker has used {named}. Do not trust a colour."


def _levels(lidar: Lidar) -> Iterator[str]:
    if lidar.link == "serial" and lidar.signal_v:
        yield (
            f"The data line of {lidar.name} has {lidar.signal_v:g} V. Use a USB adapter with UART levels of "
            f"{lidar.signal_v:g} V, and leave its 5 V pin open: 5 V logic or an RS-232 port can destroy the lidar."
        )


def _ties(lidar: Lidar) -> Iterator[str]:
    for tie in lidar.tied_pins or ():
        yield f"Join pin {tie.pin} of {lidar.name} to its pin {tie.to}, unless something drives {tie.pin}."
