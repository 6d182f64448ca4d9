"""The servo beside the axis, for capsule rings: belt, hollow shaft, tower. See `Drive` in `cad/drive.py`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from cad.drives.belt_words import belt_steps, teeth_words
from cad.findings import Finding
from cad.layout.belt_stack import (
    FOOT_HALF,
    FOOT_HOLE,
    FOOT_SCREW,
    PLATE,
    PLATE_GRIP,
    PLATE_SCREW,
    SHELF,
    BeltStack,
    case_corners,
    drive_corners,
)
from cad.layout.fits import Fit, OnSheet, no_wider, printed_seat, turned_spigot
from cad.layout.mounted import Carried
from cad.screws import Screw, trap_of
from design.catalogue.products import Bearing, Belt, Product
from design.left_out import LeftOut
from design.scanner import Scanner

if TYPE_CHECKING:
    import cadquery as cq

    from cad.checks.check import Check
    from cad.geometry.inertia import Inertial
    from cad.statics.shaft import ShaftBend

SHAFT = "main_shaft"
STACKED = (
    "base_mount",
    "slip_ring_adapter",
    "ring",
    "shaft_ring",
    "bearing_tower",
    "bearing",
    "main_shaft",
    "servo",
    "drive_plate",
    "drive_pulley",
    "belt",
    "shaft_pulley",
    "alignment_linkage",
)
SHAPING = {
    "case_min_mm": "bearing_tower",
    "case_max_mm": "bearing_tower and drive_plate",
    "horn_diameter_mm": "drive_plate",
    "horn_thickness_mm": "drive_pulley",
    "horn_boss_diameter_mm": "drive_pulley",
    "horn_boss_height_mm": "drive_pulley",
    "horn_circle_mm": "drive_pulley",
    "horn_holes": "drive_pulley",
    "horn_first_hole_deg": "drive_pulley",
    "horn_screw": "drive_pulley",
    "case_screw": "drive_plate",
    "case_holes_mm": "drive_plate",
    "case_holes_z_mm": "drive_plate",
    "bore_mm": "main_shaft",
    "length_mm": "bearing_tower",
    "fit_clearance_mm": "every bore and seat",
    "flange": "slip_ring_adapter and bearing_tower",
    "rotor": "main_shaft",
    "thickness_mm": "the rims of the pulleys",
    "groove_radius_mm": "the teeth of the pulleys",
    "teeth": "where the servo stands",
}
OFF_AXIS = "more play puts the pulley further off its axis than belt_angle of checks.json counts with"
SOFT_TUBE = "a soft tube, 10 mm long, from the shaft's bore to the stub of the capsule's rotor: {:g} x {:g} mm"


@dataclass(frozen=True, slots=True)
class BeltDrive:
    """The `Drive` of a scanner with a capsule ring."""

    scanner: Scanner
    stack: BeltStack

    def products(self) -> tuple[Bearing | Belt, ...]:
        """Two bearings and the belt."""
        return self.stack.carrier, self.stack.carrier, self.stack.belt

    def order_number(self, product: Product) -> str:
        """Its name, that of the belt with its length."""
        if product == self.stack.belt:
            teeth = self.stack.belt_teeth
            return f"{product.name}, {teeth} teeth, {teeth * self.stack.belt.pitch_mm:g} mm"
        return product.name

    def turned(self) -> frozenset[str]:
        """The shaft: bearings want its seats."""
        return frozenset({SHAFT})

    def on_sheets(self) -> dict[str, OnSheet]:
        """Fits of bearings, hub and pulleys, the pulleys' teeth, and the horn's axis where a part stands on it."""
        from cad.parts.bearing_tower import nuts_words, tower_of

        stack, fit = self.stack, self.scanner.printer.fit_clearance_mm
        seat = Fit(stack.seat_diameter, False, "+0.02/0", "f7 in the bearings, which slide on by hand")
        beside = (float(stack.beside()[0]), float(stack.beside()[1]))
        bore, pocket = stack.tube_diameter, stack.servo.horn_boss_diameter_mm
        centred = (no_wider(pocket, fit, OFF_AXIS),) if pocket > 0 else ()
        return {
            SHAFT: OnSheet((seat, turned_spigot(stack.shaft_diameter, fit))),
            "bearing_tower": OnSheet((printed_seat(stack.carrier, fit),), nuts_words(tower_of(self.scanner, stack))),
            "shaft_pulley": OnSheet((no_wider(bore, fit, OFF_AXIS),), (teeth_words(stack),)),
            "drive_pulley": OnSheet(centred, (teeth_words(stack),), beside),
            "drive_plate": OnSheet(axis=beside),
        }

    def carried(self) -> Carried:
        """The tower."""
        stack = self.stack
        foot = [(x, y, stack.tower_bottom) for x in (-FOOT_HALF, FOOT_HALF) for y in (-FOOT_HALF, FOOT_HALF)]
        return Carried(
            rear=stack.tower_bottom,
            ears=stack.tower_bottom,
            screw=FOOT_SCREW,
            holes=tuple((a * FOOT_HOLE, b * FOOT_HOLE) for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))),
            corners=np.concatenate([drive_corners(stack), np.array(foot)]),
            discs=((stack.wide_radius, stack.tower_bottom), (stack.wide_radius, stack.tower_top)),
            stands_alone=False,
        )

    def made(self) -> dict[str, Callable[[], cq.Solid]]:
        """Shaft, pulleys, tower, the plate of the servo and the disc of the capsule."""
        from cad.parts.bearing_tower import bearing_tower, tower_of
        from cad.parts.capsule_holder import capsule_holder, holder_of
        from cad.parts.drive_plate import drive_plate, plate_of
        from cad.parts.main_shaft import MainShaft, main_shaft
        from cad.parts.pulleys import drive_pulley, foot_radius, pulley_of, shaft_pulley
        from cad.parts.shaft_ring import shaft_ring, shaft_ring_of

        scanner, stack = self.scanner, self.stack
        pulley = pulley_of(scanner, stack)
        plate = plate_of(scanner, stack, foot_radius(pulley))
        return {
            SHAFT: partial(main_shaft, MainShaft(stack=stack)),
            "shaft_pulley": partial(shaft_pulley, pulley),
            "shaft_ring": partial(shaft_ring, shaft_ring_of(scanner, stack)),
            "bearing_tower": partial(bearing_tower, tower_of(scanner, stack)),
            "slip_ring_adapter": partial(capsule_holder, holder_of(scanner, stack)),
            "drive_plate": partial(drive_plate, plate),
            "drive_pulley": partial(drive_pulley, pulley),
        }

    def bought(self) -> dict[str, cq.Solid]:
        """Servo, bearings, capsule and belt."""
        from cad.drives.belt_bought import belt_bought

        return belt_bought(self.stack)

    def sweeps(self) -> dict[str, cq.Solid]:
        """The pulley on the horn turns about the horn's axis."""
        from cad.parts.pulleys import drive_envelope, pulley_of

        return {"drive_pulley": drive_envelope(pulley_of(self.scanner, self.stack))}

    def weights(self) -> tuple[list[Inertial], list[Inertial]]:
        """Servo, belt, and half of ring and bearings each."""
        from cad.geometry import inertia

        stack, servo, ring = self.stack, self.scanner.servo, self.scanner.slip_ring
        assert ring is not None
        halves = []
        r = stack.ring_radius
        halves.append(inertia.of_box(ring.mass_g / 2, (-r, -r, stack.ring_bottom), (r, r, stack.ring_top)))
        r, half = stack.carrier.outer_mm / 2, stack.carrier.width_mm / 2
        for middle in (stack.upper_middle, stack.lower_middle):
            halves.append(inertia.of_box(stack.carrier.mass_g / 2, (-r, -r, middle - half), (r, r, middle + half)))
        case = case_corners(stack)
        corner = stack.turn() @ [stack.centre + stack.belt_radius, stack.belt_radius, 0.0]
        start = stack.turn() @ [-stack.belt_radius, -stack.belt_radius, 0.0]
        low, high = np.minimum(corner, start), np.maximum(corner, start)
        width = np.array([0.0, 0.0, stack.belt.width_mm / 2])
        middle_z = np.array([0.0, 0.0, stack.belt_middle])
        belt = inertia.of_box(stack.belt.mass_g, low + middle_z - width, high + middle_z + width)
        return [inertia.of_box(servo.mass_g, case.min(axis=0), case.max(axis=0)), belt, *halves], halves

    def shapes(self) -> list[tuple[tuple[float, float, float], tuple[float, ...]]]:
        """Servo and capsule."""
        stack = self.stack
        case = case_corners(stack)
        x, y, z = ((case.min(axis=0) + case.max(axis=0)) / 2).tolist()
        middle = (0.0, 0.0, (stack.ring_top + stack.ring_bottom) / 2)
        return [((x, y, z), tuple(np.ptp(case, axis=0))), (middle, (stack.ring_radius, stack.ring_length))]

    def bend(self) -> ShaftBend:
        """The shaft beyond its bearings, and the belt."""
        from cad.drives.belt_loads import belt_shaft_bend

        return belt_shaft_bend(self.stack)

    def load_checks(self, bodies: dict[str, Inertial]) -> list[Check]:
        """Bearings, belt and horn."""
        from cad.checks.belt import belt_checks

        return belt_checks(self.scanner, self.stack, bodies)

    def findings(self, bodies: dict[str, Inertial]) -> list[Finding]:
        """A shaft to have turned, and pulleys to look at."""
        from cad.checks.belt import belt_checks
        from cad.checks.remarks import turn_from_metal

        why = f"two bearings of {self.stack.carrier.bore_mm:g} mm want its seats to f7 (-0.02 to -0.041)"
        off = [
            Finding(check.kind, "warning", check.where, check.message)
            for check in belt_checks(self.scanner, self.stack, bodies)
            if check.severity in ("warning", "error")
        ]
        return [turn_from_metal(SHAFT, why), *off]

    def left_out(self) -> list[LeftOut]:
        """The cage: the tower's bearings carry the rotor."""
        return [LeftOut("bearing_cage", "the two bearings of the tower carry the axis", 1, "parts")]

    def steps(self) -> dict[str, tuple[str, str]]:
        """From the capsule outwards."""
        return belt_steps(self.stack)

    def stacked(self) -> tuple[str, ...]:
        """As it is taken apart upwards."""
        return STACKED

    def slotted(self) -> list[tuple[str, str, Screw, int, float, float]]:
        """Of the plate that tightens the belt."""
        depth = SHELF if trap_of(PLATE_SCREW, self.scanner.printer) is None else PLATE_GRIP
        return [("drive_plate", "bearing_tower", PLATE_SCREW, 4, PLATE, depth)]

    def shaping(self) -> dict[str, str]:
        """What the tower and its neighbours do in place of shaft and adapter."""
        return SHAPING

    def wiring(self) -> list[tuple[str, str]]:
        """What couples the capsule's rotor to the shaft."""
        tube = SOFT_TUBE.format(self.stack.shaft_bore, self.stack.rotor.diameter_mm)
        return [(tube, "mounting instructions of capsule rings: drive the rotor by rubber tubing")]
