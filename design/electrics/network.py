"""Records of a wiring: boxes with pins, wires between pins, circuits of the slip ring, branches with a fuse."""

from __future__ import annotations

from dataclasses import dataclass

from scanwright.design.findings import Finding

Pin = tuple[str, str]  # box and pin


@dataclass(frozen=True, slots=True)
class Box:
    """One device.

    Attributes:
        name: unique.
        title: its heading.
        lines: further text in it.
        left: pins towards the supply, from the top.
        right: pins away from it.
        column: its place from left to right.
        free: pins that stay open on purpose.
        bought: whether the parts list has a row for it.
    """

    name: str
    title: str
    lines: tuple[str, ...]
    left: tuple[str, ...]
    right: tuple[str, ...]
    column: int
    free: tuple[str, ...] = ()
    bought: bool = False


@dataclass(frozen=True, slots=True)
class Wire:
    """One wire.

    Attributes:
        start: pin nearer to the supply.
        end: the other one.
        net: what it carries, such as "12 V" or "D+".
        amps: largest current; 0 for signals.
        mm2: cross-section; 0 if it is part of a ready-made cable.
        colour: of its insulation; empty if no verified source names one.
        source: of the colour; empty if there is no colour.
        note: text on the sheet in place of a colour.
    """

    start: Pin
    end: Pin
    net: str
    amps: float
    mm2: float
    colour: str = ""
    source: str = ""
    note: str = ""

    @property
    def words(self) -> str:
        """Its label."""
        size = f"{self.mm2:g} mm²" if self.mm2 else ""
        return ", ".join(filter(None, (self.net, self.colour or self.note, size)))


@dataclass(frozen=True, slots=True)
class Circuit:
    """One circuit of the slip ring.

    Attributes:
        number: from 1; our own, since no maker in the catalogue numbers them.
        rated_a: continuous current.
        net: its use; empty for a spare one.
        amps: largest current.
    """

    number: int
    rated_a: float
    net: str
    amps: float


@dataclass(frozen=True, slots=True)
class Branch:
    """The wires and the device that one fuse protects.

    Attributes:
        name: of the fuse.
        feeds: title of the device.
        continuous_a: at 12 V, in operation.
        peak_a: at 12 V, the largest.
        fuse_a: its rating.
        mm2: of its wires.
    """

    name: str
    feeds: str
    continuous_a: float
    peak_a: float
    fuse_a: float
    mm2: float


@dataclass(frozen=True, slots=True)
class Drop:
    """The voltage at a device.

    Attributes:
        device: its name.
        volts: at its largest continuous current.
        idle_v: without current.
        least: lowest voltage that its maker allows.
        most: highest voltage that its maker allows.
    """

    device: str
    volts: float
    idle_v: float
    least: float
    most: float


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
