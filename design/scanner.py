"""One scanner: an angle set and the products it is made of. What `cad` builds and the report describes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pydantic import Field, model_validator

from scanwright.design.angles import AngleSet
from scanwright.design.catalogue.catalogue import Catalogue
from scanwright.design.catalogue.products import Bearing, Belt, Lidar, Printer, Servo, SlipRing
from scanwright.design.deck_holes import Circle, Rectangle
from scanwright.design.errors import removal
from scanwright.design.files.record import Record


class Modules(Record):
    """Parts that a scanner works without, and that a task may ask for."""

    tripod_foot: bool = Field(
        default=False, strict=True, description="a plate under the mount with a nut 1/4-20 for a tripod"
    )

    @model_validator(mode="before")
    @classmethod
    def _without_removed(cls, table: Any) -> Any:
        """The resolved tasks of version 0.1 say `false` for modules that are no longer there."""
        if not isinstance(table, dict):
            return table
        return {key: value for key, value in table.items() if value is not False or removal(key) is None}


NO_MODULES = Modules()


@dataclass(frozen=True, slots=True)
class Scanner:
    """Angles with their products; `slip_ring` is None where the motion needs none.

    Attributes:
        bearings: those that a tilted axis may choose from, smallest bore first.
        belts: those that a capsule ring's scanner may choose from, the narrowest first.
        deck: holes that the base mount is screwed to; None where the mount may choose them.
        modules: what else was asked for.
    """

    angles: AngleSet
    lidar: Lidar
    servo: Servo
    slip_ring: SlipRing | None
    printer: Printer
    bearings: tuple[Bearing, ...]
    belts: tuple[Belt, ...] = ()
    deck: Rectangle | Circle | None = None
    modules: Modules = NO_MODULES


def scanner_of(
    angles: AngleSet,
    printer: str,
    catalogue: Catalogue,
    deck: Rectangle | Circle | None = None,
    modules: Modules = NO_MODULES,
) -> Scanner:
    """Look up the products that an angle set names.

    Raises:
        TaskError: a product is not in the catalogue.
    """
    return Scanner(
        angles=angles,
        lidar=catalogue.get(angles.sensor, Lidar),
        servo=catalogue.get(angles.servo, Servo),
        slip_ring=None if angles.slip_ring is None else catalogue.get(angles.slip_ring, SlipRing),
        printer=catalogue.get(printer, Printer),
        bearings=catalogue.bearings(),
        belts=catalogue.belts(),
        deck=deck,
        modules=modules,
    )
