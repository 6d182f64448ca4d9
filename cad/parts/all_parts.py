"""Every part that a scanner may have, in the order of their drawing numbers: a new part is listed here."""

from scanwright.cad.layout.layout import Layout, layout_of
from scanwright.cad.layout.placement import Placement
from scanwright.cad.parts.linkage.alignment_linkage import linkage_spec
from scanwright.cad.parts.linkage.counterweight import counterweight_spec
from scanwright.cad.parts.linkage.sub_plate import sub_plate_spec
from scanwright.cad.parts.mounts.base_mount import mount_spec
from scanwright.cad.parts.mounts.bearing_cage import base_spec, bell_spec
from scanwright.cad.parts.mounts.bearing_tower import tower_spec
from scanwright.cad.parts.mounts.capsule_holder import holder_spec
from scanwright.cad.parts.mounts.drive_plate import plate_spec
from scanwright.cad.parts.mounts.servo_frame import frame_spec
from scanwright.cad.parts.mounts.slip_ring_adapter import adapter_spec
from scanwright.cad.parts.mounts.tripod_foot import tripod_foot_spec
from scanwright.cad.parts.part_spec import PartSpec
from scanwright.cad.parts.shafts.horn_cup import cup_spec
from scanwright.cad.parts.shafts.journal_sleeve import sleeve_spec
from scanwright.cad.parts.shafts.main_shaft import main_shaft_spec
from scanwright.cad.parts.shafts.pulleys import drive_pulley_spec, shaft_pulley_spec
from scanwright.cad.parts.shafts.servo_shaft import servo_shaft_spec
from scanwright.cad.parts.shafts.shaft_ring import shaft_ring_spec
from scanwright.design.left_out import LeftOut
from scanwright.design.scanner import Scanner

SPECS = (
    frame_spec,
    servo_shaft_spec,
    adapter_spec,
    base_spec,
    bell_spec,
    main_shaft_spec,
    shaft_pulley_spec,
    shaft_ring_spec,
    tower_spec,
    holder_spec,
    plate_spec,
    drive_pulley_spec,
    cup_spec,
    linkage_spec,
    sub_plate_spec,
    mount_spec,
    counterweight_spec,
    sleeve_spec,
    tripod_foot_spec,
)


def parts_of(place: Placement) -> list[PartSpec | LeftOut]:
    """Return the parts that one scanner needs, and those that it does not, with the reason."""
    return [part for spec_of in SPECS if (part := spec_of(place)) is not None]


def laid_out(scanner: Scanner) -> Layout:
    """Lay out one scanner with all its parts; BuildError if it cannot be laid out."""
    return layout_of(scanner, parts_of)
