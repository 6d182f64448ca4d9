"""Every part that a scanner may have, in the order of their drawing numbers: a new part is listed here."""

from __future__ import annotations

from scanwright.cad.layout.belt.stack import BeltStack
from scanwright.cad.layout.layout import Layout
from scanwright.cad.parts.alignment_linkage import linkage_spec
from scanwright.cad.parts.base_mount import mount_spec
from scanwright.cad.parts.bearing_cage import base_spec, bell_spec
from scanwright.cad.parts.bearing_tower import tower_spec
from scanwright.cad.parts.capsule_holder import holder_spec
from scanwright.cad.parts.counterweight import counterweight_spec
from scanwright.cad.parts.drive_plate import plate_spec
from scanwright.cad.parts.horn_cup import cup_spec
from scanwright.cad.parts.journal_sleeve import sleeve_spec
from scanwright.cad.parts.main_shaft import main_shaft_spec
from scanwright.cad.parts.part_spec import PartSpec
from scanwright.cad.parts.pulleys import drive_pulley_spec, shaft_pulley_spec
from scanwright.cad.parts.servo_frame import frame_spec
from scanwright.cad.parts.servo_shaft import servo_shaft_spec
from scanwright.cad.parts.shaft_ring import shaft_ring_spec
from scanwright.cad.parts.slip_ring_adapter import adapter_spec
from scanwright.cad.parts.sub_plate import sub_plate_spec
from scanwright.cad.parts.tripod_foot import tripod_foot_spec

OF_DIRECT = (frame_spec, servo_shaft_spec, adapter_spec, base_spec, bell_spec)
OF_BELT = (
    main_shaft_spec,
    shaft_pulley_spec,
    shaft_ring_spec,
    tower_spec,
    holder_spec,
    plate_spec,
    drive_pulley_spec,
)
OF_ALL = (
    cup_spec,
    linkage_spec,
    sub_plate_spec,
    mount_spec,
    counterweight_spec,
    sleeve_spec,
    tripod_foot_spec,
)


def parts_of(layout: Layout) -> list[PartSpec]:
    """The parts that one scanner needs."""
    scanner, stack = layout.scanner, layout.stack
    specs: list[PartSpec | None] = [spec_of(layout) for spec_of in OF_ALL]
    if isinstance(stack, BeltStack):
        return _needed([*(spec_of(scanner, stack) for spec_of in OF_BELT), *specs])
    return _needed([*(spec_of(scanner, stack) for spec_of in OF_DIRECT), *specs])


def _needed(specs: list[PartSpec | None]) -> list[PartSpec]:
    return [spec for spec in specs if spec is not None]
