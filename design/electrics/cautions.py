"""What a person must know before the first wire is joined, since a mistake can destroy a device."""

from __future__ import annotations

from collections.abc import Iterator

from design.catalogue.products import Lidar
from design.electrics.loads import SUPPLY_V, ElectricLoad
from design.scanner import Scanner

NARROW_V = 0.5  # of room above 12 V: a supply that is trimmed higher than this can destroy the device
HOW = (
    "switch all power off, unplug the cable from the lidar, set a multimeter to continuity, and find for each lead "
    "the pin of the plug that it beeps to; the data sheet of its maker names the pins"
)


def cautions_of(scanner: Scanner, loads: list[ElectricLoad]) -> Iterator[str]:
    """One sentence or two for each danger."""
    for load in loads:
        yield from _voltage(load)
    if scanner.lidar.link != "usb-powered":
        yield from _leads(scanner.lidar)
    yield from _ties(scanner.lidar)
    yield f"Find V and GND of {scanner.servo.name} by the pins of its plug, not by colour."


def _voltage(load: ElectricLoad) -> Iterator[str]:
    if load.bounds_v is not None and not load.bounds_v[0] <= load.volts <= load.bounds_v[1]:
        yield (
            f"Do not connect {load.title}: it accepts {load.bounds_v[0]:g} to {load.bounds_v[1]:g} V, and this wiring "
            f"has no converter for that, only {load.volts:g} V."
        )
    elif load.volts != SUPPLY_V:
        limit = "" if load.bounds_v is None else f" It accepts {load.bounds_v[0]:g} to {load.bounds_v[1]:g} V."
        yield (
            f"Set the converter for the {load.name} to {load.set_v:g} V with a multimeter before you connect "
            f"{load.title}.{limit}"
        )
    elif load.bounds_v is not None and load.bounds_v[1] - SUPPLY_V < NARROW_V:
        yield (
            f"Check with a multimeter that the supply gives {SUPPLY_V:g} V before you connect {load.title}. It accepts "
            f"{load.bounds_v[0]:g} to {load.bounds_v[1]:g} V."
        )


def _leads(lidar: Lidar) -> Iterator[str]:
    """How to find + and - if no colour can be trusted."""
    colours = lidar.lead_colours()
    if any(len(of_net) > 1 for of_net in colours.values()):
        named = " and ".join(f"{', '.join(of_net)} for {net}" for net, of_net in colours.items())
        yield f"Cables of {lidar.name} differ by revision: its maker has used {named}. Do not trust a colour."
    if not all(len(colours.get(net, ())) == 1 for net in "+-"):
        yield f"A swapped + and - can destroy {lidar.name}. Measure its leads first: {HOW}."


def _ties(lidar: Lidar) -> Iterator[str]:
    for tie in lidar.tied_pins or ():
        yield f"Join pin {tie.pin} of {lidar.name} to its pin {tie.to}, unless something drives {tie.pin}."
