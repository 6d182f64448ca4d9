"""One scanner: an angle set and its products. `cad` builds it and the report describes it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pydantic import Field, model_validator

from scanwright.design.angles import AngleSet
from scanwright.design.catalogue.catalogue import Catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.products import Bearing, Belt, Printer
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.deck_holes import Circle, Rectangle
from scanwright.design.errors import removal
from scanwright.design.files.record import Record


class Modules(Record):
    """Optional parts that a task can require."""

    tripod_foot: bool = Field(
        default=False, strict=True, description="a plate under the mount with a nut 1/4-20 for a tripod"
    )

    @model_validator(mode="before")
    @classmethod
    def _without_removed(cls, table: Any) -> Any:
        """Accept `false` for modules of version 0.1 that version 0.2 does not have."""
        if not isinstance(table, dict):
            return table
        return {key: value for key, value in table.items() if value is not False or removal(key) is None}


NO_MODULES = Modules()


@dataclass(frozen=True, slots=True)
class Scanner:
    """Angles with their products; `slip_ring` is None if the motion needs none."""

    angles: AngleSet
    lidar: Lidar
    servo: Servo
    slip_ring: SlipRing | None
    printer: Printer
    bearings: tuple[Bearing, ...]  # candidates for a tilted axis, smallest bore first
    belts: tuple[Belt, ...] = ()  # candidates for a scanner with a capsule ring, the narrowest first
    deck: Rectangle | Circle | None = None  # holes for the base mount; None if the mount can choose them
    modules: Modules = NO_MODULES  # optional parts


def scanner_of(
    angles: AngleSet,
    printer: str,
    catalogue: Catalogue,
    deck: Rectangle | Circle | None = None,
    modules: Modules = NO_MODULES,
) -> Scanner:
    """Look up the products of an angle set.

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
