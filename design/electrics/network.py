"""Records of a wiring: boxes with pins, wires between pins, circuits of the slip ring, branches with a fuse."""

from __future__ import annotations

from dataclasses import dataclass

from scanwright.design.findings import Finding

Pin = tuple[str, str]  # box and pin


@dataclass(frozen=True, slots=True)
class Box:
    """One device."""

    name: str  # unique
    title: str  # its heading
    lines: tuple[str, ...]  # further text in it
    left: tuple[str, ...]  # pins towards the supply, from the top
    right: tuple[str, ...]  # pins away from it
    column: int  # its place from left to right
    free: tuple[str, ...] = ()  # pins that stay open on purpose
    bought: bool = False  # whether the parts list has a row for it


@dataclass(frozen=True, slots=True)
class Wire:
    """One wire."""

    start: Pin  # pin nearer to the supply
    end: Pin  # the other one
    net: str  # what it carries, such as "12 V" or "D+"
    amps: float  # largest current; 0 for signals
    mm2: float  # cross-section; 0 if it is part of a ready-made cable
    colour: str = ""  # of its insulation; empty if no verified source names one
    source: str = ""  # of the colour; empty if there is no colour
    note: str = ""  # text on the sheet in place of a colour

    @property
    def words(self) -> str:
        """Its label."""
        size = f"{self.mm2:g} mm²" if self.mm2 else ""
        return ", ".join(filter(None, (self.net, self.colour or self.note, size)))


@dataclass(frozen=True, slots=True)
class Circuit:
    """One circuit of the slip ring."""

    number: int  # from 1; our own, since no maker in the catalogue numbers them
    rated_a: float  # continuous current
    net: str  # its use; empty for a spare one
    amps: float  # largest current


@dataclass(frozen=True, slots=True)
class Branch:
    """The wires and the device that one fuse protects."""

    name: str  # of the fuse
    feeds: str  # title of the device
    continuous_a: float  # at 12 V, in operation
    peak_a: float  # at 12 V, the largest
    fuse_a: float  # its rating
    mm2: float  # of its wires


@dataclass(frozen=True, slots=True)
class Drop:
    """The voltage at a device."""

    device: str  # its name
    volts: float  # at its largest continuous current
    idle_v: float  # without current
    least: float  # lowest voltage that its maker allows
    most: float  # highest voltage that its maker allows


@dataclass(frozen=True, slots=True)
class Network:
    """All of it; `cautions` are for a person before wiring, `unknown` warn of values that the catalogue lacks."""

    boxes: tuple[Box, ...]
    wires: tuple[Wire, ...]
    circuits: tuple[Circuit, ...]
    branches: tuple[Branch, ...]
    drops: tuple[Drop, ...]
    supply_a: float
    risks: tuple[str, ...]
    cautions: tuple[str, ...]
    unknown: tuple[Finding, ...]
