"""How the servo turns the shaft: on its axis, or beside it by a belt where the ring is a capsule.

`drive_of` is the one place that decides. Everything else asks the drive: what it is made of, weighs and bears, how it
is put together. Importing this is cheap; the kernel is imported when something is made.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Protocol

from cad.drives.belt import BeltDrive
from cad.drives.direct import DirectDrive
from cad.findings import Finding
from cad.layout.belt_stack import belt_stack_of
from cad.layout.direct_stack import stack_of
from cad.layout.fits import OnSheet
from cad.layout.head import Head
from cad.layout.mounted import Carried
from cad.screws import Screw
from design.catalogue.products import Bearing, Belt, Product
from design.left_out import LeftOut
from design.scanner import Scanner

if TYPE_CHECKING:
    import cadquery as cq

    from cad.checks.check import Check
    from cad.geometry.inertia import Inertial
    from cad.statics.shaft import ShaftBend


class Drive(Protocol):
    """One layout of one scanner."""

    @property
    def stack(self) -> Head:
        """Every number that more than one part needs."""
        ...

    def products(self) -> tuple[Bearing | Belt, ...]:
        """What is bought beside lidar, servo and ring, as often as it is needed."""
        ...

    def order_number(self, product: Product) -> str:
        """What to ask a shop for."""
        ...

    def turned(self) -> frozenset[str]:
        """Made parts that are turned from metal."""
        ...

    def on_sheets(self) -> Mapping[str, OnSheet]:
        """What the sheets of some made parts say beyond their shape, by part."""
        ...

    def carried(self) -> Carried:
        """What the base mount holds."""
        ...

    def made(self) -> Mapping[str, Callable[[], cq.Solid]]:
        """Makers of the parts between mount and linkage by name; the first one carries the linkage."""
        ...

    def bought(self) -> Mapping[str, cq.Solid]:
        """Servo, ring and what else is bought, by name of the body."""
        ...

    def sweeps(self) -> Mapping[str, cq.Solid]:
        """What bodies fill that stand still about the axis, but turn about one of their own."""
        ...

    def weights(self) -> tuple[list[Inertial], list[Inertial]]:
        """Of the bought bodies: those that stand still, and those that turn."""
        ...

    def shapes(self) -> list[tuple[tuple[float, float, float], tuple[float, ...]]]:
        """Centre of simple bodies that stand still, with the edges of a box, or radius and length about z [mm]."""
        ...

    def bend(self) -> ShaftBend:
        """How far the shaft gives way at the hub."""
        ...

    def load_checks(self, bodies: dict[str, Inertial]) -> list[Check]:
        """Forces on servo and bearings against their ratings."""
        ...

    def findings(self, bodies: dict[str, Inertial]) -> list[Finding]:
        """What a person should know before the parts are made."""
        ...

    def left_out(self) -> list[LeftOut]:
        """Parts that this scanner does not need."""
        ...

    def steps(self) -> Mapping[str, tuple[str, str]]:
        """Title and words of each step of the assembly, by the part that it puts in, in their order."""
        ...

    def stacked(self) -> tuple[str, ...]:
        """Products from the deck to the linkage as the exploded view lifts them: what comes later goes further."""
        ...

    def slotted(self) -> list[tuple[str, str, Screw, int, float, float]]:
        """Screws in slots, which are no round holes: part, what they end in, size, number, grip and depth of thread."""
        ...

    def shaping(self) -> Mapping[str, str]:
        """Which values of a product shape which parts, where these are not those of `remarks.SHAPING`."""
        ...

    def wiring(self) -> list[tuple[str, str]]:
        """Small things that the ring asks for, each with its source."""
        ...


def drive_of(scanner: Scanner) -> Drive:
    """The drive of one scanner.

    Raises:
        BuildError: it cannot be laid out.
    """
    ring = scanner.slip_ring
    if ring is not None and ring.bore_mm == 0:
        return BeltDrive(scanner, belt_stack_of(scanner))
    return DirectDrive(scanner, stack_of(scanner))
